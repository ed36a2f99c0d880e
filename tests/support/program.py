"""Running the command line: in this process for messages, in a process of its own for signals and full disks."""

import os
import subprocess
import sys
import time
from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import pytest
import tomli_w

from framearray_cli.cli.main import main
from support import ROOT, tiny

PACKAGE_PARENT = ROOT


@dataclass(frozen=True)
class Result:
    """How a command ended, and what it said."""

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
    said = capsys.readouterr()
    return Result(code, said.out, said.err)


def start(*arguments: str | Path, **options: Any) -> subprocess.Popen[str]:
    """Start a command as a user does."""
    return subprocess.Popen(
        [sys.executable, "-m", "framearray_cli", *map(str, arguments)],
        stdout=options.pop("stdout", subprocess.PIPE),
        stderr=subprocess.PIPE,
        text=True,
        # output is buffered as a user's is, whatever the tests run under
        env={name: value for name, value in os.environ.items() if name != "PYTHONUNBUFFERED"}
        | {"PYTHONPATH": os.pathsep.join([str(PACKAGE_PARENT), os.environ.get("PYTHONPATH", "")])},
        **options,
    )


def finish(process: subprocess.Popen[str]) -> Result:
    """Wait for the end of a command."""
    out, err = process.communicate(timeout=300)
    return Result(process.returncode, out or "", err)


def wait_for(happened: Callable[[], bool], process: subprocess.Popen[str], seconds: float = 240.0) -> None:
    """Wait until something happened; a process that ends before that fails the test."""
    end = time.monotonic() + seconds
    while not happened():
        assert process.poll() is None, f"ended with {process.returncode}: {process.communicate()}"
        assert time.monotonic() < end, "nothing happened"
        time.sleep(0.005)


def write_job(folder: Path, file_name: str = "job.toml", /, **changes: Any) -> Path:
    """A small job in a folder, with its scene beside it; `changes` as in `tiny.job`."""
    scene = folder / "tiny.glb"
    if not scene.exists():
        tiny.save_glb(tiny.room_meshes(), scene)
    file = folder / file_name
    output = {"directory": "out", "format": "png"} | changes.pop("output", {})
    file.write_text(tomli_w.dumps(tiny.table(output=output, **changes)))
    return file


def names(folder: Path) -> set[str]:
    """Names of all files in a folder, hidden ones too."""
    return {file.name for file in folder.iterdir()}
