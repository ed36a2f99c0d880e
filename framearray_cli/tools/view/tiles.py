"""The page's pictures: JPEG tiles of the array's images, made once and kept in a folder.

    index.json                what the page needs to know of the array
    tiles/KEY/c0012.jpg       sheet: small pictures of camera 12 under all lights, row by row
    tiles/KEY/c0012.l003.jpg  one picture, full size

A tile has the file time of its image, a sheet that of its newest image. So only tiles of images that were rendered
again are made again.
"""

import json
import os
import shutil
import threading
from collections.abc import Sequence
from concurrent.futures import ThreadPoolExecutor
from contextlib import suppress
from dataclasses import replace
from functools import lru_cache
from pathlib import Path
from typing import Any

import numpy as np

from framearray_cli.array.images.images import read_layers
from framearray_cli.array.images.png import encode_jpeg
from framearray_cli.array.manifest import Manifest, layers_path
from framearray_cli.base.arrays import Bytes
from framearray_cli.base.errors import OutputError
from framearray_cli.base.files import reason, whole_file, write_bytes

from .coding import Coding, encode
from .index import index_table, sheet_layout
from .streams import Stream, choose_coding, layer_streams, read_values, source_file, streams_of

INDEX_FILE = "index.json"
TILES_FOLDER = "tiles"
# 4:4:4. At 90 files are a quarter larger, and the error in a noisy picture is 3.3 codes instead of 4.1.
QUALITY = 85
KEPT_LAYER_FILES = 6  # a file holds all layers of a camera; codings are chosen from the same number of files


class Tiles:
    """The tiles of one array in a folder; missing and outdated ones are made on demand. Threads may share it.

    Attributes:
        manifest: of the array.
        folder: of index and tiles.
        streams: of the array, with their codings.
    """

    def __init__(self, manifest: Manifest, folder: Path, threads: int = 1) -> None:
        """Choose the codings, delete tiles of other codings, and write the index.

        Raises:
            OutputError: the folder cannot be written to.
        """
        self.manifest, self.folder = manifest, folder
        self._read_layers = lru_cache(KEPT_LAYER_FILES)(read_layers)
        self.streams = self._with_codings(threads)
        self.layout = sheet_layout(manifest.resolution, max(stream.n for stream in self.streams))
        self._by_key = {stream.key: stream for stream in self.streams}
        self._locks = {(stream.key, c): threading.Lock() for stream in self.streams for c in range(manifest.n_cameras)}
        self._slots = threading.BoundedSemaphore(threads)
        self.stopping = threading.Event()
        table = index_table(manifest, self.streams, self.layout)
        if _read_index(folder / INDEX_FILE) != table:
            _remove(folder / TILES_FOLDER)
            write_bytes(folder / INDEX_FILE, json.dumps(table, indent=1).encode())

    def _with_codings(self, threads: int) -> list[Stream]:
        manifest = self.manifest
        found = streams_of(manifest)
        for c in range(manifest.n_cameras if manifest.layers else 0):
            with suppress(OutputError):  # not rendered yet, or damaged
                found += layer_streams(self._read_layers(layers_path(manifest, c)))
                break
        # One task for all layers: they are in the same files.
        pictures = [stream for stream in found if stream.role != "layer"]
        layers = [stream for stream in found if stream.role == "layer"]
        with ThreadPoolExecutor(threads) as pool:
            tasks = [pool.submit(self._codings, some) for some in (layers, *([stream] for stream in pictures))]
            codings = {key: coding for task in tasks for key, coding in task.result().items()}
        return [replace(stream, coding=codings[stream.key]) for stream in found]

    def _codings(self, streams: Sequence[Stream]) -> dict[str, Coding]:
        return {stream.key: choose_coding(self.manifest, stream, self._read_layers) for stream in streams}

    @property
    def n_pictures(self) -> int:
        """The number of full-size tiles."""
        return self.manifest.n_cameras * sum(stream.n for stream in self.streams)

    def tile_path(self, key: str, c: int, l: int | None) -> Path:
        """Return the path of a tile, or of a sheet if l is None."""
        name = f"c{c:04d}.jpg" if l is None else f"c{c:04d}.l{l:03d}.jpg"
        return self.folder / TILES_FOLDER / key / name

    def ensure_tile(self, key: str, c: int, l: int | None) -> Path:
        """Return the path of a tile, or of a sheet if l is None; make it if it is missing or out of date.

        Raises:
            OutputError: the array has no such tile, or its image is missing or damaged.
        """
        stream = self._by_key.get(key)
        if stream is None or not 0 <= c < self.manifest.n_cameras or not 0 <= (l or 0) < stream.n:
            raise OutputError(f"{self.folder}: no tile {key}, camera {c}, position {l}")
        path = self.tile_path(key, c, l)
        if l is not None:
            time_ns = self._time(stream, c, l)
            if not _is_fresh(path, time_ns):
                self._write_full(stream, c, l, time_ns)
        elif not self._sheet_is_fresh(stream, c):
            with self._slots:
                problems = self.prepare(stream, c)
            if len(problems) == stream.n:
                raise problems[0]
        return path

    def prepare(self, stream: Stream, c: int) -> list[OutputError]:
        """Make all tiles of one stream and camera that are not up to date.

        Returns:
            The errors of missing or damaged images; their places in the sheet are black.
        """
        with self._locks[stream.key, c]:
            problems: list[OutputError] = []
            times = [self._time_or_problem(stream, c, l, problems) for l in range(stream.n)]
            newest = max(times)
            fulls = [_is_fresh(self.tile_path(stream.key, c, l), time) for l, time in enumerate(times) if time]
            if not newest or (all(fulls) and _is_fresh(self.tile_path(stream.key, c, None), newest)):
                return problems
            sheet = np.zeros((*self.layout.sheet(stream.n), 3), np.uint8)
            for l, time_ns in enumerate(times):
                if self.stopping.is_set():
                    return problems
                if not time_ns:
                    continue
                try:
                    values = read_values(self.manifest, stream, c, l, self._read_layers)
                except OutputError as problem:
                    problems.append(problem)
                    continue
                path = self.tile_path(stream.key, c, l)
                if not _is_fresh(path, time_ns):
                    _write_tile(path, encode(values, stream.coding), time_ns)
                sheet[self.layout.part(l)] = encode(self.layout.reduce(values), stream.coding)
            _write_tile(self.tile_path(stream.key, c, None), sheet, newest)
            return problems

    def _write_full(self, stream: Stream, c: int, l: int, time_ns: int) -> None:
        values = read_values(self.manifest, stream, c, l, self._read_layers)
        _write_tile(self.tile_path(stream.key, c, l), encode(values, stream.coding), time_ns)

    def _sheet_is_fresh(self, stream: Stream, c: int) -> bool:
        times = [self._time_or_problem(stream, c, l, []) for l in range(stream.n)]
        return any(times) and _is_fresh(self.tile_path(stream.key, c, None), max(times))

    def _time(self, stream: Stream, c: int, l: int) -> int:
        path = source_file(self.manifest, stream, c, l)
        try:
            return path.stat().st_mtime_ns
        except OSError as error:
            raise OutputError(f"{path}: cannot be read: {reason(error)}") from error

    def _time_or_problem(self, stream: Stream, c: int, l: int, problems: list[OutputError]) -> int:
        """Return the file time of an image; if it is missing, 0, and add a problem."""
        try:
            return self._time(stream, c, l)
        except OutputError as problem:
            problems.append(problem)
            return 0


def _write_tile(path: Path, codes: Bytes, time_ns: int) -> None:
    if codes.shape[2] == 1:
        codes = np.repeat(codes, 3, axis=2)
    with whole_file(path) as part:
        part.write_bytes(encode_jpeg(codes, QUALITY))
        os.utime(part, ns=(time_ns, time_ns))


def _is_fresh(path: Path, time_ns: int) -> bool:
    try:
        return path.stat().st_mtime_ns == time_ns
    except OSError:
        return False


def _read_index(path: Path) -> Any:
    """Read the index of an earlier run; None if it is missing or damaged."""
    try:
        return json.loads(path.read_bytes())
    except (OSError, ValueError):
        return None


def _remove(folder: Path) -> None:
    try:
        if folder.exists():
            shutil.rmtree(folder)
    except OSError as error:
        raise OutputError(f"{folder}: cannot be removed: {reason(error)}") from error
