"""Run the command line: in this process for messages, in a process of its own for signals and full disks."""

import os
import subprocess
import sys
import time
from collections.abc import Callable, Mapping
from contextlib import suppress
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import psutil
import pytest
import tomli_w

from framearray_cli.cli.main import main
from support import ROOT, tiny

LOADING = 0.6  # seconds that importing the renderer takes on an idle machine
IDLE = 60.0  # seconds without progress after which a command counts as hanging
WAKEFUL = 0.05  # seconds of processor time that are progress


@dataclass(frozen=True)
class Result:
    """How a command ended, and what it printed."""

    code: int
    out: str
    err: str


def run(capsys: pytest.CaptureFixture[str], *arguments: str | Path) -> Result:
    """Run a command in this process."""
    capsys.readouterr()
    try:
        main([str(argument) for argument in arguments])
        code = 0
    except SystemExit as end:
        code = end.code if isinstance(end.code, int) else int(end.code is not None)
    printed = capsys.readouterr()
    return Result(code, printed.out, printed.err)


def complete(*arguments: str | Path) -> None:
    """Run a command in this process, which must end well; starting a program would take longer than a small render."""
    try:
        main([str(argument) for argument in arguments])
    except SystemExit as end:
        assert not end.code


def python(code: str, *arguments: str | Path, env: Mapping[str, str] = os.environ, **variables: str) -> str:
    """Run Python code in a process of its own, which must end well; return what it printed."""
    command = [sys.executable, "-c", code, *map(str, arguments)]
    ran = subprocess.run(command, cwd=ROOT, env={**env, **variables}, capture_output=True, text=True)
    assert ran.returncode == 0, ran.stderr
    return ran.stdout.strip()


def start(*arguments: str | Path, **options: Any) -> subprocess.Popen[str]:
    """Start a command as a user does."""
    return subprocess.Popen(
        [sys.executable, "-m", "framearray_cli", *map(str, arguments)],
        stdout=options.pop("stdout", subprocess.PIPE),
        stderr=options.pop("stderr", subprocess.PIPE),
        text=True,
        # buffer the output as for a user, even where the tests run unbuffered
        env={name: value for name, value in os.environ.items() if name != "PYTHONUNBUFFERED"}
        | {"PYTHONPATH": os.pathsep.join([str(ROOT), os.environ.get("PYTHONPATH", "")])},
        **options,
    )


def finish(process: subprocess.Popen[str], seconds: float = 300.0) -> Result:
    """Wait for the end of a command; fail with its output where it hangs, or takes longer than some seconds."""
    started = woke = time.monotonic()
    used = 0.0
    while True:
        try:
            out, err = process.communicate(timeout=1.0)
        except subprocess.TimeoutExpired:
            now, spent = time.monotonic(), processor_seconds(process)
            if spent > used + WAKEFUL:
                used, woke = spent, now
            if now - woke > IDLE or now - started > seconds:
                kill(process)
                pytest.fail(f"no end after {now - started:.0f} s, {now - woke:.0f} s idle: {process.communicate()}")
        else:
            return Result(process.returncode, out or "", err or "")


def family(process: subprocess.Popen[str]) -> list[psutil.Process]:
    """Return a process and those that it started."""
    try:
        first = psutil.Process(process.pid)
        return [first, *first.children(recursive=True)]
    except psutil.NoSuchProcess:
        return []


def processor_seconds(process: subprocess.Popen[str]) -> float:
    """Return the processor time that a process and those that it started have used."""
    total = 0.0
    for member in family(process):
        with suppress(psutil.Error):
            times = member.cpu_times()
            total += times.user + times.system
    return total


def kill(process: subprocess.Popen[str]) -> None:
    """Kill a process and those that it started: each may hold the pipes open."""
    for member in family(process):
        with suppress(psutil.Error):
            member.kill()


def is_prompt(took: float, seconds: float) -> bool:
    """Return whether an end that took a while was prompt: within some seconds, more of them where the machine is busy.

    Where it took longer, measure how busy the machine is: import the renderer.
    """
    if took < seconds:
        return True
    started = time.monotonic()
    subprocess.run([sys.executable, "-c", "import framearray_cli.render.render"], cwd=ROOT, check=True)
    return took < seconds * (time.monotonic() - started) / LOADING


def wait_for(happened: Callable[[], bool], process: subprocess.Popen[str], seconds: float = 240.0) -> None:
    """Wait until something happened; fail where the process ends before that."""
    end = time.monotonic() + seconds
    while not happened():
        assert process.poll() is None, f"ended with {process.returncode}: {process.communicate()}"
        assert time.monotonic() < end, "nothing happened"
        time.sleep(0.005)


def write_job(folder: Path, file_name: str = "job.toml", /, **changes: Any) -> Path:
    """Write a small job into a folder, with its scene beside it; `changes` as in `tiny.job`."""
    scene = folder / "tiny.glb"
    if not scene.exists():
        tiny.save_glb(tiny.room_meshes(), scene)
    file = folder / file_name
    output = {"directory": "out", "format": "png"} | changes.pop("output", {})
    file.write_text(tomli_w.dumps(tiny.table(output=output, **changes)))
    return file


def names(folder: Path) -> set[str]:
    """Return the names of all files in a folder, hidden ones too."""
    return {file.name for file in folder.iterdir()}
