"""COLMAP's text model, `cameras.txt` and `images.txt` -> camera keys (colmap.github.io/format.html).

Its cameras have x right, y down, z along the view, and image positions that count from the upper left corner.
"""

from pathlib import Path
from typing import Any

import numpy as np

from framearray_cli.base.forms.words import shown
from framearray_cli.base.lens import PERSPECTIVE

from .poses import EyeRows, eye_rows, lens_of, pose_key, quaternion_matrix
from .rowfile import RowFileError, read_data, read_text

CAMERAS_FILE, IMAGES_FILE = "cameras.txt", "images.txt"
LARGEST_IMAGES = 1 << 30  # bytes; most of them are detected points, which are not used
# Number of focal lengths of each model that may be without distortion; then come the centre and the distortion.
_FOCALS = {"SIMPLE_PINHOLE": 1, "PINHOLE": 2, "SIMPLE_RADIAL": 1, "RADIAL": 1, "OPENCV": 2, "FULL_OPENCV": 2}
_PARAMETERS = {"SIMPLE_PINHOLE": 3, "PINHOLE": 4, "SIMPLE_RADIAL": 4, "RADIAL": 5, "OPENCV": 8, "FULL_OPENCV": 12}


def read_colmap(path: Path) -> EyeRows:
    """Read an `images.txt` with the `cameras.txt` beside it, images by name; equal neighbours, as in our exports, once.

    Raises:
        RowFileError: a file is missing or broken, or has cameras that a job has not.
    """
    cameras = _cameras(path.with_name(CAMERAS_FILE))
    found = sorted(_images(path), key=lambda image: image[0])
    poses: list[dict[str, Any]] = []
    lenses: list[dict[str, Any]] = []
    sizes, last = set(), None
    for _, place, values, camera in found:
        if camera not in cameras:
            raise RowFileError(f"{place}: expected a camera of {CAMERAS_FILE}, got {camera}")
        if (values, camera) == last:
            continue
        last = values, camera
        size, lens = cameras[camera]
        sizes.add(size)
        if len(sizes) > 1:
            texts = " and ".join(f"{width} x {height}" for width, height in sorted(sizes))
            raise RowFileError(f"{place}: expected cameras of one size, got {texts}")
        poses.append(_pose(place, values))
        lenses.append(lens)
    return eye_rows(poses, lenses, kind=PERSPECTIVE, resolution=sizes.pop()) if poses else EyeRows(keys=[])


def _pose(place: str, values: list[float]) -> dict[str, Any]:
    """Turn camera_from_world, a quaternion and a translation, into a key."""
    if not any(values[:4]):
        raise RowFileError(f"{place}: expected a rotation, got the quaternion 0 0 0 0")
    turn = quaternion_matrix(*values[:4])
    with np.errstate(all="ignore"):  # a place beyond the range of floats is refused below
        eye = -turn.T @ np.array(values[4:])
    return pose_key(place, np.column_stack([turn.T * [1, -1, -1], eye]).tolist())


def _numbers(place: str, words: list[str]) -> list[float]:
    try:
        found = [float(word) for word in words]
    except ValueError:
        found = [float("nan")]
    if not np.isfinite(found).all():
        raise RowFileError(f"{place}: expected numbers, got {shown(' '.join(words))}")
    return found


def _cameras(path: Path) -> dict[int, tuple[tuple[int, int], dict[str, Any]]]:
    """Read size and lens of each camera, by its number."""
    try:
        text = read_text(path)
    except RowFileError as error:
        raise RowFileError(f"{path.name} beside it: {error}") from error
    found = {}
    for number, line in enumerate(text.splitlines(), start=1):
        words, place = line.split(), f"{CAMERAS_FILE}: line {number}"
        if not words or words[0].startswith("#"):
            continue
        if len(words) < 5:
            raise RowFileError(f"{place}: expected CAMERA_ID, MODEL, WIDTH, HEIGHT, PARAMS, got {shown(line)}")
        model = words[1]
        if model not in _FOCALS:
            names = ", ".join(_FOCALS)
            raise RowFileError(f"{place}: expected a model of {names}, got {model}; undistort the images in COLMAP")
        camera, width, height, *parameters = _numbers(place, [words[0], *words[2:]])
        n = _FOCALS[model]
        if len(parameters) != _PARAMETERS[model] or min(width, height, *parameters[:n]) <= 0:
            raise RowFileError(f"{place}: expected {_PARAMETERS[model]} parameters of {model}, got {shown(line)}")
        if any(parameters[n + 2 :]):
            values = " ".join(f"{value:g}" for value in parameters[n + 2 :])
            remedy = "undistort the images: colmap image_undistorter"
            raise RowFileError(f"{place}: expected no lens distortion, got {model} with {values}; {remedy}")
        size, focal = (int(width), int(height)), (parameters[0], parameters[n - 1])
        found[int(camera)] = size, lens_of(PERSPECTIVE, size, focal, (parameters[n], parameters[n + 1]))
    return found


def _images(path: Path) -> list[tuple[str, str, list[float], int]]:
    """Read name, place, pose and camera of each image; a line with its points follows, which may be empty."""
    found, points = [], False
    for number, line in enumerate(read_data(path, LARGEST_IMAGES).split(b"\n"), start=1):
        if points:
            points = False
            continue
        if not line.strip() or line.startswith(b"#"):
            continue
        place = f"line {number}"
        words = line[:10_000].decode("utf-8", "replace").split(maxsplit=9)
        if len(words) < 10:
            text = shown(" ".join(words))
            raise RowFileError(f"{place}: expected IMAGE_ID, QW, QX, QY, QZ, TX, TY, TZ, CAMERA_ID, NAME, got {text}")
        _, *pose, camera = _numbers(place, words[:9])
        found.append((words[9].strip(), place, pose, int(camera)))
        points = True
    return found
