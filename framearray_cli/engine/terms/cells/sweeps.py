"""All bounces of light between cells: sums of samples by cell, and Jacobi sweeps.

    E(k)[l] = E_direct(k)[l] + mean over samples i of cell k of R(y_i) E(cell of y_i)[l]

Samples of a cell are summed in the order of `Members`, so that no sum depends on the number of threads. Cell ALL is the
mean over all samples, of equal weight, whether they joined another cell or not.
"""

import math
from collections.abc import Callable
from functools import partial
from typing import NamedTuple

import numpy as np

from framearray_cli.base.arrays import Addresses, Float32, Float64, Int32, Rgb
from framearray_cli.base.threads import TaskPool

from ...kernels.kernel import kernel
from .table import ALL

# The light of a bounce has fallen to this share of direct light after the last sweep, at the mean reflectivity.
LEFT_OVER = 0.01
FEWEST_SWEEPS, MOST_SWEEPS = 4, 64
# Cells per task, and samples per partial sum of those of cell ALL.
_TASK = 4096
_TOGETHER = 4096


class Members(NamedTuple):
    """The samples of each cell, and what their links meet.

    Attributes:
        first: (n_cells + 1,) samples of cell k: sample[first[k] : first[k + 1]]; cell ALL, which has all, lists none.
        sample: numbers of samples, in rising order within a cell; `weight`: of each in the means of its cell.
        target: (n_samples,) the cell that a sample's link meets, or NOWHERE.
        reflectivity: (n_samples, 3) R there.
    """

    first: Addresses
    sample: Int32
    weight: Float32
    target: Int32
    reflectivity: Rgb


@kernel
def mean_of_samples(members: Members, first: int, n: int, values: Float32, mean: Float32) -> None:
    """Average values of samples, (n_samples, channels, n_lights), over cells first to first + n - 1."""
    for k in range(first, first + n):
        for channel in range(values.shape[1]):
            for l in range(values.shape[2]):
                mean[k, channel, l] = 0.0
        for at in range(members.first[k], members.first[k + 1]):
            i, weight = members.sample[at], members.weight[at]
            for channel in range(values.shape[1]):
                for l in range(values.shape[2]):
                    mean[k, channel, l] += weight * values[i, channel, l]


@kernel
def sweep_cells(members: Members, first: int, n: int, direct: Float32, before: Float32, after: Float32) -> None:
    """Gather the light of one more bounce in cells first to first + n - 1.

    Args:
        direct: (n_cells, 1 or 3, n_lights) E_direct.
        before: (n_cells, 3, n_lights) E of the sweep before; `after`: overwritten.
    """
    channels, n_lights = direct.shape[1], direct.shape[2]
    for k in range(first, first + n):
        for channel in range(3):
            for l in range(n_lights):
                after[k, channel, l] = 0.0
        for at in range(members.first[k], members.first[k + 1]):
            i = members.sample[at]
            target = members.target[i]
            if target < 0:
                continue
            for channel in range(3):
                r = members.weight[at] * members.reflectivity[i, channel]
                for l in range(n_lights):
                    after[k, channel, l] += r * before[target, channel, l]
        for channel in range(3):
            for l in range(n_lights):
                after[k, channel, l] += direct[k, channel if channels == 3 else 0, l]


def _over_cells(n_cells: int, pool: TaskPool, task: Callable[..., None], *arrays: Float32) -> None:
    """Call task(first, n, *arrays) for all cells but ALL, on all threads."""
    starts = range(ALL + 1, n_cells, _TASK)
    list(pool.map(lambda first: task(first, min(_TASK, n_cells - first), *arrays), starts))


def _over_all(
    members: Members, shape: tuple[int, ...], pool: TaskPool, task: Callable[..., None], *arrays: Float32
) -> Float64:
    """The mean over all samples, of that shape, of what task(members, row, 1, *arrays, sums) adds up."""
    n = len(members.target)
    rows = members._replace(
        first=np.append(np.arange(0, n, _TOGETHER), n),
        sample=np.arange(n, dtype=np.int32),
        weight=np.full(n, 1 / max(n, 1), np.float32),
    )
    sums = np.zeros((len(rows.first) - 1, *shape), np.float32)
    list(pool.map(lambda row: task(rows, row, 1, *arrays, sums), range(len(sums))))
    found: Float64 = sums.sum(axis=0, dtype=np.float64)
    return found


def mean_by_cell(members: Members, values: Float32, pool: TaskPool) -> Float32:
    """Average values of samples, (n_samples, channels, n_lights), over each cell, (n_cells, channels, n_lights)."""
    mean = np.zeros((len(members.first) - 1, *values.shape[1:]), np.float32)
    _over_cells(len(mean), pool, partial(mean_of_samples, members), values, mean)
    mean[ALL] = _over_all(members, values.shape[1:], pool, mean_of_samples, values)
    return mean


def mean_reflectivity(members: Members) -> Float64:
    """The share of light that one bounce keeps, on average over all samples, (3,), cut at 0.99."""
    met = members.reflectivity[members.target >= 0]
    found: Float64 = np.minimum(met.sum(axis=0, dtype=np.float64) / max(len(members.target), 1), 0.99)
    return found


def sweeps_for(reflectivity: Float64) -> int:
    """The number of sweeps for a mean reflectivity, (3,)."""
    most = max(float(reflectivity.max()), 1e-6)
    return min(max(math.ceil(math.log(LEFT_OVER) / math.log(most)), FEWEST_SWEEPS), MOST_SWEEPS)


def solve(members: Members, direct: Float32, pool: TaskPool) -> Float32:
    """The irradiance of all cells with all bounces, (n_cells, 3, n_lights), in units of the lights' colour.

    What the sweeps leave out is the last bounce times r + r^2 + ..., r the mean reflectivity: each further bounce is
    spread almost like the one before, and where no light has come none is added. The number of sweeps depends on r
    only, so that the result is linear in the light.

    Args:
        direct: (n_cells, 1 or 3, n_lights) E_direct.
    """
    r = mean_reflectivity(members)
    before = np.empty((len(direct), 3, direct.shape[2]), np.float32)
    before[:] = direct
    after = np.zeros_like(before)
    dark = np.zeros((-(-len(members.target) // _TOGETHER), *direct.shape[1:]), np.float32)  # of the samples of ALL
    for _ in range(sweeps_for(r)):
        _over_cells(len(direct), pool, partial(sweep_cells, members), direct, before, after)
        after[ALL] = direct[ALL] + _over_all(members, before.shape[1:], pool, sweep_cells, dark, before)
        before, after = after, before
    after -= before  # minus the last bounce
    after *= -(r / (1 - r)).astype(np.float32)[:, None]
    before += after
    return before
