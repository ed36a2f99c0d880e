"""Squared bias from independent runs and independent parts of a reference, with its standard error.

Runs x_i and parts r_m are vectors of n values; x and r are their limits. The mean of (x - r)^2 over the values
is estimated by products of only different runs and parts, so that it contains no noise:

    mean of x_i . x_j (i != j) - 2 mean of x_i . r_m + mean of r_m . r_n (m != n),    . the mean of products

which is mean((mean of runs - mean of parts)^2) - variance / runs - variance of the reference. Noise may make it
negative. Its standard error is that of the jackknife: each run, and each part, is left out once. Where there is no
bias, it is too large by a factor of up to sqrt 2, never too small.
"""

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

Array = NDArray[np.float64]


@dataclass(frozen=True, slots=True, kw_only=True)
class Squares:
    """The error of runs, per value.

    Attributes:
        bias, error: squared bias and its standard error.
        variance: of one run.
    """

    bias: float
    error: float
    variance: float

    @property
    def mean_square(self) -> float:
        """Mean squared error of one run."""
        return self.bias + self.variance


def products(runs: NDArray[np.floating], parts: NDArray[np.floating]) -> tuple[Array, int]:
    """Products of all runs (k, n) and parts (m, n) with each other, (k + m, k + m), summed over n values; and n.

    The mean of the parts is subtracted first, which changes no difference and keeps digits. Sums of several pictures
    add up.
    """
    together = np.concatenate([runs, parts]).astype(np.float64)
    together -= together[len(runs) :].mean(axis=0)
    return together @ together.T, together.shape[1]


def squares(gram: Array, n: int, k: int) -> Squares:
    """Squared bias of k runs.

    Args:
        gram: (k + m, k + m) from `products`, k and m at least 3.
        n: values that were summed.
    """
    gram = gram / n
    xx, xr, rr = gram[:k, :k], gram[:k, k:], gram[k:, k:]
    m = len(rr)
    own_x, own_r = np.diag(xx), np.diag(rr)
    sum_x, sum_r = xx.sum() - own_x.sum(), rr.sum() - own_r.sum()
    pairs_x, pairs_r, cross = sum_x / (k * (k - 1)), sum_r / (m * (m - 1)), xr.mean()
    # with one run left out, and with one part
    less_x = (sum_x - 2 * (xx.sum(axis=1) - own_x)) / ((k - 1) * (k - 2))
    less_r = (sum_r - 2 * (rr.sum(axis=1) - own_r)) / ((m - 1) * (m - 2))
    cross_x = (xr.sum() - xr.sum(axis=1)) / ((k - 1) * m)
    cross_r = (xr.sum() - xr.sum(axis=0)) / (k * (m - 1))
    without_run, without_part = less_x - 2 * cross_x, less_r - 2 * cross_r
    spread = (k - 1) * without_run.var() + (m - 1) * without_part.var()
    return Squares(
        bias=float(pairs_x - 2 * cross + pairs_r),
        error=float(np.sqrt(spread)),
        variance=float(own_x.mean() - pairs_x),
    )
