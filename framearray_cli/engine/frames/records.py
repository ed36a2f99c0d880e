"""Columns of hits: all that is kept of a hit until the last frame that shows it is composed."""

import math
from collections.abc import Callable, Iterable, Mapping, Sequence
from dataclasses import dataclass, field
from threading import Lock
from typing import Any, NamedTuple, TypeAlias

import numpy as np

from framearray_cli.base.arrays import Bytes, Float32, Int32, reshaped, with_room

from ..kernels.simd import LANES


class Column(NamedTuple):
    """An array with a row per hit, or per frame and hit.

    Attributes:
        name: unique among all columns.
        shape: of a row; () is one number.
        dtype: of its numbers.
        packed: True if it is kept only of hits whose first number is above 0, next to their light; see `LightStore`.
        usual: of a column per frame, the number that most hits have in all frames; only others are kept, see `Rare`.
    """

    name: str
    shape: tuple[int, ...] = ()
    dtype: Any = np.float32
    packed: bool = False
    usual: Any = None

    @property
    def nbytes(self) -> int:
        """Bytes per hit."""
        return int(np.dtype(self.dtype).itemsize) * math.prod(self.shape)


class StoredLight(NamedTuple):
    """The size of the light that a hit keeps: all columns that depend on lights follow from it."""

    n_sources: int
    channels: int
    n_lights: int

    @property
    def values(self) -> int:
        """Numbers per hit."""
        return self.channels * self.n_lights


ROW = Column("row", (LANES,))  # see `hits/row.py`
ADDRESS = Column("light", (), np.int64)  # of the light that is kept of a hit, see `kept_light.py`


def light_columns(light: StoredLight) -> tuple[Column, ...]:
    """The columns of every hit of a batch: its row, and E[l]."""
    return ROW, Column("irradiance", (light.channels, light.n_lights))


def bytes_per_hit(columns: Iterable[Column]) -> int:
    """Bytes that some columns need per hit, or per frame and hit."""
    return sum(column.nbytes for column in columns)


@dataclass(slots=True, eq=False)
class HitRecords:
    """Columns of n hits.

    Attributes:
        arrays: (n, *shape) by the name of the column.
    """

    arrays: dict[str, Any]

    @property
    def row(self) -> Float32:
        """(n, LANES) see `hits/row.py`."""
        found: Float32 = self.arrays["row"]
        return found

    @property
    def irradiance(self) -> Float32:
        """(n, channels, n_lights) E[l]."""
        found: Float32 = self.arrays["irradiance"]
        return found

    def __getitem__(self, name: str) -> Any:
        return self.arrays[name]

    def __contains__(self, name: str) -> bool:
        return name in self.arrays

    def with_light(self, light: "HitRecords") -> "HitRecords":
        """The columns of n hits, together with the first n rows of others; shares memory."""
        n = len(self.row)
        return HitRecords(self.arrays | {name: array[:n] for name, array in light.arrays.items()})

    def part(self, span: slice) -> "HitRecords":
        """The columns of some of the hits; shares memory."""
        return HitRecords({name: array[span] for name, array in self.arrays.items()})


PIECE_BYTES = 1 << 24  # that blocks are cut from; numpy asks for huge pages from 4 MiB on


class ArrayPool:
    """Arrays of hits that the window dropped, by name, for the next eye: fresh pages cost the system more.

    Neighbour eyes have about the same number of hits.

    Attributes:
        lent: bytes of arrays that were taken and not given back; `peak`: the most so far.
    """

    def __init__(self) -> None:
        self.lent = self.peak = 0
        self._free: dict[Any, list[Any]] = {}  # by name and dtype, and blocks by size
        self._lock = Lock()

    def take(self, name: str, shape: tuple[int, ...], dtype: Any) -> Any:
        """Take an array of a shape, contents arbitrary; free arrays of that name that do not fit are released."""
        with self._lock:
            array, free = None, self._free.get((name, np.dtype(dtype)), [])
            while free and array is None:
                array = reshaped(free.pop(), shape)
            if array is None:
                array = with_room(shape, dtype)
            self.lent += array.nbytes
            self.peak = max(self.peak, self.lent)
        return array

    def give(self, name: str, array: Any) -> None:
        """Return an array that is not read any more."""
        with self._lock:
            self.lent -= array.nbytes
            self._free.setdefault((name, array.dtype), []).append(array)

    def take_block(self, size: int) -> Bytes:
        """Take a block of bytes, contents arbitrary. Blocks are cut from pieces that have huge pages."""
        with self._lock:
            free = self._free.setdefault(size, [])
            if not free:
                piece: Bytes = with_room((max(PIECE_BYTES // size, 1) * size,), np.uint8)
                free.extend(piece[first : first + size] for first in reversed(range(0, len(piece), size)))
            self.lent += size
            self.peak = max(self.peak, self.lent)
            block: Bytes = free.pop()
        return block

    def give_block(self, block: Bytes) -> None:
        """Return a block that is not read any more."""
        with self._lock:
            self.lent -= len(block)
            self._free.setdefault(len(block), []).append(block)

    def release(self) -> None:
        """Return to the system what is not lent."""
        with self._lock:
            self._free.clear()


Take: TypeAlias = Callable[[str, tuple[int, ...], Any], Any]  # an array of a name, shape and dtype


def fresh_array(_name: str, shape: tuple[int, ...], dtype: Any) -> Any:
    """Allocate a new array; its contents are arbitrary."""
    return with_room(shape, dtype)


def empty_records(columns: Iterable[Column], n: int, take: Take = fresh_array) -> HitRecords:
    """Allocate columns of n hits; contents are arbitrary."""
    return HitRecords({column.name: take(column.name, (n, *column.shape), column.dtype) for column in columns})


def empty_by_frame(columns: Iterable[Column], n_frames: int, n: int, take: Take = fresh_array) -> dict[str, Any]:
    """Allocate columns per frame and hit, (n_frames, n, *shape); contents are arbitrary."""
    return {column.name: take(column.name, (n_frames, n, *column.shape), column.dtype) for column in columns}


class Rare(NamedTuple):
    """A column per frame and hit, of the hits that have unusual numbers in any frame.

    Attributes:
        hits: (n,) their numbers, rising.
        values: (n_frames, n, *shape).
    """

    hits: Int32
    values: Any


def split_columns(columns: Iterable[Column]) -> tuple[list[Column], list[Column]]:
    """Split columns into dense ones, kept of all hits, and rare ones, kept of hits with unusual numbers."""
    found: tuple[list[Column], list[Column]] = [], []
    for column in columns:
        found[column.usual is not None].append(column)
    return found


def rare_numbers(columns: Iterable[Column], by_frame: Mapping[str, Any], first: int) -> dict[str, Rare]:
    """Find the unusual numbers of some columns of a batch, (n_frames, n, *shape), which begins with hit `first`."""
    found = {}
    for column in columns:
        values = by_frame[column.name]
        hits = np.flatnonzero((values != column.usual).any(axis=(0, *range(2, values.ndim))))
        found[column.name] = Rare((hits + first).astype(np.int32), values[:, hits])
    return found


def joined_numbers(parts: Sequence[Mapping[str, Rare]]) -> dict[str, Rare]:
    """Join the unusual numbers of batches, in their order."""
    names = parts[0] if parts else ()
    return {
        name: Rare(
            np.concatenate([part[name].hits for part in parts]),
            np.concatenate([part[name].values for part in parts], axis=1),
        )
        for name in names
    }


@dataclass(slots=True, kw_only=True, eq=False)
class HitsByPixel:
    """Hits sorted by the pixel of one frame that they fall into; see `sort_by_pixel`.

    Attributes:
        start: (n_pixels + 1,) hits order[start[p] : start[p + 1]] fall into pixel p.
        order: (n,) numbers of hits.
    """

    start: Int32
    order: Int32


@dataclass(slots=True, kw_only=True, eq=False)
class FrameHits:
    """The hits that an eye found.

    Attributes:
        records: of the native hits.
        frames: those that may see the hits.
        by_frame: columns per frame and hit, (n_frames, n, *shape); row r is of frame frames[r].
        rare: columns of which only unusual numbers are kept.
        undimmed: what glass dims of the hits behind it, by the name of the column, once a frame has shown them.
        places: frame j -> the hits by the pixel of j that sees them.
        mirrored, mirror_places: reflected hits of mirror pixels of the eye's frame; None without any.
        mirror_hits: (2, n_pixels) the number of native hits of each pixel whose mirrors were followed, with even and
            with odd sample numbers; (2, 0) without mirrors.
        pooled: arrays of the above, without those for reflected hits, by their name in the pool.
        pooled_mirrors: arrays of reflected hits.
        stores: see `LightStore`, of native and of reflected hits.
    """

    eye: int
    records: HitRecords
    frames: range
    by_frame: dict[str, Any]
    places: dict[int, HitsByPixel]
    mirrored: HitRecords | None = None
    mirror_places: HitsByPixel | None = None
    mirror_hits: Int32 = field(default_factory=lambda: np.zeros((2, 0), np.int32))
    pooled: dict[str, Any] = field(default_factory=dict)
    pooled_mirrors: dict[str, Any] = field(default_factory=dict)
    stores: tuple[Any, ...] = ()
    rare: dict[str, Rare] = field(default_factory=dict)
    undimmed: dict[str, Any] = field(default_factory=dict)

    def seen_in(self, j: int) -> Mapping[str, Any]:
        """The columns per frame and hit, of frame j."""
        return {name: array[self.frames.index(j)] for name, array in self.by_frame.items()}

    def forget_mirrors(self, arrays: ArrayPool) -> None:
        """Return the arrays of reflected hits to the pool; the eye's frame cannot be composed afterwards."""
        for name, array in self.pooled_mirrors.items():
            arrays.give(name, array)
        self.mirrored = self.mirror_places = None
        self.pooled_mirrors = {}
        for store in self.stores[1:]:
            store.put_back()

    def put_back(self, arrays: ArrayPool) -> None:
        """Return all other arrays to the pool; the hits must not be read afterwards."""
        for name, array in self.pooled.items():
            arrays.give(name, array)
        for store in self.stores[:1]:
            store.put_back()
