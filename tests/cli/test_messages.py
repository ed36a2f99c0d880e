"""How errors end a command, and wrong input beyond the wording in golden/: messages, exit codes, names."""

import errno
import importlib
import os
import re
import subprocess
import sys
from pathlib import Path

import pytest
from support.program import complete, finish, names, run, start, write_job

from framearray_cli.base.errors import (
    BusyError,
    CheckError,
    JobError,
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
    return "; nothing was written" if command in ("assemble", "init", "export", "sheet", "still") else ""


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
    ],
)
def test_commands_as_typed(capsys, monkeypatch, tmp_path, arguments: str, function: str) -> None:
    monkeypatch.chdir(tmp_path)
    for name in ("scene.glb", "job.toml"):
        Path(name).touch()

    def refuse(*args: object, **options: object) -> None:
        raise JobError("a.toml", ["x: expected y"])

    module, _, name = function.rpartition(".")
    monkeypatch.setattr(importlib.import_module(f"framearray_cli.{module}"), name, refuse)
    monkeypatch.setattr(cli, "listen", lambda: None)
    with pytest.raises(SystemExit) as end:
        cli.main(arguments.split())
    assert end.value.code == 2
    assert tuple(capsys.readouterr()) == ("", f"a.toml: x: expected y\n1 problem{outcome_of(arguments.split()[0])}.\n")


@pytest.mark.skipif(os.name == "nt", reason="file names are text there")
def test_a_name_that_cannot_be_shown(tmp_path):
    result = finish(start("render", os.fsdecode(b"n\xffx.toml"), cwd=tmp_path))
    assert result.code == 2
    assert result.err.startswith("n\\udcffx.toml: no such file")


@pytest.mark.parametrize("change", [{"camera": {"resolution": [16384, 16384]}}, {"light": {"frames": 100_000}}])
def test_a_job_beyond_memory(change, tmp_path, capsys, monkeypatch):
    monkeypatch.setattr("framearray_cli.render.memory.free_memory", lambda: 2**30)
    result = run(capsys, "render", "-q", write_job(tmp_path, **change))
    assert (result.code, result.out) == (2, "")
    assert re.search(r"job\.toml: rendering needs at least [\d.]+ GiB of memory, 1\.0 GiB", result.err)
    assert "out" not in names(tmp_path)


def test_memory_that_runs_out_all_the_same(tmp_path, capsys, monkeypatch):
    def fail(*arguments: object, **more: object) -> None:
        raise MemoryError

    monkeypatch.setattr("framearray_cli.render.render.plan_work", fail)
    result = run(capsys, "render", "-q", write_job(tmp_path))
    assert result.code == 2
    assert result.err.startswith("not enough memory; ")


def test_our_own_mistakes_keep_their_traceback(tmp_path, monkeypatch):
    def fail(*arguments: object) -> None:
        raise ZeroDivisionError

    monkeypatch.setattr("framearray_cli.render.session.prepare", fail)
    with pytest.raises(ZeroDivisionError):
        cli.main(["render", str(write_job(tmp_path))])


def test_all_problems_are_counted_at_the_end(tmp_path, capsys):
    result = run(capsys, "check", write_job(tmp_path, camera={f"k{i}": 1 for i in range(1200)}))
    assert result.code == 2
    assert result.err.splitlines()[-2].endswith("job.toml: and 1,150 more problems")
    assert result.err.splitlines()[-1] == "1,200 problems; the job cannot be rendered."


@pytest.mark.skipif(os.name == "nt", reason="such names are none there")
def test_names_cannot_control_the_terminal(tmp_path, capsys, monkeypatch):
    monkeypatch.chdir(tmp_path)
    result = run(capsys, "check", "a\x1b[31m\u202eb\n.toml")
    assert result.err == "a\\x1b[31m\\u202eb\\n.toml: no such file\n1 problem; the job cannot be rendered.\n"
    job = write_job(tmp_path, scene={"materials": {"x\x1b[2J": {"specular": 0.5}}})
    assert "\x1b" not in run(capsys, "check", job).err


def test_a_long_name_of_a_material_is_shortened(tmp_path, capsys):
    result = run(capsys, "check", write_job(tmp_path, scene={"materials": {"x" * 5000: {"specular": 0.5}}}))
    assert result.code == 3
    assert '"' + "x" * 100 + '...": no such material' in result.err
    assert len(result.err) < 1000


LONG = "x" * 300  # characters; file systems allow 255
OUT, OTHER = "out", "other.png"


@pytest.fixture(scope="module")
def rendered(tmp_path_factory):
    """Return a folder with a job, and its frame array in `out`."""
    folder = tmp_path_factory.mktemp("array")
    complete("render", "-q", write_job(folder))
    return folder


@pytest.mark.parametrize(
    ("arguments", "code"),
    [
        (["render", LONG], 2),
        (["check", LONG], 2),
        (["render", "job.toml", "-o", LONG], 4),
        (["render", "job.toml", "-o", f"{LONG}/a"], 4),
        (["check", "job.toml", "-o", LONG], 4),
        (["verify", LONG], 4),
        (["init", LONG], 3),
        (["init", "tiny.glb", "-o", LONG], 4),
        (["assemble", LONG, "walk", "-o", "a.png"], 4),
        (["assemble", OUT, LONG, "-o", "a.gif"], 2),
        (["assemble", OUT, "walk", "-o", LONG], 4),
        (["assemble", OUT, "walk", "-o", f"{LONG}.gif"], 4),
        (["assemble", OUT, "walk", "-o", f"{LONG}/a.gif"], 4),
        (["assemble", OUT, "walk", "-o", f"{LONG}.####.png"], 4),
        (["assemble", OUT, "walk", "-o", f"{LONG}/a.####.png"], 4),
        (["sheet", OUT, "-o", f"{LONG}.png"], 4),
        (["sheet", LONG, "-o", OTHER], 4),
        (["export", OUT, "-f", "nerfstudio", "-o", LONG], 4),
        (["export", OUT, "-f", "rti", "-o", LONG], 4),
        (["view", OUT, "--export", LONG], 4),
        (["view", OUT, "--cache", LONG, "--export", "page"], 4),
        (["view", LONG, "--export", "page"], 4),
    ],
    ids=lambda value: " ".join(value).replace(LONG, "LONG") if isinstance(value, list) else None,
)
def test_a_long_name_is_reported(arguments, code, rendered, capsys, monkeypatch):
    monkeypatch.chdir(rendered)
    before = names(rendered)
    result = run(capsys, *arguments)
    assert result.code == code
    assert LONG in result.err
    assert "File name too long" in result.err or "no such" in result.err
    assert names(rendered) == before


def test_a_long_name_in_a_job_is_reported(tmp_path, capsys):
    result = run(capsys, "check", write_job(tmp_path, scene={"file": f"{LONG}.glb"}))
    assert (result.code, result.out) == (3, "")
    assert f"{LONG}.glb: cannot be read: File name too long\n" in result.err or "no such scene file" in result.err


@pytest.mark.parametrize("key", ["scene.file", "output.directory"])
def test_no_file_has_a_name_of_thousands_of_letters(key, tmp_path, capsys):
    table, name = key.split(".")
    result = run(capsys, "check", write_job(tmp_path, **{table: {name: "a/" * 5000}}))
    assert (result.code, result.out) == (2, "")
    assert f"{key}: " in result.err
    assert len(result.err) < 1000


KINDS = {
    "job.toml": "a job file",
    "walk.toml": "a movie path",
    "out": "the folder of a frame array",
    "out/manifest.toml": "the manifest of a frame array",
    "out/image.png": "an image",
    "tiny.glb": "a scene",
    "movie.mp4": "a movie",
}


@pytest.fixture
def files(tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    write_job(tmp_path)
    (tmp_path / "walk.toml").write_text("[[segments]]\nframes = 2\n")
    (tmp_path / "out").mkdir()
    (tmp_path / "out" / "manifest.toml").write_text('fingerprint = ""\ncameras = []\nscene = {}\n')
    for name in ("out/image.png", "movie.mp4"):
        (tmp_path / name).write_bytes(b"x")
    return tmp_path


WANTED = [
    (["check", "{}"], "a job file", 2, ["job.toml"]),
    (["render", "{}"], "a job file", 2, ["job.toml"]),
    (["report", "{}"], "a job file", 2, ["job.toml"]),
    (["init", "{}", "-o", "new.toml"], "a scene", 3, ["tiny.glb"]),
    (["verify", "{}"], "the folder of a frame array", 4, ["out", "out/manifest.toml"]),
    (["view", "{}", "--no-browser"], "the folder of a frame array", 4, ["out", "out/manifest.toml"]),
    (["sheet", "{}", "-o", "sheet.png"], "the folder of a frame array", 4, ["out", "out/manifest.toml"]),
    (["export", "{}", "-f", "colmap", "-o", "new"], "the folder of a frame array", 4, ["out", "out/manifest.toml"]),
    (["assemble", "{}", "walk.toml", "-o", "new.png"], "the folder of a frame array", 4, ["out", "out/manifest.toml"]),
]


@pytest.mark.usefixtures("files")
@pytest.mark.parametrize(("command", "wanted", "code", "right"), WANTED, ids=[case[0][0] for case in WANTED])
def test_a_file_of_another_kind_is_named(command, wanted, code, right, capsys):
    for name, noun in KINDS.items():
        if name in right:
            continue
        result = run(capsys, *(part.format(name) for part in command))
        assert (result.code, result.out) == (code, "")
        assert result.err.startswith(f"{name}: expected {wanted}, got {noun}"), result.err


@pytest.mark.usefixtures("files")
def test_the_remedy_names_the_command(capsys):
    assert "; `framearray init tiny.glb` writes a job for it" in run(capsys, "render", "tiny.glb").err
    assert "; give the folder of the array: out\n" in run(capsys, "verify", "out/image.png").err
    assert "; give the folder that it renders into (output.directory)\n" in run(capsys, "verify", "job.toml").err
    assert "; `framearray render job.toml` renders it; `framearray check " in run(capsys, "init", "job.toml").err


def test_a_job_with_a_key_of_another_file_stays_a_job(tmp_path, capsys):
    job = write_job(tmp_path)
    job.write_text('segments = 1\nfingerprint = ""\ncameras = 1\n' + job.read_text())
    lines = run(capsys, "render", job).err.splitlines()
    assert [line.removeprefix(f"{job}: ").partition(";")[0] for line in lines[:-1]] == [
        "segments: unknown key",
        "fingerprint: unknown key",
        "cameras: unknown key",
    ]


@pytest.mark.parametrize(
    ("command", "problem"),
    [
        (["check", "none.toml"], "no such"),
        (["render", "none.toml"], "no such"),
        (["init", "none.glb"], "no such"),
        (["init", "a.fbx"], "known are 3dxml"),
    ],
)
def test_a_wrong_file_is_reported_before_libraries_are_loaded(command, problem, tmp_path):
    (tmp_path / "a.fbx").touch()
    code = (
        "import sys; from framearray_cli.cli.main import main\n"
        "try: main()\n"
        "finally: print(*{'numba', 'numpy', 'embreex', 'OpenImageIO'} & set(sys.modules))"
    )
    ran = subprocess.run([sys.executable, "-c", code, *command], capture_output=True, text=True, cwd=tmp_path)
    assert command[1] in ran.stderr and problem in ran.stderr
    assert ran.stdout.split() == []
