"""Which settings are worth their time, and what they gain over rendering every image from scratch."""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from .measure import Measured
from .settings import SCRATCH

# Settings are as good as asked for when their error is at most this many times as large: errors are measured, too.
SLACK = 1.02


@dataclass(frozen=True, slots=True, kw_only=True)
class Advice:
    """The cheapest settings for an error.

    Attributes:
        error: that was asked for, as RMSE.
        best: None where no settings that were tried reach it.
    """

    error: float
    best: Measured | None


def worth_trying(measured: Sequence[Measured]) -> list[Measured]:
    """Settings that no others beat in time and RMSE, the quickest first: the best front."""
    front: list[Measured] = []
    for one in sorted(measured, key=lambda m: (m.ms, m.quality.rmse)):
        if not front or one.quality.rmse < front[-1].quality.rmse:
            front.append(one)
    return front


def advice(measured: Sequence[Measured], wanted: Sequence[float]) -> list[Advice]:
    """The cheapest settings for every error; one image a time is no setting of a job."""
    usable = [m for m in measured if not m.named.settings.one_light]
    found = []
    for error in wanted:
        good = [m for m in usable if m.quality.rmse <= SLACK * error]
        found.append(Advice(error=error, best=min(good, key=lambda m: m.ms, default=None)))
    return found


def times_faster(one: Measured, measured: Sequence[Measured]) -> float | None:
    """How many times as long images from scratch take at the same RMSE; None where they were not measured.

    Time over error is a line between the two nearest counts of hits, both axes logarithmic; beyond the last one it goes
    on as noise does: four times the time for half the error.
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
