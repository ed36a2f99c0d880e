"""Progress for farms: lines that Open Job Description reads from what a program prints, beside its own.

`FRAMEARRAY_PROGRESS=openjd` asks for them; templates of `framearray openjd` set it.
"""

import os
import time
from collections.abc import Sequence

from framearray_cli.base.errors import JobError
from framearray_cli.base.forms.words import printable, shown
from framearray_cli.base.units import duration

from .screen import Screen, err, say

PROGRESS_VARIABLE, OPENJD = "FRAMEARRAY_PROGRESS", "openjd"
SECONDS_BETWEEN_MESSAGES = 1.0  # farms keep every line


class FarmScreen(Screen):
    """Also prints `openjd_progress` (percent of the images) and `openjd_status` (time left)."""

    _sent, _sent_at = -1, 0.0  # the last percent that was printed, and when

    def advance(self, units: int = 1) -> None:
        """Count finished units; any thread may call."""
        super().advance(units)
        with self._lock:
            percent = 100 * self.done // self.total if self.total else 0
            soon = time.monotonic() - self._sent_at < SECONDS_BETWEEN_MESSAGES
            if percent <= self._sent or (soon and percent < 100):
                return
            self._sent, self._sent_at = percent, time.monotonic()
            lines = [f"openjd_progress: {percent}"]
            if (left := self.left()) is not None and percent < 100:
                lines.append(f"openjd_status: {self._label}, {duration(left)} left")
        say(self._console, lines)


def failure_lines(reasons: Sequence[str]) -> list[str]:
    """Return the line that tells a farm why a command failed; none if no farm asks or nothing failed."""
    if not reasons or os.environ.get(PROGRESS_VARIABLE) != OPENJD:
        return []
    return [f"openjd_fail: {' '.join(' '.join(printable(one) for one in reasons).split())}"]


def rendering_screen(*, quiet: bool = False) -> Screen:
    """Return the screen of a render.

    Raises:
        JobError: the environment asks for progress of an unknown kind.
    """
    wanted = os.environ.get(PROGRESS_VARIABLE, "")
    if wanted not in ("", OPENJD):
        raise JobError(PROGRESS_VARIABLE, [f"expected {OPENJD} or nothing, got {shown(wanted)}"])
    return FarmScreen(err, quiet=quiet) if wanted else Screen(err, quiet=quiet)
