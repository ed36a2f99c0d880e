"""Open Job Description: openjd-cli checks and runs the template that `framearray openjd` writes."""

import io
import json
import logging
import os
import shutil
import subprocess
import sys
from pathlib import Path
from typing import Any

import pytest
from rich.console import Console
from support import tiny
from support.handed import contents
from support.program import run, write_job

from framearray_cli.base.platform import Stopped, python_environment
from framearray_cli.cli import screen as screens

N = 6
OPENJD = shutil.which("openjd", path=os.pathsep.join([str(Path(sys.executable).parent), os.environ.get("PATH", "")]))
needs_openjd = pytest.mark.skipif(OPENJD is None, reason="openjd-cli is not installed (extra dev)")
JOB = {"camera": tiny.WALK, "reuse": {"n_r": 1}, "ambient": {"paths": 64}, "output": {"format": "exr"}}


def openjd(folder: Path, *arguments: str | Path) -> str:
    """Run openjd-cli with `framearray` as the program under test."""
    assert OPENJD is not None
    command = folder / "framearray"
    command.write_text(f'#!/bin/sh\nexec "{sys.executable}" -m framearray_cli "$@"\n')
    command.chmod(0o755)
    environment = python_environment(PATH=os.pathsep.join([str(folder), os.environ.get("PATH", "")]))
    done = subprocess.run(
        [OPENJD, *map(str, arguments)], capture_output=True, text=True, env=environment, timeout=300, check=False
    )
    assert done.returncode == 0, done.stdout + done.stderr
    return done.stdout


def parameters(template: dict[str, Any]) -> dict[str, Any]:
    return {parameter["name"]: parameter["default"] for parameter in template["parameterDefinitions"]}


def test_what_is_written(tmp_path, capsys, monkeypatch):
    monkeypatch.chdir(tmp_path)
    job = write_job(tmp_path, **(JOB | {"render": {"threads": 2, "memory": "3 GiB"}}))
    result = run(capsys, "openjd", job, "--chunk", "3")
    assert (result.code, result.err) == (0, "")
    # frames 0 and 5 count twice, for the missing frames beyond the ends; each half traces one frame of the other
    assert result.out.splitlines()[0] == "2 chunks of 3 camera positions; halos add 25% to the hits"
    template = json.loads((tmp_path / "job.openjd.json").read_text())
    defaults = {"JobFile": "job.toml", "SceneFile": "tiny.glb", "OutputFolder": "out", "ChunkSize": 3, "Threads": 2}
    assert parameters(template) == defaults
    render, verify = template["steps"]
    [cameras] = render["parameterSpace"]["taskParameterDefinitions"]
    assert (cameras["range"], cameras["chunks"]["rangeConstraint"]) == ("0-5", "CONTIGUOUS")
    needs = {need["name"]: need["min"] for need in render["hostRequirements"]["amounts"]}
    assert needs == {"amount.worker.vcpu": 2, "amount.worker.memory": 3072}
    assert verify["dependencies"] == [{"dependsOn": "Render"}]
    for step in (render, verify):
        action = step["script"]["actions"]["onRun"]
        assert action["cancelation"]["mode"] == "NOTIFY_THEN_TERMINATE" and action["timeout"] > 0


def test_files_elsewhere_are_named_from_the_root(tmp_path, capsys):
    job = write_job(tmp_path, **JOB)
    (tmp_path / "farm").mkdir()
    file = tmp_path / "farm" / "walk.yaml"
    assert run(capsys, "openjd", job, "-o", file, "-q").out == ""
    found = parameters(json.loads(file.read_text()))
    assert found["JobFile"] == str(job) and found["OutputFolder"] == str(tmp_path / "out")
    assert found["ChunkSize"] == N and "Threads" in found


@pytest.mark.parametrize(
    ("arguments", "code", "message"),
    [
        (["--chunk", "0"], 2, "--chunk"),
        (["--chunk", "7"], 2, "expected at most 6, the number of camera positions, got 7"),
        (["-o", "walk.txt"], 4, "walk.txt: expected a name that ends in .json, .yaml, .yml"),
        (["-o", "there.json/walk.json"], 4, "there.json: a file of that name is in the way of the folder"),
    ],
)
def test_bad_options(arguments, code, message, tmp_path, capsys, monkeypatch):
    monkeypatch.chdir(tmp_path)
    (tmp_path / "there.json").write_text("mine")
    result = run(capsys, "openjd", write_job(tmp_path, **JOB), *arguments)
    assert result.code == code and message in result.err and "Traceback" not in result.err
    assert (tmp_path / "there.json").read_text() == "mine"
    assert not (tmp_path / "job.openjd.json").exists()


def test_a_missing_scene(tmp_path, capsys, monkeypatch):
    monkeypatch.chdir(tmp_path)
    job = write_job(tmp_path, **JOB)
    (tmp_path / "tiny.glb").unlink()
    result = run(capsys, "openjd", job)
    assert result.code == 3 and "tiny.glb" in result.err
    assert not (tmp_path / "job.openjd.json").exists()


def test_what_a_render_chooses_is_known(tmp_path, capsys):
    job = write_job(tmp_path, **(JOB | {"reuse": {"n_r": "auto"}}))
    result = run(capsys, "openjd", job, "--chunk", "3", "-o", tmp_path / "a.json")
    assert result.code == 0 and result.out.startswith("2 chunks of 3 camera positions; halos add ")


@needs_openjd
@pytest.mark.parametrize("n_r", [2, pytest.param(0, marks=pytest.mark.slow)])
def test_a_farm_renders_the_same_bytes(n_r, tmp_path, capsys):
    job = write_job(tmp_path, **(JOB | {"reuse": {"n_r": n_r}}))
    template = tmp_path / "job.openjd.json"
    assert run(capsys, "openjd", job, "--chunk", "4", "-o", template).code == 0
    assert run(capsys, "render", job, "-o", tmp_path / "whole", "-q").code == 0
    openjd(tmp_path, "check", template)
    printed = openjd(tmp_path, "run", template)
    assert "Cameras(CHUNK[INT]) = 0-2" in printed and "24 files of tiny are whole" in printed
    assert printed.count("openjd_progress: 100") == 2
    files = contents(tmp_path / "whole")
    assert contents(tmp_path / "out") == files
    assert len(files) == N * 4
    assert sorted(file.stem for file in (tmp_path / "out/records").glob("*.jsonl")) == ["0-2", "3-5"]


class Messages(list):  # type: ignore[type-arg]  # of pairs
    """What a farm reads from the lines of a task, by the reader of the specification's own runner."""

    def __init__(self, lines: str) -> None:
        module = pytest.importorskip("openjd.sessions._action_filter", reason="openjd-cli is not installed (extra dev)")

        def keep(kind: Any, message: Any, cancel: bool) -> None:
            self.append((kind.value, message))

        found = module.ActionMonitoringFilter(session_id="s", callback=keep)
        for line in lines.splitlines():
            record = logging.LogRecord("a", logging.INFO, "", 0, line, None, None)
            record.session_id = "s"
            found.filter(record)


def farm_screen(monkeypatch: pytest.MonkeyPatch) -> tuple[Any, io.StringIO]:
    monkeypatch.setenv("FRAMEARRAY_PROGRESS", "openjd")
    monkeypatch.setattr(screens, "SECONDS_BETWEEN_MESSAGES", 0.0)
    text = io.StringIO()
    monkeypatch.setattr(screens, "err", Console(file=text))
    return screens.rendering_screen(quiet=True), text


def test_a_farm_sees_percent_and_time_left(monkeypatch):
    screen, text = farm_screen(monkeypatch)
    with screen:
        screen.count("rendering", 300, "image", timed=True)
        for _ in range(299):
            screen.advance()
        screen.expect(75.0)
        screen.advance()
    found = Messages(text.getvalue())
    assert [value for kind, value in found if kind == "progress"] == [float(k) for k in range(101)]
    screen, text = farm_screen(monkeypatch)
    with screen:
        screen.count("rendering", 10, "image", timed=True)
        screen.expect(75.0)
        screen.advance()
    assert ("status", "rendering, 1 min 15 s left") in Messages(text.getvalue())


@pytest.mark.parametrize(
    ("arguments", "code", "reason"),
    [
        (["render", "none.toml"], 2, "none.toml: no such file"),
        (["render", "job.toml", "--cameras", "99"], 2, "--cameras: expected one of 6 camera positions "),
        (["render", "job.toml", "--chunk", "3"], 2, "Invalid value for --chunk: needs --workers or --dask"),
        (["render", "job.toml", "--threads", "x"], 2, "Invalid value for '--threads'"),
        (["render", "job.toml", "--set", "x=1", "--set", "y=2"], 2, "job.toml: x: unknown key; "),
        (["verify", "none"], 4, "none: no such file"),
    ],
)
def test_a_farm_sees_why_a_task_failed(arguments, code, reason, tmp_path, capsys, monkeypatch):
    monkeypatch.chdir(tmp_path)
    write_job(tmp_path, **JOB)
    assert "openjd_fail" not in run(capsys, *arguments).err
    monkeypatch.setenv("FRAMEARRAY_PROGRESS", "openjd")
    result = run(capsys, *arguments)
    assert result.code == code
    [(kind, text)] = Messages(result.err)
    assert kind == "fail" and text.startswith(reason), text
    assert " y: " in text or "y=2" not in arguments, "all problems are in one line"


def test_a_task_that_is_stopped_has_not_failed(tmp_path, capsys, monkeypatch):
    def stop(*_: object, **__: object) -> None:
        raise Stopped(15)

    monkeypatch.setattr("framearray_cli.job.read.read_job", stop)
    monkeypatch.setenv("FRAMEARRAY_PROGRESS", "openjd")
    result = run(capsys, "render", write_job(tmp_path, **JOB))
    assert result.code == 143 and Messages(result.err) == []


def test_progress_of_another_kind_is_refused(tmp_path, capsys, monkeypatch):
    monkeypatch.setenv("FRAMEARRAY_PROGRESS", "percent")
    result = run(capsys, "render", write_job(tmp_path, **JOB))
    assert result.code == 2
    assert result.err.startswith('FRAMEARRAY_PROGRESS: expected openjd or nothing, got "percent"\n')
    assert not (tmp_path / "out").exists()
