"""Makes all tiles of an array, on all cores, before anybody asks for them."""

from collections.abc import Callable
from concurrent.futures import ThreadPoolExecutor, as_completed

from framearray_cli.base.errors import OutputError

from .tiles import Tiles


def prepare_all(tiles: Tiles, threads: int, progress: Callable[[int], None]) -> list[OutputError]:
    """Make every tile that is missing or out of date; what is made stays when this is interrupted.

    Args:
        progress: called with the number of pictures that became ready.

    Returns:
        What is wrong with images that are missing or damaged.

    Raises:
        OutputError: a tile cannot be written.
    """
    problems: list[OutputError] = []
    # All streams of a camera go to one thread, in turn: its layers are in one file, which is read once.
    with ThreadPoolExecutor(threads, thread_name_prefix="tiles") as pool:
        try:
            tasks = [pool.submit(_camera, tiles, c, progress) for c in range(tiles.manifest.n_cameras)]
            for task in as_completed(tasks):
                problems += task.result()
        except BaseException:
            tiles.stopping.set()
            pool.shutdown(wait=True, cancel_futures=True)
            raise
    return problems


def _camera(tiles: Tiles, c: int, progress: Callable[[int], None]) -> list[OutputError]:
    problems = []
    for stream in tiles.streams:
        if tiles.stopping.is_set():
            break
        problems += tiles.prepare(stream, c)
        progress(stream.n)
    return problems
