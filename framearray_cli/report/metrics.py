"""Distances between an image and its reference, (h, w, 3) linear radiance each.

Unless stated otherwise, relative measures are divided by the mean of the whole reference, so that they can be compared
between options and light positions. Also the door to HDR-FLIP, the visibility of a difference at all exposures that may
show the image [Andersson21]: its library is optional within the extra `report`, as it has no wheel for Python 3.14.
"""

from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from framearray_cli.base.arrays import Float32, Float64, Image
from framearray_cli.base.extras import install_command, not_installed

# relMSE divides by R^2 + EPSILON, so an error at a radiance far below 0.1 counts as one at 0.1.
EPSILON = 0.01
# A shadow edge: irradiance changes by more than this share of its local maximum between neighbours ...
EDGE_STEP = 0.25
# ... while the cosine between normals is above, and the relative step of depth below these: no edge of geometry.
EDGE_COSINE, EDGE_DEPTH = 0.95, 0.05
# Ignore edges whose local maximum is below this share of the image's largest irradiance.
EDGE_LEAST = 0.02
# Side of the blocks of pixels for a standard error: errors of neighbours are correlated.
BLOCK = 20


@dataclass(frozen=True, slots=True, kw_only=True)
class Errors:
    """Distance of one image from its reference.

    Attributes:
        rmse: root mean square error over the mean of the reference.
        relmse: mean of (I - R)^2 / (R^2 + EPSILON).
        mean_off: mean of I - R over the mean of the reference.
        edge_rmse, edge_max: root mean square and largest error at shadow edges, over the mean of the reference; the
            error of a pixel is the mean over its channels. 0 without shadow edges.
    """

    rmse: float
    relmse: float
    mean_off: float
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
        mean_off=float((image - reference).mean(dtype=np.float64)) / mean,
        edge_rmse=float(np.sqrt(np.mean(np.square(at_edges, dtype=np.float64)))) / mean if len(at_edges) else 0.0,
        edge_max=float(at_edges.max()) / mean if len(at_edges) else 0.0,
    )


def rmse(image: Image, reference: Image) -> float:
    """Return the root mean square error, radiance."""
    return float(np.sqrt(np.mean(np.square(image - reference, dtype=np.float64))))


def relmse(image: Image, reference: Image) -> float:
    """Return the mean of (I - R)^2 / (R^2 + EPSILON)."""
    squares = np.square(image - reference, dtype=np.float64) / (np.square(reference, dtype=np.float64) + EPSILON)
    return float(squares.mean())


def squared_bias(runs: tuple[Image, Image], halves: tuple[Image, Image]) -> tuple[float, float]:
    """Estimate the mean squared difference between the limits of runs and halves, and its standard error.

    All four images are independent, so the noise of (run 0 - half 0) and of (run 1 - half 1) is uncorrelated, and the
    expected mean of their product is the squared bias. Noise may make it negative.
    """
    product = (runs[0] - halves[0]).astype(np.float64) * (runs[1] - halves[1])
    return block_mean(product.mean(axis=-1))


def block_mean(values: Float64) -> tuple[float, float]:
    """Return the mean of an (h, w) map and its standard error, from the spread between blocks of pixels."""
    h, w = (side // BLOCK * BLOCK for side in values.shape)
    blocks = values[:h, :w].reshape(h // BLOCK, BLOCK, w // BLOCK, BLOCK).mean(axis=(1, 3)).ravel()
    if len(blocks) < 2:
        return float(values.mean()), float("inf")
    return float(values.mean()), float(blocks.std(ddof=1) / np.sqrt(len(blocks)))


def shadow_edges(irradiance: Float32, normal: Float32, depth: Float32) -> NDArray[np.bool_]:
    """Find the pixels at edges of shadows, where irradiance jumps, but normal and depth do not.

    Args:
        irradiance: (h, w) from the light sources only, in any unit.
        normal: (h, w, 3) and depth: (h, w), 0 where no surface is seen.
    Returns:
        (h, w)
    """
    from scipy.ndimage import generate_binary_structure, maximum_filter, minimum_filter

    cross = generate_binary_structure(2, 1)  # a pixel and its four neighbours
    largest, smallest = (kind(irradiance, footprint=cross, mode="wrap") for kind in (maximum_filter, minimum_filter))
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


# The libraries of the extra `report` that it cannot do without.
EXTRA = ("matplotlib", "jinja2")


def require_extra() -> None:
    """Check that the libraries that a report needs are installed, before any work is done.

    Raises:
        MissingExtraError: one is missing.
    """
    from importlib.util import find_spec

    missing = [name for name in EXTRA if find_spec(name) is None]
    if missing:
        raise not_installed(f"a report needs {', '.join(missing)}", "[report]")


def has_flip() -> bool:
    """Return True if HDR-FLIP can be computed."""
    from importlib.util import find_spec

    return find_spec("flip_evaluator") is not None


def flip_note() -> str:
    """Return why a report lacks HDR-FLIP; "" if it does not."""
    if has_flip():
        return ""
    return f"HDR-FLIP is left out, as flip-evaluator is not installed: {install_command('flip-evaluator')}"


def flip_map(image: Image, reference: Image) -> Float32 | None:
    """Compute HDR-FLIP of every pixel, (h, w), 0 to 1, at 67 pixels per degree, as on a desktop screen.

    None if its library is not installed.

    Args:
        image, reference: (h, w, 3) linear radiance; below 0 counts as 0.
    """
    if not has_flip():
        return None
    import flip_evaluator

    evaluator: Any = flip_evaluator
    shown = (np.ascontiguousarray(np.maximum(picture, 0.0), np.float32) for picture in (reference, image))
    error, _, _ = evaluator.evaluate(*shown, "HDR", inputsRGB=False, applyMagma=False, computeMeanError=False)
    return np.asarray(error, np.float32)[..., 0]
