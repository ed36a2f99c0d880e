"""The page as files, served by another server from a sub-folder."""

import threading
import time
from functools import partial
from http.server import SimpleHTTPRequestHandler, ThreadingHTTPServer
from pathlib import Path
from urllib.parse import quote

import numpy as np
import pytest
from support import handmade
from support.chromium import PATIENCE_S, PHONE, shown
from support.expected import bounds, nearest_place, outside

from framearray_cli.base.errors import OutputError
from framearray_cli.tools.view.show import open_tiles, write_page


class Silent(SimpleHTTPRequestHandler):
    def log_message(self, format, *args):
        pass


@pytest.fixture
def served(tmp_path: Path):
    """Python's own file server, on a folder above that of the page."""
    with ThreadingHTTPServer(("127.0.0.1", 0), partial(Silent, directory=tmp_path)) as server:
        thread = threading.Thread(target=server.serve_forever, args=(0.05,), daemon=True)
        thread.start()
        yield f"http://127.0.0.1:{server.server_port}/"
        server.shutdown()
        thread.join()


def test_an_export_works_from_a_sub_folder(browser, served, tmp_path):
    manifest = handmade.plain(tmp_path / "array", n_c=3, n_l=2)
    tiles = open_tiles(manifest.directory, None, 2)
    n_bytes, problems = write_page(tiles, tmp_path / "some where" / "page", threads=2, progress=lambda n: None)
    assert problems == [] and n_bytes > 10_000
    for source in manifest.directory.glob("room.*"):
        source.unlink()  # the page does not need the array
    url = f"{served}some%20where/page/"
    with shown(browser, f"{url}#camera=2&light=1") as page:
        low, high = bounds_of_copy(tiles, tmp_path / "some where" / "page")
        assert outside(page.pixels(), low, high) == 0.0
        page.page.keyboard.press("ArrowLeft")
        page.settle()
        assert page.place == (1, 1)
        page.all_loaded()
        assert [one for one in page.requests if "offline" in one] == [], "nothing that it does not use"
        page.check(url)


@pytest.mark.parametrize("kind", ["file", pytest.param("http", marks=pytest.mark.slow)])
def test_an_offline_export_opens_as_a_file_too(browser, served, tmp_path, kind):
    manifest = handmade.plain(tmp_path / "array", n_c=3, n_l=2)
    tiles = open_tiles(manifest.directory, None, 2)
    page = tmp_path / "some where" / "page"
    for _ in range(2):  # the second in place of the first
        assert write_page(tiles, page, threads=2, progress=lambda n: None, offline=True)[1] == []
    assert not list(page.rglob("*.jpg"))
    base = f"file://{quote(str(page))}/" if kind == "file" else f"{served}some%20where/page/"
    with shown(browser, f"{base}index.html#camera=2&light=1") as screen:
        low, high = bounds(tiles, 2, [("light", 1, (1.0, 1.0, 1.0))])
        assert outside(screen.pixels(), low, high) == 0.0
        screen.page.keyboard.press("Escape")
        screen.drag([(2, 1), (1, 0)])
        screen.settle()
        assert screen.place == (1, 0)
        screen.all_loaded()
        assert {url.rpartition("/")[2] for url in screen.requests} >= {"data.js", "c0001.js", "c0000.sheets.js"}
        assert not screen.get("framearray.store.missing.size")
        assert screen.errors == []
        assert all(url.startswith((base, "blob:", "data:")) for url in screen.requests)


def bounds_of_copy(tiles, folder):
    copy = type("Copy", (), {"manifest": tiles.manifest, "streams": tiles.streams})()
    copy.ensure_tile = lambda key, c, l: folder / "tiles" / key / f"c{c:04d}.l{l:03d}.jpg"
    return bounds(copy, 2, [("light", 1, (1.0, 1.0, 1.0))])


def test_an_export_replaces_its_like_and_nothing_else(tmp_path, monkeypatch):
    manifest = handmade.plain(tmp_path / "array", n_c=2, n_l=1, layers=False)
    tiles = open_tiles(manifest.directory, None, 1)
    target = tmp_path / "page"
    for place in (target, Path()):  # the second time from within
        write_page(tiles, place, threads=1, progress=lambda n: None)
        monkeypatch.chdir(target)
        assert len(list(target.rglob("*.jpg"))) == 4
    assert {entry.name for entry in tmp_path.iterdir()} == {"array", "page"}
    (target / "letter.txt").write_text("dear")
    with pytest.raises(OutputError, match=r"holds other files, 'letter.txt' for one"):
        write_page(tiles, target, threads=1, progress=lambda n: None)
    assert (target / "letter.txt").read_text() == "dear"


BLOG = """<!doctype html><meta name="viewport" content="width=device-width, initial-scale=1"><p>Words before.</p>
<iframe id="room" src="page/index.html#embed&camera=2&light=1" title="A room" style="width: 100%; aspect-ratio: 4 / 3;
border: 0"></iframe><p style="height: 200vh">Words after.</p>"""


@pytest.fixture
def blog(served, tmp_path) -> str:
    """The address of a page of somebody else that shows an export."""
    manifest = handmade.plain(tmp_path / "array", layers=False)
    write_page(open_tiles(manifest.directory, None, 2), tmp_path / "page", threads=2, progress=lambda n: None)
    (tmp_path / "blog.html").write_text(BLOG)
    return f"{served}blog.html"


@pytest.mark.parametrize("size", [pytest.param((900, 700), marks=pytest.mark.slow), PHONE], ids=["desktop", "phone"])
def test_an_embedded_page_is_only_a_picture_that_turns(browser, blog, size):
    phone = {"has_touch": True, "is_mobile": True} if size == PHONE else {}
    with browser.new_context(viewport={"width": size[0], "height": size[1]}, **phone) as context:
        page = context.new_page()
        tiles, errors = [], []
        page.on("request", lambda request: tiles.append(request.url) if ".jpg" in request.url else None)
        page.on("pageerror", lambda error: errors.append(str(error)))
        page.goto(blog)
        room = Room(page)
        room.until("globalThis.framearray?.level === 2")
        assert room.place() == (2, 1)
        assert room.frame.evaluate("document.getElementById('panel').offsetWidth") == 0
        width, height = room.frame.evaluate("[innerWidth, document.documentElement.scrollHeight - innerHeight]")
        assert (width, height) == (room.box["width"], 0), "the picture fills its frame"
        page.wait_for_timeout(200)
        assert len(tiles) == 1, "nothing more until somebody touches it"
        room.drag(0.5, 0.5)  # of the picture: half of 7 cameras to the right, half of 5 lights down
        assert room.place() == (5, 3)
        room.until("framearray.level === 2")
        assert nearest_place(room.pixels()) == (5, 3)
        assert len(tiles) > 1, "and then what is around it"
        page.keyboard.press("ArrowLeft"), page.keyboard.press("ArrowUp"), page.keyboard.press("d")
        assert room.place() == (4, 2) and not room.frame.evaluate("framearray.isDrawing")
        assert page.evaluate("[scrollY, document.getElementById('room').contentWindow.location.hash]") == [
            0,
            "#embed&camera=2&light=1",
        ]
        assert errors == []


class Room:
    """The page in a frame of another one."""

    def __init__(self, page):
        self.page, self.frame = page, page.frames[1]
        self.box = page.locator("#room").bounding_box()

    def until(self, expression):
        end = time.monotonic() + PATIENCE_S
        while not self.frame.evaluate(f"Boolean({expression})"):
            assert time.monotonic() < end, expression
            time.sleep(0.01)

    def place(self):
        return tuple(self.frame.evaluate("[framearray.view.c, framearray.l]"))

    def pixels(self):
        width, height = handmade.SIZE
        codes = self.frame.evaluate("[...framearray.picture.pixels()]")
        return np.reshape(codes, (height, width, 4))[..., :3].astype(np.uint8)

    def drag(self, right, down):
        """Drag over shares of the picture, with a finger where there is a touch screen."""
        x, y = self.box["x"] + 0.3 * self.box["width"], self.box["y"] + 0.3 * self.box["height"]
        ends = [(x + share * right * self.box["width"], y + share * down * self.box["height"]) for share in (0, 0.5, 1)]
        if not self.frame.evaluate("matchMedia('(pointer: coarse)').matches"):
            self.page.mouse.move(*ends[0])
            self.page.mouse.down()
            for end in ends[1:]:
                self.page.mouse.move(*end)
            self.page.mouse.up()
            return
        touch = self.page.context.new_cdp_session(self.page)
        for kind, (x, y) in zip(("touchStart", "touchMove", "touchMove"), ends, strict=True):
            touch.send("Input.dispatchTouchEvent", {"type": kind, "touchPoints": [{"x": x, "y": y}]})
        touch.send("Input.dispatchTouchEvent", {"type": "touchEnd", "touchPoints": []})
