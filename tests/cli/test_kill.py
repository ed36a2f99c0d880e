"""kill -9 at random moments of a render, resumed each time: the same bytes as an uninterrupted one."""

import os
import random
import shutil
import signal
import subprocess
import sys
import time
from pathlib import Path
from typing import Any

import pytest
from support import tiny
from support.program import complete, finish, start, write_job

pytestmark = pytest.mark.skipif(sys.platform == "win32", reason="no kill -9 there")

N, LIGHTS = 60, 3
WALK = tiny.WALK | {"frames": N, "resolution": [60, 45]}
Changes = dict[str, Any]  # of tables of the job
AREA: Changes = {"reuse": {"weights": "area"}}
WALK["keys"] = [tiny.WALK["keys"][0], tiny.WALK["keys"][1] | {"frame": N - 1}]


def contents(folder: Path) -> dict[str, bytes]:
    return {file.name: file.read_bytes() for file in folder.glob("tiny.*")}


def job(folder: Path, changes: Changes) -> Path:
    reuse = {"n_r": 2} | changes.get("reuse", {})
    return write_job(
        folder, **(changes | {"camera": WALK, "output": {"format": "exr"}, "reuse": reuse, "ambient": {"paths": 64}})
    )


def lines(out: Path) -> int:
    """Count the lines of all records: a run adds one when it starts to render, and one per frame."""
    return sum(file.read_bytes().count(b"\n") for file in out.glob("records/*.jsonl"))


def until_it_renders(folder: Path, changes: Changes) -> subprocess.Popen[str]:
    """Start a render and wait until it has read the folder and renders the rest, if there is any."""
    before = lines(folder / "out")
    process = start("render", "-q", job(folder, changes))
    while process.poll() is None and lines(folder / "out") == before:
        time.sleep(0.002)
    return process


def killed_and_resumed(
    folder: Path, changes: Changes, whole: dict[str, bytes], seconds: float, kills: int, seed: int
) -> list[int]:
    """Kill a job a number of times, at moments spread over the time in which it writes images. Whenever it reaches its
    end, compare its files and start anew. Return the number of images that each killed run wrote.
    """
    rng, out, found = random.Random(seed), folder / "out", list[int]()
    while len(found) < kills:
        before = len(contents(out)) if out.exists() else 0
        process = until_it_renders(folder, changes)
        time.sleep(rng.uniform(0, seconds))
        process.send_signal(signal.SIGKILL)
        code = finish(process).code
        if code == 0:
            assert contents(out) == whole
            shutil.rmtree(out)
        else:
            assert code == -signal.SIGKILL
            found.append(len(contents(out)) - before)
    complete("render", "-q", job(folder, changes))
    return found


@pytest.mark.parametrize(
    ("kills", "changes"),
    [
        (3, {}),
        pytest.param(50, {}, marks=pytest.mark.slow),
        pytest.param(10, AREA, marks=pytest.mark.slow),
        pytest.param(10, AREA | {"indirect": tiny.CELLS}, marks=pytest.mark.slow),
    ],
    ids=["3", "50", "area", "cells"],
)
def test_a_render_that_is_killed_ends_with_the_same_bytes(kills, changes, tmp_path):
    for name in ("whole", "killed"):
        (tmp_path / name).mkdir()
    process = until_it_renders(tmp_path / "whole", changes)
    started = time.monotonic()
    assert finish(process).code == 0
    seconds, whole = time.monotonic() - started, contents(tmp_path / "whole/out")
    found = killed_and_resumed(tmp_path / "killed", changes, whole, seconds, kills, seed=os.getpid())
    assert contents(tmp_path / "killed/out") == whole
    assert len(whole) == N * (LIGHTS + 1)  # with layers
    within = sum(images > 0 for images in found)
    print(f"{kills} kills, {within} of them after some images ({sum(found)} in all): all bytes the same")
    assert within >= kills / 3
