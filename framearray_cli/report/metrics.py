"""Distances between an image and its reference, (h, w, 3) linear radiance each.

Unless stated otherwise, relative measures are divided by the mean of the whole reference, so that they can be compared
between options and light positions. Also the door to HDR-FLIP, the visibility of a difference at all exposures that may
show the image [Andersson21]: its library is optional within the extra `report`, as it has no wheel for Python 3.14.
"""

from dataclasses import dataclass
from typing import Any

import numpy as np

from framearray_cli.base.arrays import Float32, Float64, Image
from framearray_cli.base.extras import install_command, not_installed

# relMSE divides by R^2 + EPSILON, so an error at a radiance far below 0.1 counts as one at 0.1.
EPSILON = 0.01
# Side of the blocks of pixels for a standard error: errors of neighbours are correlated.
BLOCK = 20


@dataclass(frozen=True, slots=True, kw_only=True)
class Errors:
    """Distance of one image from its reference.

    Attributes:
        rmse: root mean square error over the mean of the reference.
        relmse: mean of (I - R)^2 / (R^2 + EPSILON).
        mean_off: mean of I - R over the mean of the reference.
    """

    rmse: float
    relmse: float
    mean_off: float


def errors(image: Image, reference: Image) -> Errors:
    """Compare an image with its reference."""
    mean = float(reference.mean(dtype=np.float64))
    return Errors(
        rmse=rmse(image, reference) / mean,
        relmse=relmse(image, reference),
        mean_off=float((image - reference).mean(dtype=np.float64)) / mean,
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
