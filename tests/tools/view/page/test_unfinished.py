"""The page on an array that lacks images: it shows them as missing, and picks them up when they come."""

import numpy as np
from support import handmade
from support.chromium import shown
from support.expected import bounds, nearest_place, outside

from framearray_cli.array.images import write_image
from framearray_cli.array.manifest import image_path
from framearray_cli.tools.view.run import open_server, open_tiles

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

        def text(name):
            return page.get(
                f"document.getElementById('{name}').hidden || document.getElementById('{name}').textContent"
            )

        assert text("lacking") == "2 of 4 camera positions lack images: 1-2"
        page.all_loaded()
        page.page.keyboard.press("ArrowRight")
        page.settle()
        assert text("note") == "Camera 1, light 0: not rendered yet."
        assert len(np.unique(page.pixels())) == 2, "stripes, not the picture before"
        page.page.keyboard.press("ArrowDown")
        assert nearest_place(page.pixels()) == (1, 1) and text("note") is True
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
        assert page.get("document.getElementById('note').textContent") == "Camera 0, light 0: not rendered yet."
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
        assert "c0001.l000.exr" in page.get("document.getElementById('note').textContent")
        write_image(image_path(manifest, 1, 0), handmade.soft(1, 0, 6.0), handmade.FLOAT)
        page.get("framearray.refresh()")
        assert nearest_place(page.pixels()) == (1, 0)
        assert all("404" in error for error in page.errors), page.errors
