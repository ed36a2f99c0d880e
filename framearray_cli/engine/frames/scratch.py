"""The arrays that one thread computes in, kept from batch to batch."""

from collections import Counter, defaultdict

import numpy as np

from framearray_cli.base.arrays import with_room

from ..hits.emission import EMISSION_COLUMNS
from ..hits.hits import empty_hits
from ..hits.rays import room_for_hits, room_for_tests
from ..kernels.simd import LANES
from ..terms.cells.exact import PathScratch
from ..terms.cells.lookups import room_for_gathering, room_for_near
from ..terms.cells.mirrored import room_for_mirrors
from ..terms.cells.smooth import room_for_smoothing
from ..terms.lobe_cells import room_for_lobes
from ..terms.obscurance import RAYS_TOGETHER
from ..terms.sun_hours import room_for_sun
from .setup import FrameSetup

# Rays traced together within a batch.
RAYS = 4096


class Scratch:
    """One thread's arrays and counters, kept from batch to batch.

    Attributes:
        hit_rays, test_rays: packets of rays that find hits, and of rays that are only tested for being blocked.
        hits: the batch.
        reflected, throughput: reflected hits and the tint of the mirrors on the way, of this bounce and the last one.
        pixel, density: (4 N_r + 1, batch) of the eyes around, see `outer_hits`.
        weight: (2 N_r + 1, batch) of hits in the frames around.
        place: (2 N_r + 1, batch) where hits lie in their pixels of the frames around, see `find_places`.
        obscurance, skylight: (batch, 3) W and S.
        gather, near: of gather rays, and of those too short for cells; and `constant`: (batch, 3) the light that cells
            have at every light position, `closeness`: (batch,) of their rays; None and empty without cells.
        mirrors: of gather rays that meet mirrors; empty without.
        alpha, metal: (batch + LANES,) gloss of the hits, see `record_gloss`; empty where nothing is glossy.
        by_source: the lights with one source at a time, where gloss needs the light of each; else empty.
        emission: (batch, EMISSION_COLUMNS) of the hits, see `record_emission`; (0, ...) where nothing shines.
        glow: (batch, 3) radiance that the hits send out without being sources; (0, 3) where none does.
        lobes: of what wide lobes reflect; None where their rays are followed.
        paths: of indirect light by paths; None without.
        smooth: of the filter of indirect light; None without.
        sun: of hours of sun; None without.
        rays: number of rays traced by kind; `seconds`: by stage.
    """

    def __init__(self, setup: FrameSetup, batch: int) -> None:
        n_eyes = 4 * setup.n_r + 1  # the windows of all frames that see a hit of eye c
        rays = max(RAYS, batch, setup.obscurance.n_rays)
        self.hit_rays = room_for_hits(rays)
        suns = setup.sun.lights.n_lights if setup.sun else 0
        self.test_rays = room_for_tests(RAYS, max(setup.lights.n_lights, suns))
        self.sun = room_for_sun(setup.sun, batch) if setup.sun else None
        self.hits = empty_hits(batch)
        # kernels write sixteen hits at a time, here from any hit on
        self.reflected = [empty_hits(batch + LANES) for _ in range(2 if setup.follows else 0)]
        self.throughput = [np.empty((batch, 3), np.float32) for _ in self.reflected]
        self.pixel = np.empty((n_eyes, batch), np.int32)
        self.place = np.empty((2 * setup.n_r + 1, batch if setup.area else 0), np.int32)
        self.density = np.empty((n_eyes, batch if setup.balance else 0), np.float64)
        self.weight = np.empty((2 * setup.n_r + 1, batch if setup.balance else 0), np.float32)
        self.obscurance = np.empty((batch, 3), np.float32)
        self.skylight = np.empty((batch if setup.obscurance.sky else 0, 3), np.float32)
        self.gather = room_for_gathering(rays) if setup.cells is not None else None
        channels, n_lights = setup.lights.channels, setup.lights.n_lights
        near = [room_for_near(channels, n_lights) for _ in range(2 if setup.cells is not None else 0)]
        self.near = (near[0], near[1]) if near else None
        self.mirrors = room_for_mirrors(min(rays, RAYS_TOGETHER), setup.depth if near else 0)
        self.closeness = np.empty(batch if near else 0, np.float32)
        self.constant = np.empty((batch if setup.cells is not None else 0, 3), np.float32)
        self.emission = np.empty((batch if setup.shines else 0, EMISSION_COLUMNS), np.float32)
        self.glow = np.empty((batch if setup.glows else 0, 3), np.float32)
        self.alpha, self.metal = (np.empty(batch + LANES if setup.shiny else 0, np.float32) for _ in range(2))
        n_sources = len(setup.lights.kind)
        self.by_source = [setup.lights.of_source(s) for s in range(n_sources if setup.shiny and n_sources > 1 else 0)]
        self.of_source = with_room((batch if self.by_source else 0, channels, n_lights), np.float32)
        values = channels * n_lights
        self.lobes = room_for_lobes(batch, 0 if setup.cells is None else values) if setup.reads_lobes else None
        self.paths = PathScratch(setup.lights) if setup.exact else None
        self.smooth = room_for_smoothing(values) if setup.smooth else None
        self.rays: Counter[str] = Counter()
        self.seconds: defaultdict[str, float] = defaultdict(float)
