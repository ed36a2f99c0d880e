"""Parts of a picture where errors of reuse may occur, found from the geometry in a reference."""

from typing import TypeAlias

import numpy as np
from numpy.typing import NDArray

from framearray_cli.base.arrays import Float32, Float64
from framearray_cli.engine.inputs.cameras import Cameras
from framearray_cli.report.metrics import shadow_edges

Mask: TypeAlias = NDArray[np.bool_]

# An edge: inverse depth bends by more than this share of itself from pixel to pixel (on a plane it does not bend at
# all), or normals part by more than the angle of this cosine.
BEND, COSINE = 0.05, 0.95
# A texture: reflectivity differs by more than this between neighbours, and no edge is there.
STEP = 0.03
GRAZING = 0.25  # cosine between normal and direction to the eye, below which a surface is seen at a grazing angle
BORDER = 1.5  # pixels from where another eye's picture ends
DARK = 0.02  # the least reflectivity that radiance is divided by, to find light
FEW = 0.7  # of the hits that a pixel would rest on if every eye of its window saw its surface


def regions(
    normal: Float32, depth: Float32, reflectivity: Float32, hits: NDArray[np.floating], cams: Cameras, c: int, n_r: int
) -> dict[str, Mask]:
    """Parts of frame c by name, (h, w) each.

    Disocclusions may overlap with the parts before; the last part holds the pixels that are in none of the others.

    Args:
        normal: (h, w, 3), depth: (h, w), reflectivity: (h, w, 3); see `Layers`.
        hits: (h, w) hits that a pixel rests on, over those of a pixel that every eye of the window sees.
    """
    look_vec = _looks(cams, c)
    edges = _bends(depth) | _turns(normal)
    found = {
        "silhouettes": edges,
        "textures": _steps(reflectivity) & ~edges,
        "grazing angles": (np.abs(_facing(normal, look_vec)) < GRAZING) & (depth > 0) & ~edges,
        "frame edges": _ends(depth, look_vec, cams, c, n_r) & ~edges,
        "disocclusions": hits < FEW,
    }
    found["the rest"] = ~np.logical_or.reduce(list(found.values()))
    return found


def edges_of_shadows(images: Float32, normal: Float32, depth: Float32, reflectivity: Float32) -> Mask:
    """Pixels where light jumps under each light position, but neither normal nor depth does, (n_lights, h, w).

    Args:
        images: (n_lights, h, w, 3), with little noise; the others as in `regions`.
    """
    light = images.mean(axis=-1) / np.maximum(reflectivity.mean(axis=-1), DARK)
    return np.stack([shadow_edges(one, normal, depth) for one in light])


def _looks(cams: Cameras, c: int) -> Float64:
    """Vectors from eye c through the middle of its pixels, (h, w, 3), 1 long along the optical axis."""
    x = (np.arange(cams.width) + 0.5 - 0.5 * cams.width) / cams.focal
    y = (0.5 * cams.height - np.arange(cams.height) - 0.5) / cams.focal
    found: Float64 = x[None, :, None] * cams.right[c] + y[:, None, None] * cams.up[c] + cams.forward[c]
    return found


def _ends(depth: Float32, look_vec: Float64, cams: Cameras, c: int, n_r: int) -> Mask:
    """Surfaces where the picture of another eye of the window ends."""
    found = np.zeros(depth.shape, bool)
    for k in range(max(c - n_r, 0), min(c + n_r + 1, len(cams.position))):
        if k == c:
            continue
        seen = (depth > 0)[..., None]  # else it lies in one direction from all eyes
        vec = np.where(seen, depth[..., None] * look_vec + cams.position[c] - cams.position[k], look_vec)
        z = vec @ cams.forward[k]
        ahead = np.where(z > 0, z, np.inf)
        x = 0.5 * cams.width + cams.focal * (vec @ cams.right[k]) / ahead
        y = 0.5 * cams.height - cams.focal * (vec @ cams.up[k]) / ahead
        inside = np.minimum(np.minimum(x, cams.width - x), np.minimum(y, cams.height - y))
        found |= (z > 0) & (np.abs(inside) < BORDER)
    return found


def _bends(depth: Float32) -> Mask:
    """Outlines: inverse depth, 0 where nothing is seen, is linear in a picture of a plane."""
    near = np.divide(1.0, depth, out=np.zeros(depth.shape), where=depth > 0)
    found = np.zeros(depth.shape, bool)
    for axis in (0, 1):
        values, bends = np.moveaxis(near, axis, 0), np.moveaxis(found, axis, 0)  # views
        largest = np.maximum(np.maximum(values[:-2], values[2:]), values[1:-1])
        bends[1:-1] |= np.abs(np.diff(values, 2, axis=0)) > BEND * largest
    return found


def _turns(normal: Float32) -> Mask:
    """Creases, and pixels that show several surfaces, whose mean normal is short."""
    length = np.linalg.norm(normal, axis=-1)
    found = (length > 0) & (length < COSINE)
    for axis in (0, 1):
        for other in _neighbours(normal, axis):
            lengths = length * np.linalg.norm(other, axis=-1)
            found |= (normal * other).sum(axis=-1) < COSINE * lengths
    return np.asarray(found)


def _steps(reflectivity: Float32) -> Mask:
    found = np.zeros(reflectivity.shape[:2], bool)
    for axis in (0, 1):
        for other in _neighbours(reflectivity, axis):
            found |= np.abs(other - reflectivity).max(axis=-1) > STEP
    return found


def _facing(normal: Float32, look_vec: Float64) -> Float64:
    """Cosine between a pixel's normal and the direction to its eye; 1 where there is no normal."""
    lengths = np.linalg.norm(look_vec, axis=-1) * np.linalg.norm(normal, axis=-1)
    along = -(look_vec * normal).sum(axis=-1)
    return np.divide(along, lengths, out=np.ones_like(along), where=lengths > 0)


def _neighbours(values: NDArray[np.floating], axis: int) -> tuple[NDArray[np.floating], NDArray[np.floating]]:
    """The neighbours before and after along an axis; at the border a value is its own neighbour."""
    first, last = values.take([0], axis), values.take([-1], axis)
    inner = values.shape[axis]
    padded = np.concatenate([first, values, last], axis)
    return padded.take(range(inner), axis), padded.take(range(2, inner + 2), axis)
