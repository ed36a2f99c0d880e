"""Views of a few eyes under a few light positions, with a few hundred pixels each, and single rays around them."""

import math
from collections.abc import Sequence
from dataclasses import dataclass, replace
from itertools import groupby
from typing import Any

import numpy as np

from framearray_cli.base.arrays import Flags, Float32, Float64, Int32, with_room
from framearray_cli.engine.embree.packets import GEOMETRY, MASKED, TRIANGLE, Tracer
from framearray_cli.engine.features.emission import AreaLights, own_light
from framearray_cli.engine.features.indirect import irradiance_of
from framearray_cli.engine.frames.bounces import NO_GLASS, reflected_hits
from framearray_cli.engine.frames.pool import TracePool
from framearray_cli.engine.frames.records import HitRecords
from framearray_cli.engine.frames.setup import Batch, FrameSetup, Scratch
from framearray_cli.engine.frames.shading import record, shade
from framearray_cli.engine.hits.aiming import ray_origins
from framearray_cli.engine.hits.hits import SURFACE, Hits, empty_hits
from framearray_cli.engine.hits.native import PixelSamples, native_hits, pixel_order
from framearray_cli.engine.hits.rays import room_for_hits
from framearray_cli.engine.hits.row import INDIRECT, LIGHT_INDEPENDENT, REFLECTIVITY
from framearray_cli.engine.inputs.cameras import Cameras, resized
from framearray_cli.engine.inputs.lights import LightArrays
from framearray_cli.engine.inputs.random import lattice_steps
from framearray_cli.engine.terms.ambient.intensity import Ambient
from framearray_cli.engine.terms.direct import direct
from framearray_cli.scene.paths.curves import interpolate_keys
from framearray_cli.scene.paths.paths import Lights, Plane
from framearray_cli.scene.scene import Scene

from ..automatic import evenly_from_end_to_end
from ..prepare import Prepared

POSITIONS = 8  # along each light axis, at most
DIM = 0.01  # of the brightest light position; a darker one fades in or out, and is meant to be dark
SIDE = 8  # pixels along the edge of each face of a cube around a point
# Share of back faces, from which on a point without light is inside a solid: one that stands on a floor may have no
# bottom, or one in the same plane as the floor.
BACK = 0.6
MOST_STEPS = 256  # from frame to frame, that are tested for surfaces in between
FINER = 16  # parts of a step that seems to cross a surface: the camera follows a curve
FAR_FOCAL = 1e6  # pixels; a picture of one pixel is then a single direction
EYES = 32  # looked through, at most: a camera that strays for a thirtieth of its path is noticed
PIXELS, FEWEST_PIXELS = 256, 64  # of each eye
MOST_RAYS = 3_000_000  # about a second on two cores
OBSCURANCE_RAYS = 5  # per hit, at most: shares of pixels need no better W
MOST_SOURCES = 32  # followed one by one


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class Positions:
    """Light positions: K of all groups together, each one position along every axis.

    Attributes:
        planes: the image planes to render.
        together: K tuples of indices in `planes` that shine together.
        index: K tables of the position along each axis.
        power: (K,) strength of all sources, in units of the strongest position; 0 where all are off.
        unlit: plane at which no source shines, in an array with groups.
    """

    planes: tuple[int, ...]
    together: tuple[tuple[int, ...], ...]
    index: tuple[dict[str, int], ...]
    power: Float64
    unlit: int | None

    @property
    def bright(self) -> Flags:
        """(K,) whether sources shine, and not only faintly."""
        return self.power > DIM

    def ambient(self, intensity: Float32) -> Float64:
        """Return I_A of all groups together, (K, 3), from the I_A of each plane."""
        each = intensity.astype(np.float64)
        if self.unlit is None:
            return each[[self.planes[planes[0]] for planes in self.together]]
        dark = each[self.unlit]
        return np.stack([dark + sum(each[self.planes[p]] - dark for p in planes) for planes in self.together])


def choose_positions(lights: Lights, arrays: LightArrays) -> Positions:
    """Choose some light positions, evenly from the first to the last along every axis at once."""
    if lights.groups:
        axes = {group.axis: len(group.positions) for group in lights.groups}
        steps = min(POSITIONS, max(axes.values()))
        index = [{axis: round((n - 1) * share) for axis, n in axes.items()} for share in np.linspace(0, 1, steps)]
        shining = [[group.positions[at[group.axis]] for group in lights.groups] for at in index]
        unlit = lights.planes.index(Plane.INDIRECT)
    else:
        index = [{"light": l} for l in evenly_from_end_to_end(lights.n, POSITIONS)]
        shining, unlit = [[at["light"]] for at in index], None
    planes = sorted({p for group in shining for p in group})
    strength = (arrays.strength.max(axis=1) * arrays.lit).sum(axis=0)  # (n_planes,)
    power = np.array([sum(float(strength[p]) * float(arrays.colour[p].max()) for p in group) for group in shining])
    return Positions(
        planes=tuple(planes),
        together=tuple(tuple(planes.index(p) for p in group) for group in shining),
        index=tuple(index),
        power=power / max(float(power.max()), np.finfo(np.float64).tiny),
        unlit=unlit,
    )


def runs_text(flagged: Sequence[bool], names: Sequence[int]) -> str:
    """Name runs of flagged places: "12-31,47"."""
    runs = []
    for bad, group in groupby(zip(flagged, names, strict=True), key=lambda pair: pair[0]):
        run = [name for _, name in group]
        if bad:
            runs.append(f"{run[0]}-{run[-1]}" if run[0] != run[-1] else str(run[0]))
    return ",".join(runs)


def lights_text(flagged: Sequence[bool], positions: Positions) -> str:
    """Name light positions of all groups together: "light 3-5", with the positions of further axes."""
    return ", ".join(
        f"{axis} {runs_text(flagged, [at[axis] for at in positions.index])}" for axis in positions.index[0]
    )


def met_triangles(tracer: Tracer, packets: Float32, n: int) -> Int32:
    """Return the triangle of the scene that each of n traced rays met; an arbitrary one where it met none."""
    bits = packets.view(np.int32)
    triangle: Int32 = bits[:, TRIANGLE].reshape(-1)[:n].copy()
    triangle[bits[:, GEOMETRY].reshape(-1)[:n] == MASKED] += tracer.first_masked
    return np.maximum(triangle, 0)


def from_behind(scene: Scene, triangle: Int32, direction: Float32) -> Flags:
    """Return whether each ray, (n, 3), met the back of its triangle: the side from which its corners run clockwise."""
    corners = scene.corners[triangle]
    normal = np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0])
    behind: Flags = np.einsum("ij,ij->i", normal, direction) > 0
    return behind


def _trace(setup: FrameSetup, scene: Scene, cams: Cameras, c: int) -> tuple[Float64, Int32, Flags]:
    """Trace one ray through each of the n pixels of an eye.

    Returns:
        (n,) distance, scene units; inf where nothing was met. (n,) triangle, and whether it was met from behind.
    """
    n = cams.width * cams.height
    packets, hits = room_for_hits(n).packets, empty_hits(n)
    samples = PixelSamples(0, pixel_order(cams.width, cams.height), 1, 0, False)
    native_hits(cams, c, samples, 0, n, setup.world, False, packets, hits)
    triangle = met_triangles(setup.world.tracer, packets, n)
    met = hits.kind == SURFACE
    distance = np.linalg.norm(hits.position - cams.position[c], axis=1).astype(np.float64)
    return np.where(met, distance, np.inf), triangle, met & from_behind(scene, triangle, hits.incoming)


def is_inside_solid(setup: FrameSetup, scene: Scene, position: Any) -> bool:
    """Return whether all that is seen from a point, centred, is the back of surfaces on every side."""
    forward = np.concatenate([np.eye(3), -np.eye(3)])
    up = np.roll(forward, 1, axis=1)
    cams = _eyes(np.repeat(np.atleast_2d(position), 6, axis=0), forward, up, focal=SIDE / 2, side=SIDE)
    met = [_trace(setup, scene, cams, c) for c in range(6)]
    closed = all(np.isfinite(distance).all() for distance, _, _ in met)
    return closed and float(np.mean([back.mean() for _, _, back in met])) >= BACK


def crossings(prepared: Prepared, setup: FrameSetup) -> list[tuple[int, int]]:
    """Return the frames before and after which the camera passes through an opaque surface, with its triangle."""
    scene = prepared.scene
    positions = prepared.eyes.position - scene.centre
    stops = evenly_from_end_to_end(len(positions), MOST_STEPS + 1)
    found = []
    for first, triangle in _crossed(setup, scene, positions[stops]):
        frame, after = stops[first], stops[first + 1]
        curve = _curve(prepared, frame, after) - scene.centre
        if (fine := _crossed(setup, scene, curve)) and triangle < scene.n_opaque:
            found.append((frame, fine[0][1]))
    return found


def _curve(prepared: Prepared, first: int, last: int) -> Float64:
    """Return the path of the eye from one frame to another, in steps finer than a frame."""
    camera = prepared.job.camera
    keys = camera.keys
    frames = [FINER * key.frame for key in keys]
    path = interpolate_keys(frames, [key.eye for key in keys], FINER * (camera.frames - 1) + 1)
    return path[FINER * first : FINER * last + 1]


def _crossed(setup: FrameSetup, scene: Scene, path: Float64) -> list[tuple[int, int]]:
    """Return the steps of a path, (n, 3), that cross a surface, with its triangle."""
    step = np.diff(path, axis=0)
    length = np.linalg.norm(step, axis=1)
    moves = np.flatnonzero(length > 0)
    if not len(moves):
        return []
    forward = step[moves] / length[moves, None]
    across = np.eye(3)[np.abs(forward).argmin(axis=1)]
    cams = _eyes(path[moves], forward, np.cross(forward, across), focal=FAR_FOCAL, side=1)
    met = [_trace(setup, scene, cams, c) for c in range(len(moves))]
    return [(int(k), int(triangle[0])) for k, (way, triangle, _) in zip(moves, met, strict=True) if way[0] < length[k]]


def _eyes(position: Any, forward: Any, up: Any, *, focal: float, side: int) -> Cameras:
    """Return eyes with square pictures."""
    right = np.cross(forward, up)
    arrays = {"position": position, "forward": forward, "right": right, "up": np.cross(right, forward)}
    plain: Any = {name: np.ascontiguousarray(array, np.float32) for name, array in arrays.items()}
    return Cameras(**plain, focal=float(focal), width=side, height=side, near=0.0)


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class Views:
    """Views of n pixels of E eyes at K light positions of all groups together.

    Attributes:
        eyes: (E,) frames of the path.
        surface: (E, n) whether a pixel sees a surface; `back`: from behind, by the order of its corners.
        distance: (E, n) from the eye, scene units; 0 where no surface is.
        reflects: (E, n) whether the surface reflects diffusely; `mirrors`: like a mirror.
        radiance: (E, n, K, 3).
        lit: (E, n, P) whether any source lights the pixel's surface directly, at each of the rendered planes.
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

    @property
    def empty(self) -> Flags:
        """(E,) whether an eye sees no surface."""
        return np.asarray(~self.surface.any(axis=1))


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
    sources = [small.lights.of_source(s) for s in range(n_sources)] if apart else []
    look = _Look(small, prepared.scene, positions, positions.ambient(ambient.intensity), sources)
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
    few = setup.without_layers().at(planes)
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


@dataclass(frozen=True, slots=True, eq=False)
class _Look:
    """Looks through single eyes; any thread may call `through`."""

    setup: FrameSetup
    scene: Scene
    positions: Positions
    ambient: Float64  # (K, 3)
    sources: Sequence[LightArrays]

    def through(self, c: int, scratch: Scratch) -> dict[str, Any]:
        """Return the arrays of `Views` for eye c, without the axis E."""
        setup, hits, packets = self.setup, scratch.hits, scratch.hit_rays.packets
        n = setup.n_pixels
        samples = PixelSamples(setup.seed, setup.order, 1, 0, False)
        native_hits(setup.cams, c, samples, 0, n, setup.world, setup.depth > 0, packets, hits)
        records = setup.empty_records(n)
        batch = Batch(setup=setup, c=c, hits=hits, n=n, scratch=scratch, records=records, pilot=True)
        record(batch)
        surface = hits.kind[:n] == SURFACE
        back = surface & from_behind(self.scene, met_triangles(setup.world.tracer, packets, n), hits.incoming[:n])
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
        irradiance = with_room((n, self.setup.lights.channels, self.setup.lights.n_lights), np.float32)
        found = np.zeros((len(self.sources), irradiance.shape[2]), np.int32)
        for s, source in enumerate(self.sources):
            direct(hits, n, source, self.setup.world.sight, scratch.test_rays, irradiance, True)
            found[s] = (irradiance > 0).any(axis=1).sum(axis=0)
        return found

    def _radiance(self, records: HitRecords) -> Float32:
        """Return the radiance of hits at the light positions of all groups together, (n, K, 3)."""
        rgb = {at: records.row[:, None, at : at + 3] for at in (LIGHT_INDEPENDENT, INDIRECT, REFLECTIVITY)}
        by_plane = irradiance_of(records) * self.setup.lights.colour / np.float32(np.pi)
        together = np.stack([by_plane[:, list(planes)].sum(axis=1) for planes in self.positions.together], axis=1)
        if AreaLights.name in records:
            by_plane = own_light(records, self.setup.lights)
            own = np.stack([by_plane[:, list(planes)].sum(axis=1) for planes in self.positions.together], axis=1)
            rgb[LIGHT_INDEPENDENT] = rgb[LIGHT_INDEPENDENT] + own
        radiance: Float32 = rgb[LIGHT_INDEPENDENT] + rgb[REFLECTIVITY] * together
        if self.setup.indirect.ambient:
            radiance += rgb[INDIRECT] * self.ambient.astype(np.float32)
        return radiance
