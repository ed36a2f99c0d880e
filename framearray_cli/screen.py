"""What a person sees while a render runs: a bar on a terminal, plain lines elsewhere, nothing if quiet."""

import threading
import time
from collections.abc import Iterable
from types import TracebackType
from typing import Self

from rich.console import Console
from rich.progress import BarColumn, MofNCompleteColumn, Progress, ProgressColumn, Task, TextColumn, TimeRemainingColumn
from rich.text import Text

# Plain lines: a log file should tell that work goes on, not fill up.
SECONDS_BETWEEN_LINES = 5.0


class _Rate(ProgressColumn):
    """Units a second, over the last while."""

    def __init__(self, unit: str) -> None:
        super().__init__()
        self._unit = unit

    def render(self, task: Task) -> Text:
        rate = task.finished_speed or task.speed
        return Text("" if rate is None else f"{rate:.1f} {self._unit}s/s")


class ProgressBar:
    """Counts finished units up to a total."""

    def __init__(self, console: Console, label: str, total: int, unit: str, *, quiet: bool) -> None:
        self._console, self._label, self._total, self._unit = console, label, total, unit
        self._quiet = quiet
        self._done = 0
        self._lock = threading.Lock()
        self._started = self._last = time.monotonic()
        self._bar: Progress | None = None
        if console.is_terminal and not quiet:
            self._bar = Progress(
                TextColumn("{task.description}"),
                BarColumn(),
                MofNCompleteColumn(),
                _Rate(unit),
                TimeRemainingColumn(),
                console=console,
                transient=True,
            )
            self._task = self._bar.add_task(label, total=total)

    def advance(self, units: int = 1) -> None:
        """Count units that were finished; from any thread."""
        with self._lock:
            self._done += units
            if self._bar is not None:
                self._bar.advance(self._task, units)
                return
            now = time.monotonic()
            if self._quiet or now - self._last < SECONDS_BETWEEN_LINES:
                return
            self._last = now
            rate = self._done / (now - self._started)
            left = duration((self._total - self._done) / rate)
            line = f"{self._label}: {self._done} of {self._total} {self._unit}s, {rate:.1f} a second, {left} left"
        self._console.print(line, highlight=False, soft_wrap=True)

    def __enter__(self) -> Self:
        if self._bar is not None:
            self._bar.start()
        return self

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None
    ) -> None:
        if self._bar is not None:
            self._bar.stop()


def say(console: Console, lines: Iterable[str]) -> None:
    """Print lines as they are: no wrapping, no markup, no colours."""
    for line in lines:
        console.print(line, markup=False, highlight=False, soft_wrap=True)


def duration(seconds: float) -> str:
    """A time in the two units that matter: "3 h 05 min", "2 min 07 s", "12.3 s"."""
    if seconds < 60:
        return f"{seconds:.1f} s"
    minutes, rest = divmod(round(seconds), 60)
    if minutes < 60:
        return f"{minutes} min {rest:02d} s"
    return f"{minutes // 60} h {minutes % 60:02d} min"


def size(n_bytes: float) -> str:
    """A number of bytes in the unit that suits: "1.3 GiB"."""
    for unit in ("bytes", "KiB", "MiB"):
        if n_bytes < 1024:
            return f"{n_bytes:.0f} {unit}" if unit == "bytes" else f"{n_bytes:.1f} {unit}"
        n_bytes /= 1024
    return f"{n_bytes:.1f} GiB" if n_bytes < 1024 else f"{n_bytes / 1024:.1f} TiB"
