"""The page of an array that is being rendered, or was never finished."""

from functools import partial
from pathlib import Path

import numpy as np
from support import handmade
from support.browsers import shown
from support.expected import bounds, nearest_place, outside

from framearray_cli.array.coarsearray import COARSE_FOLDER, coarse_folder, write_coarse
from framearray_cli.array.images import write_image
from framearray_cli.array.manifest import Manifest, image_path
from framearray_cli.base.colour import srgb8_from_linear
from framearray_cli.tools.view.show import open_server, open_tiles

PLACES = {"light": [0, 2, 4]}


def unfinished(folder: Path) -> tuple[Manifest, Manifest]:
    """Five cameras and lights, of which only camera 0 is there; coarse pictures of cameras 0 and 4, red."""
    fine = handmade.plain(folder, n_c=5, n_l=5, layers=False)
    for file in folder.glob("room.c000[1-4]*"):
        file.unlink()
    coarse = handmade.plain(folder / COARSE_FOLDER, n_c=5, n_l=3, layers=False)
    for file in coarse.directory.glob("room.c*"):
        file.unlink()
    for c in (0, 4):
        for k in range(3):
            write_image(image_path(coarse, c, k), red(c, k), handmade.FLOAT)
    return fine, write_coarse(coarse.directory, coarse, PLACES).manifest


def text_of(page, name: str) -> str | None:
    """The text of an element; None where it is hidden."""
    return page.get(f"(at => at.hidden ? null : at.innerText.trim())(document.getElementById('{name}'))")


def red(c: int, k: int) -> np.ndarray:
    """One colour that tells camera and light of a coarse picture."""
    width, height = handmade.SIZE
    return np.full((height, width, 3), [0.3 + 0.1 * c, 0.02, 0.05 + 0.2 * k], np.float32)


def test_coarse_pictures_stand_for_those_that_are_not_rendered(browser, tmp_path):
    with coarse_folder(tmp_path):
        fine, _ = unfinished(tmp_path)
        with open_server(open_tiles(tmp_path, None, 1)) as server, shown(browser, server.url) as page:
            text = partial(text_of, page)

            def shows(c, k):
                expected = srgb8_from_linear(red(c, k)[0, 0])
                return np.abs(page.pixels().mean((0, 1)) - expected).max() < 6

            assert text("made") == "5 of 25 images; coarse pictures stand for the others" and text("note") is None
            assert not shows(0, 0), "the fine one is there"
            for key, c, k, place in (
                ("ArrowRight", 0, 0, "camera 0, light 0"),
                ("End", 4, 0, "camera 4, light 0"),
                ("PageDown", 4, 2, "camera 4, light 4"),
            ):
                page.page.keyboard.press(key)
                page.settle()
                assert shows(c, k), key
                assert text("note") == f"Not rendered yet. Coarse picture of {place}."
            page.all_loaded()
            page.wait("!framearray.map.changed")
            pad = page.get("[...framearray.map.canvas.getContext('2d').getImageData(4, 4, 1, 1).data]")
            bright = srgb8_from_linear(0.55 * red(4, 2)[0, 0])
            # lights share blue in a sheet this small
            assert abs(pad[0] - int(bright[0])) < 8, "dimmer than the picture"
            write_image(image_path(fine, 4, 4), handmade.soft(4, 4, 6.0), handmade.FLOAT)
            page.get("framearray.refresh()")
            page.settle()
            assert not shows(4, 2) and text("note") is None, "the fine one takes its place"
            page.all_loaded()
            assert not [url for url in page.requests if "/tiles/" in url and "/coarse/" not in url and "c0002" in url]
            page.check(server.url)


def test_a_coarse_array_comes_and_goes(browser, tmp_path):
    fine, coarse = unfinished(tmp_path)
    hidden = tmp_path / "elsewhere"
    coarse.directory.rename(hidden)
    with open_server(open_tiles(tmp_path, None, 1)) as server, shown(browser, server.url + "#camera=3") as page:
        assert text_of(page, "note") == "Camera 3, light 0: not rendered yet."
        hidden.rename(coarse.directory)
        page.get("framearray.refresh()")
        page.settle()
        assert text_of(page, "note") == "Not rendered yet. Coarse picture of camera 4, light 0."
        page.all_loaded()  # what it asks for later is gone
        coarse.directory.rename(hidden)
        for c in range(1, 5):
            for l in range(5):
                write_image(image_path(fine, c, l), handmade.soft(c, l, 6.0), handmade.FLOAT)
        page.get("framearray.refresh()")
        page.settle()
        assert text_of(page, "made") is None and text_of(page, "note") is None
        page.all_loaded()
        page.check(server.url)


ONE = (1.0, 1.0, 1.0)
GROUND = """(() => {  // codes of the pad's cells, row by row
    const { canvas } = framearray.map, copy = new OffscreenCanvas(canvas.width, canvas.height).getContext("2d");
    copy.drawImage(canvas, 0, 0);
    const { data } = copy.getImageData(0, 0, canvas.width, canvas.height);
    return Array.from({ length: data.length / 4 }, (_, i) => [...data.subarray(4 * i, 4 * i + 4)]);
})()"""


def test_an_unfinished_array_shows_what_is_there_and_what_comes(browser, tmp_path):
    manifest = handmade.plain(tmp_path, n_c=4, n_l=2, layers=False)
    for c, l in ((1, 0), (2, 0), (2, 1)):
        image_path(manifest, c, l).unlink()
    with open_server(open_tiles(tmp_path, None, 1)) as server, shown(browser, server.url) as page:
        text = partial(text_of, page)
        assert text("lacking") == "2 of 4 camera positions lack images: 1-2"
        page.all_loaded()
        page.page.keyboard.press("ArrowRight")
        page.settle()
        assert text("note") == "Camera 1, light 0: not rendered yet."
        assert len(np.unique(page.pixels())) == 2, "stripes, not the picture before"
        page.page.keyboard.press("ArrowDown")
        assert nearest_place(page.pixels()) == (1, 1) and text("note") is None
        page.wait("!framearray.map.changed")
        cells = page.get(GROUND)
        assert cells[1] == [46, 52, 66, 255] and cells[2] == [32, 36, 46, 255] and cells[5][2] != 66
        page.page.keyboard.press("ArrowUp")
        write_image(image_path(manifest, 1, 0), handmade.soft(1, 0, 6.0), handmade.FLOAT)
        page.get("framearray.refresh()")
        assert nearest_place(page.pixels()) == (1, 0), "it appears without a reload"
        page.all_loaded()
        page.wait("!framearray.map.changed")
        assert page.get(GROUND)[1] != [46, 52, 66, 255] and text("lacking") == "1 of 4 camera positions lack images: 2"
        asked = [url for url in page.requests if "/tiles/" in url and "c0002" in url]
        assert asked == [], "nothing that is not there is asked for"
        page.check(server.url)


def test_a_page_on_nothing_fills(browser, tmp_path):
    """Codings are chosen anew as images come, and the page loads itself again."""
    manifest = handmade.plain(tmp_path, n_c=2, n_l=1, layers=False)
    files = {file: file.read_bytes() for file in tmp_path.glob("room.*")}
    for file in files:
        file.unlink()
    with open_server(open_tiles(tmp_path, None, 1)) as server, shown(browser, server.url) as page:
        assert text_of(page, "note") == "Camera 0, light 0: not rendered yet."
        image_path(manifest, 0, 0).write_bytes(files[image_path(manifest, 0, 0)])
        with page.page.expect_navigation():
            page.get("void framearray.refresh()")
        page.wait("globalThis.framearray?.level === 2")
        low, high = bounds(server.tiles, 0, [("light", 0, ONE)])
        assert outside(page.pixels(), low, high) == 0.0
        page.check(server.url)


def test_a_damaged_image_is_reported(browser, tmp_path):
    manifest = handmade.plain(tmp_path, n_c=2, n_l=2, layers=False)
    image_path(manifest, 1, 0).write_bytes(b"")
    with open_server(open_tiles(tmp_path, None, 1)) as server, shown(browser, server.url) as page:
        page.page.keyboard.press("ArrowRight")
        page.wait("!document.getElementById('note').hidden")
        assert "c0001.l000.exr" in text_of(page, "note")
        write_image(image_path(manifest, 1, 0), handmade.soft(1, 0, 6.0), handmade.FLOAT)
        page.get("framearray.refresh()")
        assert nearest_place(page.pixels()) == (1, 0)
        assert all("404" in error for error in page.errors), page.errors
