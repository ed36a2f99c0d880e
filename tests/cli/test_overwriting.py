"""What exists is replaced only with `--force`; `--dry-run` touches nothing; `-` writes to standard output."""

import hashlib
import io
import json
import re
import sys
import tomllib
from pathlib import Path

import PIL.Image
import pytest
from support.boxarrays import plain_manifest, write_array
from support.program import names, run, write_job
from support.tiny import WALK

from framearray_cli.cli.main import main


@pytest.fixture
def array(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    monkeypatch.chdir(tmp_path)
    return write_array(plain_manifest(tmp_path / "out")).directory


COMMANDS = [
    ["sheet", "out", "-o", "x.png"],
    ["assemble", "out", "walk", "-o", "x.gif"],
    ["render", "job.toml", "--preview", "-o", "x.png"],
    ["openjd", "job.toml", "-o", "x.json"],
    ["init", "tiny.glb", "-o", "x.toml", "--frames", "1", "--lights", "1"],
]


@pytest.mark.parametrize("command", COMMANDS, ids=lambda command: command[0])
def test_a_file_is_replaced_only_with_force(array, tmp_path, capsys, command):
    write_job(tmp_path, "job.toml", output={"directory": "elsewhere"})
    file = tmp_path / command[command.index("-o") + 1]
    file.write_bytes(b"mine")
    result = run(capsys, *command)
    assert (result.code, result.out) == (4, "")
    assert result.err.startswith(
        f"{file.name}: is there already; give another name with --output, or --force to replace it\n"
    )
    assert file.read_bytes() == b"mine"
    assert run(capsys, *command, "--force", "-q").code == 0
    assert file.read_bytes() != b"mine"
    file.unlink()
    file.mkdir()
    assert run(capsys, *command, "--force").code == 4, "a folder is never replaced"
    assert file.is_dir()


def test_a_sequence_is_replaced_only_with_force(array, tmp_path, capsys):
    (tmp_path / "s").mkdir()
    (tmp_path / "s" / "notes.txt").write_text("mine")
    command = ["assemble", "out", "walk", "-o", "s/f.##.jpg", "-q"]
    assert run(capsys, *command).code == 0
    result = run(capsys, *command)
    assert result.code == 4
    assert result.err.startswith("s/f.00.jpg: is there already, with 4 files of an earlier sequence; give another name")
    assert run(capsys, *command, "--force").code == 0
    assert names(tmp_path / "s") == {"notes.txt", *(f"f.0{k}.jpg" for k in range(4))}


def test_a_page_is_replaced_only_with_force(array, tmp_path, capsys):
    command = ["view", "out", "--export", "page", "-q"]
    assert run(capsys, *command).code == 0
    result = run(capsys, *command)
    assert result.code == 4
    assert "page: an earlier export is there; choose another folder, or give --force to replace it" in result.err
    assert run(capsys, *command, "--force").code == 0
    (tmp_path / "page" / "mine.txt").write_text("mine")
    assert run(capsys, *command, "--force").code == 4


def test_a_report_does_not_mix_with_other_files(array, tmp_path, capsys):
    job = write_job(tmp_path, output={"directory": "elsewhere"})
    result = run(capsys, "report", job, "-o", "out")
    assert result.code == 4
    assert "holds other files, 'box.c0000" in result.err and "and no report; choose another folder" in result.err


def written(monkeypatch: pytest.MonkeyPatch, *arguments: str) -> bytes:
    """Run a command; return the bytes that it writes to standard output."""
    out = io.BytesIO()
    stream = io.TextIOWrapper(out, encoding="utf-8", write_through=True)
    with monkeypatch.context() as patched:
        patched.setattr(sys, "stdout", stream)
        main(list(arguments))
    stream.flush()
    return out.getvalue()


def test_pictures_and_movies_on_standard_output(array, tmp_path, monkeypatch):
    before = names(tmp_path)
    sheet = PIL.Image.open(io.BytesIO(written(monkeypatch, "sheet", "out", "-o", "-")))
    assert (sheet.format, sheet.mode) == ("PNG", "RGB")
    assert PIL.Image.open(io.BytesIO(written(monkeypatch, "sheet", "out", "-o", "-.jpg"))).format == "JPEG"
    movie = PIL.Image.open(io.BytesIO(written(monkeypatch, "assemble", "out", "walk", "-o", "-.gif")))
    assert (movie.format, movie.n_frames) == ("GIF", 4)
    assert names(tmp_path) == before


@pytest.mark.parametrize(
    ("command", "code", "message"),
    [
        (["assemble", "out", "walk", "-o", "-"], 4, ", the format of a movie on standard output"),
        (["sheet", "out", "-o", "-", "--json"], 2, "expected a file, as --json prints on standard output"),
        (["init", "tiny.glb", "-o", "-", "--json"], 2, "expected a file, as --json prints on standard output"),
    ],
)
def test_what_standard_output_cannot_hold(array, tmp_path, capsys, command, code, message):
    write_job(tmp_path)
    result = run(capsys, *command)
    assert (result.code, message in result.err + result.out) == (code, True)


def test_no_picture_on_a_terminal(array, capsys, monkeypatch):
    monkeypatch.setattr(sys.stdout, "isatty", lambda: True)
    result = run(capsys, "sheet", "out", "-o", "-")
    assert (result.code, result.out) == (4, "")
    assert "standard output: expected a file or a pipe, got a terminal" in result.err


def test_a_first_job_goes_through_a_pipe(tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    write_job(tmp_path)
    text = written(monkeypatch, "init", "tiny.glb", "-o", "-", "--frames", "2", "--lights", "2").decode()
    assert tomllib.loads(text)["scene"]["file"] == "tiny.glb"
    assert names(tmp_path) == {"job.toml", "tiny.glb"}
    with monkeypatch.context() as patched:
        patched.setattr(sys, "stdin", io.TextIOWrapper(io.BytesIO(text.encode())))
        picture = written(monkeypatch, "render", "-", "--preview", "-o", "-", "--set", "camera.resolution=[32,24]")
    assert PIL.Image.open(io.BytesIO(picture)).size == (32, 24)


def contents(folder: Path) -> dict[str, str]:
    """Return the digest of every file below a folder, with its time of change."""
    return {
        str(file): f"{hashlib.sha256(file.read_bytes()).hexdigest()} {file.stat().st_mtime_ns}"
        for file in sorted(folder.rglob("*"))
        if file.is_file()
    }


def test_a_render(tmp_path, capsys):
    job, out = write_job(tmp_path, camera=WALK), tmp_path / "out"
    result = run(capsys, "render", job, "--dry-run")
    assert (result.code, result.out) == (0, f"would render 18 images of cameras 0-5 into {out}\n")
    assert not out.exists()
    assert run(capsys, "render", job, "-q", "--cameras", "0-1").code == 0
    next(out.glob("*c0001.l002.png")).write_bytes(b"damaged")
    before = contents(tmp_path)
    result = run(capsys, "render", job, "--dry-run")
    lines = ["would replace 1 damaged file", "would keep 3 images that are there"]
    assert result.out.splitlines() == [*lines, f"would render 15 images of cameras 1-5 into {out}"]
    result = run(capsys, "render", job, "--dry-run", "--cameras", "0")
    assert result.out.endswith(f"would render nothing: {out} is complete\n")
    result = run(capsys, "render", job, "--restart", "--dry-run", "--set", "samples.hits=3")
    removal = result.out.splitlines()[0]
    assert re.fullmatch(rf"would remove \d+ files of the frame array in {re.escape(str(out))}", removal)
    assert result.out.splitlines()[1:] == [f"would render 18 images of cameras 0-5 into {out}"]
    assert contents(tmp_path) == before
    assert run(capsys, "render", job, "--dry-run", "--set", "samples.hits=3").code == 4, "as without --dry-run"
    result = run(capsys, "verify", out, "--repair", "--dry-run")
    assert result.code == 5
    assert "would render" in result.out and contents(tmp_path) == before
    result = run(capsys, "render", job, "--restart", "--set", "samples.hits=3")
    assert removal.replace("would remove", "removed") in result.err, "it did what was said"


def test_the_file_beside_a_sequence_is_named(array, tmp_path, capsys):
    pytest.importorskip("opentimelineio", reason="needs OpenTimelineIO: the extra otio")
    command = ["assemble", "out", "walk", "-o", "x/walk.#.png", "--otio"]
    size = "4 frames from 4 images, 24 frames per second"
    wanted = [f"would write x/walk.#.png: {size}", f"would write {Path('x/walk.otio')}"]
    assert run(capsys, *command, "--dry-run").out.splitlines() == wanted
    assert run(capsys, *command).out == f"x: {size}; {Path('x/walk.otio')} describes it\n"
    assert f"would replace {Path('x/walk.otio')}\n" in run(capsys, *command, "--dry-run", "--force").out
    found = json.loads(run(capsys, *command, "--force", "--json").out)["result"]
    assert Path(found["otio"]) == Path("x/walk.otio")


@pytest.mark.parametrize(
    ("command", "made", "what"),
    [
        (["assemble", "out", "walk", "-o", "x.gif"], "x.gif", "4 frames from 4 images, 24 frames per second"),
        (["sheet", "out", "-o", "x.png"], "x.png", "4 camera positions x 3 light positions"),
        (["export", "out", "-f", "cinema", "-o", "x"], "x.cdb", "4 camera positions x 3 light positions"),
        (["init", "tiny.glb", "-o", "x.toml", "--frames", "1", "--lights", "1"], "x.toml", ""),
    ],
)
def test_what_is_written_or_replaced(array, tmp_path, capsys, monkeypatch, command, made, what):
    monkeypatch.setattr("framearray_cli.starter.lighting.find_factors", lambda *_: (0.5, 1.0))  # renders no pictures
    write_job(tmp_path)
    before = contents(tmp_path)
    rest = f": {what}\n" if what else "\n"
    assert run(capsys, *command, "--dry-run").out == f"would write {made}{rest}"
    assert contents(tmp_path) == before
    assert run(capsys, *command, "-q").code == 0
    before = contents(tmp_path)
    assert run(capsys, *command, "--dry-run").code == 4
    assert run(capsys, *command, "--dry-run", "--force").out == f"would replace {made}{rest}"
    assert contents(tmp_path) == before
