"""Progress: on a terminal, in a log file, and if quiet."""

import io
import re
from collections.abc import Callable, Iterator
from contextlib import contextmanager

import pytest
from rich.console import Console

from framearray_cli.base.errors import OutputError
from framearray_cli.base.units import duration, size
from framearray_cli.cli import screen
from framearray_cli.cli.screen import Screen, print_result, say
from framearray_cli.engine.kernels.clock import CompileClock


class Full(io.StringIO):
    """A file on a full disk."""

    def write(self, _: str) -> int:
        raise OSError(28, "No space left on device")


class Clock:
    """A clock that a test sets."""

    def __init__(self) -> None:
        self.now = 100.0

    def monotonic(self) -> float:
        return self.now


@pytest.fixture
def clock(monkeypatch: pytest.MonkeyPatch) -> Clock:
    clock = Clock()
    monkeypatch.setattr(screen, "time", clock)
    return clock


def plain() -> Console:
    return Console(file=io.StringIO(), width=80)


def terminal() -> Console:
    return Console(file=io.StringIO(), force_terminal=True, width=100, legacy_windows=False, _environ={})


def text(console: Console) -> str:
    assert isinstance(console.file, io.StringIO)
    return console.file.getvalue()


def test_a_log_gets_a_line_in_five_seconds_at_most(clock):
    console = plain()
    with Screen(console) as shown:
        shown.count("rendering", 1200, "image")
        for _ in range(100):
            clock.now += 0.125
            shown.advance()
    lines = text(console).splitlines()
    assert lines == [
        "rendering: 40 of 1,200 images, 2 min 25 s left",
        "rendering: 80 of 1,200 images, 2 min 20 s left",
    ]


def test_the_time_left_is_what_the_work_expects_and_runs_down_between_two_estimates(clock):
    console = plain()
    with Screen(console) as shown:
        shown.count("rendering", 1200, "image", timed=True)
        clock.now += 6
        shown.advance(10)  # nothing is expected yet
        clock.now += 1
        shown.expect(90.0)
        clock.now += 5
        shown.advance(10)
        clock.now += 5
        shown.expect(None)
        shown.advance(10)
    assert text(console).splitlines() == [
        "rendering: 10 of 1,200 images, 1 min 30 s left",
        "rendering: 20 of 1,200 images, 1 min 25 s left",
    ]


def test_work_that_takes_longer_than_expected_is_not_said_to_be_done(clock):
    console = plain()
    with Screen(console) as shown:
        shown.count("rendering", 100, "image", timed=True)
        shown.expect(4.0)
        clock.now += 8
        shown.advance(8)
        clock.now += 92
        shown.advance(92)
    assert text(console).splitlines() == [
        "rendering: 8 of 100 images, 1 min 32 s left",
        "rendering: 100 of 100 images",
    ]


def test_no_line_says_that_nothing_is_done_and_no_time_is_left(clock):
    console = plain()
    with Screen(console) as shown:
        shown.count("rendering", 1, "image", timed=True)
        clock.now += 6
        shown.expect(0.01)
        assert text(console) == ""
        clock.now += 6
        shown.expect(2.0)
        shown.advance()
    assert text(console).splitlines() == ["rendering: 0 of 1 image, 2.0 s left"]


@pytest.fixture
def compiler(monkeypatch: pytest.MonkeyPatch) -> Callable[[int], None]:
    """Replace numba's events: the function returned "compiles" kernels, three seconds each."""
    given: list[Callable[..., None]] = []
    found = CompileClock()

    @contextmanager
    def compile_clock(*calls: Callable[..., None]) -> Iterator[CompileClock]:
        given[:] = calls
        yield found

    def compile_kernels(n: int) -> None:
        begins, compiled = given
        if not found.kernels:
            begins()
        for _ in range(n):
            screen.time.now += 3.0
            found.kernels, found.seconds = found.kernels + 1, found.seconds + 3.0
            compiled(found.kernels)

    monkeypatch.setattr(screen, "compile_clock", compile_clock)
    monkeypatch.setattr(screen, "kept_kernels", lambda: screen.KERNELS - 4)
    return compile_kernels


@pytest.mark.parametrize(
    ("problem", "when", "kept"),
    [("", "once", "kept for the next run"), ("full", "each time, as they cannot be kept", "not kept")],
)
def test_compiling_is_a_stage_with_a_duration(clock, compiler, monkeypatch, problem, when, kept):
    monkeypatch.setattr(screen, "problem", lambda: problem)
    console = plain()
    with Screen(console) as shown, shown.compiling():
        compiler(5)
        shown.count("rendering", 8, "image")
        compiler(1)  # too late for the stage
    assert [line for line in text(console).splitlines() if not line.startswith("note: ")] == [
        f"compiling kernels for this machine, {when}",
        "compiling: 2 of about 4 kernels",
        "compiling: 4 of about 4 kernels",
        f"compiled 5 kernels in 15.0 s; {kept}",
    ]


def test_a_log_gets_no_waiting_and_no_kernels_that_are_loaded(clock, compiler):
    console = plain()
    with Screen(console) as shown, shown.compiling():
        shown.wait("reading the scene")
        shown.count("rendering", 8, "image")
    assert text(console) == ""


def test_compiling_within_a_command_that_counts_nothing_ends_with_it(clock, compiler):
    console = plain()
    with Screen(console) as shown, shown.compiling():
        compiler(1)
    assert text(console).splitlines()[-1] == "compiled 1 kernel in 3.0 s; kept for the next run"


def test_one_kernel_is_one(clock, compiler):
    console = plain()
    with Screen(console) as shown, shown.compiling(0):
        clock.now += 3
        compiler(1)
    assert "compiling: 1 kernel" in text(console).splitlines()


def test_a_terminal_shows_a_bar_of_kernels(compiler, clock):
    console = terminal()
    with Screen(console) as shown, shown.compiling():
        shown.wait("reading the scene")
        compiler(3)
        shown.wait("estimating")  # the bar stays
        assert "compiling" in text(console)
        assert re.search(r"3\S*/\S*4", text(console))
        shown.count("rendering", 8, "image")
    assert "compiled 3 kernels in 9.0 s" in text(console)
    assert text(console).count("\x1b[?25l") == text(console).count("\x1b[?25h")


@pytest.mark.parametrize("make", [plain, terminal])
def test_quiet_is_silent_on_a_terminal_too(make, clock, compiler):
    console = make()
    with Screen(console, quiet=True) as shown, shown.compiling():
        shown.wait("reading the scene")
        compiler(5)
        shown.say(["a line"])
        shown.count("rendering", 3, "image")
        clock.now += 100
        shown.advance(3)
    assert text(console) == ""
    assert shown.done == 3


def test_a_terminal_shows_a_bar_and_removes_it():
    console = terminal()
    with Screen(console) as shown:
        shown.wait("reading the scene")
        shown.say(["about the scene"])
        shown.count("rendering", 8, "image")
        shown.advance(5)
    seen = text(console)
    assert "reading the scene" in seen
    assert "about the scene" in seen
    assert re.search(r"5\S*/\S*8", seen)
    assert seen.count("\x1b[?25l") == seen.count("\x1b[?25h") == 2  # the cursor is hidden, and comes back
    assert seen.endswith("\x1b[2K")  # the bar's line is empty again


def test_a_bar_ends_with_an_error_too():
    console = terminal()
    with pytest.raises(RuntimeError), Screen(console) as shown:
        shown.count("rendering", 8, "image")
        raise RuntimeError
    assert text(console).count("\x1b[?25h") == 1


def test_lines_are_printed_as_they_are():
    console = terminal()
    line = "[bold]x[/bold] :smile: http://a.b 'text' 12" + 100 * " long"
    say(console, [line])
    assert text(console) == f"{line}\n"


def test_a_log_that_cannot_be_written_does_not_end_a_render(clock):
    console = Console(file=Full())
    with Screen(console) as shown:
        shown.count("rendering", 8, "image")
        clock.now += 100
        shown.advance(5)
    assert shown.done == 5
    with pytest.raises(OutputError, match="standard output: cannot be written: No space left on device"):
        say(Console(file=Full()), ["a line"])


def test_results_are_separate_from_notes_and_warnings(capsys):
    print_result(["note: rough", "5 files", "warning: full", "no note: here"])
    assert tuple(capsys.readouterr()) == ("5 files\nno note: here\n", "note: rough\nwarning: full\n")


def test_a_note_that_cannot_be_printed_does_not_end_a_command(monkeypatch, capsys):
    monkeypatch.setattr(screen, "err", Console(file=Full()))
    print_result(["note: rough", "5 files"])
    assert capsys.readouterr().out == "5 files\n"


@pytest.mark.parametrize(
    ("wording", "value", "shown"),
    [
        *((duration, 0.04, "0.0 s"), (duration, 12.34, "12.3 s"), (duration, 59.94, "59.9 s")),
        *((duration, 60, "1 min 00 s"), (duration, 127, "2 min 07 s")),
        *((duration, 3600, "1 h 00 min"), (duration, 11100, "3 h 05 min")),
        *((size, 0, "0 bytes"), (size, 1023, "1023 bytes"), (size, 1024, "1.0 KiB")),
        *((size, 1.3 * 2**30, "1.3 GiB"), (size, 2**40, "1.0 TiB")),
    ],
)
def test_durations_and_sizes(wording, value, shown):
    assert wording(value) == shown
