"""Export the page and its tiles as a folder of plain files, for any web server."""

import json
import os
import shutil
from pathlib import Path

from framearray_cli.base.errors import OutputError
from framearray_cli.base.files import reason, whole_folder

from .contents import CONTENTS_FILE
from .offline import DATA, LOADER, offline_page, script, tile_scripts
from .page import page_files
from .shaders import VIEWS_FOLDER
from .tiles import INDEX_FILE, TILES_FOLDER, Tiles


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
    strangers = [name for name in found if name not in ours]
    if strangers or (found and INDEX_FILE not in found):
        name = (strangers or found)[0]
        raise OutputError(f"{target}: holds other files, {name!r} for one; choose a new or empty folder")
    if found and not force:
        raise OutputError(f"{target}: an earlier export is there; choose another folder, or give --force to replace it")


def export_page(tiles: Tiles, target: Path, *, offline: bool = False) -> int:
    """Write the page with all tiles; the folder appears whole or not at all, in place of an earlier export.

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
