"""Queues of rays that kernels trace together, with the hit or light position that each ray belongs to."""

from typing import NamedTuple, cast

import numpy as np

from framearray_cli.base.arrays import Float32, Int32

from ..embree.packets import HIT_ROWS, RAY_ROWS, empty_packets
from ..kernels.bundle import bundle
from ..kernels.simd import LANES


@bundle
class Rays(NamedTuple):
    """Arrays for rays of one kind.

    Attributes:
        packets: (n_packets, rows, width); see `embree/packets.py`.
        place: (n_rays + LANES,) what a ray belongs to: an index, whose meaning depends on the kernel.
        value: (3, n_rays + LANES) what a ray carries if nothing blocks it.
        number: (4, n_rays + LANES) further integers, whose meaning depends on the kernel; of sorted rays, row ORDER
            lists them as they stand in packets, and row RANK says where each stands.
        row: (ROWS, n_rays + LANES) rays as one array per component, before they become packets: see `terms/direct.py`
            and `terms/obscurance_rays.py`.
        start: (MOST_CELLS,) counters of a sort.
    """

    packets: Float32
    place: Int32
    value: Float32
    number: Int32
    row: Float32
    start: Int32


# Rows of `Rays.row`: origin, direction, and length in units of that.
FROM, TO, REACH = 0, 3, 6
ROWS = 7
# Rows of `Rays.number`.
ORDER, RANK = 2, 3
MOST_CELLS = 128
# Kernels start their counts of rays from this, not from the literal 0: numba would compile every kernel that takes the
# count a second time, for the constant 0.
NO_RAYS = cast(int, np.int64(0))


def _empty_rays(n_rays: int, rows: int, queue: int) -> Rays:
    capacity = -(-n_rays // LANES) * LANES
    return Rays(
        packets=empty_packets(n_rays, rows),
        place=np.empty(capacity + LANES, np.int32),
        value=np.empty((3, max(capacity, queue) + LANES), np.float32),
        number=np.empty((4, capacity + LANES), np.int32),
        row=np.empty((ROWS, queue), np.float32),
        start=np.empty(MOST_CELLS, np.int32),
    )


def room_for_hits(n_rays: int) -> Rays:
    """Allocate packets for n rays that find first hits."""
    return _empty_rays(n_rays, HIT_ROWS, -(-n_rays // LANES) * LANES)


def room_for_tests(n_rays: int, n_lights: int) -> Rays:
    """Allocate packets for shadow rays from a batch of points to at most n_lights lights."""
    return _empty_rays(n_rays, RAY_ROWS, max(-(-n_rays // LANES) * LANES, n_lights) + LANES)
