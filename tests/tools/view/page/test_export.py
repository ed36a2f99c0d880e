"""The page as files, served by another server from a sub-folder."""

import time
from pathlib import Path
from urllib.parse import quote
from zipfile import ZipFile

import numpy as np
import pytest
from support import handmade
from support.browsers import PATIENCE_S, PHONE, file_server, shown, touch
from support.expected import bounds, nearest_place, outside

from framearray_cli.array.images import read_codes
from framearray_cli.base.colour import srgb8_from_linear
from framearray_cli.base.errors import OutputError
from framearray_cli.tools.view.clips import Clips
from framearray_cli.tools.view.pagefiles import write_page
from framearray_cli.tools.view.show import open_tiles
from framearray_cli.tools.view.tiles import Tiles

LEAST_DB = 36.0  # of a coded picture; the neighbouring places have less than 30


@pytest.fixture
def served(tmp_path: Path):
    """A server of files, on a folder above that of the page."""
    with file_server(tmp_path) as address:
        yield address


def exported(folder: Path, clips: Clips | None, **sizes) -> tuple[Tiles, Path]:
    """Export a small array."""
    manifest = handmade.plain(folder / "array", **sizes)
    tiles = open_tiles(manifest.directory, None, 2)
    tiles.clips = clips
    page = folder / "some where" / "page"
    n_bytes, problems = write_page(tiles, page, threads=2, progress=lambda n: None)
    assert problems == [] and n_bytes == sum(file.stat().st_size for file in page.rglob("*") if file.is_file())
    return tiles, page


def error_db(pixels, c, l, exposure=0.0):
    """The mean square error of the screen against a picture of the array, as PSNR."""
    right = srgb8_from_linear(handmade.soft(c, l, 6.0) * 2.0**exposure)
    return 10 * np.log10(255**2 / np.mean((pixels - right.astype(float)) ** 2))


KINDS = ["file", pytest.param("http", marks=pytest.mark.slow)]


@pytest.mark.parametrize("kind", KINDS)
@pytest.mark.parametrize(
    ("either", "clips"),
    [
        pytest.param("chromium", None, id="chromium-jpeg"),
        pytest.param("chromium", Clips(), id="chromium-clips"),
        pytest.param("firefox", None, id="firefox-jpeg", marks=pytest.mark.slow),
        pytest.param("firefox", Clips(), id="firefox-clips"),
    ],
    indirect=["either"],
)
def test_an_export_works_as_a_file_and_on_a_server(either, served, tmp_path, kind, clips):
    pytest.importorskip("av")
    tiles, page = exported(tmp_path, clips, n_c=3, n_l=14)
    assert not list(page.rglob("tiles/*.jpg"))
    low, high = bounds(tiles, 2, [("light", 12, (1.0, 1.0, 1.0))])
    for source in tiles.manifest.directory.glob("room.*.exr"):
        source.unlink()  # the page does not need the array
    base = f"file://{quote(str(page))}/" if kind == "file" else f"{served}some%20where/page/"
    with shown(either, f"{base}index.html#camera=2&light=12") as screen:
        assert error_db(screen.pixels(), 2, 12) > LEAST_DB
        if not clips:
            assert outside(screen.pixels(), low, high) == 0.0
        screen.page.keyboard.press("Escape")
        screen.drag([(2, 12), (1, 5)])
        screen.settle()
        assert screen.place == (1, 5)
        assert error_db(screen.pixels(), 1, 5) > LEAST_DB
        for label in ("Depth", "Normals"):
            screen.page.locator(f"label:has-text('{label}')").click()
            screen.settle()
        normal = 255 * handmade.soft(1, 1)
        assert np.abs(screen.pixels() - normal).mean() < 4
        screen.all_loaded()
        names = {url.rpartition("/")[2] for url in screen.requests}
        if kind == "http" or either.browser_type.name == "chromium":  # Firefox reports no files
            assert names >= {"data.js", "c0001.js", "c0001.l000.js", "c0002.l012.js"}
            assert ("depth.c0000.js" in names) == bool(clips)
        assert not screen.get("framearray.store.missing.size")
        assert screen.errors == []
        assert all(url.startswith((base, "blob:", "data:")) for url in screen.requests)


NO_FRAMES = "delete globalThis.VideoDecoder;"
NO_VIDEO = NO_FRAMES + "HTMLVideoElement.prototype.canPlayType = () => '';"
BUSY = (  # a video that has no picture at first
    NO_FRAMES
    + """const make = createImageBitmap; let times = 0;
    globalThis.createImageBitmap = (source, ...rest) => source instanceof HTMLVideoElement && times++ < 3 ?
        Promise.reject(new DOMException("not usable", "InvalidStateError")) : make(source, ...rest);"""
)
WAYS = {"video": (NO_FRAMES, "video"), "busy": (BUSY, "video"), "small": (NO_VIDEO, "")}


@pytest.mark.parametrize(("script", "way"), WAYS.values(), ids=WAYS)
def test_clips_without_webcodecs(either, tmp_path, script, way):
    pytest.importorskip("av")
    _, page = exported(tmp_path, Clips(), n_c=2, n_l=13, layers=False)
    with shown(either, f"file://{quote(str(page))}/index.html#camera=1&light=11", script=script) as screen:
        assert screen.get("framearray.array.decodesBy") == way
        assert error_db(screen.pixels(), 1, 11) > LEAST_DB  # small pictures of a picture as small as this are whole
        screen.page.keyboard.press("PageDown")
        assert error_db(screen.pixels(), 1, 12) > LEAST_DB
        screen.all_loaded()
        assert screen.get("[...framearray.store.missing.values()]") == [] and screen.errors == []


def test_planes_become_colours(browser, tmp_path):
    """The page's conversion against its formula: chroma between four samples, weights 9, 3, 3 and 1."""
    _, page = exported(tmp_path, None, n_c=1, n_l=1, layers=False)
    rng = np.random.default_rng(3)
    width, height, columns, rows = 7, 5, 4, 3
    luma = rng.integers(0, 256, (height, 8))
    chroma = rng.integers(90, 166, (2, rows, columns))
    separate = [luma, *chroma], [(0, 8), (40, 4), (52, 4)]
    paired = [luma, np.stack(chroma, axis=-1)], [(0, 8), (40, 8)]
    with shown(browser, f"file://{quote(str(page))}/index.html") as screen:
        for planes, places in (separate, paired):
            data = [int(code) for plane in planes for code in plane.ravel()]
            layout = [{"offset": offset, "stride": stride} for offset, stride in places]
            call = """([data, layout]) => import("page/planes.js").then(({ Planes }) =>
                [...new Planes(new Uint8Array(data), layout, [7, 5]).codes()])"""
            packed = np.array(screen.page.evaluate(call, [data, layout]), np.int64).reshape(height, width)
            found = np.stack([(packed >> shift) & 1023 for shift in (0, 10, 20)], axis=-1)
            padded = np.pad(chroma.astype(float), ((0, 0), (1, 1), (1, 1)), mode="edge")
            u, v = np.empty((2, height, width))
            for y in range(height):
                for x in range(width):
                    j, i = y // 2 + 1, x // 2 + 1
                    dj, di = (1 if y % 2 else -1), (1 if x % 2 else -1)
                    near, far = padded[:, j], padded[:, j + dj]
                    mean = (9 * near[:, i] + 3 * far[:, i] + 3 * near[:, i + di] + far[:, i + di]) / 16
                    u[y, x], v[y, x] = mean - 128
            y, u, v = (luma[:, :width] - 16) * 255 / 219, u * 255 / 224, v * 255 / 224
            right = np.stack([y + 1.5748 * v, y - 0.18733 * u - 0.46813 * v, y + 1.8556 * u], axis=-1)
            assert np.abs(found - np.clip(right / 255 * 1023, 0, 1023)).max() <= 1.0


def test_an_export_replaces_its_like_and_nothing_else(tmp_path, monkeypatch):
    manifest = handmade.plain(tmp_path / "array", n_c=2, n_l=1, layers=False)
    tiles = open_tiles(manifest.directory, None, 1)
    target = tmp_path / "page"
    for place in (target, Path()):  # the second time from within
        write_page(tiles, place, threads=1, progress=lambda n: None)
        monkeypatch.chdir(target)
        tiles_there = {path.name for path in (target / "tiles").iterdir()}
        assert tiles_there == {"c0000.js", "c0000.l000.js", "c0001.js", "c0001.l000.js"}
    assert {entry.name for entry in tmp_path.iterdir()} == {"array", "page"}
    zipped = tmp_path / "page.zip"
    write_page(tiles, zipped, threads=1, progress=lambda n: None)
    with ZipFile(zipped) as file:
        names = {name.partition("/")[2] for name in file.namelist()}
        assert names == {str(path.relative_to(target)) for path in target.rglob("*") if path.is_file()}
        assert {name.partition("/")[0] for name in file.namelist()} == {"page"}
    with pytest.raises(OutputError, match="an earlier export is there"):
        write_page(tiles, zipped, threads=1, progress=lambda n: None, force=False)
    (target / "letter.txt").write_text("dear")
    with pytest.raises(OutputError, match=r"holds other files, 'letter.txt' for one"):
        write_page(tiles, target, threads=1, progress=lambda n: None)
    assert (target / "letter.txt").read_text() == "dear"


def test_a_link_has_a_preview(tmp_path):
    _, page = exported(tmp_path, None, n_c=3, n_l=2, layers=False)
    html = (page / "index.html").read_text()
    assert "<title>room</title>" in html
    assert '<meta property="og:description" content="3 camera positions x 2 (light): walk, and move the light">' in html
    assert '<meta property="og:image" content="preview.jpg">' in html
    preview = read_codes(page / "preview.jpg")
    assert preview.shape == (48, 64, 3) and error_db(preview, 1, 1) > LEAST_DB


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
        page.on("request", lambda request: tiles.append(request.url) if "/tiles/" in request.url else None)
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
        scrolled, hash = page.evaluate("[scrollY, document.getElementById('room').contentWindow.location.hash]")
        assert (scrolled, hash) == (0, "#embed&camera=2&light=1")
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
        touch(self.page, *([end] for end in ends))
