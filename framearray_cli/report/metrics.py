"""Distances between an image and its reference, (h, w, 3) linear radiance each.

Unless stated otherwise, relative measures are divided by the mean of the whole reference, so that they can be compared
between options and light positions.
"""

from dataclasses import dataclass

import numpy as np

from framearray_cli.base.arrays import Float64, Image
from framearray_cli.base.extras import not_installed

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
