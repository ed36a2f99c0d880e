"""The best front of error and time, the cheapest settings for an error, and the gain over images from scratch."""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from .measure import Measured
from .settings import SCRATCH

# Settings reach an error if theirs is at most this many times as large: measured errors are noisy.
SLACK = 1.02


@dataclass(frozen=True, slots=True, kw_only=True)
class Advice:
    """The cheapest settings for an error.

    Attributes:
        error: the RMSE that the user asks for.
        best: None if no tested settings reach it.
    """

    error: float
    best: Measured | None


def best_front(measured: Sequence[Measured]) -> list[Measured]:
    """Return the settings that no others beat in both time and RMSE, the quickest first."""
    front: list[Measured] = []
    for one in sorted(measured, key=lambda m: (m.ms, m.quality.rmse)):
        if not front or one.quality.rmse < front[-1].quality.rmse:
            front.append(one)
    return front


def advise(measured: Sequence[Measured], wanted: Sequence[float]) -> list[Advice]:
    """Return the cheapest settings for each error, without those for single lights, which no job can have."""
    usable = [m for m in measured if not m.named.settings.one_light]
    found = []
    for error in wanted:
        good = [m for m in usable if m.quality.rmse <= SLACK * error]
        found.append(Advice(error=error, best=min(good, key=lambda m: m.ms, default=None)))
    return found


def times_faster(one: Measured, measured: Sequence[Measured]) -> float | None:
    """Return the time of images from scratch at the same RMSE over that of some settings; None if not measured.

    Interpolate time over error between the two nearest numbers of hits, on logarithmic axes. Extrapolate as noise
    behaves: four times the time for half the error.
    """
    scratch = sorted((m.quality.rmse, m.ms) for m in measured if m.named.family == SCRATCH)
    if not scratch:
        return None
    errors, times = (np.log([pair[i] for pair in scratch]) for i in (0, 1))
    wanted = np.log(one.quality.rmse)
    if wanted <= errors[0]:
        time = times[0] + 2 * (errors[0] - wanted)
    elif wanted >= errors[-1]:
        time = times[-1] - 2 * (wanted - errors[-1])
    else:
        time = np.interp(wanted, errors, times)
    return float(np.exp(time) / one.ms)
