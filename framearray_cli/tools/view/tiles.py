"""The page's pictures: JPEG tiles of the array's images, made once and kept in a folder.

    index.json                what the page needs to know of the array
    tiles/KEY/c0012.jpg       sheet: small pictures of camera 12 under all lights, row by row
    tiles/KEY/c0012.l003.jpg  one picture, full size
    tiles/KEY/c0012.l012.clip  for an export: light positions 12 to 23, a line with the stamp, then a file of `clips.py`
    tiles/KEY/c0012.clip      the same of a layer: cameras 12 to 23

A tile is made again if its stamp has changed, see `coding.py`. An array may still be rendered, so files may be missing,
and appear at any time and in any order.
"""

import json
import shutil
import threading
from collections.abc import Mapping, Sequence
from contextlib import ExitStack, suppress
from dataclasses import replace
from functools import lru_cache, partial
from pathlib import Path
from tempfile import TemporaryDirectory
from typing import Any

import numpy as np

from framearray_cli.array.coarsearray import COARSE_FOLDER, CoarseArray, read_coarse
from framearray_cli.array.images import encode_jpeg, read_layers
from framearray_cli.array.integrity import list_present
from framearray_cli.array.manifest import FILE_NAME, Manifest, file_name, layers_path
from framearray_cli.array.manifest_toml import read_manifest
from framearray_cli.base.arrays import Bytes, Float32
from framearray_cli.base.errors import OutputError
from framearray_cli.base.files import reason, write_bytes
from framearray_cli.base.threads import TaskPool
from framearray_cli.base.units import size

from .clips import CHOICES, DECODER, LENGTH, MARGIN, Clips
from .coding import QUALITY, Source, encode, is_fresh, source_of, stamp_of, write_tile
from .index import contents_table, index_table, sheet_layout
from .streams import Stream, choose_coding, largest_value, layer_streams, read_values, streams_of

INDEX_FILE = "index.json"
TILES_FOLDER = "tiles"
TILES_DEPEND_ON = ("format", "fingerprint", "resolution", "n_cameras", "axes", "small", "streams")  # keys of the index
NO_BOUNDS: Mapping[str, float] = {}
KEPT_LAYER_FILES = 6  # a file has all layers of a camera; codings are chosen from the same number of files
SAMPLED = 3  # cameras that the size of an export is judged by
LAYER_CODES = 1 << 28  # bytes of layers that wait for their clips, in each thread
COARSE_URL = "coarse/"  # before the addresses of its tiles


class Tiles:
    """The tiles of one array in a folder; missing and outdated ones are made on demand. Threads may share it.

    Attributes:
        manifest: of the array.
        folder: of index and tiles.
        streams: of the array, with their codings.
        largest: value of each stream in a sample of its pictures.
        index: table of `index.json`.
        clips: how an export codes pictures; None: each as a JPEG of its size.
    """

    clips: Clips | None = None

    def __init__(
        self,
        manifest: Manifest,
        folder: Path,
        threads: int = 1,
        *,
        discard: bool = True,
        bounds: Mapping[str, float] = NO_BOUNDS,
    ) -> None:
        """Choose the codings, and write the index.

        Args:
            discard: delete tiles of other codings, which no thread may be making meanwhile.
            bounds: by stream, a value that its pictures will reach; few of them may be there.

        Raises:
            OutputError: the folder cannot be written to.
        """
        self.manifest, self.folder, self._threads = manifest, folder, threads
        self._bounds = bounds
        self._read_layers = lru_cache(KEPT_LAYER_FILES)(read_layers)
        self._manifest_source = source_of(manifest.directory / FILE_NAME)
        present = list_present(manifest)
        self._n_sources, self._lacks = present.count(), bool(present.incomplete())
        self.streams, self.largest = self._with_codings()
        self.layout = sheet_layout(manifest.resolution, max(stream.n for stream in self.streams))
        self._by_key = {stream.key: stream for stream in self.streams}
        self._locks = {(stream.key, c): threading.Lock() for stream in self.streams for c in range(manifest.n_cameras)}
        self._slots = threading.BoundedSemaphore(threads)  # of sheets
        self._pictures = threading.BoundedSemaphore(2 * threads)  # a drag must not wait for a sheet; memory is limited
        self.stopping = threading.Event()
        self.index = index_table(manifest, self.streams, self.layout)
        old = _read_index(folder / INDEX_FILE)
        if discard and any(old.get(key) != self.index[key] for key in TILES_DEPEND_ON):
            _remove(folder / TILES_FOLDER)
        if old != self.index:
            write_bytes(folder / INDEX_FILE, json.dumps(self.index, indent=1).encode())

    def contents(self, *, live: bool) -> dict[str, Any]:
        """Return the table of `contents.json`."""
        return contents_table(self.manifest, self.streams, self.index["digest"], live=live)

    def renewed(self, bounds: Mapping[str, float] = NO_BOUNDS) -> "Tiles":
        """Return these tiles, or new ones if the array has changed so much that index and codings must be chosen anew.

        That is so if it was rendered again, or if twice as many files are there as when the codings were chosen.

        Args:
            bounds: by stream, a value that its pictures will reach.
        """
        manifest, source = self.manifest, source_of(self.manifest.directory / FILE_NAME)
        if source != self._manifest_source:
            manifest, self._manifest_source = read_manifest(manifest.directory), source
        same = replace(manifest, summary={}) == replace(self.manifest, summary={})
        found, before = list_present(manifest).count(), self._n_sources
        if same and (found <= before or found < 2 * before):
            return self
        bounds = {key: max(value, bounds.get(key, 0.0)) for key, value in (dict(bounds) | self.largest).items()}
        return Tiles(manifest, self.folder, self._threads, discard=False, bounds=bounds)

    def settled(self) -> "Tiles":
        """Return tiles of the array as it is, with the codings of an array that is opened now."""
        return Tiles(self.manifest, self.folder, self._threads, discard=False)

    def _with_codings(self) -> tuple[list[Stream], dict[str, float]]:
        manifest = self.manifest
        found = streams_of(manifest)
        for c in range(manifest.n_cameras if manifest.layers else 0):
            with suppress(OutputError):  # not rendered yet, or damaged
                found += layer_streams(manifest.layers, self._read_layers(layers_path(manifest, c)))
                break
        # One task for all layers: they are in the same files.
        pictures = [stream for stream in found if stream.role != "layer"]
        layers = [stream for stream in found if stream.role == "layer"]
        with TaskPool(self._threads) as pool:
            tasks = [pool.submit(self._largest, some) for some in (layers, *([stream] for stream in pictures))]
            largest = {key: value for task in tasks for key, value in task.result().items()}
        return [replace(stream, coding=choose_coding(stream, largest[stream.key])) for stream in found], largest

    def _largest(self, streams: Sequence[Stream]) -> dict[str, float]:
        """Return the largest value of some streams in a sample of their pictures, or its bound if that is larger.

        Data have no room above their largest value: while images are missing, that is twice what is known.
        """
        found = {}
        for stream in streams:
            value = largest_value(self.manifest, stream, partial(self._read, stream))
            bound = self._bounds.get(stream.key, 0.0)
            room = 1 if stream.exposed or not self._lacks else 2
            found[stream.key] = bound if value <= bound else room * value
        return found

    def _read(self, stream: Stream, c: int, l: int) -> Float32:
        return read_values(self.manifest, stream, c, l, self._read_layers)

    @property
    def n_pictures(self) -> int:
        """The number of full-size tiles."""
        return self.manifest.n_cameras * sum(stream.n for stream in self.streams)

    def tile_path(self, key: str, c: int, l: int | None) -> Path:
        """Return the path of a tile, or of a sheet if l is None."""
        name = f"c{c:04d}.jpg" if l is None else f"c{c:04d}.l{l:03d}.jpg"
        return self.folder / TILES_FOLDER / key / name

    def in_clips(self, stream: Stream) -> bool:
        """True if full-size pictures of a stream are in clips: along the light, or of layers along the cameras."""
        return self.clips is not None and (stream.n > 1 or stream.role == "layer")

    @property
    def layer_clips(self) -> list[Stream]:
        """The streams whose clips go along the cameras."""
        return [stream for stream in self.streams if self.clips and stream.role == "layer"]

    def layer_clip_path(self, stream: Stream, first: int) -> Path:
        """Return the path of the clip of a layer from a camera on."""
        return self.tile_path(stream.key, first, None).with_suffix(".clip")

    def tile_files(self, stream: Stream, c: int) -> list[tuple[Path, range]]:
        """List the files of full-size pictures of a stream and camera alone, with their light positions."""
        if stream in self.layer_clips:
            return []
        length, suffix = (LENGTH, ".clip") if self.in_clips(stream) else (1, ".jpg")
        return [
            (self.tile_path(stream.key, c, l).with_suffix(suffix), range(l, min(l + length, stream.n)))
            for l in range(0, stream.n, length)
        ]

    def export_index(self) -> dict[str, Any]:
        """Return the table of `index.json` of an export."""
        if self.clips is None:
            return self.index
        resolution = [-(-side // self.clips.factor) for side in self.manifest.resolution]
        small = self.index["small"] | {"factor": self.layout.factor / self.clips.factor}
        clips = {"length": LENGTH, "codec": DECODER}
        return self.index | {"resolution": resolution, "small": small, "clips": clips}

    def source_path(self, key: str, c: int, l: int) -> Path:
        """Return the path of the image that a tile shows."""
        return self._file(self._stream(key, c, l), c, l)

    def _stream(self, key: str, c: int, l: int | None) -> Stream:
        stream = self._by_key.get(key)
        if stream is None or not 0 <= c < self.manifest.n_cameras or not 0 <= (l or 0) < stream.n:
            raise OutputError(f"{self.folder}: no tile {key}, camera {c}, position {l}")
        return stream

    def ensure_tile(self, key: str, c: int, l: int | None) -> Path:
        """Return the path of a tile, or of a sheet if l is None; make it if it is missing or out of date.

        Raises:
            OutputError: the array has no such tile, or its image is missing or damaged.
        """
        stream = self._stream(key, c, l)
        path = self.tile_path(key, c, l)
        if l is not None:
            stamp = self._stamp(stream, [source_of(self._file(stream, c, l))])
            if not is_fresh(path, stamp):
                with self._pictures:
                    write_tile(path, self._codes(stream, self._read(stream, c, l)), stamp)
            return path
        stamp = self._stamp(stream, self._sources(stream, c))
        if not stamp:
            raise OutputError(f"{self._file(stream, c, 0)}: no such file")
        if not is_fresh(path, stamp):
            with self._slots:
                problems = self.prepare(stream, c)
            if problems and not path.exists():
                raise problems[0]
        return path

    def prepare(self, stream: Stream, c: int) -> list[OutputError]:
        """Make all tiles of one stream and camera that are not up to date, of the images that are there.

        Returns:
            The errors of damaged images; in the sheet their places are black, as for missing images.
        """
        with self._locks[stream.key, c]:
            problems: list[OutputError] = []
            sources = self._sources(stream, c)
            files = [
                (path, lights, self._stamp(stream, [sources[l] for l in lights], self.clips))
                for path, lights in self.tile_files(stream, c)
            ]
            stale = {path for path, _, stamp in files if stamp and not is_fresh(path, stamp)}
            sheet_path = self.tile_path(stream.key, c, None)
            files = files or [(sheet_path, range(1), "")]  # `prepare_layers` makes the clips
            if not any(sources) or (not stale and is_fresh(sheet_path, self._stamp(stream, sources))):
                return problems
            sheet = np.zeros((*self.layout.sheet(stream.n), 3), np.uint8)
            for path, lights, stamp in files:
                pictures: dict[int, Bytes] = {}
                for l in lights:
                    if self.stopping.is_set():
                        return problems
                    if sources[l] is None:
                        continue
                    try:
                        values = self._read(stream, c, l)
                    except OutputError as problem:
                        problems.append(problem)
                        sources[l] = None  # the sheet is made again when it can be read
                        continue
                    if path in stale:
                        pictures[l] = self._codes(stream, values)
                    sheet[self.layout.part(l)] = encode(self.layout.reduce(values), stream.coding)
                if pictures:
                    self._write(path, [pictures.get(l) for l in lights], stamp, self.clips)
            if any(sources):
                write_tile(sheet_path, sheet, self._stamp(stream, sources))
            return problems

    def prepare_layers(self, first: int) -> None:
        """Make the clips of layers from a camera on that are not up to date, of the files that are there."""
        cameras = range(first, min(first + LENGTH, self.manifest.n_cameras))
        stale: dict[Path, tuple[Stream, str]] = {}
        for stream in self.layer_clips:
            path = self.layer_clip_path(stream, first)
            stamp = self._stamp(stream, [source_of(self._file(stream, c, 0)) for c in cameras], self._clips_of(stream))
            if stamp and not is_fresh(path, stamp):
                stale[path] = stream, stamp
        # A file has all layers of a camera: as many at once as memory has room for.
        width, height = self.manifest.resolution
        at_once = max(1, LAYER_CODES // (3 * width * height * LENGTH))
        for k in range(0, len(stale), at_once):
            codes: dict[Path, list[Bytes | None]] = {path: [] for path in list(stale)[k : k + at_once]}
            for c in cameras:
                for path, pictures in codes.items():
                    if self.stopping.is_set():
                        return
                    pictures.append(None)
                    with suppress(OutputError):  # missing, or damaged, as the sheet says
                        pictures[-1] = self._codes(stale[path][0], self._read(stale[path][0], c, 0))
            for path, pictures in codes.items():
                if any(one is not None for one in pictures):
                    stream, stamp = stale[path]
                    self._write(path, pictures, stamp, self._clips_of(stream))

    def _codes(self, stream: Stream, values: Float32) -> Bytes:
        """Return the codes of a full-size picture, (h, w, 3)."""
        if self.clips and self.clips.factor > 1:
            values = replace(self.layout, factor=self.clips.factor).reduce(values)
        return _in_colour(encode(values, stream.coding))

    def _clips_of(self, stream: Stream) -> Clips | None:
        return self.clips.of_layers if self.clips and stream.role == "layer" else self.clips

    def _write(self, path: Path, pictures: Sequence[Bytes | None], stamp: str, clips: Clips | None) -> None:
        """Write the file of some pictures; in a clip those that are missing are black."""
        there = [codes for codes in pictures if codes is not None]
        if clips and path.suffix == ".clip":
            black = np.zeros_like(there[0])
            clip = clips.encode([black if codes is None else codes for codes in pictures])
            write_bytes(path, stamp.encode() + b"\n" + clip)
        else:
            write_tile(path, there[0], stamp)

    def fit_clips(self, most: float) -> None:
        """Choose the best clips that keep all files within a number of bytes, judged by a few cameras.

        Raises:
            OutputError: none do, or a sampled image is missing or damaged.
        """
        n_c = self.manifest.n_cameras
        cameras = sorted({int((k + 0.5) * n_c / SAMPLED) for k in range(SAMPLED)})
        samples = []
        for stream in self.streams:
            lights = _middle_clip(stream.n)
            places = [[(c, l) for l in lights] for c in cameras]
            if stream.role == "layer":
                places = [[(c, 0) for c in _middle_clip(n_c)]]
            for some in places:
                values = [self._read(stream, c, l) for c, l in some]
                samples.append((stream.n * n_c / len(places) / len(values), stream, values))
        for self.clips in CHOICES:
            n_bytes = 0.0
            for weight, stream, values in samples:
                clips = self._clips_of(stream) if self.in_clips(stream) else None
                full = [self._codes(stream, one) for one in values]
                small = np.vstack([encode(self.layout.reduce(one), stream.coding) for one in values])
                data = clips.encode(full) if clips else encode_jpeg(full[0], QUALITY)
                n_bytes += weight * (len(data) + len(encode_jpeg(_in_colour(small), QUALITY)))
            if n_bytes <= MARGIN * most:
                return
        raise OutputError(f"--most: the pictures of this array need about {size(n_bytes / MARGIN)}")

    def _file(self, stream: Stream, c: int, l: int) -> Path:
        return self.manifest.directory / file_name(stream.files, c, l)

    def _sources(self, stream: Stream, c: int) -> list[Source | None]:
        return [source_of(self._file(stream, c, l)) for l in range(stream.n)]

    def _stamp(self, stream: Stream, sources: Sequence[Source | None], clips: Clips | None = None) -> str:
        how = (self.manifest.fingerprint, stream.coding, self.layout, *([clips.stamp] if clips else []))
        return stamp_of(repr(how), sources)


def _middle_clip(n: int) -> range:
    """Return the places of the clip in the middle of n places."""
    first = (n - 1) // 2 // LENGTH * LENGTH
    return range(first, min(first + LENGTH, n))


def _in_colour(codes: Bytes) -> Bytes:
    return np.repeat(codes, 3, axis=2) if codes.shape[2] == 1 else codes


def _read_index(path: Path) -> dict[str, Any]:
    """Read the index of an earlier run; nothing if it is missing or damaged."""
    with suppress(OSError, ValueError):
        if isinstance(table := json.loads(path.read_bytes()), dict):
            return table
    return {}


def _remove(folder: Path) -> None:
    try:
        if folder.exists():
            shutil.rmtree(folder)
    except OSError as error:
        raise OutputError(f"{folder}: cannot be removed: {reason(error)}") from error


class CoarseTiles:
    """Follows the coarse array in the folder of an array, which comes and goes; its tiles lie in a temporary folder."""

    def __init__(self, threads: int) -> None:
        self._threads, self._stack = threads, ExitStack()
        self._array: CoarseArray | None = None
        self._seen: tuple[Source | None, str] = (None, "")  # file of the manifest, and what it has to belong to
        self.tiles: Tiles | None = None

    def look(self, manifest: Manifest) -> None:
        """Look whether there is a coarse array of this array now."""
        seen = source_of(manifest.directory / COARSE_FOLDER / FILE_NAME), manifest.fingerprint
        if seen == self._seen:
            with suppress(OutputError):  # it was removed just now
                self.tiles = self.tiles and self.tiles.renewed()
            return
        self.close()
        self._seen, self._array = seen, read_coarse(manifest.directory, manifest.fingerprint) if seen[0] else None
        if self._array is not None:
            with suppress(OSError, OutputError):  # without room for its tiles the page does without
                folder = Path(self._stack.enter_context(TemporaryDirectory(ignore_cleanup_errors=True)))
                self.tiles = Tiles(self._array.manifest, folder, self._threads)

    def table(self) -> dict[str, Any] | None:
        """Return what the page needs to know of it; None if there is none."""
        if self.tiles is None or self._array is None:
            return None
        contents = self.tiles.contents(live=True)
        return {"index": self.tiles.index, "contents": contents, "places": self._array.places}

    def largest(self) -> Mapping[str, float]:
        """Return the largest value of each kind of picture, as far as known."""
        return self.tiles.largest if self.tiles else {}

    def close(self) -> None:
        """Forget it."""
        self.tiles, self._array, self._seen = None, None, (None, "")
        self._stack.close()
