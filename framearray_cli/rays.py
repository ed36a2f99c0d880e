"""Rays that wait to be traced together, and what each stands for."""

from typing import NamedTuple

import numpy as np

from .arrays import Float32, Int32
from .embree.packets import HIT_ROWS, LANES, RAY_ROWS, empty_packets


class Rays(NamedTuple):
    """Room for rays of one kind.

    Attributes:
        packets: (n_packets, rows, 16).
        place: (n_rays, 2) what a ray belongs to: two indices, by use.
        value: (n_rays, 3) what a ray carries if it arrives.
        row: (5, n) one row of candidates: see `terms/direct.py`.
    """

    packets: Float32
    place: Int32
    value: Float32
    row: Float32


def _room(n_rays: int, rows: int, row_length: int) -> Rays:
    n_packets = -(-n_rays // LANES)
    capacity = n_packets * LANES
    return Rays(
        packets=empty_packets(n_packets, rows),
        place=np.empty((capacity, 2), np.int32),
        value=np.empty((capacity, 3), np.float32),
        row=np.empty((5, row_length), np.float32),
    )


def room_for_hits(n_rays: int) -> Rays:
    """Room for rays that look for first hits."""
    return _room(n_rays, HIT_ROWS, 0)


def room_for_tests(n_rays: int, n_lights: int) -> Rays:
    """Room for rays that are only tested for being blocked, from points to up to n_lights lights."""
    return _room(n_rays, RAY_ROWS, n_lights)
