"""How errors end a command: message and exit code, the same for all commands."""

import errno
import importlib

import pytest

from framearray_cli.base.errors import (
    BusyError,
    CheckError,
    JobError,
    LimitError,
    MissingExtraError,
    OutputError,
    SceneError,
    WorkerError,
)
from framearray_cli.base.platform import Stopped
from framearray_cli.cli import main as cli
from framearray_cli.cli.main import ending

COMMANDS = [command.callback.__name__ for command in cli.app.registered_commands]
ENDINGS = [
    (SceneError("a.glb: broken"), ["a.glb: broken"], 3),
    (OutputError("out: full\nand more"), ["out: full", "and more"], 4),
    (BusyError("out: busy"), ["out: busy"], 4),
    (WorkerError("lost"), ["lost"], 4),
    (CheckError("1 damaged"), ["1 damaged"], 5),
    (LimitError("`ulimit -v`"), ["`ulimit -v`"], 2),
    (MissingExtraError("needs PyAV"), ["needs PyAV"], 2),
    (
        OSError(errno.EMFILE, "Too many open files", "entry_points.txt"),  # of a library, amid its own work
        ["entry_points.txt: Too many open files; `ulimit -n 1024` lets this program open more"],
        4,
    ),
    (
        OSError(errno.EMFILE, "Too many open files"),  # of a pipe
        ["Too many open files; `ulimit -n 1024` lets this program open more"],
        4,
    ),
    (Stopped(2), ["interrupted"], 130),
    (Stopped(15), ["terminated"], 143),
]


@pytest.mark.parametrize("command", COMMANDS)
@pytest.mark.parametrize(("error", "lines", "code"), ENDINGS, ids=lambda value: type(value).__name__)
def test_errors_end_all_commands_alike(command: str, error: BaseException, lines: list[str], code: int) -> None:
    assert ending(error, command) == (lines, code)


def outcome_of(command: str) -> str:
    if command in ("render", "report"):
        return "; nothing was rendered"
    if command == "check":
        return "; the job cannot be rendered"
    return "; nothing was written" if command in ("assemble", "init", "export", "openjd", "sheet") else ""


@pytest.mark.parametrize("command", COMMANDS)
def test_a_job_error_lists_its_problems_and_their_outcome(command: str) -> None:
    outcome = outcome_of(command)
    one = ending(JobError("a.toml", ["x: expected\ny"]), command)
    assert one == (["a.toml: x: expected\\ny", f"1 problem{outcome}."], 2)
    many = ending(JobError("a.toml", ["x", "and 1234 more problems"]), command)
    assert many == (["a.toml: x", "a.toml: and 1234 more problems", f"1,235 problems{outcome}."], 2)


def test_notes_follow() -> None:
    for error, first in ((OutputError("out: full"), "out: full"), (MemoryError(), "not enough memory; a render")):
        error.add_note("5 of 9 images were written")
        lines, _ = ending(error, "render")
        assert lines[0].startswith(first) and lines[1:] == ["5 of 9 images were written"]


def test_what_python_adds_to_a_signal_amid_a_codec_is_not_printed() -> None:
    error = Stopped(2)
    error.add_note("decoding with 'utf-8-sig' codec failed")  # of a job file that is just being read; Python 3.12
    error.add_note("5 of 9 images were written")
    assert ending(error, "render") == (["interrupted", "5 of 9 images were written"], 130)


def test_too_few_threads_are_no_fault_of_the_program() -> None:
    lines, code = ending(RuntimeError("can't start new thread"), "render")
    assert code == 2 and lines[0].startswith("no more threads can be started; --threads 1 takes the fewest")
    with pytest.raises(RuntimeError, match="another"):
        ending(RuntimeError("another"), "render")


def test_an_error_that_a_signal_led_to_counts_as_the_signal() -> None:
    error = RuntimeError("cannot release un-acquired lock")
    error.__context__ = Stopped(2)
    assert ending(error, "render") == (["interrupted"], 130)


@pytest.mark.parametrize(
    ("arguments", "function"),
    [
        ("assemble out walk -o m.mp4", "tools.movie.movie.assemble_movie"),
        ("export out -f colmap -o x", "tools.export.write.export_array"),
        ("init scene.glb", "starter.init"),
        ("sheet out -o s.png", "tools.contactsheet.make_sheet"),
        ("verify out", "array.integrity.verify"),
        ("view out", "tools.view.show.open_tiles"),
        ("render job.toml", "job.read.read_job"),
        ("openjd job.toml", "job.read.read_job"),
    ],
)
def test_commands_as_typed(capsys, monkeypatch, arguments: str, function: str) -> None:
    def refuse(*args: object, **options: object) -> None:
        raise JobError("a.toml", ["x: expected y"])

    module, _, name = function.rpartition(".")
    monkeypatch.setattr(importlib.import_module(f"framearray_cli.{module}"), name, refuse)
    monkeypatch.setattr(cli, "listen", lambda: None)
    with pytest.raises(SystemExit) as end:
        cli.main(arguments.split())
    assert end.value.code == 2
    assert tuple(capsys.readouterr()) == ("", f"a.toml: x: expected y\n1 problem{outcome_of(arguments.split()[0])}.\n")
