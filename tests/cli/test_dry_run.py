"""`--dry-run` says what a command would do, and touches nothing."""

import hashlib
import json
import re
from pathlib import Path

import pytest
from support.boxarrays import plain_manifest, write_array
from support.program import run, write_job
from support.tiny import WALK


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


@pytest.fixture
def array(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    monkeypatch.chdir(tmp_path)
    return write_array(plain_manifest(tmp_path / "out")).directory


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
