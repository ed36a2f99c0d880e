"""Camera positions of other programs' files -> key tables: poses, and lenses from focal lengths in pixels."""

from collections.abc import Sequence
from dataclasses import dataclass, field
from typing import Any

import numpy as np

from framearray_cli.base.arrays import Float64
from framearray_cli.base.forms.words import shown
from framearray_cli.base.lens import ORTHOGRAPHIC, PANORAMA, Lens, fov_of_focal, shift_of_centre

from .lens import KEYS_OF_TYPE
from .rowfile import RowFileError

# A matrix counts as a pose if its columns are orthogonal and equally long to within this; files have few digits.
RIGID = 1e-3
# Shares of a picture below which the middle of a lens is the middle of the picture, and pixels are square.
ROUNDING = 1e-12


@dataclass(frozen=True, slots=True, kw_only=True)
class EyeRows:
    """What a file of camera positions says.

    Attributes:
        keys: tables of `CameraKey`, for frames 0, 1, 2 and so on.
        camera: keys of `[camera]` that the file gives, for all frames.
        resolution: width and height that its lenses are given for, pixels; None if it says none.
        off_centre: whether lenses depend on the shape of the picture.
    """

    keys: list[dict[str, Any]]
    camera: dict[str, Any] = field(default_factory=dict)
    resolution: tuple[int, int] | None = None
    off_centre: bool = False


def pose_key(place: str, matrix: object) -> dict[str, Any]:
    """Return eye, target and up of a pose: 4 x 4, or its upper 3 x 4, world from camera; the camera looks along -z.

    Raises:
        RowFileError: it is no matrix, or scales unevenly, shears or mirrors.
    """
    try:
        rows = np.array(matrix, np.float64)
    except (ValueError, TypeError):
        rows = np.empty(0)
    if rows.shape not in ((4, 4), (3, 4)) or not np.isfinite(rows).all():
        raise RowFileError(f"{place}: expected a matrix of 4 rows of 4 numbers, got {shown(matrix)}")
    axes, eye = rows[:3, :3], rows[:3, 3]
    largest = float(np.abs(axes).max())
    whole = axes / largest if largest > 0 else axes  # so that no square leaves the range of floats
    scale = float(np.linalg.norm(whole, axis=0).mean())
    turn = whole / scale if scale > 0 else whole
    if np.abs(turn.T @ turn - np.eye(3)).max() > RIGID or np.linalg.det(turn) < 0:
        raise RowFileError(f"{place}: expected a rotation and a translation, got a matrix that shears or mirrors")
    away = max(1.0, float(np.abs(eye).max()))  # so far that a target keeps the digits of the direction
    return {"eye": eye.tolist(), "target": (eye - away * turn[:, 2]).tolist(), "up": turn[:, 1].tolist()}


def lens_of(
    kind: str, resolution: tuple[int, int], focal: tuple[float, float], centre: tuple[float, float]
) -> dict[str, Any]:
    """Return the lens keys of focal lengths and an image centre in pixels; of a panorama none.

    Args:
        focal: of an orthographic camera, pixels per scene unit.
    """
    if kind == PANORAMA:
        return {}
    height, aspect, shift = resolution[1], focal[1] / focal[0], shift_of_centre(centre, resolution)
    size = {"height": height / focal[1]} if kind == ORTHOGRAPHIC else {"fov": fov_of_focal(focal[1], height)}
    shift = (0.0, 0.0) if max(abs(share) for share in shift) < ROUNDING else shift
    return {**size, "shift": list(shift), "pixel_aspect": 1.0 if abs(aspect - 1) < ROUNDING else aspect}


def eye_rows(
    poses: Sequence[dict[str, Any]],
    lenses: Sequence[dict[str, Any]],
    *,
    kind: str,
    resolution: tuple[int, int] | None,
    sized: bool = True,
) -> EyeRows:
    """Join poses and lenses; what all lenses have in common becomes keys of the camera.

    Args:
        sized: whether pictures should have that resolution, too.
    """
    camera: dict[str, Any] = {"type": kind, **({"resolution": list(resolution)} if resolution and sized else {})}
    own: list[dict[str, Any]] = [{} for _ in poses]
    neutral = {"shift": list(Lens().shift), "pixel_aspect": Lens().pixel_aspect}
    off_centre = False
    for name in KEYS_OF_TYPE[kind]:
        values = [lens.get(name, neutral.get(name)) for lens in lenses]
        off_centre |= name == "shift" and any(value != neutral["shift"] for value in values)
        if all(value == values[0] for value in values):
            if values[0] != neutral.get(name):
                camera[name] = values[0]
        else:
            for key, value in zip(own, values, strict=True):
                key[name] = value
    keys = [{"frame": c, **pose, **lens} for c, (pose, lens) in enumerate(zip(poses, own, strict=True))]
    return EyeRows(keys=keys, camera=camera, resolution=resolution, off_centre=off_centre)


def quaternion_matrix(w: float, x: float, y: float, z: float) -> Float64:
    """The rotation (3, 3) of a quaternion of any length but 0."""
    whole = np.array([w, x, y, z]) / np.abs([w, x, y, z]).max()  # so that no square leaves the range of floats
    w, x, y, z = whole / np.linalg.norm(whole)
    return np.array(
        [
            [1 - 2 * (y * y + z * z), 2 * (x * y - w * z), 2 * (x * z + w * y)],
            [2 * (x * y + w * z), 1 - 2 * (x * x + z * z), 2 * (y * z - w * x)],
            [2 * (x * z - w * y), 2 * (y * z + w * x), 1 - 2 * (x * x + y * y)],
        ]
    )
