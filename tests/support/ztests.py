"""Comparisons of estimates: z-tests with errors from independent values, and the meaning of "within the errors"."""

import math
from dataclasses import dataclass
from statistics import NormalDist

import numpy as np
from numpy.typing import NDArray
from scipy.stats import chi2, t

Array = NDArray[np.float64]

# Chance that a right program fails one comparison: that of 3 standard errors, both sides.
CHANCE = 2 * (1 - NormalDist().cdf(3.0))


@dataclass(frozen=True, slots=True, kw_only=True)
class Estimate:
    """A mean of independent values and its standard error."""

    mean: float
    error: float

    def z(self, right: float) -> float:
        """Distance from the right answer in standard errors; infinite for a wrong value without an error."""
        off = self.mean - right
        if self.error == 0:
            return 0.0 if off == 0 else math.copysign(math.inf, off)
        return off / self.error


def estimate(values: NDArray[np.floating]) -> Estimate:
    """Mean of independent values, of any shape, with the standard error from their spread."""
    flat = np.asarray(values, np.float64).ravel()
    return Estimate(mean=float(flat.mean()), error=float(flat.std(ddof=1) / math.sqrt(flat.size)))


def difference(a: Estimate, b: Estimate) -> Estimate:
    """The difference of two independent estimates."""
    return Estimate(mean=a.mean - b.mean, error=math.hypot(a.error, b.error))


def sidak(n: int, chance: float = CHANCE) -> float:
    """Chance that each of n independent comparisons may fail by, so that all together fail by `chance`."""
    return -math.expm1(math.log1p(-chance) / n)


def sidak_z(n: int, chance: float = CHANCE) -> float:
    """Standard errors that the largest of n deviations may reach."""
    return NormalDist().inv_cdf(1 - sidak(n, chance) / 2)


def differing(a: Array, b: Array, rounding: float = 1e-6) -> Array:
    """Which columns differ between runs a (n, values) and b (m, values): Welch's test, Sidak's correction.

    Args:
        rounding: relative error of float32 sums of some dozens of values, which the spread of runs need not show;
            it is added to the standard errors.

    Returns:
        (values,) how many times the allowed deviation each difference is; above 1 it is significant.
    """
    va, vb = a.var(axis=0, ddof=1) / len(a), b.var(axis=0, ddof=1) / len(b)
    error = np.sqrt(va + vb) + rounding * np.abs(b.mean(axis=0))
    off = np.abs(a.mean(axis=0) - b.mean(axis=0))
    with np.errstate(divide="ignore", invalid="ignore"):
        freedom = (va + vb) ** 2 / (va**2 / (len(a) - 1) + vb**2 / (len(b) - 1))
    freedom = np.where(np.isfinite(freedom), freedom, len(a) + len(b) - 2)
    allowed = t.ppf(1 - sidak(off.size) / 2, freedom)
    return np.divide(off, allowed * error, out=np.where(off > 0, np.inf, 0.0), where=error > 0)


def off(a: Array, right: Array, rounding: float = 1e-6) -> Array:
    """Which columns of runs a (n, values) have another mean than `right` (values,): Student's test, Sidak's correction.

    Args:
        rounding: relative error of the right values, added to the standard errors.

    Returns:
        (values,) how many times the allowed deviation each difference is; above 1 it is significant.
    """
    error = a.std(axis=0, ddof=1) / math.sqrt(len(a)) + rounding * np.abs(right)
    far = np.abs(a.mean(axis=0) - right)
    allowed = float(t.ppf(1 - sidak(far.size) / 2, len(a) - 1))
    return np.divide(far, allowed * error, out=np.where(far > 0, np.inf, 0.0), where=error > 0)


def chi2_bounds(freedom: int) -> tuple[float, float]:
    """Between which values a sum of `freedom` squared standard deviations stays, but for `CHANCE`."""
    low, high = chi2.ppf([CHANCE / 2, 1 - CHANCE / 2], freedom)
    return float(low), float(high)
