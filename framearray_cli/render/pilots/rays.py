"""Trace single rays: what they meet, and from which side; around a point, and along the path of the camera."""

from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from framearray_cli.base.arrays import Float32, Float64, Int32
from framearray_cli.base.lens import Lens, fov_of_focal
from framearray_cli.engine.embree.packets import GEOMETRY, MASKED, TRIANGLE, Tracer
from framearray_cli.engine.frames.setup import FrameSetup
from framearray_cli.engine.hits.hits import SURFACE, empty_hits
from framearray_cli.engine.hits.native import Samples, native_hits, pixel_order
from framearray_cli.engine.hits.rays import room_for_hits
from framearray_cli.engine.inputs.cameras import Cameras, rows_of
from framearray_cli.job.job import Job
from framearray_cli.scene.paths.curves import interpolate_keys
from framearray_cli.scene.scene import Scene

SIDE = 8  # pixels along the edge of each face of a cube around a point
# Share of back faces, from which on a point without light is inside a solid: one that stands on a floor may have no
# bottom, or one in the same plane as the floor.
BACK = 0.6
MOST_STEPS = 256  # from frame to frame, that are tested for surfaces in between
FINER = 16  # parts of a step that seems to cross a surface: the camera follows a curve
FAR_FOCAL = 1e6  # pixels; a picture of one pixel is then a single direction

Flags = NDArray[np.bool_]


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


class Met(NamedTuple):
    """What rays through the pixels of one eye met.

    Attributes:
        distance: (n,) scene units; inf where nothing was met.
        triangle: (n,) arbitrary where nothing was met.
        back: (n,) whether it was met from behind.
    """

    distance: Float64
    triangle: Int32
    back: Flags


def _trace(setup: FrameSetup, scene: Scene, cams: Cameras, c: int) -> Met:
    """Trace one ray through each pixel of an eye."""
    n = cams.width * cams.height
    packets, hits = room_for_hits(n).packets, empty_hits(n)
    samples = Samples(0, pixel_order(cams.width, cams.height), 1, 0, False)
    native_hits(cams, c, samples, 0, n, setup.world, False, packets, hits)
    triangle = met_triangles(setup.world.tracer, packets, n)
    met = hits.kind == SURFACE
    distance = np.linalg.norm(hits.position - cams.position[c], axis=1).astype(np.float64)
    return Met(np.where(met, distance, np.inf), triangle, met & from_behind(scene, triangle, hits.incoming))


def is_inside_solid(setup: FrameSetup, scene: Scene, position: Any) -> bool:
    """Return whether all that is seen from a point, centred, is the back of surfaces on every side."""
    forward = np.concatenate([np.eye(3), -np.eye(3)])
    up = np.roll(forward, 1, axis=1)
    cams = _eyes(setup, np.repeat(np.atleast_2d(position), 6, axis=0), forward, up, focal=SIDE / 2, side=SIDE)
    met = [_trace(setup, scene, cams, c) for c in range(6)]
    closed = all(np.isfinite(face.distance).all() for face in met)
    return closed and float(np.mean([face.back.mean() for face in met])) >= BACK


def crossings(setup: FrameSetup, scene: Scene, job: Job, positions: Float64) -> list[tuple[int, int]]:
    """Return the frames before and after which the camera passes through an opaque surface, with its triangle.

    Args:
        positions: (n_c, 3) of the eyes, centred.
    """
    n = len(positions)
    stops = np.unique(np.linspace(0, n - 1, min(n, MOST_STEPS + 1)).round().astype(int))
    found = []
    for first, triangle in _crossed(setup, scene, positions[stops]):
        frame, after = int(stops[first]), int(stops[first + 1])
        curve = _curve(job, frame, after) - scene.centre
        if (fine := _crossed(setup, scene, curve)) and triangle < scene.n_opaque:
            found.append((frame, fine[0][1]))
    return found


def _curve(job: Job, first: int, last: int) -> Float64:
    """Return the path of the eye from one frame to another, in steps finer than a frame."""
    keys = job.camera.keys
    frames = [FINER * key.frame for key in keys]
    path = interpolate_keys(frames, [key.eye for key in keys], FINER * (job.camera.frames - 1) + 1)
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
    cams = _eyes(setup, path[moves], forward, np.cross(forward, across), focal=FAR_FOCAL, side=1)
    met = [_trace(setup, scene, cams, c) for c in range(len(moves))]
    return [(int(k), int(ray.triangle[0])) for k, ray in zip(moves, met, strict=True) if ray.distance[0] < length[k]]


def _eyes(setup: FrameSetup, position: Any, forward: Any, up: Any, *, focal: float, side: int) -> Cameras:
    """Return eyes with square pictures, for the kernels that those of the job need."""
    right = np.cross(forward, up)
    arrays = {"position": position, "forward": forward, "right": right, "up": np.cross(right, forward)}
    plain = {name: np.ascontiguousarray(array, np.float32) for name, array in arrays.items()}
    lens: Any = ()
    if len(setup.cams.lens):
        lens = rows_of((Lens(fov=fov_of_focal(focal, side)),) * len(position), (side, side))
    return Cameras(**plain, focal=float(focal), width=side, height=side, near=0.0, lens=lens)
