"""Twenty thousand images in one job: neither memory nor time per image grows with the number of images."""

import statistics
import time

import psutil
import pytest
from support import tiny

from framearray_cli.render.events import AmbientEstimated, ImagesWritten
from framearray_cli.render.render import render

CAMERAS, LIGHTS = 5000, 4
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
    first, last = tiny.WALK["keys"]
    source = tiny.TABLE["light"]["sources"][0]
    job = tiny.job(
        scene={"file": str(tmp_path / "tiny.glb")},
        camera=tiny.WALK | {"frames": CAMERAS, "resolution": [24, 18], "keys": [first, last | {"frame": CAMERAS - 1}]},
        light={
            "frames": LIGHTS,
            "sources": [source | {"keys": [source["keys"][0], source["keys"][1] | {"frame": LIGHTS - 1}]}],
        },
        reuse={"n_r": 3},
        output={"directory": str(tmp_path / "out"), "format": "exr", "layers": False},
    )
    marks = Marks()
    summary = render(job, marks)
    assert summary.there == CAMERAS * LIGHTS
    memory = [mark / 2**20 for mark in marks.memory]
    ms = [1000 * seconds / BLOCK for seconds in marks.seconds]
    print(
        f"MiB {memory[0]:.1f} to {memory[-1]:.1f}; processor ms per image: {', '.join(f'{value:.2f}' for value in ms)}"
    )
    assert max(memory) <= MEMORY_GROWTH * memory[0]
    assert statistics.median(ms[-4:]) <= TIME_GROWTH * statistics.median(ms[:4])
