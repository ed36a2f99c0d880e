"""`--set KEY=VALUE`: keys of a job that a command line replaces."""

import io
import sys
from pathlib import Path

import pytest
import tomli_w
from support import tiny
from support.program import run, write_job

from framearray_cli.base.errors import JobError
from framearray_cli.job.job import Job
from framearray_cli.job.read import read_job


def changed_job(folder: Path, *sets: str) -> Job:
    return read_job(write_job(folder), sets)


def test_values_of_all_kinds(tmp_path: Path) -> None:
    job = changed_job(
        tmp_path,
        "camera.resolution=[64,48]",
        "camera.fov = 33.5",
        "output.format=jpg",  # a bare text
        "name=2026",  # a text that looks like a number
        "light.sources[0].keys[0].intensity=[1, 2, 3]",
        "light.sources[-1].group=sun",
        'scene.materials."the wall".reflectivity=0.25',
        "render.memory=8 GiB",
        "output.format = exr",  # the last one counts
    )
    assert (job.camera.resolution, job.camera.fov, job.output.format, job.name) == ((64, 48), 33.5, "exr", "2026")
    assert job.light.sources[0].keys[0].intensity == (1, 2, 3)
    assert job.light.sources[-1].group == "sun"
    assert job.scene.materials["the wall"].reflectivity == (0.25, 0.25, 0.25)
    assert job.render.memory == 8 * 2**30


def test_a_job_with_a_set_key_is_that_with_the_key_in_its_file(tmp_path: Path) -> None:
    assert changed_job(tmp_path, "samples.hits=3") == read_job(write_job(tmp_path, samples={"hits": 3}))
    assert changed_job(tmp_path) != changed_job(tmp_path, "samples.hits=3")


def test_file_names_are_relative_to_the_current_folder(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    (tmp_path / "here").mkdir()
    monkeypatch.chdir(tmp_path / "here")
    job = changed_job(tmp_path, "output.directory=pictures", 'scene.folders=["textures"]')
    assert job.output.directory == tmp_path / "here" / "pictures"
    assert job.scene.folders == (tmp_path / "here" / "textures",)
    assert job.scene.file.parent == tmp_path, "of the file itself"


def test_all_problems_at_once(tmp_path: Path) -> None:
    file = write_job(tmp_path, camera=tiny.WALK | {"fov": 0})
    with pytest.raises(JobError) as caught:
        read_job(file, ["samples.hits=0", "specular.depth=-1"])
    assert [("--set" in problem) for problem in caught.value.problems] == [False, True, True]
    with pytest.raises(JobError) as caught:
        read_job(file, ["fov", "hits"])
    assert len(caught.value.problems) == 2


def test_a_job_on_standard_input(tmp_path: Path, capsys, monkeypatch: pytest.MonkeyPatch) -> None:
    table = tiny.table(output={"directory": "out", "format": "png"})
    write_job(tmp_path)
    monkeypatch.chdir(tmp_path)
    stdin_of(monkeypatch, tomli_w.dumps(table))
    assert run(capsys, "render", "-", "--set", "camera.resolution=[20,10]", "-q").code == 0
    manifest = (tmp_path / "out" / "manifest.toml").read_text()
    assert "20,\n    10,\n" in manifest.split("[job.camera]")[1], "the manifest holds the job as resolved"
    stdin_of(monkeypatch, tomli_w.dumps(table | {"nmae": 3}))
    result = run(capsys, "check", "-")
    assert (result.code, result.out) == (2, "")
    assert result.err.startswith('standard input: nmae: unknown key; did you mean "name"?\n')


def test_a_terminal_is_no_job(capsys, monkeypatch: pytest.MonkeyPatch) -> None:
    stdin_of(monkeypatch, "")
    monkeypatch.setattr(sys.stdin, "isatty", lambda: True)
    result = run(capsys, "check", "-")
    assert (result.code, "standard input: expected a TOML file from a pipe, got a terminal" in result.err) == (2, True)


def stdin_of(monkeypatch: pytest.MonkeyPatch, text: str) -> None:
    monkeypatch.setattr(sys, "stdin", io.TextIOWrapper(io.BytesIO(text.encode())))
