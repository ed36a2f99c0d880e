"""Recordings of the rays that the program traces: every packet, as it hands it to Embree.

A recording keeps the order of the packets, their idle lanes, and the flag that says whether their rays stay together.
"""

from collections import Counter
from collections.abc import Sequence
from dataclasses import dataclass, replace
from typing import Any

import numba as nb
import numpy as np
from numba import types
from numpy.typing import NDArray

from bench.core.cases import Case
from framearray_cli.base.arrays import Bytes, Float32
from framearray_cli.engine.embree.embreescene import _pointer
from framearray_cli.engine.embree.library import packet_width
from framearray_cli.engine.embree.packets import TFAR, Tracer, _call
from framearray_cli.engine.frames.frame import find_frame
from framearray_cli.engine.frames.pool import TracePool

Indices = NDArray[np.int64]

# Rows of a ray: origin, tnear, direction, time, tfar; the rows after them are the same in every packet.
KEPT_ROWS = TFAR + 1
PIECE = 4096  # rays of a run at most: the program, too, traces up to 4096 rays at a time
INTERSECT, OCCLUDED, COHERENT = 0, 1, 2  # bits of a packet's flags

_numba: Any = nb
_cfunc, _carray = _numba.cfunc, _numba.carray


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class Recording:
    """The packets of a frame.

    Attributes:
        rays: (n_packets, KEPT_ROWS, width).
        flags: (n_packets,) OCCLUDED, else first hits are looked for; COHERENT.
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

    @property
    def width(self) -> int:
        """Rays per packet."""
        return int(self.rays.shape[2])


class _Marks(Counter[str]):
    """Counts rays by kind as the program does, and notes how many packets were recorded when each count grew."""

    def __init__(self, state: Indices) -> None:
        super().__init__()
        self._state = state
        self.ends: list[tuple[int, str]] = []

    def __setitem__(self, kind: str, count: int) -> None:
        super().__setitem__(kind, count)
        self.ends.append((int(self._state[0]), kind))


class _Tape:
    """Room for packets, and a tracer that fills it."""

    def __init__(self, tracer: Tracer, expected: float) -> None:
        width = packet_width()
        capacity = int(1.25 * expected / width) + (1 << 20) // width
        self.rays, self.flags = np.empty((capacity, KEPT_ROWS, width), np.float32), np.empty(capacity, np.uint8)
        addresses = self.rays.ctypes.data, self.flags.ctypes.data, tracer.intersect, tracer.occluded
        self.state = np.array([0, capacity, *addresses], np.int64)
        self._functions = [_recorder(self.state.ctypes.data, what, width) for what in (INTERSECT, OCCLUDED)]
        self.tracer = tracer._replace(intersect=self._functions[0].address, occluded=self._functions[1].address)

    def end(self) -> tuple[Float32, Bytes]:
        """The packets and their flags.

        Raises:
            RuntimeError: there were more than fit.
        """
        n = int(self.state[0])
        if n > len(self.rays):
            raise RuntimeError(f"there are {n} packets, with room for {len(self.rays)}")
        return self.rays[:n], self.flags[:n]


def record(case: Case, c: int, expected: float) -> Recording:
    """Record the rays of frame c; it runs on one thread.

    Args:
        expected: approximate number of rays; there is room for a quarter more.

    Raises:
        RuntimeError: Embree's own functions cannot be reached, or rays were missed.
    """
    world = case.setup.world
    tape = _Tape(world.tracer, expected)
    marks = _Marks(tape.state)
    with TracePool(case.setup, 1) as pool:
        pool._all[0].rays = marks
        taped = world._replace(sight=world.sight._replace(tracer=tape.tracer))
        find_frame(replace(case.setup, world=taped), c, pool)
    rays, flags = tape.end()
    lanes = int((rays[:, TFAR] >= 0).sum())
    if lanes != sum(marks.values()):
        raise RuntimeError(f"recorded {lanes} rays in {len(rays)} packets; the program counts {dict(marks)}")
    kinds = tuple(dict.fromkeys(kind for _, kind in marks.ends))
    pieces = cut(marks.ends, kinds, flags, packet_width())
    return Recording(
        rays=rays, flags=flags, kinds=kinds, pieces=pieces, n_rays=dict(marks), n_pixels=case.setup.n_pixels
    )


def _recorder(state_address: int, what: int, width: int) -> Any:
    """Compile a function like Embree's that keeps a copy of the packet, and then calls Embree's."""
    size = KEPT_ROWS * width

    def recorder(lanes: int, scene: int, packet: int, arguments: int) -> None:
        state = _carray(_pointer(state_address), (6,), np.int64)
        n = state[0]
        if n < state[1]:
            source = _carray(_pointer(packet), (size,), np.float32)
            target = _carray(_pointer(state[2] + n * 4 * size), (size,), np.float32)
            for i in range(size):
                target[i] = source[i]
            _carray(_pointer(state[3] + n), (1,), np.uint8)[0] = what + (COHERENT if arguments != 0 else 0)
        state[0] = n + 1
        _call(state[4 + what], lanes, scene, packet, arguments)

    return _cfunc(types.void(*[types.intp] * 4), nopython=True)(recorder)


def cut(ends: Sequence[tuple[int, str]], kinds: tuple[str, ...], flags: Bytes, width: int) -> Indices:
    """Runs of packets of one kind and one flag, of at most PIECE rays.

    Args:
        ends: the packet after the last of each run, and its kind.
        width: rays per packet.
    """
    piece, start = PIECE // width, 0
    found: list[tuple[int, int, int]] = []
    for end, kind in ends:
        changes: list[int] = (start + 1 + np.flatnonzero(np.diff(flags[start:end]))).tolist() if end > start else []
        for stop in (*changes, end):
            found += [(first, min(first + piece, stop), kinds.index(kind)) for first in range(start, stop, piece)]
            start = stop
    return np.array(found, np.int64).reshape(-1, 3)
