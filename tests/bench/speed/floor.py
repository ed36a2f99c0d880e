"""The floor: the rays of a frame, recorded and then only traced by Embree.

A recording holds every packet that the program hands to Embree, in its order, as it is: with its idle lanes and with
the flag that says whether its rays stay together. A replay copies a few packets at a time to where they are in the
cache, and times only the calls. Left out is all work of the program itself: making rays, looking up hits, shading,
sorting, composing.
"""

import ctypes
import time
from collections import Counter
from collections.abc import Iterator, Mapping, Sequence
from concurrent.futures import ThreadPoolExecutor
from dataclasses import dataclass, replace
from threading import Lock
from typing import Any

import numba as nb
import numpy as np
from numba import types
from numpy.typing import NDArray

from bench.core.cases import Case
from framearray_cli.base.arrays import Bytes, Float32, Float64
from framearray_cli.engine.embree.masks import _pointer
from framearray_cli.engine.embree.packets import (
    GEOMETRY,
    HIT_ROWS,
    MISS,
    RAY_ROWS,
    TFAR,
    TRIANGLE,
    Tracer,
    _call,
    _trace,
    empty_packets,
)
from framearray_cli.engine.frames.frame import find_frame
from framearray_cli.engine.frames.threads import TracePool
from framearray_cli.engine.kernels.kernel import keep_on_disk
from framearray_cli.engine.kernels.simd import LANES

Indices = NDArray[np.int64]

KEPT_ROWS = (
    TFAR + 1
)  # rows of a ray: origin, tnear, direction, time, tfar; the rows after them are the same in every packet
PIECE = 256  # packets of a copy: the program, too, traces up to 4096 rays at a time
TASK = 32  # pieces that one thread takes at a time: about a batch of the program
_INTERSECT, _OCCLUDED, _COHERENT = 0, 1, 2  # bits of a packet's flags

_numba: Any = nb
_cfunc, _carray = _numba.cfunc, _numba.carray


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class Recording:
    """The packets of a frame.

    Attributes:
        rays: (n_packets, KEPT_ROWS, 16).
        flags: (n_packets,) _OCCLUDED, else first hits are looked for; _COHERENT.
        kinds: names of the kinds of rays.
        pieces: (n, 3) first packet, the one after the last, and the kind of runs of packets of one kind.
        n_rays: by kind.
        n_pixels: of an image.
    """

    rays: Float32
    flags: Bytes
    kinds: tuple[str, ...]
    pieces: Indices
    n_rays: dict[str, int]
    n_pixels: int


class _Marks(Counter[str]):
    """Counts rays by kind as the program does, and notes how many packets were recorded when each count grew."""

    def __init__(self, state: Indices) -> None:
        super().__init__()
        self._state = state
        self.ends: list[tuple[int, str]] = []

    def __setitem__(self, kind: str, count: int) -> None:
        super().__setitem__(kind, count)
        self.ends.append((int(self._state[0]), kind))


def record(case: Case, c: int, expected: float) -> Recording:
    """Record the rays of frame c; it runs on one thread.

    Args:
        expected: approximate number of rays; there is room for a quarter more.

    Raises:
        RuntimeError: Embree's own functions cannot be reached, or rays were missed.
    """
    tracer = case.setup.tracer
    if tracer.batch:
        raise RuntimeError("the floor needs Embree's C functions")
    capacity = int(1.25 * expected / LANES) + 65536
    rays, flags = np.empty((capacity, KEPT_ROWS, LANES), np.float32), np.empty(capacity, np.uint8)
    state = np.array([0, capacity, rays.ctypes.data, flags.ctypes.data, tracer.intersect, tracer.occluded], np.int64)
    recorders = [_recorder(state.ctypes.data, what) for what in (_INTERSECT, _OCCLUDED)]
    watched = tracer._replace(intersect=recorders[0].address, occluded=recorders[1].address)
    marks = _Marks(state)
    with TracePool(case.setup, 1) as pool:
        pool._all[0].rays = marks
        find_frame(replace(case.setup, tracer=watched), c, pool)
    n = int(state[0])
    lanes = int((rays[:n, TFAR] >= 0).sum())
    if n > capacity or lanes != sum(marks.values()):
        raise RuntimeError(f"recorded {lanes} rays in {n} packets of {capacity}; the program counts {dict(marks)}")
    kinds = tuple(dict.fromkeys(kind for _, kind in marks.ends))
    return Recording(
        rays=rays[:n],
        flags=flags[:n],
        kinds=kinds,
        pieces=_pieces(marks.ends, kinds, flags[:n]),
        n_rays=dict(marks),
        n_pixels=case.setup.n_pixels,
    )


def _recorder(state_address: int, what: int) -> Any:
    """Compile a function like Embree's that keeps a copy of the packet, and then calls Embree's."""

    def recorder(lanes: int, scene: int, packet: int, arguments: int) -> None:
        state = _carray(_pointer(state_address), (6,), np.int64)
        n = state[0]
        if n < state[1]:
            source = _carray(_pointer(packet), (KEPT_ROWS * LANES,), np.float32)
            target = _carray(_pointer(state[2] + n * 4 * KEPT_ROWS * LANES), (KEPT_ROWS * LANES,), np.float32)
            for i in range(KEPT_ROWS * LANES):
                target[i] = source[i]
            _carray(_pointer(state[3] + n), (1,), np.uint8)[0] = what + (_COHERENT if arguments != 0 else 0)
        state[0] = n + 1
        _call(state[4 + what], lanes, scene, packet, arguments)

    return _cfunc(types.void(*[types.intp] * 4), nopython=True)(recorder)


def _pieces(ends: Sequence[tuple[int, str]], kinds: tuple[str, ...], flags: Bytes) -> Indices:
    """Runs of at most PIECE packets of one kind and one flag."""
    found, start = [], 0
    for end, kind in ends:
        changes: list[int] = (start + 1 + np.flatnonzero(np.diff(flags[start:end]))).tolist() if end > start else []
        for stop in (*changes, end):
            found += [(first, min(first + PIECE, stop), kinds.index(kind)) for first in range(start, stop, PIECE)]
            start = stop
    return np.array(found, np.int64).reshape(-1, 3)


@keep_on_disk
@nb.njit(nogil=True)
def _now(clock: Any, which: int, spec: Any) -> Any:
    """Seconds of a clock of the system."""
    _call(clock, which, spec.ctypes.data, 0, 0)
    return spec[0] + 1e-9 * spec[1]


@keep_on_disk
@nb.njit(nogil=True)
def _replay(
    tracer: Tracer, rays: Float32, flags: Bytes, pieces: Indices, hit_room: Float32, test_room: Float32,
    clock: int, clocks: Any, spec: Any, seconds: Float64,
) -> None:  # fmt: skip
    """Trace some pieces; adds wall and processor time of only the calls to seconds, (n_kinds, 2)."""
    for piece in range(pieces.shape[0]):
        start, stop, kind = pieces[piece, 0], pieces[piece, 1], pieces[piece, 2]
        tests = (flags[start] & _OCCLUDED) != 0
        room = test_room if tests else hit_room
        bits = room.view(np.int32)
        for p in range(stop - start):
            for row in range(KEPT_ROWS):
                for lane in range(LANES):
                    room[p, row, lane] = rays[start + p, row, lane]
            if not tests:
                for lane in range(LANES):
                    bits[p, TRIANGLE, lane] = MISS
                    bits[p, GEOMETRY, lane] = MISS
        function = tracer.occluded if tests else tracer.intersect
        cpu = _now(clock, clocks[1], spec)
        wall = _now(clock, clocks[0], spec)
        _trace(tracer, function, room, stop - start, (flags[start] & _COHERENT) != 0)
        seconds[kind, 0] += _now(clock, clocks[0], spec) - wall
        seconds[kind, 1] += _now(clock, clocks[1], spec) - cpu


def replay(
    recording: Recording, tracer: Tracer, threads: int, rays: Mapping[str, float]
) -> dict[str, dict[str, float]]:
    """Trace a recording on all threads; returns ms per image by kind, as wall time (`ms`) and of threads (`cpu_ms`).

    The wall time is that of a machine whose threads only trace: the traced time of all, over their number.

    Args:
        rays: rays per pixel and image by kind, of the run whose floor this is. It has a few cameras, the recording
            one of them: the cost of a ray comes from the recording, the number of rays from the run.
    """
    clock = ctypes.cast(ctypes.CDLL(None).clock_gettime, ctypes.c_void_p).value or 0
    clocks = np.array([time.CLOCK_MONOTONIC, time.CLOCK_THREAD_CPUTIME_ID], np.int64)
    tasks = iter([recording.pieces[i : i + TASK] for i in range(0, len(recording.pieces), TASK)])
    lock = Lock()

    def waiting() -> Iterator[Indices]:
        while True:
            with lock:
                task = next(tasks, None)
            if task is None:
                return
            yield task

    def work(_thread: int) -> Float64:
        rooms = empty_packets(PIECE, HIT_ROWS), empty_packets(PIECE, RAY_ROWS)
        seconds, spec = np.zeros((len(recording.kinds), 2)), np.zeros(2, np.int64)
        for task in waiting():
            _replay(tracer, recording.rays, recording.flags, task, *rooms, clock, clocks, spec, seconds)
        return seconds

    with ThreadPoolExecutor(threads) as pool:
        seconds = sum(pool.map(work, range(threads)), np.zeros((len(recording.kinds), 2)))
    found: dict[str, dict[str, float]] = {"ms": {}, "cpu_ms": {}}
    for i, kind in enumerate(recording.kinds):
        if recording.n_rays[kind]:
            scale = 1e3 * rays.get(kind, 0.0) * recording.n_pixels / recording.n_rays[kind]
            found["ms"][kind] = scale * float(seconds[i, 0]) / threads
            found["cpu_ms"][kind] = scale * float(seconds[i, 1])
    return found
