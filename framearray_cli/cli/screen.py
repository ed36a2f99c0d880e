"""Output of commands: results to standard output; progress, notes and warnings to standard error.

Progress is a bar on a terminal, plain lines elsewhere, nothing if quiet.
"""

import os
import threading
import time
from collections.abc import Callable, Iterable, Iterator, Sequence
from contextlib import contextmanager, suppress
from typing import IO, TYPE_CHECKING, Self

from rich.console import Console
from rich.text import Text

from framearray_cli.base.errors import OutputError, ReaderGoneError
from framearray_cli.base.files import reason
from framearray_cli.base.forms.words import printable
from framearray_cli.base.units import counted, duration
from framearray_cli.engine.kernels.cache import kept_kernels, problem
from framearray_cli.engine.kernels.clock import CompileClock, compile_clock

from .document import REMARKS, document_text, outcome

if TYPE_CHECKING:
    from rich.progress import Progress
    from rich.status import Status


class _Console(Console):
    def on_broken_pipe(self) -> None:
        """Raise an error of our own; rich would end the process."""
        _discard(self.file)
        raise ReaderGoneError


out, err = _Console(), _Console(stderr=True)

# Plain lines show in a log file that work goes on, without filling it up.
SECONDS_BETWEEN_LINES = 5.0
LEAST_LEFT = 0.05  # seconds; less is not shown
KERNELS = 50  # that the first command compiles; jobs differ by a few


def _make_bar(console: Console, left: Callable[[], str]) -> "Progress":
    """Make a bar that vanishes when it ends; `left` words the time left, or gives ""."""
    from rich import progress  # takes long to import

    class Left(progress.ProgressColumn):
        def render(self, task: progress.Task) -> Text:
            return Text(left())

    columns = progress.TextColumn("{task.description}"), progress.BarColumn(), progress.MofNCompleteColumn(), Left()
    return progress.Progress(*columns, console=console, transient=True)


def _left_text(seconds: float | None) -> str:
    return "" if seconds is None or seconds < LEAST_LEFT else f"{duration(seconds)} left"


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
        self._timed = False
        self._deadline: float | None = None
        self._clock: CompileClock | None = None
        self._expected_kernels = 0
        self.done = self.total = 0
        self.compile_seconds = 0.0  # of what was reported so far

    def say(self, lines: Iterable[str]) -> None:
        """Print progress, notes or warnings above the moving line."""
        lines = list(lines)
        outcome.remember(lines)
        if not self._quiet:
            with suppress(OutputError):  # a full log is no reason to end a long render
                say(self._console, lines)

    def show(self, lines: Iterable[str]) -> None:
        """Print a part of the result, instead of the bar on a terminal."""
        self._end_wait()
        print_result(lines)

    def wait(self, what: str) -> None:
        """Show work of unknown length; only on a terminal."""
        if self._moving and self._bar is None:
            if self._status is None:
                self._status = self._console.status("")
                self._status.start()
            self._status.update(Text(what))

    @contextmanager
    def compiling(self, usual: int = KERNELS, *, exact: bool = False) -> Iterator[CompileClock]:
        """Show what is compiled within the block as a stage of its own, which `compiled` ends, or the block.

        Args:
            usual: kernels that the command needs, about.
            exact: it needs these, and no others.
        """

        def begin() -> None:
            self._expected_kernels = max(usual - kept_kernels(), 0)
            keeping = "each time, as they cannot be kept" if problem() else "once"
            self.say([f"compiling kernels for this machine, {keeping}"])
            if self._bar is None:
                self._open_bar("compiling", self._expected_kernels or None)

        def count(kernels: int) -> None:
            if self._clock is None:  # the stage has ended; a few kernels came late
                return
            total = max(self._expected_kernels, kernels)
            of = f"{kernels} of {'' if exact else 'about '}" if self._expected_kernels else ""
            if self._bar is not None:
                self._bar.update(self._task, completed=kernels, total=total)
            elif self._is_time():
                self.say([f"compiling: {of}{counted(total, 'kernel')}"])

        self._last = time.monotonic()
        with compile_clock(begin, count) as clock:
            self._clock = clock
            yield clock
            self.compiled()

    def compiled(self) -> None:
        """Report what was compiled, if anything, and end the stage."""
        if self._clock is not None and self._clock.kernels:
            self._close_bar()
            self.report_compiled(self._clock.kernels, self._clock.seconds)
            self._clock = None

    def report_compiled(self, kernels: int, seconds: float) -> None:
        """Print the number of kernels compiled, and how long that took."""
        self.compile_seconds += seconds
        kept = "not kept" if problem() else "kept for the next run"
        self.say([f"compiled {counted(kernels, 'kernel')} in {duration(seconds)}; {kept}"])

    def count(self, label: str, total: int, unit: str, *, timed: bool = False) -> None:
        """Start to count up to a total.

        Args:
            timed: `expect` says how much time is left; otherwise the units finished so far do.
        """
        self.compiled()
        self._label, self._unit, self.total, self._timed = label, unit, total, timed
        self._started = self._last = time.monotonic()
        self._open_bar(label, total)

    def expect(self, seconds: float | None) -> None:
        """Set the time left; None: not known. Any thread may call."""
        with self._lock:
            self._deadline = None if seconds is None else time.monotonic() + seconds
        if seconds is not None:
            self.advance(0)

    def left(self) -> float | None:
        """Return the seconds left; None: not known. What takes longer than expected is judged by what is done."""
        now = time.monotonic()
        if self._timed and (self._deadline is None or self._deadline > now or self.done >= self.total):
            return None if self._deadline is None else max(self._deadline - now, 0.0)
        return (self.total - self.done) * (now - self._started) / self.done if self.done > 0 else None

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
            left = self.left()
            if left is None or (left < LEAST_LEFT and self.done < self.total) or not self._is_time():
                return
            done = f"{self._label}: {self.done:,} of {counted(self.total, self._unit)}"
            line = ", ".join(filter(None, (done, _left_text(left))))
        self.say([line])

    def _is_time(self) -> bool:
        """True if another plain line may be printed."""
        now = time.monotonic()
        if self._quiet or self._moving or now - self._last < SECONDS_BETWEEN_LINES:
            return False
        self._last = now
        return True

    def _open_bar(self, label: str, total: int | None) -> None:
        """Show a bar, on a terminal, instead of the last one."""
        self._close_bar()
        self._end_wait()
        if self._moving:
            self._bar = _make_bar(self._console, lambda: _left_text(self.left() if self.total else None))
            self._task = self._bar.add_task(label, total=total)
            self._bar.start()

    def _close_bar(self) -> None:
        if self._bar is not None:
            self._bar.stop()
            self._bar = None

    def end(self) -> None:
        """Remove the moving line; counting has ended."""
        with suppress(OSError):  # a terminal that was closed
            self._end_wait()
            self._close_bar()

    def _end_wait(self) -> None:
        if self._status is not None:
            self._status.stop()
            self._status = None

    def __enter__(self) -> Self:
        return self

    def __exit__(self, kind: object, error: BaseException | None, trace: object) -> None:
        self.end()
        if error is None and (why := problem()):
            self.say([f"note: compiled kernels cannot be kept: {why}; NUMBA_CACHE_DIR names another folder for them"])


def print_result(lines: Iterable[str], result: object = None, *, quiet: bool = False) -> None:
    """Print the result of a command; its notes and warnings go to standard error.

    Args:
        result: one of `results.RESULTS`, for `--json`, which prints it at the end instead of the lines.
        quiet: print nothing, but keep the result.
    """
    lines = list(lines)
    outcome.remember(lines)
    outcome.result = result
    for line in [] if quiet else lines:
        if line.startswith(REMARKS):
            with suppress(OutputError):
                say(err, [line])
        elif not outcome.wanted:
            say(out, [line])


def print_document(command: str, exit_code: int = 0, problems: Sequence[str] = ()) -> None:
    """Print the document of a command if `--json` wants it, once."""
    if outcome.wanted:
        outcome.wanted = False
        say(out, [document_text(command, exit_code, problems)])


def say(console: Console, lines: Iterable[str]) -> None:
    """Print lines as they are, without wrapping, markup and colours; escape what would control a terminal.

    Raises:
        OutputError: they cannot be printed, for instance into a file on a full disk.
        ReaderGoneError: the reader of the output is gone.
    """
    try:
        for line in lines:
            console.print(printable(line), markup=False, highlight=False, soft_wrap=True, emoji=False)
    except BrokenPipeError as error:  # of rich before 13.8
        _discard(console.file)
        raise ReaderGoneError from error
    except OSError as error:
        _discard(console.file)
        stream = "standard error" if console.stderr else "standard output"
        raise OutputError(f"{stream}: cannot be written: {reason(error)}") from error


def _discard(stream: IO[str]) -> None:
    """Send the rest of a stream to the null device: its buffer would fail again when the process ends."""
    with suppress(OSError, ValueError):  # a stream without a file cannot fail
        os.dup2(os.open(os.devnull, os.O_WRONLY), stream.fileno())
