"""The page as files, served by another server from a sub-folder."""

import threading
from functools import partial
from http.server import SimpleHTTPRequestHandler, ThreadingHTTPServer
from pathlib import Path

import pytest
from support import handmade
from support.chromium import shown
from support.expected import bounds, outside

from framearray_cli.base.errors import OutputError
from framearray_cli.tools.view.run import open_tiles, write_page


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
        page.check(url)


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
