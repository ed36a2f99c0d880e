"""What commands print: results to standard output; progress, notes and warnings to standard error.

Progress is a bar on a terminal, plain lines elsewhere, nothing if quiet.
"""

import os
import threading
import time
from collections.abc import Callable, Iterable
from contextlib import suppress
from types import TracebackType
from typing import IO, Self

from rich.console import Console
from rich.progress import BarColumn, MofNCompleteColumn, Progress, ProgressColumn, Task, TextColumn, TimeRemainingColumn
from rich.status import Status
from rich.text import Text

from framearray_cli.base.errors import OutputError
from framearray_cli.base.files import reason
from framearray_cli.base.units import duration
from framearray_cli.engine.kernels.cache import problem

out, err = Console(), Console(stderr=True)

# Plain lines show in a log file that work goes on, without filling it up.
SECONDS_BETWEEN_LINES = 5.0
REMARKS = ("note: ", "warning: ")  # how lines begin that are no results


class _Rate(ProgressColumn):
    """Print units per second, over the last few seconds."""

    def __init__(self, unit: str) -> None:
        super().__init__()
        self._unit = unit

    def render(self, task: Task) -> Text:
        rate = task.finished_speed or task.speed
        return Text("" if rate is None else f"{rate:.1f} {self._unit}s/s")


class Screen:
    """Show what the program waits for, then count finished units up to a total.

    On a terminal the last line moves. Elsewhere print a plain line every few seconds. If quiet, print nothing.
    """

    def __init__(self, console: Console, *, quiet: bool = False) -> None:
        self._console, self._quiet = console, quiet
        self._moving = console.is_terminal and not quiet
        self._lock = threading.Lock()
        self._status: Status | None = None
        self._bar: Progress | None = None
        self._label = self._unit = ""
        self._started = self._last = 0.0
        self.done = self.total = 0

    def say(self, lines: Iterable[str]) -> None:
        """Print progress, notes or warnings above the moving line."""
        if not self._quiet:
            with suppress(OutputError):  # a full log is no reason to end a long render
                say(self._console, lines)

    def wait(self, what: str) -> None:
        """Show work of unknown length; only on a terminal."""
        if self._moving and self._bar is None:
            if self._status is None:
                self._status = self._console.status("")
                self._status.start()
            self._status.update(Text(what))

    def compiling(self) -> None:
        """Print why the first run on a machine starts slowly."""
        when = "each time" if problem() else "the first time only"
        self.say([f"compiling for this machine; that takes up to a minute, {when}"])

    def count(self, label: str, total: int, unit: str) -> None:
        """Start to count up to a total."""
        self._label, self._unit, self.total = label, unit, total
        self._started = self._last = time.monotonic()
        self._end_wait()
        if self._moving:
            self._bar = Progress(
                TextColumn("{task.description}"),
                BarColumn(),
                MofNCompleteColumn(),
                _Rate(unit),
                TimeRemainingColumn(),
                console=self._console,
                transient=True,
            )
            self._task = self._bar.add_task(label, total=total)
            self._bar.start()

    def counter(self, label: str, unit: str) -> Callable[[int, int], None]:
        """Return a function of (units done, total) that counts one more unit; its first call starts to count."""

        def count_one(done: int, total: int) -> None:
            if not self.total:
                self.count(label, total, unit)
            self.advance()

        return count_one

    def advance(self, units: int = 1) -> None:
        """Count finished units; any thread may call."""
        with self._lock:
            self.done += units
            if self._bar is not None:
                self._bar.advance(self._task, units)
                return
            now = time.monotonic()
            if self._quiet or self.done <= 0 or now - self._last < SECONDS_BETWEEN_LINES:
                return
            self._last = now
            rate = self.done / (now - self._started)
            left = duration((self.total - self.done) / rate)
            line = f"{self._label}: {self.done} of {self.total} {self._unit}s, {rate:.1f} per second, {left} left"
        self.say([line])

    def end(self) -> None:
        """Remove the moving line; counting has ended."""
        with suppress(OSError):  # a terminal that was closed
            self._end_wait()
            if self._bar is not None:
                self._bar.stop()

    def _end_wait(self) -> None:
        if self._status is not None:
            self._status.stop()
            self._status = None

    def __enter__(self) -> Self:
        return self

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None
    ) -> None:
        self.end()
        if error is None and (why := problem()):
            self.say([f"note: compiled kernels cannot be kept: {why}; NUMBA_CACHE_DIR names another folder for them"])


def print_result(lines: Iterable[str]) -> None:
    """Print the result of a command; its notes and warnings go to standard error.

    Raises:
        OutputError: the result cannot be printed.
    """
    for line in lines:
        if line.startswith(REMARKS):
            with suppress(OutputError):
                say(err, [line])
        else:
            say(out, [line])


def say(console: Console, lines: Iterable[str]) -> None:
    """Print lines as they are, without wrapping, markup and colours; escape what would control a terminal.

    Raises:
        OutputError: they cannot be printed, for instance into a file on a full disk.
    """
    try:
        for line in lines:
            console.print(printable(line), markup=False, highlight=False, soft_wrap=True, emoji=False)
    except BrokenPipeError:  # the reader has gone
        raise
    except OSError as error:
        _discard(console.file)
        stream = "standard error" if console.stderr else "standard output"
        raise OutputError(f"{stream}: cannot be written: {reason(error)}") from error


def printable(text: str) -> str:
    """Escape invisible characters: names may hold escape sequences, or reverse the line."""
    if text.replace("\n", "").isprintable():
        return text
    return "".join(c if c.isprintable() or c in "\n\xa0" else c.encode("unicode_escape").decode() for c in text)


def _discard(stream: IO[str]) -> None:
    """Send the rest of a stream to the null device: its buffer would fail again when the process ends."""
    with suppress(OSError, ValueError):  # a stream without a file cannot fail
        os.dup2(os.open(os.devnull, os.O_WRONLY), stream.fileno())
