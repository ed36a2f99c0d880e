"""COLMAP's text model: `cameras.txt`, `images.txt`, `points3D.txt` (colmap.github.io/format.html).

COLMAP's camera has x right, y down, z along the view; it stores camera_from_world as a unit quaternion and a
translation. Its image positions count from the upper left corner, where the first pixel's middle is (0.5, 0.5).
"""

from collections.abc import Sequence

import numpy as np

from framearray_cli.array.manifest import Manifest
from framearray_cli.base.arrays import Float64
from framearray_cli.base.errors import OutputError
from framearray_cli.base.lens import PERSPECTIVE

from .format import IMAGES, NO_POINTS, Export, ExportedFrame, Format, PointCloud, frames_by_set, rigid_pose, write_lines

MODEL_FOLDER = "sparse/0"  # where COLMAP and tools built on it look for a model
IMAGES_FILE = f"{MODEL_FOLDER}/images.txt"

# From our camera (x right, y up, looks along -z) to theirs.
_THEIRS_FROM_OURS = np.diag([1.0, -1.0, -1.0])
_NOTHING = (np.empty(0, np.int64), np.empty((0, 2)))  # is seen


def write_model(export: Export) -> None:
    """Write `cameras.txt`, `images.txt`, `points3D.txt`, and the lists of sets; see `Format.write`."""
    selection, folder, cloud = export.selection, export.folder, export.cloud or NO_POINTS
    manifest, frames = selection.manifest, export.frames
    width, height = manifest.resolution
    lenses = [_pinhole(manifest, c) for c in selection.cameras]
    ids = {lens: k for k, lens in enumerate(dict.fromkeys(lenses), start=1)}
    lines = [f"{k} PINHOLE {width} {height} {' '.join(map(repr, lens))}" for lens, k in ids.items()]
    write_lines(folder / MODEL_FOLDER / "cameras.txt", ["# CAMERA_ID, MODEL, WIDTH, HEIGHT, FX, FY, CX, CY", *lines])
    camera_ids = {c: ids[lens] for c, lens in zip(selection.cameras, lenses, strict=True)}
    lines = ["# IMAGE_ID, QW, QX, QY, QZ, TX, TY, TZ, CAMERA_ID, NAME", "# POINTS2D[] as (X, Y, POINT3D_ID)"]
    for k, frame in enumerate(frames, start=1):
        turn, shift = camera_from_world(rigid_pose(manifest, frame.c))
        pose = " ".join(map(repr, np.append(quaternion(turn), shift).tolist()))
        lines.append(f"{k} {pose} {camera_ids[frame.c]} {frame.file.removeprefix(IMAGES)}")
        points, position = cloud.observations.get(frame.c, _NOTHING)
        seen = zip(position.tolist(), points.tolist(), strict=True)
        lines.append(" ".join(f"{x:.4f} {y:.4f} {point + 1}" for (x, y), point in seen))
    write_lines(folder / IMAGES_FILE, lines)
    write_lines(folder / MODEL_FOLDER / "points3D.txt", _point_lines(frames, cloud))
    if selection.splits is not None:  # lists that nerfstudio reads; it needs all three as soon as there is one
        for name, own in frames_by_set(frames).items():
            write_lines(folder / f"{name}_list.txt", [frame.file.removeprefix(IMAGES) for frame in own])


def _pinhole(manifest: Manifest, c: int) -> tuple[float, float, float, float]:
    """Return focal lengths and centre of camera c, and refuse a camera that is no perspective."""
    lens = manifest.cameras[c].lens
    if lens.type != PERSPECTIVE:
        raise OutputError(
            f'{manifest.directory}: cameras[{c}].type: expected "{PERSPECTIVE}", the only one that COLMAP has, '
            f'got "{lens.type}"; export with --format nerfstudio'
        )
    return *lens.focal(manifest.resolution), *lens.centre(manifest.resolution)


def camera_from_world(world_from_camera: Float64) -> tuple[Float64, Float64]:
    """Convert a pose of ours to COLMAP's: rotation (3, 3) and translation (3,), world -> camera, z along the view."""
    turn = _THEIRS_FROM_OURS @ world_from_camera[:3, :3].T
    return turn, -turn @ world_from_camera[:3, 3]


def quaternion(turn: Float64) -> Float64:
    """Return the unit quaternion (w, x, y, z), w >= 0, of a rotation (3, 3)."""
    from scipy.spatial.transform import Rotation

    return np.roll(Rotation.from_matrix(turn).as_quat(canonical=True), 1)


def _point_lines(frames: Sequence[ExportedFrame], cloud: PointCloud) -> list[str]:
    """Return one line per point. Its error is 0: images list the projection of a point, not where it was detected."""
    tracks: list[list[str]] = [[] for _ in cloud.position]
    for k, frame in enumerate(frames, start=1):
        for index, point in enumerate(cloud.observations.get(frame.c, _NOTHING)[0].tolist()):
            tracks[point].append(f"{k} {index}")
    lines = ["# POINT3D_ID, X, Y, Z, R, G, B, ERROR, TRACK[] as (IMAGE_ID, POINT2D_IDX)"]
    points = zip(cloud.position.tolist(), cloud.codes.tolist(), tracks, strict=True)
    for k, (position, code, track) in enumerate(points, start=1):
        xyz, rgb = " ".join(map(repr, position)), " ".join(map(str, code))
        lines.append(f"{k} {xyz} {rgb} 0 {' '.join(track)}")
    return lines


COLMAP = Format(mark=IMAGES_FILE, write=write_model, all_lights=False, points=True)
