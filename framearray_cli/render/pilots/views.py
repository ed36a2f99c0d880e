"""Render what a few eyes see under a few light positions, with a few hundred pixels each."""

import math
from collections.abc import Sequence
from dataclasses import dataclass, replace
from typing import Any

import numpy as np

from framearray_cli.base.arrays import Float32, Int32, with_room
from framearray_cli.engine.features.emission import AreaLights, own_light
from framearray_cli.engine.features.indirect import irradiance_of
from framearray_cli.engine.frames.bounces import NO_GLASS, reflected_hits
from framearray_cli.engine.frames.records import HitRecords
from framearray_cli.engine.frames.setup import Batch, FrameSetup, Scratch
from framearray_cli.engine.frames.shading import record, shade
from framearray_cli.engine.frames.threads import TracePool
from framearray_cli.engine.hits.aiming import ray_origins
from framearray_cli.engine.hits.hits import SURFACE, Hits
from framearray_cli.engine.hits.native import Samples, native_hits
from framearray_cli.engine.hits.row import INDIRECT, LIGHT_INDEPENDENT, REFLECTIVITY
from framearray_cli.engine.inputs.cameras import resized
from framearray_cli.engine.inputs.lights import LightArrays
from framearray_cli.engine.inputs.profiles import Profiles
from framearray_cli.engine.inputs.random import lattice_steps
from framearray_cli.engine.terms.ambient.intensity import Ambient
from framearray_cli.engine.terms.direct import direct

from ..prepare import Prepared
from .positions import Positions, choose_positions, evenly_from_end_to_end
from .rays import Flags, from_behind, met_triangles

EYES = 32  # looked through, at most: a camera that strays for a thirtieth of its path is noticed
PIXELS, FEWEST_PIXELS = 256, 64  # of each eye
MOST_RAYS = 3_000_000  # about a second on two cores
OBSCURANCE_RAYS = 5  # per hit, at most: shares of pixels need no better W
MOST_SOURCES = 32  # whose light is followed one by one


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class Views:
    """What n pixels of E eyes see at K light positions of all groups together.

    Attributes:
        eyes: (E,) frames of the path.
        surface: (E, n) whether a pixel sees a surface; `back`: from behind, by the order of its corners.
        distance: (E, n) from the eye, scene units; 0 where no surface is.
        reflects: (E, n) whether the surface reflects diffusely; `mirrors`: like a mirror.
        radiance: (E, n, K, 3).
        lit: (E, n, P) whether any source lights the pixel's surface directly, at each of the planes looked at.
        reached: (n_sources, P) the number of pixels that each source lights at each plane; None: not counted.
    """

    eyes: Sequence[int]
    positions: Positions
    surface: Flags
    back: Flags
    distance: Float32
    reflects: Flags
    mirrors: Flags
    radiance: Float32
    lit: Flags
    reached: Int32 | None


def render_views(prepared: Prepared, setup: FrameSetup, ambient: Ambient) -> Views:
    """Render the views of a job.

    Args:
        setup: for all light positions.
    """
    positions = choose_positions(prepared.lights, setup.lights)
    eyes = evenly_from_end_to_end(setup.n_frames, EYES)
    n_sources = len(setup.lights.kind)
    apart = 1 < n_sources <= MOST_SOURCES
    rays = 1 + OBSCURANCE_RAYS + len(positions.planes) * n_sources * (2 if apart else 1)
    pixels = min(max(MOST_RAYS // (rays * len(eyes)), FEWEST_PIXELS), PIXELS)
    small = _shrink(setup, positions.planes, pixels)
    sources = [_one_source(small.lights, s) for s in range(n_sources)] if apart else []
    look = _Look(prepared, small, positions, ambient, sources)
    with TracePool(small, min(prepared.threads, len(eyes))) as pool:
        found = pool.run(look.through, eyes)
    joined = {name: np.stack([view[name] for view in found]) for name in found[0] if name != "reached"}
    reached = sum(view["reached"] for view in found) if sources else None
    return Views(eyes=eyes, positions=positions, reached=reached, **joined)


def _shrink(setup: FrameSetup, planes: Sequence[int], pixels: int) -> FrameSetup:
    """Return the setup for single hits of about that many pixels per eye, at some planes."""
    cams, obscurance = setup.cams, setup.indirect.settings
    scale = min(math.sqrt(pixels / setup.n_pixels), 1.0)
    width, height = (max(1, round(side * scale)) for side in (cams.width, cams.height))
    n_rays = min(obscurance.n_rays, OBSCURANCE_RAYS)
    step_x, step_y = lattice_steps(n_rays)
    settings = obscurance._replace(n_rays=n_rays, step_x=step_x, step_y=step_y)
    few = setup.without_layers().at_lights(planes)
    return replace(
        few,
        cams=resized(cams, width, height),
        indirect=few.indirect.with_settings(settings),
        n_r=0,
        weights="average",
        per_pixel=np.ones(setup.n_frames),
        halves=0,
        allotment=None,
    )


def _one_source(lights: LightArrays, s: int) -> LightArrays:
    """Return the lights without all sources but one."""
    one, (frame, grid, table) = slice(s, s + 1), lights.profiles
    return lights._replace(
        kind=lights.kind[one].copy(),
        vector=_with_room(lights.vector[one]),
        strength=_with_room(lights.strength[one]),
        lit=_with_room(lights.lit[one]),
        size=_with_room(lights.size[one]),
        cone=_with_room(lights.cone[one]),
        panel=_with_room(lights.panel[one]),
        profiles=Profiles(_with_room(frame[one]), grid[one].copy(), table),
        maps=lights.maps._replace(grid=lights.maps.grid[one].copy(), inverse=lights.maps.inverse[one].copy()),
        emitters=lights.emitters._replace(span=lights.emitters.span[one], back=lights.emitters.back[one]),
    )


def _with_room(array: Any) -> Any:
    room = with_room(array.shape, array.dtype, fill=1)
    room[:] = array
    return room


class _Look:
    """Looks through single eyes; any thread may call `through`."""

    def __init__(
        self,
        prepared: Prepared,
        setup: FrameSetup,
        positions: Positions,
        ambient: Ambient,
        sources: Sequence[LightArrays],
    ) -> None:
        self._setup, self._positions, self._sources = setup, positions, sources
        self._scene = prepared.scene
        self._ambient = positions.ambient(ambient.intensity)

    def through(self, c: int, scratch: Scratch) -> dict[str, Any]:
        """Return the arrays of `Views` for eye c, without the axis E."""
        setup, hits, packets = self._setup, scratch.hits, scratch.hit_rays.packets
        n = setup.n_pixels
        samples = Samples(setup.seed, setup.order, 1, 0, False)
        native_hits(setup.cams, c, samples, 0, n, setup.world, setup.depth > 0, packets, hits)
        records = setup.empty_records(n)
        batch = Batch(setup=setup, c=c, hits=hits, n=n, scratch=scratch, records=records, pilot=True)
        record(batch)
        surface = hits.kind[:n] == SURFACE
        back = surface & from_behind(self._scene, met_triangles(setup.world.tracer, packets, n), hits.incoming[:n])
        distance = np.linalg.norm(hits.position[:n] - ray_origins(setup.cams, c, hits, n), axis=1)
        shade(batch)
        reached = self._count_reached(hits, n, scratch)
        radiance = self._radiance(records)
        mirrors = (hits.specular[:n] > 0).any(axis=1) & surface if setup.depth else np.zeros(n, bool)
        place = np.empty(n, np.int64)
        place[hits.pixel[:n]] = np.arange(n)
        reflects = surface & (hits.reflectivity[:n] > 0).any(axis=1)
        for pixel, reflected in reflected_hits(batch, NO_GLASS[0]) if setup.follows else []:
            np.add.at(radiance, place[pixel], self._radiance(reflected))
        return {
            "surface": surface,
            "back": back,
            "distance": np.where(surface, distance, np.float32(0)),
            "reflects": reflects,
            "mirrors": mirrors,
            "radiance": radiance,
            "lit": (records.irradiance > 0).any(axis=1),
            "reached": reached,
        }

    def _count_reached(self, hits: Hits, n: int, scratch: Scratch) -> Int32:
        """Return the number of hits that each source lights at each plane."""
        irradiance = with_room((n, self._setup.lights.channels, self._setup.lights.n_lights), np.float32)
        found = np.zeros((len(self._sources), irradiance.shape[2]), np.int32)
        for s, source in enumerate(self._sources):
            direct(hits, n, source, self._setup.world.sight, scratch.test_rays, irradiance, True)
            found[s] = (irradiance > 0).any(axis=1).sum(axis=0)
        return found

    def _radiance(self, records: HitRecords) -> Float32:
        """Return the radiance of hits at the light positions of all groups together, (n, K, 3)."""
        rgb = {at: records.row[:, None, at : at + 3] for at in (LIGHT_INDEPENDENT, INDIRECT, REFLECTIVITY)}
        by_plane = irradiance_of(records) * self._setup.lights.colour / np.float32(np.pi)
        together = np.stack([by_plane[:, list(planes)].sum(axis=1) for planes in self._positions.together], axis=1)
        if AreaLights.name in records:
            by_plane = own_light(records, self._setup.lights)
            own = np.stack([by_plane[:, list(planes)].sum(axis=1) for planes in self._positions.together], axis=1)
            rgb[LIGHT_INDEPENDENT] = rgb[LIGHT_INDEPENDENT] + own
        radiance: Float32 = rgb[LIGHT_INDEPENDENT] + rgb[REFLECTIVITY] * together
        if self._setup.indirect.ambient:
            radiance += rgb[INDIRECT] * self._ambient.astype(np.float32)
        return radiance
