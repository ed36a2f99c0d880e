"""Export the page with its tiles: a folder, or a ZIP of it, for any web server; as a file it opens without one.

    index.html           the page, with its modules inside
    data.js              index.json and contents.json
    preview.jpg          a picture for previews of a link
    tiles/c0012.js       sheets of camera 12
    tiles/c0012.l012.js  full-size pictures of camera 12, light positions 12 to 23
    tiles/depth.c0012.js a layer of cameras 12 to 23, as a clip

Everything is in scripts, as browsers load nothing else from files. A script calls `framearrayFiles` with names and
contents, in base64; `offline.js` hands them to the page.
"""

import json
import os
import re
from base64 import b64encode
from collections.abc import Callable, Iterator, Mapping
from html import escape
from pathlib import Path
from zipfile import ZIP_DEFLATED, ZipFile

import numpy as np

from framearray_cli.array.images import encode_jpeg
from framearray_cli.array.pictures import Pictures
from framearray_cli.base.colour import srgb8_from_linear
from framearray_cli.base.errors import OutputError
from framearray_cli.base.files import reason, whole_file, whole_folder
from framearray_cli.base.units import counted

from .clips import LENGTH
from .coding import QUALITY
from .index import CONTENTS_FILE
from .server import page_files
from .show import prepare_all
from .tiles import INDEX_FILE, TILES_FOLDER, Tiles

LOADER = "offline.js"
DATA = "data.js"
PREVIEW = "preview.jpg"
ZIP = ".zip"
MODULE = re.compile(r'(from |import\()"\./([\w.]+\.js)"')
HEAD = re.compile(r'<title>.*<script type="module" src="main.js"></script>\n', re.DOTALL)
POLICY = re.compile(r'(?<=http-equiv="Content-Security-Policy"\n  content=")[^"]*')
NOTE = re.compile(r'(?<=<p id="note" role="alert">).*?(?=</p>)', re.DOTALL)
# Scripts next to the page and inside it, pictures that it makes itself; no request to any machine.
OPEN_POLICY = (
    "default-src 'none'; script-src 'self' 'unsafe-inline' data: file:; style-src 'self' file:; "
    "img-src 'self' file: blob: data:; media-src blob:; connect-src 'none'; base-uri 'none'; form-action 'none'"
)


def write_page(
    tiles: Tiles, target: Path, *, threads: int, progress: Callable[[int], None], force: bool = True
) -> tuple[int, list[OutputError]]:
    """Prepare all tiles, and export the page; it appears whole or not at all, instead of an earlier export.

    Args:
        target: a folder, or a ZIP file by its suffix.
        force: replace an earlier export.

    Returns:
        The number of bytes written, and the errors of damaged images.

    Raises:
        OutputError: the target has other files or cannot be written.
    """
    target = Path(os.path.realpath(target))  # "." has no name for a folder next to it
    _check_target(target, force=force)
    problems = prepare_all(tiles, threads, progress)
    if is_zip(target):
        with whole_file(target) as part, ZipFile(part, "w", ZIP_DEFLATED, compresslevel=1) as file:
            for name, content in _files(tiles):
                file.writestr(f"{target.stem}/{name}", content)
        return target.stat().st_size, problems
    _check_target(target, force=True)  # minutes later
    with whole_folder(target, replace=True) as part:
        (part / TILES_FOLDER).mkdir()
        for name, content in _files(tiles):
            (part / name).write_bytes(content)
    return sum(file.stat().st_size for file in target.rglob("*") if file.is_file()), problems


def is_zip(target: Path) -> bool:
    """Return whether an export is one file."""
    return target.suffix.lower() == ZIP


def bytes_for_tiles(target: Path, most: float) -> float:
    """Return how many bytes of tiles keep an export within a number of bytes: base64 has 4 characters for 3 bytes."""
    return (most - sum(map(len, page_files().values())) * 4 / 3) * (1 if is_zip(target) else 3 / 4)


def _check_target(target: Path, *, force: bool) -> None:
    """Refuse a folder with anything but an earlier export of the page.

    Args:
        force: accept an earlier export.

    Raises:
        OutputError: the folder has other files, or cannot be read.
    """
    ours = {INDEX_FILE, DATA, PREVIEW, TILES_FOLDER, *page_files()}
    found: list[str] = []
    try:
        if is_zip(target) and target.is_file():
            found = [INDEX_FILE]
        elif os.path.exists(target):
            found = sorted(entry.name for entry in target.iterdir())
    except OSError as error:
        raise OutputError(f"{target}: cannot be read as a folder: {reason(error)}") from error
    others = [name for name in found if name not in ours]
    if others or (found and INDEX_FILE not in found):
        name = (others or found)[0]
        raise OutputError(f"{target}: holds other files, {name!r} for one; choose a new or empty folder")
    if found and not force:
        raise OutputError(f"{target}: an earlier export is there; choose another name, or give --force to replace it")


def _files(tiles: Tiles) -> Iterator[tuple[str, bytes]]:
    """Make the files of an export, one after the other: name, content."""
    index = json.dumps(tiles.export_index()).encode()
    contents = json.dumps(tiles.contents(live=False)).encode()
    page = page_files()
    yield "index.html", _html(tiles, page)
    yield from ((name, data) for name, data in page.items() if name == LOADER or not name.endswith((".js", ".html")))
    yield PREVIEW, _preview(tiles)
    yield INDEX_FILE, index
    yield DATA, _script(DATA, {INDEX_FILE: index, CONTENTS_FILE: contents})
    for c in range(tiles.manifest.n_cameras):
        scripts: dict[str, list[Path]] = {f"c{c:04d}.js": [tiles.tile_path(one.key, c, None) for one in tiles.streams]}
        for stream in tiles.streams:
            for path, lights in tiles.tile_files(stream, c):
                first = lights.start - lights.start % LENGTH
                scripts.setdefault(f"c{c:04d}.l{first:03d}.js", []).append(path)
        for stream in tiles.layer_clips if c % LENGTH == 0 else ():
            scripts[f"{stream.key}.c{c:04d}.js"] = [tiles.layer_clip_path(stream, c)]
        for name, paths in scripts.items():
            tables = {
                f"{TILES_FOLDER}/{path.parent.name}/{path.name}": _content(path) for path in paths if path.exists()
            }
            yield f"{TILES_FOLDER}/{name}", _script(f"{TILES_FOLDER}/{name}", tables)


def _content(path: Path) -> bytes:
    """Read a tile; a clip without its stamp."""
    data = path.read_bytes()
    return data.partition(b"\n")[2] if path.suffix == ".clip" else data


def _script(name: str, files: Mapping[str, bytes]) -> bytes:
    """Write a script that contains files."""
    table = {file: b64encode(data).decode() for file, data in files.items()}
    return f"framearrayFiles({json.dumps(name)}, {json.dumps(table)});\n".encode()


def _html(tiles: Tiles, page: Mapping[str, bytes]) -> bytes:
    """Put the page's modules into its HTML, under names of an import map, as files may not load modules."""
    manifest = tiles.manifest
    urls = {}
    for name, data in page.items():
        if name.endswith(".js") and name != LOADER:
            code = MODULE.sub(r'\1"page/\2"', data.decode()).encode()
            urls[f"page/{name}"] = f"data:text/javascript;base64,{b64encode(code).decode()}"
    lights = " x ".join(f"{n} ({name})" for name, n in manifest.axes.items())
    about = {
        "og:type": "website",
        "og:title": manifest.name,
        "og:description": f"{counted(manifest.n_cameras, 'camera position')} x {lights}: walk, and move the light",
        "og:image": PREVIEW,
    }
    head = [
        f"<title>{escape(manifest.name)}</title>",
        *(f'<meta property="{name}" content="{escape(text)}">' for name, text in about.items()),
        '<link rel="icon" href="icon.svg">',
        '<link rel="stylesheet" href="style.css">',
        f'<script src="{LOADER}"></script>',
        f'<script src="{DATA}"></script>',
        f'<script type="importmap">{json.dumps({"imports": urls})}</script>',
        '<script type="module">import "page/main.js";</script>\n',
    ]
    html = HEAD.sub(lambda _: "\n".join(head), page["index.html"].decode())
    html = POLICY.sub(OPEN_POLICY, html)
    return NOTE.sub("Loading. If this line stays: the page needs JavaScript.", html).encode()


def _preview(tiles: Tiles) -> bytes:
    """Draw the picture in the middle of an array, as the page shows it; black if it is not there."""
    manifest = tiles.manifest
    try:
        image = Pictures(manifest).picture(manifest.n_cameras // 2, [n // 2 for n in manifest.axes.values()])
    except OutputError:
        image = np.zeros((*manifest.resolution[::-1], 3), np.float32)
    return encode_jpeg(srgb8_from_linear(image * np.float32(2.0 ** tiles.index["exposure"])), QUALITY)
