"""Progress: on a terminal, in a log file, and if quiet."""

import io
import re

import pytest
from rich.console import Console

from framearray_cli.base.errors import OutputError
from framearray_cli.base.units import duration, size
from framearray_cli.cli import screen
from framearray_cli.cli.screen import Screen, print_result, say


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
        "rendering: 40 of 1200 images, 8.0 per second, 2 min 25 s left",
        "rendering: 80 of 1200 images, 8.0 per second, 2 min 20 s left",
    ]


def test_a_log_gets_no_waiting(clock):
    console = plain()
    with Screen(console) as shown:
        shown.wait("reading the scene")
    assert text(console) == ""


def test_compiling_is_printed_unless_quiet(clock):
    for quiet in (False, True):
        console = plain()
        with Screen(console, quiet=quiet) as shown:
            shown.compiling()
        assert bool(re.search("compiling .* the first time only", text(console))) is not quiet


def test_quiet_is_silent_on_a_terminal_too(clock):
    console = terminal()
    with Screen(console, quiet=True) as shown:
        shown.wait("reading the scene")
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
    line = "[bold]x[/bold] :smile: http://a.b 'text' 12 " + 100 * "long "
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
    ("seconds", "shown"),
    [
        (0.04, "0.0 s"),
        (12.34, "12.3 s"),
        (59.94, "59.9 s"),
        (60, "1 min 00 s"),
        (127, "2 min 07 s"),
        (3600, "1 h 00 min"),
        (11100, "3 h 05 min"),
    ],
)
def test_durations(seconds, shown):
    assert duration(seconds) == shown


@pytest.mark.parametrize(
    ("n_bytes", "shown"),
    [(0, "0 bytes"), (1023, "1023 bytes"), (1024, "1.0 KiB"), (1.3 * 2**30, "1.3 GiB"), (2**40, "1.0 TiB")],
)
def test_sizes(n_bytes, shown):
    assert size(n_bytes) == shown
