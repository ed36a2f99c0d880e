"""The days of a sun study: which light positions are of which day, when these are, and hours that each stands for."""

from collections.abc import Sequence
from dataclasses import dataclass
from datetime import datetime
from itertools import groupby, pairwise

TOTAL = "total"  # instead of a date: all days


@dataclass(frozen=True, slots=True, kw_only=True)
class SunDay:
    """The light positions of one day.

    Attributes:
        lights: along the axis of the sun.
        moments: local date and time of each.
    """

    lights: range
    moments: tuple[datetime, ...]

    @property
    def date(self) -> str:
        """The day: "2026-06-21"."""
        return self.moments[0].date().isoformat()

    @property
    def step_h(self) -> float:
        """Hours that pass from one position to the next, the median; 0 where there is only one."""
        from statistics import median  # of no use to most commands

        steps = [(b.timestamp() - a.timestamp()) / 3600 for a, b in pairwise(self.moments)]
        return float(median(steps)) if steps else 0.0

    @property
    def most_h(self) -> float:
        """Hours of a place that is in the sun at all positions."""
        return len(self.lights) * self.step_h

    @property
    def text(self) -> str:
        """Date and times of the first and the last position."""
        return moment_text(self.moments[0]) + (f" to {_clock(self.moments[-1])}" if len(self.lights) > 1 else "")

    @property
    def indices_text(self) -> str:
        """First and last position, as places are written."""
        first, last = self.lights[0], self.lights[-1]
        return f"light position {first}" if first == last else f"light positions {first}-{last}"


def sun_days(times: Sequence[datetime]) -> tuple[SunDay, ...]:
    """Return the days of light positions, in their order.

    Args:
        times: local date and time of each position; the times of a day follow one another.
    """
    days = [list(each) for _, each in groupby(range(len(times)), key=lambda l: times[l].date())]
    return tuple(SunDay(lights=range(day[0], day[-1] + 1), moments=tuple(times[l] for l in day)) for day in days)


def short_days(days: Sequence[SunDay]) -> str:
    """Name the day that has too few positions to count hours; empty if none has."""
    date = next((day.date for day in days if len(day.lights) < 2), None)
    return f"at least 2 light positions per day, got 1 on {date}" if date else ""


def moment_text(moment: datetime) -> str:
    """Write a moment as "2026-06-21 14:30", with seconds where it has some."""
    return f"{moment:%Y-%m-%d} {_clock(moment)}"


def _clock(moment: datetime) -> str:
    return moment.strftime("%H:%M:%S" if moment.second else "%H:%M")
