"""The files of the page (HTML, CSS and JavaScript in `page/`), and exports of the page with its tiles.

An export is a folder of plain files for any web server. A folder that can also be opened as a file, without a server,
has everything in scripts, which browsers load there:

    index.html          the page, with its modules inside
    data.js             index.json, contents.json and the views
    tiles/c0012.js      all full-size tiles of camera 12
    tiles/c0012.sheets.js

A script calls `framearrayFiles` with names and contents, in base64; `offline.js` hands them to the page.
"""

import json
import os
import re
import shutil
from base64 import b64encode
from collections.abc import Iterator, Mapping
from importlib.resources import files
from pathlib import Path, PurePosixPath

from framearray_cli.base.errors import OutputError
from framearray_cli.base.files import reason, whole_folder

from .index import CONTENTS_FILE, VIEWS_FOLDER
from .tiles import INDEX_FILE, TILES_FOLDER, Tiles

TYPES = {
    ".html": "text/html; charset=utf-8",
    ".css": "text/css; charset=utf-8",
    ".js": "text/javascript; charset=utf-8",
    ".svg": "image/svg+xml",
    ".json": "application/json",
    ".bin": "application/octet-stream",
}

TYPE_LINES = re.compile(rb"^ */\*\*(?:[^*]|\*(?!/))*\*/\r?\n", re.MULTILINE)  # JSDoc comments with lines of their own
LOADER = "offline.js"
DATA = "data.js"
MODULE = re.compile(r'(from |import\()"\./([\w.]+\.js)"')
HEAD = re.compile(r'<link rel="modulepreload".*?<script type="module" src="main.js"></script>\n', re.DOTALL)
POLICY = re.compile(r'(?<=http-equiv="Content-Security-Policy"\n  content=")[^"]*')
NOTE = re.compile(r'(?<=<p id="note" role="alert">).*?(?=</p>)', re.DOTALL)
# Scripts next to the page and inside it, pictures that it makes itself; and it asks no machine for anything.
OPEN_POLICY = (
    "default-src 'none'; script-src 'self' 'unsafe-inline' data: file:; style-src 'self' file:; "
    "img-src 'self' file: blob: data:; connect-src 'none'; base-uri 'none'; form-action 'none'"
)


def page_files() -> dict[str, bytes]:
    """Read all files: name -> content; JavaScript without its types, which only `deno check` reads."""
    found = {}
    for entry in (files(__package__) / "page").iterdir():
        suffix = PurePosixPath(entry.name).suffix
        if suffix in TYPES:
            data = entry.read_bytes()
            found[entry.name] = TYPE_LINES.sub(b"", data) if suffix == ".js" else data
    return found


def content_type(name: str) -> str:
    """Return the media type of a file."""
    return TYPES[PurePosixPath(name).suffix]


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
    """Write a script that brings files."""
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


def check_target(target: Path, *, force: bool = True) -> None:
    """Refuse a folder that holds anything but an earlier export of the page.

    Args:
        force: accept an earlier export.

    Raises:
        OutputError: the folder holds other files, or cannot be read.
    """
    ours = {INDEX_FILE, CONTENTS_FILE, TILES_FOLDER, VIEWS_FOLDER, DATA, *page_files()}
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


def export_page(tiles: Tiles, target: Path, *, offline: bool = False) -> int:
    """Write the page with all tiles; the folder appears whole or not at all, instead of an earlier export.

    Args:
        tiles: all prepared.
        offline: write a page that can be opened as a file, too.

    Returns:
        The number of bytes written.

    Raises:
        OutputError: the target holds other files, or cannot be written.
    """
    check_target(target)
    with whole_folder(target, replace=True) as part:
        page, index = page_files(), (tiles.folder / INDEX_FILE).read_bytes()
        contents = json.dumps(tiles.contents(live=False)).encode()
        data = {INDEX_FILE: index, CONTENTS_FILE: contents, **tiles.views.files}
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
    return sum(file.stat().st_size for file in target.rglob("*") if file.is_file())


def _copy_tiles(source: Path, target: Path) -> None:
    """Copy all tiles. On a full disk `shutil.copytree` would try each of thousands of files."""
    for folder, _, names in os.walk(source):
        there = target / Path(folder).relative_to(source)
        there.mkdir()
        for name in names:
            if not name.startswith("."):
                shutil.copyfile(Path(folder, name), there / name)
