"""The coarse array that `render --view` makes first: like the array, small, beside it, and gone at the end."""

import json
import os
import signal
import time
import urllib.request

import numpy as np
import pytest
from support.program import names, start, write_job
from support.tiny import WALK

from framearray_cli.array.coarsearray import COARSE_FOLDER, read_coarse
from framearray_cli.array.images import read_image
from framearray_cli.array.manifest import image_path
from framearray_cli.job.read import read_job
from framearray_cli.render.events import CoarseBegun, FramesBegun, Noted
from framearray_cli.render.preview import coarse_to_fine, places_of
from framearray_cli.render.render import render
from framearray_cli.scene.paths.paths import LightGroup, Lights, group_planes


@pytest.mark.parametrize("n", [1, 2, 3, 10, 288])
def test_places_come_from_coarse_to_fine(n):
    places = [5 + 2 * k for k in range(n)]
    found = list(coarse_to_fine(places))
    assert sorted(found) == places and found[:2] == list(dict.fromkeys((places[0], places[-1])))
    for k in (k for k in (3, 5, 9, 17) if k <= n):
        assert np.diff(sorted(found[:k])).max() <= 2 * (np.ceil((n - 1) / (k - 1)) + 1), "evenly"


def test_places_along_each_axis():
    def group(name, axis, first, stop):
        return LightGroup(name=name, axis=axis, positions=range(first, stop), sources=(0,))

    lights = Lights(
        sources=(), planes=group_planes(9, background=True), groups=(group("a", "x", 0, 4), group("b", "y", 4, 9))
    )
    assert places_of(lights, [0, 3, 4, 6, 8, 9, 10]) == {"x": [0, 3], "y": [0, 2, 4]}


class Looks:
    """Compares the coarse pictures when all are there."""

    def __init__(self, stop=False):
        self.stop, self.come, self.coarse, self.images = stop, None, None, {}

    def __call__(self, event):
        if isinstance(event, CoarseBegun):
            self.begin(event.array)
        elif isinstance(event, Noted) and event.line.startswith("coarse array: "):
            self.end(event.line)
        elif isinstance(event, FramesBegun) and self.stop:
            raise KeyboardInterrupt

    def begin(self, array):
        self.come = array
        coarse = read_coarse(array.directory, array.fingerprint).manifest
        assert image_path(coarse, 0, 0).is_file() and image_path(coarse, array.n_cameras - 1, 0).is_file()

    def end(self, coarse):
        self.coarse, array = coarse, self.come
        found = read_coarse(array.directory, array.fingerprint)
        self.images = {
            (c, l): read_image(image_path(found.manifest, c, k))
            for c in range(array.n_cameras)
            for k, l in enumerate(found.places["light"])
        }


def test_it_looks_like_the_array_and_changes_no_byte(tmp_path):
    camera = WALK | {"resolution": [48, 32]}
    for name in "ab":
        (tmp_path / name).mkdir()
    first, second = (write_job(tmp_path / name, camera=camera, output={"format": "exr"}) for name in "ab")
    looks = Looks()
    render(read_job(first), looks, coarse=True)
    render(read_job(second))
    assert names(tmp_path / "a" / "out") == names(tmp_path / "b" / "out"), "nothing is left of it"
    n_c, n_l = looks.come.n_cameras, looks.come.n_lights
    assert looks.coarse.startswith(f"coarse array: {n_c} of {n_c} camera positions x {n_l} of {n_l} light position")
    assert ", 12 x 8 pixels, in " in looks.coarse
    assert len(looks.images) == n_c * n_l
    for (c, l), small in looks.images.items():
        name = image_path(looks.come, c, l).name
        assert (tmp_path / "a" / "out" / name).read_bytes() == (tmp_path / "b" / "out" / name).read_bytes()
        fine = read_image(tmp_path / "a" / "out" / name).reshape(8, 4, 12, 4, 3).mean((1, 3))
        assert np.corrcoef(small.ravel(), fine.ravel())[0, 1] > 0.8 and abs(small.mean() / fine.mean() - 1) < 0.2


def test_it_is_removed_when_the_render_is_stopped(tmp_path):
    job = read_job(write_job(tmp_path, camera=WALK, output={"format": "exr"}))
    with pytest.raises(KeyboardInterrupt):
        render(job, Looks(stop=True), coarse=True)
    out = job.output.directory
    assert not (out / COARSE_FOLDER).exists()
    (out / COARSE_FOLDER).mkdir()  # as a killed run leaves it
    render(job)
    assert not (out / COARSE_FOLDER).exists()


@pytest.mark.skipif(os.name == "nt", reason="Ctrl-C is sent by a signal")
def test_the_page_is_served_until_ctrl_c(tmp_path):
    job = write_job(tmp_path, camera=WALK, output={"format": "exr"})
    process = start("render", job, "--view", "--no-browser")
    try:
        url = process.stdout.readline().split()[0]
        end = time.monotonic() + 120
        while True:
            contents = json.load(urllib.request.urlopen(f"{url}contents.json", timeout=10))
            assert time.monotonic() < end, contents
            if contents["images"][0] == contents["images"][1]:
                break
            time.sleep(0.05)
        for line in process.stderr:
            if "are prepared" in line:
                break
        assert json.load(urllib.request.urlopen(f"{url}contents.json", timeout=10))["coarse"] is None
        process.send_signal(signal.SIGINT)
        out, err = process.communicate(timeout=30)
        assert (process.returncode, err) == (0, "") and "images and manifest" in out
    finally:
        process.kill()
    assert not (tmp_path / "out" / COARSE_FOLDER).exists()
