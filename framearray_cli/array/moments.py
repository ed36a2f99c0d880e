"""Date and time of light positions under a sun: their names, and places that are written as times.

"2026-06-21" stands for all positions of that day, and "2026-06-21T14:30" for the one nearest to that time; a blank
instead of the T is allowed. Times are local, as in the job.
"""

import re
from collections.abc import Callable, Mapping, Sequence
from datetime import date, datetime
from itertools import groupby
from typing import TYPE_CHECKING, Any, NamedTuple

from framearray_cli.base.errors import JobError
from framearray_cli.base.forms.words import shown

from .places import match_part

if TYPE_CHECKING:
    from .manifest import Manifest

TIME = r"\d{4}-\d{2}-\d{2}(?:[T ]\d{1,2}:\d{2}(?::\d{2})?)?"
_TIME = re.compile(rf"(?<![\d.:])({TIME})(?![\d:.])")
MOST_DAYS = 4  # that a message lists


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


def without_times(text: str) -> str:
    """Replace all dates and times by indices, to check the notation of a text."""
    return ",".join(_replace(part, lambda _: (0, 1)) for part in text.split(","))


def put_indices(text: str, moments: Sequence[datetime]) -> str:
    """Replace dates and times by indices in a text in the notation of places; a day becomes a range.

    Args:
        text: in the notation, as "2026-06-21", "2026-06-21x4" or "2026-06-21T06:00-2026-06-21T12:00".
        moments: of the positions of the axis; empty without a sun.

    Raises:
        ValueError: the axis has no such day or time; the message says what was expected.
    """
    return ",".join(_replace(part, lambda time: _indices(time, moments)) for part in text.split(","))


def read_times(option: str, text: str, moments: Callable[[], Sequence[datetime]]) -> str:
    """Replace dates and times by indices in places that an option names; see `put_indices`.

    Args:
        option: that the text was given to, for messages.
        moments: returns the times of the axis; called only if the text names any.

    Raises:
        JobError: the axis has no such day or time.
    """
    if without_times(text) == text:
        return text
    try:
        return put_indices(text, moments())
    except ValueError as error:
        raise JobError(option, [str(error)]) from error


def _replace(part: str, indices: Callable[[str], tuple[int, int]]) -> str:
    """Replace times by indices; a range of days includes all of their positions, a downward one too."""
    ends = match_part(_TIME.sub("0", part))
    is_range = ends is not None and ends[2] is not None
    found = [indices(match[1]) for match in _TIME.finditer(part)]
    way = -1 if len(found) == 2 and found[0] > found[1] else 1

    def index(match: re.Match[str]) -> str:
        first, last = indices(match[1])
        if is_range:
            return str((first, last)[::way][bool(part[: match.start()].strip())])
        return f"{first}-{last}" if last > first else str(first)

    return _TIME.sub(index, part)


def _indices(text: str, moments: Sequence[datetime]) -> tuple[int, int]:
    """Find the first and last position of a day, or the one nearest to a time."""
    if not moments:
        raise ValueError(f"expected an index, as these positions have no date and time, got {shown(text)}")
    spans = day_spans(moments)
    day_text, _, clock = text.replace("T", " ").partition(" ")
    try:
        day = date.fromisoformat(day_text)
        wanted = datetime.fromisoformat(f"{day_text} {clock.zfill(5)}") if clock else None
    except ValueError:
        raise ValueError(f"expected a date and time that exist, got {shown(text)}") from None
    span = next((span for span in spans if span.start.date() == day), None)
    if span is not None and wanted is None:
        return span.first, span.last
    if span is None or wanted is None or not _naive(span.start) <= wanted <= _naive(span.stop):
        listed = [each.text for each in spans[:MOST_DAYS]]
        more = f" and {len(spans) - MOST_DAYS} more days" if len(spans) > MOST_DAYS else ""
        raise ValueError(f"expected a time within {', '.join(listed)}{more}, got {shown(text)}")
    nearest = min(range(span.first, span.last + 1), key=lambda l: abs(_naive(moments[l]) - wanted))
    return nearest, nearest


def _naive(moment: datetime) -> datetime:
    return moment.replace(tzinfo=None)
