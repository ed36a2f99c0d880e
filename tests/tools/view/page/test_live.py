"""The page on an array that is being rendered, with a coarse array beside it."""

from pathlib import Path

import numpy as np
from support import handmade
from support.chromium import shown

from framearray_cli.array.coarsearray import COARSE_FOLDER, coarse_folder, write_coarse
from framearray_cli.array.images import write_image
from framearray_cli.array.manifest import Manifest, image_path
from framearray_cli.base.colour import srgb8_from_linear
from framearray_cli.tools.view.run import open_server, open_tiles

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


def red(c: int, k: int) -> np.ndarray:
    """One colour that tells camera and light of a coarse picture."""
    width, height = handmade.SIZE
    return np.full((height, width, 3), [0.3 + 0.1 * c, 0.02, 0.05 + 0.2 * k], np.float32)


def test_coarse_pictures_stand_for_those_that_are_not_rendered(browser, tmp_path):
    with coarse_folder(tmp_path):
        fine, _ = unfinished(tmp_path)
        with open_server(open_tiles(tmp_path, None, 1)) as server, shown(browser, server.url) as page:

            def text(name):
                found = f"document.getElementById('{name}')"
                return page.get(f"{found}.hidden ? '' : {found}.innerText").strip()

            def shows(c, k):
                expected = srgb8_from_linear(red(c, k)[0, 0])
                return np.abs(page.pixels().mean((0, 1)) - expected).max() < 6

            assert text("made") == "5 of 25 images; coarse pictures stand for the others" and text("note") == ""
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
            assert abs(pad[0] - int(bright[0])) < 8, (
                "dimmer than the picture"
            )  # lights share blue in a sheet this small
            write_image(image_path(fine, 4, 4), handmade.soft(4, 4, 6.0), handmade.FLOAT)
            page.get("framearray.refresh()")
            page.settle()
            assert not shows(4, 2) and text("note") == "", "the fine one takes its place"
            page.all_loaded()
            assert not [url for url in page.requests if "/tiles/" in url and "/coarse/" not in url and "c0002" in url]
            page.check(server.url)


def test_a_coarse_array_comes_and_goes(browser, tmp_path):
    fine, coarse = unfinished(tmp_path)
    hidden = tmp_path / "elsewhere"
    coarse.directory.rename(hidden)
    with open_server(open_tiles(tmp_path, None, 1)) as server, shown(browser, server.url + "#camera=3") as page:
        note = "document.getElementById('note').textContent"
        assert page.get(note) == "Camera 3, light 0: not rendered yet."
        hidden.rename(coarse.directory)
        page.get("framearray.refresh()")
        page.settle()
        assert page.get(note) == "Not rendered yet. Coarse picture of camera 4, light 0."
        page.all_loaded()  # what it asks for later is gone
        coarse.directory.rename(hidden)
        for c in range(1, 5):
            for l in range(5):
                write_image(image_path(fine, c, l), handmade.soft(c, l, 6.0), handmade.FLOAT)
        page.get("framearray.refresh()")
        page.settle()
        assert page.get("document.getElementById('made').hidden && document.getElementById('note').hidden")
        page.all_loaded()
        page.check(server.url)
