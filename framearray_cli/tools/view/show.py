"""Show an array in the browser, and prepare its tiles."""

import threading
import webbrowser
from collections.abc import Callable, Iterator
from concurrent.futures import as_completed
from contextlib import contextmanager
from pathlib import Path

from framearray_cli.array.manifest import Manifest
from framearray_cli.array.manifest_toml import read_manifest
from framearray_cli.base.errors import OutputError
from framearray_cli.base.files import make_folder
from framearray_cli.base.threads import TaskPool

from .clips import LENGTH
from .server import LOOPBACK, PageServer
from .tiles import Tiles

CACHE_FOLDER = ".view"  # of the tiles, next to the images


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


def prepare_all(tiles: Tiles, threads: int, progress: Callable[[int], None]) -> list[OutputError]:
    """Make every tile that is missing or out of date; an interrupt keeps the finished ones.

    Args:
        progress: called with the number of pictures just prepared.

    Returns:
        The errors of damaged images.
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
    if c % LENGTH == 0:
        tiles.prepare_layers(c)
    return problems
