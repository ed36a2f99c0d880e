"""A hundred thousand small images with two kills: the bytes of an uninterrupted run, in memory that does not grow."""

import hashlib
import signal
import sys
import time
from itertools import pairwise
from pathlib import Path

import psutil
import pytest
from support import tiny
from support.program import finish, start, write_job

pytestmark = [pytest.mark.slow, pytest.mark.skipif(sys.platform == "win32", reason="no kill -9 there")]

EYES, LIGHTS = 1000, 100
EVERY = 0.2  # seconds between looks at a process
GROWTH = 1.05  # of memory from a quarter of a run to the next; allocators keep some blocks more
DONE = 0.98  # share of the eyes after which a run may be ending: it reads its records and sums up
ENDING = 1000  # bytes per image that this may take
Memory = list[tuple[float, int]]  # share of the images that are there, bytes resident


def job(folder: Path) -> Path:
    walk = tiny.WALK | {"frames": EYES, "resolution": [16, 12]}
    walk["keys"] = [tiny.WALK["keys"][0], tiny.WALK["keys"][1] | {"frame": EYES - 1}]
    sun = tiny.SUN | {"keys": [tiny.SUN["keys"][0], tiny.SUN["keys"][-1] | {"frame": LIGHTS - 1}]}
    light = {"sources": [sun], "frames": LIGHTS}
    return write_job(
        folder, camera=walk, light=light, output={"format": "exr"}, reuse={"n_r": 2}, ambient={"paths": 64}
    )


def digests(out: Path) -> dict[str, bytes]:
    return {file.name: hashlib.sha256(file.read_bytes()).digest() for file in out.glob("tiny.*")}


def finished(out: Path) -> int:
    """Count the eyes that records know."""
    return sum(file.read_bytes().count(b'"lights"') for file in out.glob("records/*.jsonl"))


def rendered(folder: Path, until: int) -> Memory:
    """Render until a number of eyes is finished, then kill the process, or to the end; returns its memory."""
    process, memory = start("render", "-q", job(folder)), list[tuple[float, int]]()
    watched = psutil.Process(process.pid)
    while process.poll() is None:
        done = finished(folder / "out")
        if done >= until:
            process.send_signal(signal.SIGKILL)
            assert finish(process).code == -signal.SIGKILL
            return memory
        if watched.status() != psutil.STATUS_ZOMBIE:
            memory.append((done / EYES, watched.memory_info().rss))
        time.sleep(EVERY)
    assert finish(process).code == 0
    return memory


def test_a_long_run_with_two_kills(tmp_path: Path) -> None:
    (tmp_path / "whole").mkdir()
    (tmp_path / "killed").mkdir()
    memory = rendered(tmp_path / "whole", EYES + 1)
    whole = digests(tmp_path / "whole/out")
    assert len(whole) == EYES * (LIGHTS + 1)  # with layers
    quarters = [max(m for share, m in memory if k / 4 <= share < min((k + 1) / 4, DONE)) for k in range(4)]
    assert max(later / before for before, later in pairwise(quarters)) < GROWTH
    most = max(m for _, m in memory)
    assert most - quarters[-1] < ENDING * EYES * LIGHTS
    for until in (EYES // 3, 2 * EYES // 3, EYES + 1):
        rendered(tmp_path / "killed", until)
    assert digests(tmp_path / "killed/out") == whole
    assert finish(start("verify", "-q", tmp_path / "killed/out")).code == 0
    megabytes = [round(m / 1e6) for m in (*quarters, most)]
    print(f"{EYES * LIGHTS} images; most memory in each quarter and at the end, MB: {megabytes}")
