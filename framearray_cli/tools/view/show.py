"""Show an array in the browser, or export the page with its tiles.

An export is a folder of plain files for any web server. A folder that can also be opened as a file, without a server,
has everything in scripts, which browsers load there:

    index.html          the page, with its modules inside
    data.js             index.json and contents.json
    tiles/c0012.js      all full-size tiles of camera 12
    tiles/c0012.sheets.js

A script calls `framearrayFiles` with names and contents, in base64; `offline.js` hands them to the page.
"""

import json
import os
import re
import shutil
import threading
import webbrowser
from base64 import b64encode
from collections.abc import Callable, Iterator, Mapping
from concurrent.futures import as_completed
from contextlib import contextmanager
from pathlib import Path

from framearray_cli.array.manifest import Manifest
from framearray_cli.array.manifest_toml import read_manifest
from framearray_cli.base.errors import OutputError
from framearray_cli.base.files import make_folder, reason, whole_folder
from framearray_cli.base.threads import TaskPool

from .index import CONTENTS_FILE
from .server import LOOPBACK, PageServer, page_files
from .tiles import INDEX_FILE, TILES_FOLDER, Tiles

CACHE_FOLDER = ".view"  # of the tiles, next to the images
LOADER = "offline.js"
DATA = "data.js"
MODULE = re.compile(r'(from |import\()"\./([\w.]+\.js)"')
HEAD = re.compile(r'<link rel="modulepreload".*?<script type="module" src="main.js"></script>\n', re.DOTALL)
POLICY = re.compile(r'(?<=http-equiv="Content-Security-Policy"\n  content=")[^"]*')
NOTE = re.compile(r'(?<=<p id="note" role="alert">).*?(?=</p>)', re.DOTALL)
# Scripts next to the page and inside it, pictures that it makes itself; no request to any machine.
OPEN_POLICY = (
    "default-src 'none'; script-src 'self' 'unsafe-inline' data: file:; style-src 'self' file:; "
    "img-src 'self' file: blob: data:; connect-src 'none'; base-uri 'none'; form-action 'none'"
)


def open_tiles(array: Path | Manifest, cache: Path | None, threads: int) -> Tiles:
    """Open the tiles of an array.

    Args:
        array: output folder of a render, or its manifest.
        cache: folder of the tiles; None: next to the images.
        threads: that read images at once.

    Raises:
        OutputError: the manifest cannot be read, or the folder cannot be written to.
    """
    manifest = array if isinstance(array, Manifest) else read_manifest(array)
    folder = manifest.directory / CACHE_FOLDER if cache is None else cache
    try:
        make_folder(folder)
        return Tiles(manifest, folder, threads)
    except OutputError as error:
        if cache is None:
            error.add_note("--cache FOLDER keeps what the page needs elsewhere")
        raise


@contextmanager
def open_server(tiles: Tiles, port: int = 0, host: str = LOOPBACK, threads: int = 1) -> Iterator[PageServer]:
    """Serve the page while the context lasts; see `PageServer`."""
    with PageServer(tiles, port, host, threads) as server:
        thread = threading.Thread(target=server.serve_forever, args=(0.1,), daemon=True)
        thread.start()
        try:
            yield server
        finally:
            server.shutdown()
            thread.join()


def open_browser(url: str) -> None:
    """Open a page in the browser, without waiting for it."""
    threading.Thread(target=webbrowser.open, args=(url,), daemon=True).start()


def write_page(
    tiles: Tiles,
    target: Path,
    *,
    threads: int,
    progress: Callable[[int], None],
    force: bool = True,
    offline: bool = False,
) -> tuple[int, list[OutputError]]:
    """Prepare all tiles, and export the page; the folder appears whole or not at all, instead of an earlier export.

    Args:
        force: replace an earlier export.
        offline: write a page that can be opened as a file, too.

    Returns:
        The number of bytes written, and the errors of damaged images.

    Raises:
        OutputError: the target has other files or cannot be written.
    """
    target = Path(os.path.realpath(target))  # "." has no name for a folder next to it
    _check_target(target, force=force)
    problems = prepare_all(tiles, threads, progress)
    _check_target(target, force=True)  # minutes later
    with whole_folder(target, replace=True) as part:
        page, index = page_files(), (tiles.folder / INDEX_FILE).read_bytes()
        contents = json.dumps(tiles.contents(live=False)).encode()
        data = {INDEX_FILE: index, CONTENTS_FILE: contents}
        if offline:
            files = offline_page(page) | {INDEX_FILE: index, DATA: script(DATA, data)}
        else:
            files = {name: content for name, content in page.items() if name != LOADER} | data
        for name, content in files.items():
            (part / name).parent.mkdir(exist_ok=True)
            (part / name).write_bytes(content)
        if offline:
            (part / TILES_FOLDER).mkdir()
            for name, content in tile_scripts(tiles):
                (part / name).write_bytes(content)
        else:
            _copy_tiles(tiles.folder / TILES_FOLDER, part / TILES_FOLDER)
    return sum(file.stat().st_size for file in target.rglob("*") if file.is_file()), problems


def prepare_all(tiles: Tiles, threads: int, progress: Callable[[int], None]) -> list[OutputError]:
    """Make every tile that is missing or out of date; an interrupt keeps the finished ones.

    Args:
        progress: called with the number of pictures just prepared.

    Returns:
        The errors of damaged images.

    Raises:
        OutputError: a tile cannot be written.
    """
    problems: list[OutputError] = []
    # One thread prepares all streams of a camera: its layers are in one file, which is so read once.
    with TaskPool(threads, thread_name_prefix="tiles") as pool:
        try:
            tasks = [pool.submit(_prepare_camera, tiles, c, progress) for c in range(tiles.manifest.n_cameras)]
            for task in as_completed(tasks):
                problems += task.result()
        except BaseException:
            tiles.stopping.set()
            raise
    return problems


def _prepare_camera(tiles: Tiles, c: int, progress: Callable[[int], None]) -> list[OutputError]:
    problems = []
    for stream in tiles.streams:
        if tiles.stopping.is_set():
            break
        problems += tiles.prepare(stream, c)
        progress(stream.n)
    return problems


def offline_page(page: Mapping[str, bytes]) -> dict[str, bytes]:
    """Put the page's modules into its HTML, under names of an import map, as files may not load modules."""
    modules = {
        f"page/{name}": MODULE.sub(r'\1"page/\2"', data.decode())
        for name, data in page.items()
        if name.endswith(".js") and name != LOADER
    }
    urls = {name: f"data:text/javascript;base64,{_base64(code.encode())}" for name, code in modules.items()}
    scripts = (
        f'<script src="{LOADER}"></script>\n<script src="{DATA}"></script>\n'
        f'<script type="importmap">{json.dumps({"imports": urls})}</script>\n'
        '<script type="module">import "page/main.js";</script>\n'
    )
    html = HEAD.sub(lambda _: scripts, page["index.html"].decode())
    html = POLICY.sub(lambda _: OPEN_POLICY, html)
    html = NOTE.sub("Loading. If this line stays: the page needs JavaScript.", html)
    others = {name: data for name, data in page.items() if not name.endswith((".js", ".html"))}
    return {**others, LOADER: page[LOADER], "index.html": html.encode()}


def script(name: str, files: Mapping[str, bytes]) -> bytes:
    """Write a script that contains files."""
    table = {file: _base64(data) for file, data in files.items()}
    return f"framearrayFiles({json.dumps(name)}, {json.dumps(table)});\n".encode()


def tile_scripts(tiles: Tiles) -> Iterator[tuple[str, bytes]]:
    """Write the scripts of all cameras, one after the other: name, content."""
    for c in range(tiles.manifest.n_cameras):
        full = [tiles.tile_path(stream.key, c, l) for stream in tiles.streams for l in range(stream.n)]
        sheets = [tiles.tile_path(stream.key, c, None) for stream in tiles.streams]
        for name, paths in ((f"c{c:04d}.js", full), (f"c{c:04d}.sheets.js", sheets)):
            files = {_tile_address(path): path.read_bytes() for path in paths if path.exists()}
            yield f"{TILES_FOLDER}/{name}", script(f"{TILES_FOLDER}/{name}", files)


def _tile_address(path: Path) -> str:
    """Return the address of a tile on the page."""
    return f"{TILES_FOLDER}/{path.parent.name}/{path.name}"


def _base64(data: bytes) -> str:
    return b64encode(data).decode()


def _check_target(target: Path, *, force: bool) -> None:
    """Refuse a folder with anything but an earlier export of the page.

    Args:
        force: accept an earlier export.

    Raises:
        OutputError: the folder has other files, or cannot be read.
    """
    ours = {INDEX_FILE, CONTENTS_FILE, TILES_FOLDER, DATA, *page_files()}
    try:
        found = sorted(entry.name for entry in target.iterdir()) if os.path.exists(target) else []
    except OSError as error:
        raise OutputError(f"{target}: cannot be read as a folder: {reason(error)}") from error
    others = [name for name in found if name not in ours]
    if others or (found and INDEX_FILE not in found):
        name = (others or found)[0]
        raise OutputError(f"{target}: holds other files, {name!r} for one; choose a new or empty folder")
    if found and not force:
        raise OutputError(f"{target}: an earlier export is there; choose another folder, or give --force to replace it")


def _copy_tiles(source: Path, target: Path) -> None:
    """Copy all tiles. On a full disk `shutil.copytree` would try each of thousands of files."""
    for folder, _, names in os.walk(source):
        there = target / Path(folder).relative_to(source)
        there.mkdir()
        for name in names:
            if not name.startswith("."):
                shutil.copyfile(Path(folder, name), there / name)
