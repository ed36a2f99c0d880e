"""COLMAP's text model: `cameras.txt`, `images.txt`, `points3D.txt` (colmap.github.io/format.html).

COLMAP's camera has x right, y down, z along the view; it stores camera_from_world as a unit quaternion and a
translation. Its image positions count from the upper left corner, where the first pixel's middle is (0.5, 0.5).
"""

from collections.abc import Mapping, Sequence
from pathlib import Path

import numpy as np

from framearray_cli.base.arrays import Float64
from framearray_cli.base.files import write_bytes

from .points import Cloud, Sight
from .selection import ExportedFrame, Selection, focal_length, numbers, rigid_pose

FOLDER = "sparse/0"  # where COLMAP and what builds on it look for a model
MARK = f"{FOLDER}/images.txt"

# From our camera (x right, y up, looks along -z) to theirs.
_THEIRS_FROM_OURS = np.diag([1.0, -1.0, -1.0])


def write_model(folder: Path, selection: Selection, files: Mapping[str, str], cloud: Cloud) -> None:
    """Write the three files.

    Args:
        folder: of the export; its pictures are in `images`.
        files: name of a frame -> its file in `images`.
        cloud: may be empty.

    Raises:
        OutputError: a camera is no rigid motion, or a file cannot be written.
    """
    manifest, frames = selection.manifest, selection.frames
    width, height = manifest.resolution
    focals = [focal_length(manifest, c) for c in selection.cameras]
    ids = {focal: k for k, focal in enumerate(dict.fromkeys(focals), start=1)}
    lines = [f"{k} PINHOLE {width} {height} {f!r} {f!r} {width / 2!r} {height / 2!r}" for f, k in ids.items()]
    _write(folder / FOLDER / "cameras.txt", ["# CAMERA_ID, MODEL, WIDTH, HEIGHT, FX, FY, CX, CY", *lines])
    camera_ids = {c: ids[focal] for c, focal in zip(selection.cameras, focals, strict=True)}
    lines = ["# IMAGE_ID, QW, QX, QY, QZ, TX, TY, TZ, CAMERA_ID, NAME", "# POINTS2D[] as (X, Y, POINT3D_ID)"]
    for k, frame in enumerate(frames, start=1):
        turn, shift = camera_from_world(rigid_pose(manifest, frame.c))
        pose = " ".join(map(repr, numbers([*quaternion(turn), *shift])))
        lines.append(f"{k} {pose} {camera_ids[frame.c]} {files[frame.name]}")
        sight = cloud.seen.get(frame.c)
        lines.append("" if sight is None else _observations(sight))
    _write(folder / FOLDER / "images.txt", lines)
    _write(folder / FOLDER / "points3D.txt", _point_lines(frames, cloud))


def camera_from_world(world_from_camera: Float64) -> tuple[Float64, Float64]:
    """Turn a pose of ours into COLMAP's: rotation (3, 3) and translation (3,), world -> camera, z along the view."""
    turn = _THEIRS_FROM_OURS @ world_from_camera[:3, :3].T
    return turn, -turn @ world_from_camera[:3, 3]


def quaternion(turn: Float64) -> Float64:
    """The unit quaternion (w, x, y, z), w >= 0, of a rotation (3, 3) [Itzhack00].

    It is the eigenvector of the largest eigenvalue of a symmetric matrix, so there is no case where it loses digits.
    """
    (a, b, c), (d, e, f), (g, h, i) = turn
    matrix = np.array(
        [
            [a + e + i, h - f, c - g, d - b],
            [h - f, a - e - i, b + d, c + g],
            [c - g, b + d, e - a - i, f + h],
            [d - b, c + g, f + h, i - a - e],
        ]
    )
    vector = np.linalg.eigh(matrix)[1][:, -1]
    return np.asarray(-vector if vector[0] < 0 else vector)


def _observations(sight: Sight) -> str:
    pairs = zip(sight.position.tolist(), sight.points.tolist(), strict=True)
    return " ".join(f"{x:.4f} {y:.4f} {point + 1}" for (x, y), point in pairs)


def _point_lines(frames: Sequence[ExportedFrame], cloud: Cloud) -> list[str]:
    """One line a point; its error is 0, for a point is listed where it falls in an image, not where it was found."""
    tracks: list[list[str]] = [[] for _ in cloud.position]
    for k, frame in enumerate(frames, start=1):
        sight = cloud.seen.get(frame.c)
        for index, point in enumerate(sight.points.tolist() if sight else ()):
            tracks[point].append(f"{k} {index}")
    lines = ["# POINT3D_ID, X, Y, Z, R, G, B, ERROR, TRACK[] as (IMAGE_ID, POINT2D_IDX)"]
    for k, (position, code, track) in enumerate(
        zip(cloud.position.tolist(), cloud.codes.tolist(), tracks, strict=True)
    ):
        place, colour = " ".join(map(repr, position)), " ".join(map(str, code))
        lines.append(f"{k + 1} {place} {colour} 0 {' '.join(track)}")
    return lines


def _write(file: Path, lines: Sequence[str]) -> None:
    write_bytes(file, "".join(f"{line}\n" for line in lines).encode())
