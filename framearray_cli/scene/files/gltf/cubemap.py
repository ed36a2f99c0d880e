"""Cube maps of EXT_lights_image_based -> panoramas.

The extension has the faces +x, -x, +y, -y, +z, -z in the arrangement of OpenGL, each turned upside down: the last row
of a picture is t = 0. Cube maps are left-handed: with +z ahead and +y up, +x is to the right. glTF has -x there. So the
faces +z and +y are where glTF has +z and +y, and the face +x is where glTF has -x; all pictures are then seen as they
are, and not as in a mirror. Babylon.js, which the extension names as its first reader, shows them so.
"""

import numpy as np
from numpy.typing import NDArray

from framearray_cli.base.arrays import Float32, Float64

from .motion import rotations

GLTF_FROM_CUBE = np.diag([-1.0, 1.0, 1.0])
MOST_ROWS = 4096  # of a panorama
SMOOTH = 512  # texels along the edge of a face, up to which four points per pixel are averaged
TOGETHER = 64  # rows that are made together, which takes less memory
# (3, 3) by face: which axes, with which signs, run along s and t of its texture, and towards it (OpenGL 4.6, 8.13)
_FACES = np.array(
    [
        [[0, 0, -1], [0, -1, 0], [1, 0, 0]],
        [[0, 0, 1], [0, -1, 0], [-1, 0, 0]],
        [[1, 0, 0], [0, 0, 1], [0, 1, 0]],
        [[1, 0, 0], [0, 0, -1], [0, -1, 0]],
        [[1, 0, 0], [0, -1, 0], [0, 0, 1]],
        [[-1, 0, 0], [0, -1, 0], [0, 0, -1]],
    ],
    np.float64,
)


def panorama_of(faces: Float32, rotation: Float64) -> Float32:
    """Return the panorama of a cube map, (h, 2 h, 3): north, here -z, in its middle, east to the right of it.

    Args:
        faces: (6, n, n, 3) radiance, the first row of each picture first.
        rotation: (4,) unit quaternion x, y, z, w that turns the cube map before it is placed.
    """
    n = faces.shape[1]
    height = min(2 * n, MOST_ROWS)
    fine = 2 if n <= SMOOTH else max(1, n // height)
    cube_from_gltf = rotations(rotation[None])[0].T @ GLTF_FROM_CUBE
    around = ((np.arange(2 * height * fine) + 0.5) / (height * fine) - 1) * np.pi
    bands = []
    for first in range(0, height, TOGETHER):
        rows = np.arange(first * fine, min(first + TOGETHER, height) * fine)
        up = (0.5 - (rows + 0.5) / (height * fine)) * np.pi
        level = np.cos(up)[:, None]
        ways = np.stack(
            [
                level * np.sin(around),
                np.broadcast_to(np.sin(up)[:, None], (len(up), len(around))),
                -level * np.cos(around),
            ],
            axis=-1,
        )
        seen = look_up(faces, ways.reshape(-1, 3) @ cube_from_gltf.T)
        bands.append(seen.reshape(len(rows) // fine, fine, 2 * height, fine, 3).mean(axis=(1, 3)))
    return np.ascontiguousarray(np.concatenate(bands), np.float32)


def look_up(faces: Float32, ways: Float64) -> Float32:
    """Radiance in directions (m, 3) of the cube, blended between texels of one face, (m, 3)."""
    n = faces.shape[1]
    axis = np.abs(ways).argmax(axis=1)
    along = np.take_along_axis(ways, axis[:, None], axis=1)[:, 0]
    face = 2 * axis + (along < 0)
    s, t, ahead = np.einsum("mkd,md->km", _FACES[face], ways)
    column, left = _cells(s / ahead, n)
    row, top = _cells(-t / ahead, n)
    right, below = np.minimum(left + 1, n - 1), np.minimum(top + 1, n - 1)
    upper = faces[face, top, left] * (1 - column) + faces[face, top, right] * column
    lower = faces[face, below, left] * (1 - column) + faces[face, below, right] * column
    return np.asarray(upper * (1 - row) + lower * row, np.float32)


def _cells(place: Float64, n: int) -> tuple[Float32, NDArray[np.int64]]:
    """Places from -1 to 1 along an edge of n texels -> the share of the next texel, (m, 1), and the texel before."""
    at = np.clip((place + 1) / 2 * n - 0.5, 0, n - 1)
    cell = at.astype(np.int64)
    return (at - cell).astype(np.float32)[:, None], cell
