"""Existing files are replaced only with `--force`; `--dry-run` changes no file."""

import hashlib
import re
from pathlib import Path

import pytest
from support.boxarrays import plain_manifest, write_array
from support.program import names, run, write_job
from support.tiny import WALK


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
