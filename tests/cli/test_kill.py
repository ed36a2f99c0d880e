"""kill -9 at random moments of a render, resumed each time: the same bytes as an unbroken one."""

import os
import random
import signal
import sys
import time
from pathlib import Path

import pytest
import tiny
from program import finish, run, start, write_job

pytestmark = pytest.mark.skipif(sys.platform == "win32", reason="no kill -9 there")

N = 60
WALK = tiny.WALK | {"frames": N, "resolution": [60, 45]}
WALK["keys"] = [tiny.WALK["keys"][0], tiny.WALK["keys"][1] | {"frame": N - 1}]


def contents(folder: Path) -> dict[str, bytes]:
    return {file.name: file.read_bytes() for file in folder.glob("tiny.*")}


def job(folder: Path) -> Path:
    return write_job(folder, camera=WALK, output={"format": "exr"}, reuse={"n_r": 2}, ambient={"paths": 64})


def killed_and_resumed(folder: Path, kills: int, seed: int) -> tuple[dict[str, bytes], int]:
    """The array of a job that is killed so many times, at moments spread over its run; and how often it was killed
    while it rendered.
    """
    rng, out, within = random.Random(seed), folder / "out", 0
    for _ in range(kills):
        process = start("render", "-q", job(folder))
        while process.poll() is None and not list(out.glob("records/*.jsonl")):  # loading
            time.sleep(0.002)
        time.sleep(rng.uniform(0, 0.15))
        before = len(list(out.glob("tiny.*")))
        process.send_signal(signal.SIGKILL)
        code = finish(process).code
        assert code in (0, -signal.SIGKILL)
        within += code != 0 and before > 0
    assert finish(start("render", "-q", job(folder))).code == 0
    return contents(out), within


@pytest.mark.parametrize("kills", [3, pytest.param(50, marks=pytest.mark.slow)])
def test_a_render_that_is_killed_ends_with_the_same_bytes(kills, tmp_path, capsys):
    (tmp_path / "whole").mkdir()
    (tmp_path / "killed").mkdir()
    assert run(capsys, "render", "-q", job(tmp_path / "whole")).code == 0
    found, within = killed_and_resumed(tmp_path / "killed", kills, seed=os.getpid())
    assert found == contents(tmp_path / "whole/out")
    assert len(found) == N * 4
    print(f"{kills} kills, {within} while images were written: all bytes the same")
