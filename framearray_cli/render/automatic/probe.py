"""Probe a job's camera path sparsely: how densely neighbour eyes sample each other's hits."""

from dataclasses import dataclass

import numpy as np

from framearray_cli.base.arrays import Float64, Int32, with_room
from framearray_cli.engine.embree.embreescene import EmbreeScene
from framearray_cli.engine.hits.hits import SURFACE, Hits, empty_hits
from framearray_cli.engine.hits.native import Samples, native_hits, pixel_order
from framearray_cli.engine.hits.outer import outer_hits
from framearray_cli.engine.hits.rays import Rays, room_for_hits, room_for_tests
from framearray_cli.engine.inputs.cameras import Cameras
from framearray_cli.engine.kernels.simd import LANES
from framearray_cli.engine.terms.direct import direct

from ..plan import eye_cameras
from ..prepare import Prepared

# Number of frames probed, native hits per frame, and light positions for which shadow rays are counted.
PROBE_FRAMES, PROBE_HITS, PROBE_LIGHTS = 16, 512, 32
# Limit of a neighbour's hits per hit of the eye itself, for surfaces that the eye sees nearly edge-on.
MOST_DENSE = 1000.0


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class Acceptance:
    """Some hits of some frames, and how densely the neighbour eyes would sample the same places.

    Only hits that reflect diffusely are kept, as the others have no noise; if none does, all are kept.

    Attributes:
        n_frames: of the path; 1 for a camera at rest.
        frame: (n,) the frame whose eye found each hit.
        density: (n, 2 reach + 1) relative density p_k / p_c of eye frame + k, k from -reach to reach: hits that it adds
            to a pixel of the frame per native hit per pixel; 0 where it does not see the place, or is off the path.
        reflecting: share of all hits that reflect diffusely.
        shadow_rays: per hit for all light positions.
    """

    n_frames: int
    frame: Int32
    density: Float64
    reflecting: float
    shadow_rays: float

    @property
    def reach(self) -> int:
        """Distance of the farthest neighbour probed, frames."""
        return int(self.density.shape[1]) // 2

    def seen(self, k: int) -> float:
        """Return the share of hits that the eyes k frames before and after see; beyond the reach, as at its end."""
        k, shares = min(k, self.reach), []
        for offset in (-k, k):
            there = (self.frame + offset >= 0) & (self.frame + offset < self.n_frames)
            shares.append(self.density[there, self.reach + offset] > 0)
        both = np.concatenate(shares)
        return float(both.mean()) if len(both) else 0.0


def probe(prepared: Prepared, embree: EmbreeScene, reach: int) -> Acceptance:
    """Test a few hundred native hits of some frames from all eyes at most `reach` frames away.

    The hits are among those that a render finds, so the same job gives the same result on any machine.
    """
    job, n_c = prepared.job, 1 if prepared.still else prepared.n_cameras
    cams = eye_cameras(prepared)
    lights = prepared.light_arrays.at(evenly_spaced(prepared.n_lights, PROBE_LIGHTS))
    order = pixel_order(cams.width, cams.height)
    pixels = order[evenly_spaced(len(order), PROBE_HITS)]
    n, samples = len(pixels), Samples(job.seed, pixels, per_pixel=1, first=0)
    world = prepared.world(embree)
    hits, hit_rays = empty_hits(PROBE_HITS), room_for_hits(PROBE_HITS)
    test_rays = room_for_tests(PROBE_HITS, lights.n_lights)
    irradiance = with_room((PROBE_HITS, lights.channels, lights.n_lights), np.float32)
    frames, densities, diffuse, shadow = [], [], [], 0
    for c in evenly_spaced(n_c, PROBE_FRAMES):
        native_hits(cams, c, samples, 0, n, world, False, hit_rays.packets, hits)
        shadow += direct(hits, n, lights, world.sight, test_rays, irradiance, True)
        eyes = range(max(c - reach, 0), min(c + reach, n_c - 1) + 1)
        density, first = np.zeros((n, 2 * reach + 1)), eyes.start - c + reach
        density[:, first : first + len(eyes)] = _densities(cams, c, eyes, hits, n, embree, test_rays)
        diffuse.append((hits.kind[:n] == SURFACE) & (hits.reflectivity[:n] > 0).any(axis=1))
        densities.append(density)
        frames.append(np.full(n, c, np.int32))
    reflects = np.concatenate(diffuse)
    kept = reflects if reflects.any() else slice(None)
    return Acceptance(
        n_frames=n_c,
        frame=np.concatenate(frames)[kept],
        density=np.concatenate(densities)[kept],
        reflecting=float(reflects.mean()),
        shadow_rays=shadow / len(reflects) * prepared.n_lights / lights.n_lights,
    )


def evenly_spaced(n: int, most: int) -> list[int]:
    """Return at most `most` of the numbers 0 to n - 1, evenly spaced, each in the middle of its interval."""
    count = min(n, most)
    return [(2 * i + 1) * n // (2 * count) for i in range(count)]


def _densities(cams: Cameras, c: int, eyes: range, hits: Hits, n: int, embree: EmbreeScene, test_rays: Rays) -> Float64:
    """Return the density of each eye at hits 0 to n - 1, relative to that of eye c, (n, n_eyes)."""
    stride = -(-n // LANES) * LANES
    pixel, density = np.empty((len(eyes), stride), np.int32), np.empty((len(eyes), stride))
    outer_hits(cams, c, eyes.start, hits, n, embree.tracer, test_rays, pixel, density)
    own = density[c - eyes.start, :n]
    return np.minimum(density[:, :n] / own, MOST_DENSE).T
