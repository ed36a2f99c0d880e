"""Date and time of light positions under a sun, local as in the job."""

from collections.abc import Mapping, Sequence
from datetime import datetime
from itertools import groupby
from typing import TYPE_CHECKING, Any, NamedTuple

if TYPE_CHECKING:
    from .manifest import Manifest


class DaySpan(NamedTuple):
    """The positions of one day: their first and last index, and when these are."""

    first: int
    last: int
    start: datetime
    stop: datetime

    @property
    def text(self) -> str:
        """Date and times of the first and the last position."""
        return moment_text(self.start) + (f" to {_clock(self.stop)}" if self.last > self.first else "")

    @property
    def indices_text(self) -> str:
        """First and last position, as places are written."""
        if self.last == self.first:
            return f"light position {self.first}"
        return f"light positions {self.first}-{self.last}"


def moment_text(moment: datetime) -> str:
    """Write a moment as "2026-06-21 14:30", with seconds where it has some."""
    return f"{moment:%Y-%m-%d} {_clock(moment)}"


def _clock(moment: datetime) -> str:
    return moment.strftime("%H:%M:%S" if moment.second else "%H:%M")


def moment_of(sources: Sequence[Mapping[str, Any]]) -> datetime | None:
    """Return the moment at which the sources of a light position shine; None without a sun among them."""
    for source in sources:
        try:
            return datetime.fromisoformat(source["time"])
        except (KeyError, ValueError, TypeError):
            continue
    return None


def moment_at(manifest: "Manifest", axis: str, l: int) -> datetime | None:
    """Return the moment of light position l along an axis; None without a sun."""
    parts = [part for part in manifest.parts if part.axis == axis]
    return next((found for part in parts if (found := moment_of(part.lights[l].sources))), None)


def sun_angles(manifest: "Manifest", axis: str, l: int) -> tuple[float, float] | None:
    """Return azimuth, clockwise from north, and height of the sun at a light position, degrees; None without a sun."""
    sources = [source for part in manifest.parts if part.axis == axis for source in part.lights[l].sources]
    suns = [(source["azimuth"], source["elevation"]) for source in sources if {"azimuth", "elevation"} <= source.keys()]
    return suns[0] if suns else None


def position_name(manifest: "Manifest", axis: str, l: int) -> str:
    """Name a light position: "light 12", under a sun "light 12  2026-06-21 14:30"."""
    moment = moment_at(manifest, axis, l)
    return f"{axis} {l}" + (f"  {moment_text(moment)}" if moment else "")


def axis_moments(manifest: "Manifest") -> dict[str, tuple[datetime, ...]]:
    """Return the moments of all positions of each axis with a sun, by its name."""
    found = {axis: [moment_at(manifest, axis, l) for l in range(n)] for axis, n in manifest.axes.items()}
    return {axis: tuple(m for m in moments if m) for axis, moments in found.items() if all(moments)}


def day_spans(moments: Sequence[datetime]) -> tuple[DaySpan, ...]:
    """Return the days of an axis, in its order."""
    spans = []
    for _, each in groupby(range(len(moments)), key=lambda l: moments[l].date()):
        indices = list(each)
        spans.append(DaySpan(indices[0], indices[-1], moments[indices[0]], moments[indices[-1]]))
    return tuple(spans)
