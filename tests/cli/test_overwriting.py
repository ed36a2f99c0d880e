"""Existing files are replaced only with `--force`."""

from pathlib import Path

import pytest
from support.boxarrays import plain_manifest, write_array
from support.program import names, run, write_job


@pytest.fixture
def array(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    monkeypatch.chdir(tmp_path)
    return write_array(plain_manifest(tmp_path / "out")).directory


COMMANDS = [
    ["sheet", "out", "-o", "x.png"],
    ["assemble", "out", "walk", "-o", "x.gif"],
    ["render", "job.toml", "--preview", "-o", "x.png"],
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
    assert "page: an earlier export is there; choose another name, or give --force to replace it" in result.err
    assert run(capsys, *command, "--force").code == 0
    (tmp_path / "page" / "mine.txt").write_text("mine")
    assert run(capsys, *command, "--force").code == 4
