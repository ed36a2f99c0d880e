"""Show an array in the browser, or export the page."""

import os
import threading
import time
import webbrowser
from collections.abc import Callable, Iterator, Sequence
from concurrent.futures import as_completed
from contextlib import contextmanager, suppress
from pathlib import Path

from framearray_cli.array.images import format_name, require_writer
from framearray_cli.array.manifest import Manifest
from framearray_cli.array.manifest_toml import read_manifest
from framearray_cli.base.errors import JobError, OutputError
from framearray_cli.base.files import make_folder
from framearray_cli.base.threads import TaskPool, sleep_until_stopped

from ..display import View
from .access import LOOPBACK
from .index import page_views
from .pagefiles import check_target, export_page
from .server import PageServer
from .streams import KEY, is_clipped, make_turning, streams_of
from .tiles import Tiles

LOOK_S = 3.0  # between two looks at an array that is being rendered
CACHE_FOLDER = ".view"  # of the tiles, next to the images


def open_tiles(
    out: Path, cache: Path | None, threads: int, environment: Path | None = None, views: Sequence[View] = ()
) -> Tiles:
    """Read an array's manifest and open its tiles.

    Args:
        out: output folder of a render, or its manifest.
        cache: folder of the tiles; None: next to the images.
        threads: that read images at once.
        environment: map that lights the pictures, and turns, instead of light positions.
        views: that the page offers, the one that it starts with first.

    Raises:
        JobError: the array's images are clipped for screens already, or a view has no shader.
        OutputError: the manifest or the map cannot be read, the array cannot be lit by a map, or the folder cannot be
            written to.
    """
    return tiles_of(read_manifest(out), cache, threads, environment, views)


def tiles_of(
    manifest: Manifest, cache: Path | None, threads: int, environment: Path | None = None, views: Sequence[View] = ()
) -> Tiles:
    """Open the tiles of an array; see `open_tiles`."""
    turning = make_turning(manifest, environment) if environment is not None else None
    require_writer("jpg")
    if views and turning is None and is_clipped(manifest, streams_of(manifest)[0]):
        kind = format_name(manifest.images).upper()
        raise JobError(
            "--view", [f"{manifest.directory}: its images are {kind}, clipped at 1 already; render EXR for views"]
        )
    shaders = page_views(views)
    folder = manifest.directory / CACHE_FOLDER if cache is None else cache
    folder = folder / KEY if turning else folder
    try:
        make_folder(folder)
        return Tiles(manifest, folder, threads, turning=turning, views=shaders)
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


def show_page(
    tiles: Tiles,
    *,
    port: int,
    host: str,
    browser: bool,
    threads: int,
    opened: Callable[[str], None],
    progress: Callable[[int], None],
    prepared: Callable[[list[OutputError]], None],
    grown: Callable[[int, int], None],
) -> None:
    """Serve the page until the process is told to end; prepare the tiles meanwhile.

    Args:
        opened: called with the address.
        progress: called with the number of pictures just prepared.
        prepared: called once all that are there are, with the errors of damaged images; again when the array is whole.
        grown: called with the number of images that are there, and in the array, while it lacks some, and once it is
            whole.
    """
    with open_server(tiles, port, host, threads) as server:
        opened(server.url)
        if browser:
            open_browser(server.url)
        there, images = server.look()["images"]
        prepared(prepare_all(tiles, threads, progress))
        if there < images:
            _follow(server, grown)
            prepared(prepare_all(server.settle(), threads, progress))
        sleep_until_stopped()


def open_browser(url: str) -> None:
    """Open a page in the browser, without waiting for it."""
    threading.Thread(target=webbrowser.open, args=(url,), daemon=True).start()


def _follow(server: PageServer, grown: Callable[[int, int], None]) -> None:
    """Watch an array until it has all its images."""
    while True:
        with suppress(OutputError):  # it is just being removed, or rendered again
            there, images = server.look()["images"]
            grown(there, images)
            if there == images:
                return
        time.sleep(LOOK_S)


def write_page(
    tiles: Tiles,
    target: Path,
    *,
    threads: int,
    progress: Callable[[int], None],
    force: bool = True,
    offline: bool = False,
) -> tuple[int, list[OutputError]]:
    """Prepare all tiles, and export the page.

    Args:
        force: replace an earlier export.
        offline: write a page that can be opened as a file, too.

    Returns:
        The number of bytes written, and the errors of damaged images.

    Raises:
        OutputError: the target holds other files or cannot be written.
    """
    target = Path(os.path.realpath(target))  # "." has no name for a folder next to it
    check_target(target, force=force)
    problems = prepare_all(tiles, threads, progress)
    return export_page(tiles, target, offline=offline), problems


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
