"""Tiles of the page: coding, times, views and the command."""

import json
import os
import shutil
import signal
import time
from dataclasses import replace

import numpy as np
import pytest
from support import handmade
from support.expected import decode
from support.program import start

from framearray_cli.array.images import ImageFormat, read_codes, write_image
from framearray_cli.array.manifest import image_path, layers_path
from framearray_cli.array.manifest_toml import write_manifest
from framearray_cli.base.colour import srgb8_from_linear
from framearray_cli.base.errors import OutputError
from framearray_cli.tools.view.coding import MOST_WHITE, Coding, coding_for, data_coding, encode
from framearray_cli.tools.view.index import sheet_layout
from framearray_cli.tools.view.show import open_tiles, prepare_all


@pytest.mark.parametrize("white", [1.0, 4.0, MOST_WHITE])
def test_every_code_comes_back(white):
    codes = np.arange(256, dtype=np.uint8)
    for coding in (Coding(scale=0.3, white=white), Coding(scale=0.0, low=-1.0, high=3.0)):
        np.testing.assert_array_equal(encode(decode(codes, coding), coding), codes)


def test_with_white_at_1_codes_are_plain_srgb():
    values = np.linspace(-0.1, 1.5, 1000, dtype=np.float32)
    np.testing.assert_array_equal(encode(values, Coding()), srgb8_from_linear(values))


def test_values_survive_up_to_white():
    coding = coding_for(20.0)
    values = np.geomspace(0.01, 20, 500, dtype=np.float32)
    back = decode(encode(values, coding), coding)
    step = decode(encode(values, coding) + np.uint8(1), coding) - back
    assert (np.abs(back - values) <= step).all(), "less than the step to the next code"
    assert encode(np.float32([1e9, np.inf, np.nan, -1]), coding).tolist() == [255, 255, 0, 0]
    assert coding_for(0.0) == coding_for(float("inf")) == Coding()
    assert coding_for(1e-3).scale == 2.0**-9 and coding_for(1e9).white == MOST_WHITE
    assert [data_coding(x).high for x in (30.0, 14.366, 0.0123, 0.0)] == [30.0, 15.0, 0.013, 1.0]


@pytest.mark.parametrize(("size", "n"), [((400, 300), 48), ((64, 48), 1), ((1920, 1080), 500), ((7, 5), 3)])
def test_sheets_hold_all_positions_once(size, n):
    layout = sheet_layout(size, n)
    height, width = layout.sheet(n)
    assert height * width <= 1 << 22
    taken = np.zeros((height, width), int)
    for l in range(n):
        taken[layout.part(l)] += 1
    assert taken.max() == 1 and taken.sum() == n * layout.width * layout.height
    values = np.random.default_rng(1).random((size[1], size[0], 3), np.float32)
    small = layout.reduce(values)
    assert small.shape == (layout.height, layout.width, 3)
    np.testing.assert_allclose(small[0, 0], values[: layout.factor, : layout.factor].mean((0, 1)), rtol=1e-4)


def test_tiles_hold_the_images(tmp_path):
    handmade.plain(tmp_path)
    tiles = open_tiles(tmp_path, None, 2)
    seen = []
    assert prepare_all(tiles, 2, seen.append) == []
    assert sum(seen) == tiles.n_pictures == 7 * 5 + 7 * 5
    coding = tiles.streams[0].coding
    assert coding.white > 6
    for c, l in ((0, 0), (6, 4)):
        exact = encode(handmade.soft(c, l, 6.0), coding).astype(float)
        full = read_codes(tiles.tile_path("light", c, l))
        small = read_codes(tiles.tile_path("light", c, None))[tiles.layout.part(l)]
        assert np.abs(full - exact).mean() < 1.0 < np.abs(full - np.roll(exact, 3, axis=1)).mean()
        assert np.abs(small - exact).mean() < 1.5, "small pictures of this size are not smaller"
    index = json.loads((tmp_path / ".view" / "index.json").read_text())
    assert index["axes"] == [{"name": "light", "n": 5}] and len(index["streams"]) == 6


def test_only_what_is_missing_or_new_is_made(tmp_path):
    manifest = handmade.plain(tmp_path, n_c=3, n_l=2, layers=False)

    def times():
        prepare_all(open_tiles(tmp_path, None, 1), 1, lambda n: None)
        return {path.relative_to(tmp_path): path.stat().st_ctime_ns for path in tmp_path.rglob("*.jpg")}

    first = times()
    assert len(first) == 3 * 2 + 3
    assert times() == first
    (tmp_path / ".view" / "tiles" / "light" / "c0000.l001.jpg").unlink()
    write_image(image_path(manifest, 2, 1), handmade.soft(9, 9), ImageFormat(half="never"))
    changed = {path.name for path, time_ns in times().items() if first[path] != time_ns}
    assert changed == {"c0000.l001.jpg", "c0000.jpg", "c0002.l001.jpg", "c0002.jpg"}


def test_other_codings_discard_all_tiles(tmp_path):
    manifest = handmade.plain(tmp_path, n_c=2, n_l=2, layers=False)
    prepare_all(open_tiles(tmp_path, None, 1), 1, lambda n: None)
    write_image(image_path(manifest, 0, 0), handmade.soft(0, 0, 12.0), ImageFormat(half="never"))
    assert open_tiles(tmp_path, None, 1).streams[0].coding.white > 12
    assert not list(tmp_path.rglob("*.jpg"))


def test_damaged_images_are_reported_and_missing_ones_are_known(tmp_path):
    manifest = handmade.plain(tmp_path, n_c=2, n_l=3, layers=False)
    image_path(manifest, 0, 1).unlink()
    image_path(manifest, 1, 0).write_bytes(b"no picture")
    tiles = open_tiles(tmp_path, None, 2)
    problems = sorted(map(str, prepare_all(tiles, 2, lambda n: None)))
    assert len(problems) == 1 and "c0001.l000.exr" in problems[0]
    assert tiles.ensure_tile("light", 0, None).is_file(), "the others are there"
    with pytest.raises(OutputError, match=r"c0000\.l001\.exr"):
        tiles.ensure_tile("light", 0, 1)
    contents = tiles.contents(live=True)
    assert contents["lacking"] == [1, "0"] and contents["streams"]["light"]["missing"] == {"0": [(1, 1)]}


def test_a_sheet_follows_its_sources_whatever_their_times(tmp_path):
    """Light positions may appear in any order, and a file may come with an older time than those before it."""
    manifest = handmade.plain(tmp_path / "all", n_c=1, n_l=3, layers=False)
    write_manifest(tmp_path, replace(manifest, directory=tmp_path))

    def take(l, time_ns, source=None):
        file = image_path(manifest, 0, l)
        shutil.copyfile(source or file, tmp_path / file.name)
        os.utime(tmp_path / file.name, ns=(time_ns, time_ns))

    def shown(l):
        return read_codes(tiles.ensure_tile("light", 0, None))[tiles.layout.part(l)].mean()

    take(2, 5_000_000_000)
    tiles = open_tiles(tmp_path, None, 1)
    tags = [tiles.contents(live=True)["streams"]["light"]["stamps"][0]]
    assert (shown(0), shown(1)) == (0, 0) and shown(2) > 10
    for l in (1, 0):
        take(l, 1_000_000_000)
        assert shown(l) > 10
        tags.append(tiles.contents(live=True)["streams"]["light"]["stamps"][0])
    assert len(set(tags)) == 3 and all(tags)
    before = shown(1)
    bright = tmp_path / "bright.exr"
    write_image(bright, handmade.soft(0, 0, 0.3), ImageFormat(half="never", compression="zip"))
    take(1, 1_000_000_000, bright)
    assert abs(shown(1) - before) > 1, "the same time, another file"
    (tmp_path / image_path(manifest, 0, 2).name).write_bytes(b"half")
    prepare_all(tiles, 1, lambda n: None)
    take(2, 1_000_000_000)
    assert shown(2) > 10, "what could not be read is tried again"


def test_the_array_is_looked_at_anew_while_it_grows(tmp_path):
    manifest = handmade.plain(tmp_path / "all", n_c=4, n_l=2)
    write_manifest(tmp_path, replace(manifest, directory=tmp_path))
    tiles = open_tiles(tmp_path, None, 1)
    assert tiles.contents(live=True)["lacking"] == [4, "0-3"] and len(tiles.streams) == 1
    assert prepare_all(tiles, 1, lambda n: None) == []
    for file in manifest.directory.glob("room.*c000[01]*"):
        shutil.copyfile(file, tmp_path / file.name)
    new = tiles.renewed()
    assert new is not tiles and len(new.streams) == 6 and new.streams[0].coding != tiles.streams[0].coding
    contents = new.contents(live=True)
    assert contents["lacking"] == [2, "2-3"] and contents["index"] != tiles.contents(live=True)["index"]
    assert new.renewed() is new
    write_manifest(tmp_path, replace(manifest, directory=tmp_path, summary={"images": 4}))
    assert new.renewed() is new, "a summary changes no picture"
    write_manifest(tmp_path, replace(manifest, directory=tmp_path, fingerprint="sha256:9"))
    assert new.renewed().manifest.fingerprint == "sha256:9"


def test_a_damaged_layer_file_is_reported(tmp_path):
    manifest = handmade.plain(tmp_path, n_c=2, n_l=1)
    layers_path(manifest, 0).write_bytes(b"no layers")
    tiles = open_tiles(tmp_path, None, 1)
    assert [stream.key for stream in tiles.streams][1:3] == ["obscurance", "indirect"]
    problems = prepare_all(tiles, 1, lambda n: None)
    assert len(problems) == 5 and all("room.layers.c0000.exr" in str(problem) for problem in problems)


@pytest.mark.skipif(os.name == "nt", reason="Ctrl-C is sent by a signal")
def test_the_command_serves_until_ctrl_c(tmp_path):
    handmade.plain(tmp_path, n_c=2, n_l=2)
    process = start("view", tmp_path, "--no-browser")
    try:
        url = process.stdout.readline().split()[0]
        assert url.startswith("http://127.0.0.1:")
        assert "are prepared" in process.stderr.readline()
        process.send_signal(signal.SIGINT)
        _, said = process.communicate(timeout=10)
        assert (process.returncode, said) == (0, "")
    finally:
        process.kill()
    assert len(list((tmp_path / ".view").rglob("*.jpg"))) == 4 + 2 + 2 * 5 * 2
    assert not list(tmp_path.rglob("*.part"))


def test_what_was_prepared_stays_after_an_interruption(tmp_path):
    handmade.plain(tmp_path, n_c=6, n_l=2, layers=False)
    tiles = open_tiles(tmp_path, None, 1)

    class Enough(BaseException):
        pass

    calls = []

    def stop(n):
        calls.append(n)
        assert len(calls) == 1 or tiles.stopping.wait(60), "a busy machine must not finish before it is told to stop"
        raise Enough

    with pytest.raises(Enough):
        prepare_all(tiles, 1, stop)
    made = len(list(tmp_path.rglob("*.jpg")))
    assert 3 <= made < 18
    started = time.time_ns()
    prepare_all(open_tiles(tmp_path, None, 1), 1, lambda n: None)
    kept = [path for path in tmp_path.rglob("*.jpg") if path.stat().st_ctime_ns < started]
    assert len(list(tmp_path.rglob("*.jpg"))) == 18 and len(kept) >= 3


def test_codings_stay_while_an_array_grows(tmp_path):
    """The page loads itself again when they change."""
    manifest = handmade.plain(tmp_path / "all", n_c=16, n_l=1)
    write_manifest(tmp_path, replace(manifest, directory=tmp_path))
    tiles, digests = open_tiles(tmp_path, None, 1), []
    for c in range(16):
        for file in manifest.directory.glob(f"room.*c{c:04d}*"):
            shutil.copyfile(file, tmp_path / file.name)
        tiles = tiles.renewed({"light": 6.0})
        digests.append(tiles.index["digest"])
    assert len(set(digests)) <= 2, "at first no layer is there"
    assert tiles.settled().streams == open_tiles(tmp_path / "all", None, 1).streams
