"""Distances between an image and its reference, (h, w, 3) linear radiance each.

Every measure that is relative is so to the mean of the reference, a number of the whole image, if it does not say
otherwise; so they can be compared between options, and between light positions.
"""

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from framearray_cli.base.arrays import Float32, Float64, Image

# relMSE divides by R^2 + EPSILON: below a radiance of 0.1 an error counts as if it were at 0.1.
EPSILON = 0.01
# A shadow edge: irradiance changes by more than this share of its local maximum between neighbours ...
EDGE_STEP = 0.25
# ... where normals are closer than this cosine, and depths than this share: no other edge is there.
EDGE_COSINE, EDGE_DEPTH = 0.95, 0.05
# Pixels whose local maximum is below this share of the image's largest irradiance have no edge worth the name.
EDGE_LEAST = 0.02
# Side of the blocks of pixels that a standard error is estimated from: errors of neighbours go together.
BLOCK = 20


@dataclass(frozen=True, slots=True, kw_only=True)
class Errors:
    """Distance of one image from its reference.

    Attributes:
        rmse: root mean square error over the mean of the reference.
        relmse: mean of (I - R)^2 / (R^2 + EPSILON).
        bias: mean of I - R over the mean of the reference.
        edge_rmse, edge_max: root mean square and largest error at shadow edges, over the mean of the reference; a
            pixel's error is the mean over its channels. 0 where there is no shadow edge.
    """

    rmse: float
    relmse: float
    bias: float
    edge_rmse: float
    edge_max: float


def errors(image: Image, reference: Image, edges: NDArray[np.bool_]) -> Errors:
    """Compare an image with its reference.

    Args:
        edges: (h, w) pixels at shadow edges, from `shadow_edges`.
    """
    mean = float(reference.mean(dtype=np.float64))
    at_edges = np.abs(image - reference).mean(axis=-1)[edges]
    return Errors(
        rmse=rmse(image, reference) / mean,
        relmse=relmse(image, reference),
        bias=float((image - reference).mean(dtype=np.float64)) / mean,
        edge_rmse=float(np.sqrt(np.mean(np.square(at_edges, dtype=np.float64)))) / mean if len(at_edges) else 0.0,
        edge_max=float(at_edges.max()) / mean if len(at_edges) else 0.0,
    )


def rmse(image: Image, reference: Image) -> float:
    """Root mean square error, radiance."""
    return float(np.sqrt(np.mean(np.square(image - reference, dtype=np.float64))))


def relmse(image: Image, reference: Image) -> float:
    """Mean of (I - R)^2 / (R^2 + EPSILON)."""
    squares = np.square(image - reference, dtype=np.float64) / (np.square(reference, dtype=np.float64) + EPSILON)
    return float(squares.mean())


def squared_bias(runs: tuple[Image, Image], halves: tuple[Image, Image]) -> tuple[float, float]:
    """Mean squared difference of what the runs and the halves tend to, and its standard error.

    All four images are independent, so the noise of (run 0 - half 0) and of (run 1 - half 1) does not go together, and
    the mean of their product has none but the square of the bias as its mean. It may come out below zero.
    """
    product = (runs[0] - halves[0]).astype(np.float64) * (runs[1] - halves[1])
    return block_mean(product.mean(axis=-1))


def block_mean(values: Float64) -> tuple[float, float]:
    """Mean of an (h, w) map and its standard error, from the spread between blocks of pixels."""
    h, w = (side // BLOCK * BLOCK for side in values.shape)
    blocks = values[:h, :w].reshape(h // BLOCK, BLOCK, w // BLOCK, BLOCK).mean(axis=(1, 3)).ravel()
    if len(blocks) < 2:
        return float(values.mean()), float("inf")
    return float(values.mean()), float(blocks.std(ddof=1) / np.sqrt(len(blocks)))


def shadow_edges(irradiance: Float32, normal: Float32, depth: Float32) -> NDArray[np.bool_]:
    """Find the pixels at the edges of shadows: irradiance jumps there, while normal and depth do not.

    Args:
        irradiance: (h, w) of the light alone, any unit.
        normal: (h, w, 3) and depth: (h, w), 0 where nothing is seen.
    Returns:
        (h, w)
    """
    largest, smallest = _near(irradiance, np.maximum), _near(irradiance, np.minimum)
    jumps = (largest - smallest > EDGE_STEP * largest) & (largest > EDGE_LEAST * irradiance.max())
    flat = np.full(depth.shape, True)
    for axis, step in ((0, 1), (0, -1), (1, 1), (1, -1)):
        other_normal, other_depth = np.roll(normal, step, axis), np.roll(depth, step, axis)
        length = np.linalg.norm(normal, axis=-1) * np.linalg.norm(other_normal, axis=-1)
        flat &= (normal * other_normal).sum(axis=-1) > EDGE_COSINE * length
        flat &= np.abs(depth - other_depth) < EDGE_DEPTH * depth
    inner = np.zeros_like(flat)
    inner[1:-1, 1:-1] = True
    return np.asarray(jumps & flat & (depth > 0) & inner)


def _near(values: Float32, extreme: np.ufunc) -> Float32:
    """The extreme of each pixel and its four neighbours; at the border the other side counts as one."""
    found = values
    for axis in (0, 1):
        for step in (1, -1):
            found = extreme(found, np.roll(values, step, axis))
    return found
