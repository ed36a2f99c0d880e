"""Rays that wait to be traced together, and what each stands for."""

from typing import NamedTuple

import numpy as np

from framearray_cli.base.arrays import Float32, Int32

from ..embree.packets import HIT_ROWS, RAY_ROWS, empty_packets
from ..kernels.simd import LANES


class Rays(NamedTuple):
    """Room for rays of one kind.

    Attributes:
        packets: (n_packets, rows, 16).
        place: (n_rays + LANES,) what a ray belongs to: an index, by use.
        value: (3, n_rays + LANES) what a ray carries if it arrives.
        number: (2, n_rays + LANES) integers, by use.
        row: (ROWS, n_rays + LANES) rays number by number, before they become packets: see `terms/direct.py`.
    """

    packets: Float32
    place: Int32
    value: Float32
    number: Int32
    row: Float32


# Origin, direction, tfar.
ROWS = 7


def _room(n_rays: int, rows: int, queue: int) -> Rays:
    n_packets = -(-n_rays // LANES)
    capacity = n_packets * LANES
    return Rays(
        packets=empty_packets(n_packets, rows),
        place=np.empty(capacity + LANES, np.int32),
        value=np.empty((3, max(capacity, queue) + LANES), np.float32),
        number=np.empty((2, capacity + LANES), np.int32),
        row=np.empty((ROWS, queue), np.float32),
    )


def room_for_hits(n_rays: int) -> Rays:
    """Room for rays that look for first hits."""
    return _room(n_rays, HIT_ROWS, 0)


def room_for_tests(n_rays: int, n_lights: int) -> Rays:
    """Room for rays that are only tested for being blocked, from points to up to n_lights lights."""
    return _room(n_rays, RAY_ROWS, max(-(-n_rays // LANES) * LANES, n_lights) + LANES)
