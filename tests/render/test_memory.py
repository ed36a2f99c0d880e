"""Peak memory does not grow with the length of the camera path."""

import subprocess
import sys
from pathlib import Path

import numpy as np
import pytest
from support import ROOT, tiny

# A process of its own, so that only the render is measured.
RENDER = """
import sys
from pathlib import Path
sys.path[:0] = [{tests!r}]
from support import tiny
from framearray_cli.render.render import render
keys = [{{"frame": 0, "eye": [0.2, 1.3, 1.7], "target": [-0.1, 0.9, -1.0]}},
        {{"frame": {frames} - 1, "eye": [0.5, 1.45, 1.2], "target": [0.1, 0.8, -1.0]}}]
job = tiny.job(
    scene={{"file": {scene!r}}},
    camera={{"frames": {frames}, "resolution": [{width}, {height}], "keys": keys}},
    light={{"frames": {lights}}},
    samples={{"hits": 2, "obscurance": 1}},
    reuse={{"n_r": {n_r}}},
    ambient={{"paths": 64}},
    output={{"directory": {out!r}, "format": "exr", "layers": False}},
    render={{"threads": 2}},
)
print(render(job).peak_memory)
"""


def peak(tmp_path: Path, frames: int, size: tuple[int, int], lights: int, n_r: int) -> int:
    """Return the peak memory of one render, bytes."""
    scene = tiny.save_glb(tiny.room_meshes(), tmp_path / "room.glb")
    width, height = size
    tests = str(ROOT / "tests")
    code = RENDER.format(
        tests=tests, frames=frames, scene=str(scene), width=width, height=height, lights=lights, n_r=n_r,
        out=str(tmp_path / f"{frames}-{n_r}"),
    )  # fmt: skip
    run = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, timeout=600)
    assert run.returncode == 0, run.stderr
    return int(run.stdout)


@pytest.fixture(scope="module", autouse=True)
def _compiled(tmp_path_factory: pytest.TempPathFactory) -> None:
    """Compile all kernels first, as that takes memory."""
    peak(tmp_path_factory.mktemp("first"), 2, (24, 18), 3, 1)


@pytest.mark.slow
def test_peak_memory_of_24_and_of_96_cameras_is_the_same(tmp_path: Path) -> None:
    """A frame takes 11 MB here and 3 % are 16 MB: two of the 72 additional frames, if kept, would show."""
    short, long = (peak(tmp_path, frames, (200, 150), 24, 3) for frames in (24, 96))
    assert long == pytest.approx(short, rel=0.03)


def test_a_window_that_keeps_its_frames_would_be_detected(tmp_path: Path) -> None:
    """The measurement can fail: a larger n_r holds more frames."""
    narrow, wide = (peak(tmp_path, 12, (120, 90), 24, n_r) for n_r in (1, 4))
    assert wide > 1.03 * narrow


def test_peak_memory_of_a_short_and_of_a_long_path_is_the_same(tmp_path: Path) -> None:
    short, long = (peak(tmp_path, frames, (120, 90), 24, 1) for frames in (6, 24))
    assert long == pytest.approx(short, rel=0.03)


def test_the_peak_is_only_that_of_this_process() -> None:
    """A child of a large process does not count as large."""
    ballast = np.ones(400 * 2**20, np.uint8)
    code = "from framearray_cli.base.memory import peak_memory; print(peak_memory())"
    run = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, timeout=120)
    assert int(run.stdout) < ballast.nbytes
