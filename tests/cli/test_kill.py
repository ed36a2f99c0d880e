"""Killed renders and long ones: the bytes of an uninterrupted run, in memory and time that do not grow."""

import hashlib
import os
import random
import shutil
import signal
import statistics
import subprocess
import sys
import time
from itertools import pairwise
from pathlib import Path
from typing import Any

import psutil
import pytest
from support import tiny
from support.handed import contents
from support.program import complete, finish, start, write_job

from framearray_cli.render.events import AmbientEstimated, ImagesWritten
from framearray_cli.render.render import render

pytestmark = pytest.mark.skipif(sys.platform == "win32", reason="no kill -9 there")

N, LIGHTS = 60, 3
WALK = tiny.walk(N, resolution=[60, 45])
Changes = dict[str, Any]  # of tables of the job
AREA: Changes = {"reuse": {"weights": "area"}}


def job(folder: Path, changes: Changes) -> Path:
    tables = {"camera": WALK, "output": {"format": "exr"}, "ambient": {"paths": 64}}
    return write_job(folder, **changes | tables | {"reuse": {"n_r": 2} | changes.get("reuse", {})})


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


CAMERAS, POSITIONS = 5000, 4
BLOCK = 2500  # images
MEMORY_GROWTH, TIME_GROWTH = 1.02, 1.05


class Marks:
    """Memory, and processor time since the last mark, after each block of images."""

    def __init__(self) -> None:
        self.memory: list[int] = []
        self.seconds: list[float] = []
        self._images, self._process, self._clock = 0, psutil.Process(), 0.0

    def __call__(self, event):
        if isinstance(event, AmbientEstimated):
            self._clock = time.process_time()
        before, self._images = self._images, self._images + (event.images if isinstance(event, ImagesWritten) else 0)
        if self._images // BLOCK > before // BLOCK:
            now = time.process_time()
            self.memory.append(self._process.memory_info().rss)
            self.seconds.append(now - self._clock)
            self._clock = now


@pytest.mark.slow
def test_memory_and_time_per_image_are_flat(tmp_path):
    tiny.save_glb(tiny.room_meshes(), tmp_path / "tiny.glb")
    source = tiny.TABLE["light"]["sources"][0]
    lamp = source | {"keys": [source["keys"][0], source["keys"][1] | {"frame": POSITIONS - 1}]}
    tables = {"camera": tiny.walk(CAMERAS), "light": {"frames": POSITIONS, "sources": [lamp]}, "reuse": {"n_r": 3}}
    job = tiny.job_of_file(tmp_path / "tiny.glb", tmp_path / "out", output={"layers": False}, **tables)
    marks = Marks()
    summary = render(job, marks)
    assert summary.there == CAMERAS * POSITIONS
    memory = [mark / 2**20 for mark in marks.memory]
    ms = [1000 * seconds / BLOCK for seconds in marks.seconds]
    print(
        f"MiB {memory[0]:.1f} to {memory[-1]:.1f}; processor ms per image: {', '.join(f'{value:.2f}' for value in ms)}"
    )
    assert max(memory) <= MEMORY_GROWTH * memory[0]
    assert statistics.median(ms[-4:]) <= TIME_GROWTH * statistics.median(ms[:4])


EYES, SUNS = 1000, 100
EVERY = 0.2  # seconds between looks at a process
GROWTH = 1.05  # of memory from a quarter of a run to the next; allocators keep some blocks more
DONE = 0.98  # share of the eyes after which a run may be ending: it reads its records and sums up
ENDING = 1000  # bytes per image that this may take
Memory = list[tuple[float, int]]  # share of the images that are there, bytes resident


def long_job(folder: Path) -> Path:
    sun = tiny.SUN | {"keys": [tiny.SUN["keys"][0], tiny.SUN["keys"][-1] | {"frame": SUNS - 1}]}
    camera, light = tiny.walk(EYES, resolution=[16, 12]), {"sources": [sun], "frames": SUNS}
    tables = {"output": {"format": "exr"}, "reuse": {"n_r": 2}, "ambient": {"paths": 64}}
    return write_job(folder, camera=camera, light=light, **tables)


def digests(out: Path) -> dict[str, bytes]:
    return {file.name: hashlib.sha256(file.read_bytes()).digest() for file in out.glob("tiny.*")}


def finished(out: Path) -> int:
    """Count the eyes that records know."""
    return sum(file.read_bytes().count(b'"lights"') for file in out.glob("records/*.jsonl"))


def rendered(folder: Path, until: int) -> Memory:
    """Render until a number of eyes is finished, then kill the process, or to the end; returns its memory."""
    process, memory = start("render", "-q", long_job(folder)), list[tuple[float, int]]()
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


@pytest.mark.slow
def test_a_long_run_with_two_kills(tmp_path: Path) -> None:
    (tmp_path / "whole").mkdir()
    (tmp_path / "killed").mkdir()
    memory = rendered(tmp_path / "whole", EYES + 1)
    whole = digests(tmp_path / "whole/out")
    assert len(whole) == EYES * (SUNS + 1)  # with layers
    quarters = [max(m for share, m in memory if k / 4 <= share < min((k + 1) / 4, DONE)) for k in range(4)]
    assert max(later / before for before, later in pairwise(quarters)) < GROWTH
    most = max(m for _, m in memory)
    assert most - quarters[-1] < ENDING * EYES * SUNS
    for until in (EYES // 3, 2 * EYES // 3, EYES + 1):
        rendered(tmp_path / "killed", until)
    assert digests(tmp_path / "killed/out") == whole
    assert finish(start("verify", "-q", tmp_path / "killed/out")).code == 0
    megabytes = [round(m / 1e6) for m in (*quarters, most)]
    print(f"{EYES * SUNS} images; most memory in each quarter and at the end, MB: {megabytes}")
