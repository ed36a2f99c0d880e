"""The floor: the rays of a frame, recorded and then only traced by Embree.

A replay copies a few packets at a time to where they are in the cache, and times only the calls. Left out is all work
of the program itself: making rays, looking up hits, shading, sorting, composing.
"""

import ctypes
import time
from collections.abc import Iterator, Mapping
from concurrent.futures import ThreadPoolExecutor
from threading import Lock
from typing import Any

import numba as nb
import numpy as np

from framearray_cli.base.arrays import Bytes, Float32, Float64
from framearray_cli.engine.embree.packets import (
    ALL_RAYS,
    GEOMETRY,
    HIT_ROWS,
    MASK,
    MISS,
    RAY_ROWS,
    TRIANGLE,
    Tracer,
    _call,
    aligned_zeros,
)
from framearray_cli.engine.kernels.machine_code import keep_on_disk

from .recording import COHERENT, KEPT_ROWS, OCCLUDED, PIECE, Indices, Recording

TASK = 32  # pieces that one thread takes at a time: about a batch of the program


@keep_on_disk
@nb.njit(nogil=True)
def _now(clock: Any, which: int, spec: Any) -> Any:
    """Seconds of a clock of the system."""
    _call(clock, which, spec.ctypes.data, 0, 0)
    return spec[0] + 1e-9 * spec[1]


@keep_on_disk
@nb.njit(nogil=True)
def _trace_packets(tracer: Tracer, function: int, room: Float32, n: int, coherent: bool) -> None:
    """Call one of the tracer's functions for packets 0 to n - 1 of any width; single rays have no mask of lanes."""
    address, arguments = room.ctypes.data, tracer.coherent if coherent else 0
    size = 4 * room.shape[1] * room.shape[2]
    for p in range(n):
        if room.shape[2] == 1:
            _call(function, tracer.scene, address + p * size, arguments, 0)
        else:
            _call(function, tracer.lanes, tracer.scene, address + p * size, arguments)


@keep_on_disk
@nb.njit(nogil=True)
def _replay(
    tracer: Tracer, rays: Float32, flags: Bytes, pieces: Indices, hit_room: Float32, test_room: Float32,
    clock: int, clocks: Any, spec: Any, seconds: Float64,
) -> None:  # fmt: skip
    """Trace some pieces; adds wall and processor time of only the calls to seconds, (n_kinds, 2)."""
    for piece in range(pieces.shape[0]):
        start, stop, kind = pieces[piece, 0], pieces[piece, 1], pieces[piece, 2]
        tests = (flags[start] & OCCLUDED) != 0
        room = test_room if tests else hit_room
        bits = room.view(np.int32)
        for p in range(stop - start):
            for row in range(KEPT_ROWS):
                for lane in range(rays.shape[2]):
                    room[p, row, lane] = rays[start + p, row, lane]
            if not tests:
                for lane in range(rays.shape[2]):
                    bits[p, TRIANGLE, lane] = MISS
                    bits[p, GEOMETRY, lane] = MISS
        function = tracer.occluded if tests else tracer.intersect
        cpu = _now(clock, clocks[1], spec)
        wall = _now(clock, clocks[0], spec)
        _trace_packets(tracer, function, room, stop - start, (flags[start] & COHERENT) != 0)
        seconds[kind, 0] += _now(clock, clocks[0], spec) - wall
        seconds[kind, 1] += _now(clock, clocks[1], spec) - cpu


def seconds_in_embree(recording: Recording, tracer: Tracer, threads: int) -> Float64:
    """Trace a recording on all threads; returns the wall and processor time of all calls together, (n_kinds, 2).

    Args:
        tracer: with the functions for the recording's width.
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
        rooms = _room(recording.width, HIT_ROWS), _room(recording.width, RAY_ROWS)
        seconds, spec = np.zeros((len(recording.kinds), 2)), np.zeros(2, np.int64)
        for task in waiting():
            _replay(tracer, recording.rays, recording.flags, task, *rooms, clock, clocks, spec, seconds)
        return seconds

    with ThreadPoolExecutor(threads) as pool:
        return sum(pool.map(work, range(threads)), np.zeros((len(recording.kinds), 2)))


def _room(width: int, rows: int) -> Float32:
    """Packets of a width for PIECE rays, as `empty_packets` allocates those of the program's width."""
    n = PIECE // width
    words = n * rows * width
    packets = aligned_zeros(words + HIT_ROWS * width)[:words].reshape(n, rows, width)
    packets.view(np.int32)[:, MASK] = ALL_RAYS
    return packets


def replay(
    recording: Recording, tracer: Tracer, threads: int, rays: Mapping[str, float]
) -> dict[str, dict[str, float]]:
    """Trace a recording on all threads; returns ms per image by kind, as wall time (`ms`) and of threads (`cpu_ms`).

    The wall time is that of a machine whose threads only trace: the traced time of all, over their number.

    Args:
        rays: rays per pixel and image by kind, of the run whose floor this is. It has a few cameras, the recording
            one of them: the cost of a ray comes from the recording, the number of rays from the run.
    """
    seconds = seconds_in_embree(recording, tracer, threads)
    found: dict[str, dict[str, float]] = {"ms": {}, "cpu_ms": {}}
    for i, kind in enumerate(recording.kinds):
        if recording.n_rays[kind]:
            scale = 1e3 * rays.get(kind, 0.0) * recording.n_pixels / recording.n_rays[kind]
            found["ms"][kind] = scale * float(seconds[i, 0]) / threads
            found["cpu_ms"][kind] = scale * float(seconds[i, 1])
    return found
