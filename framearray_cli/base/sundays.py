"""The days of a sun study: which light positions are of which day, and how many hours each stands for."""

from collections.abc import Sequence
from dataclasses import dataclass
from datetime import datetime
from itertools import groupby, pairwise
from statistics import median

TOTAL = "total"  # instead of a date: all days


@dataclass(frozen=True, slots=True, kw_only=True)
class SunDay:
    """The light positions of one day.

    Attributes:
        date: "2026-06-21".
        lights: along the axis of the sun.
        step_h: hours from one to the next, the median; 0 where there is only one.
    """

    date: str
    lights: range
    step_h: float

    @property
    def most_h(self) -> float:
        """Hours of a place that is in the sun at all positions."""
        return len(self.lights) * self.step_h


def sun_days(times: Sequence[datetime]) -> tuple[SunDay, ...]:
    """Return the days of light positions, in their order.

    Args:
        times: local date and time of each position; the times of a day follow one another.
    """
    days: list[SunDay] = []
    for date, each in groupby(times, key=datetime.date):
        moments = list(each)
        first = days[-1].lights.stop if days else 0
        steps = [(b - a).total_seconds() / 3600 for a, b in pairwise(moments)]
        days.append(
            SunDay(
                date=date.isoformat(),
                lights=range(first, first + len(moments)),
                step_h=float(median(steps)) if steps else 0.0,
            )
        )
    return tuple(days)


def short_days(days: Sequence[SunDay]) -> str:
    """Name the day that has too few positions to count hours; empty if none has."""
    date = next((day.date for day in days if len(day.lights) < 2), None)
    return f"at least 2 light positions per day, got 1 on {date}" if date else ""
