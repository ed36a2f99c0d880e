"""The best front of error and time, the cheapest settings for an error, and the gain over images from scratch."""

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from typing import Generic, Protocol, TypeVar

import numpy as np

from .measure import Measured
from .settings import SCRATCH, NamedSettings

# Settings reach an error if theirs is at most this many times as large: measured errors are noisy.
SLACK = 1.02


class Timed(Protocol):
    """Settings that were measured, and their cost."""

    @property
    def named(self) -> NamedSettings: ...

    @property
    def ms(self) -> float: ...


_Timed = TypeVar("_Timed", bound=Timed)


@dataclass(frozen=True, slots=True, kw_only=True)
class Advice(Generic[_Timed]):
    """The cheapest settings for an error.

    Attributes:
        error: the RMSE that the user asks for.
        best: None if no tested settings reach it.
    """

    error: float
    best: _Timed | None


def model_error(one: Measured) -> float:
    """RMSE with respect to the reference of the job's own way to find indirect light."""
    return one.quality.rmse


def best_front(measured: Sequence[_Timed], error_of: Callable[[_Timed], float]) -> list[_Timed]:
    """Return the settings that no others beat in both time and error, the quickest first."""
    front: list[_Timed] = []
    for one in sorted(measured, key=lambda m: (m.ms, error_of(m))):
        if not front or error_of(one) < error_of(front[-1]):
            front.append(one)
    return front


def advise(
    measured: Sequence[_Timed], wanted: Sequence[float], error_of: Callable[[_Timed], float]
) -> list[Advice[_Timed]]:
    """Return the cheapest settings for each error, without those for single lights, which no job can have."""
    usable = [m for m in measured if not m.named.settings.one_light]
    found = []
    for error in wanted:
        good = [m for m in usable if error_of(m) <= SLACK * error]
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
