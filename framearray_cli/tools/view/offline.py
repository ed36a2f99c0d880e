"""The page for a folder that is opened as a file, without a server: everything in scripts, which browsers load there.

    index.html          the page, with its modules inside
    data.js             index.json, contents.json and the views
    tiles/c0012.js      all full-size tiles of camera 12
    tiles/c0012.sheets.js

A script calls `framearrayFiles` with names and contents, in base64; `offline.js` hands them to the page.
"""

import json
import re
from base64 import b64encode
from collections.abc import Iterator, Mapping
from pathlib import Path

from .tiles import TILES_FOLDER, Tiles

LOADER = "offline.js"
DATA = "data.js"
MODULE = re.compile(r'(from |import\()"\./([\w.]+\.js)"')
HEAD = re.compile(r'<link rel="modulepreload".*?<script type="module" src="main.js"></script>\n', re.DOTALL)
POLICY = re.compile(r'(?<=http-equiv="Content-Security-Policy"\n  content=")[^"]*')
NOTE = re.compile(r'(?<=<p id="note" role="alert">).*?(?=</p>)', re.DOTALL)
# Scripts from beside the page and inside it, pictures that it makes itself; and it asks no machine for anything.
OPEN_POLICY = (
    "default-src 'none'; script-src 'self' 'unsafe-inline' data: file:; style-src 'self' file:; "
    "img-src 'self' file: blob: data:; connect-src 'none'; base-uri 'none'; form-action 'none'"
)


def offline_page(page: Mapping[str, bytes]) -> dict[str, bytes]:
    """Put the page's modules into its HTML, under names of an import map, as files may not load modules."""
    modules = {
        f"page/{name}": MODULE.sub(r'\1"page/\2"', data.decode())
        for name, data in page.items()
        if name.endswith(".js") and name != LOADER
    }
    urls = {name: f"data:text/javascript;base64,{_text(code.encode())}" for name, code in modules.items()}
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
    table = {file: _text(data) for file, data in files.items()}
    return f"framearrayFiles({json.dumps(name)}, {json.dumps(table)});\n".encode()


def tile_scripts(tiles: Tiles) -> Iterator[tuple[str, bytes]]:
    """Write the scripts of all cameras, one after the other: name, content."""
    for c in range(tiles.manifest.n_cameras):
        full = [tiles.tile_path(stream.key, c, l) for stream in tiles.streams for l in range(stream.n)]
        sheets = [tiles.tile_path(stream.key, c, None) for stream in tiles.streams]
        for name, paths in ((f"c{c:04d}.js", full), (f"c{c:04d}.sheets.js", sheets)):
            files = {_name(path): path.read_bytes() for path in paths if path.exists()}
            yield f"{TILES_FOLDER}/{name}", script(f"{TILES_FOLDER}/{name}", files)


def _name(path: Path) -> str:
    """Return the address of a tile on the page."""
    return f"{TILES_FOLDER}/{path.parent.name}/{path.name}"


def _text(data: bytes) -> str:
    return b64encode(data).decode()
