"""Rays between any points of a scene, in centred coordinates; evenly spread points and directions for them."""

from dataclasses import dataclass
from typing import Any, NamedTuple

import numpy as np

from framearray_cli.base.arrays import Flags, Float32, Float64, Int32
from framearray_cli.engine.embree.embreescene import EmbreeScene
from framearray_cli.engine.embree.packets import (
    DIRECTION,
    GEOMETRY,
    HIT_ROWS,
    MASKED,
    MISS,
    ORIGIN,
    RAY_ROWS,
    TFAR,
    TRIANGLE,
    empty_packets,
    intersect,
    occlude,
)
from framearray_cli.scene.paths.placing import GOLDEN_ANGLE
from framearray_cli.scene.scene import Scene

# 1 / g^k of the root g of x^4 = x + 1: the sequence R3 of [Roberts18].
R3 = 1.2207440846057596 ** -np.arange(1.0, 4.0)
IN_FRONT = 1e-3  # share of a ray by which a point is in front of the surface that the ray meets
SHORTENED = 1e-4  # share of a segment left out at both ends, so that it misses the surfaces that it starts or ends on


class ProbeHits(NamedTuple):
    """Surfaces that n rays met.

    Attributes:
        distance: (n,) in lengths of the directions; inf where nothing is met.
        triangle: (n,) -1 where nothing is met.
        front: (n,) True if the ray meets its front, the side from which its corners run counter-clockwise.
    """

    distance: Float64
    triangle: Int32
    front: Flags

    @property
    def hit(self) -> Flags:
        """(n,) True if a ray met anything."""
        return self.triangle >= 0


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class Probe:
    """A scene to trace rays in.

    Attributes:
        turned: True if the front of a surface is the side from which its corners run clockwise.
    """

    scene: Scene
    embree: EmbreeScene
    turned: bool = False

    def trace(self, origins: Any, directions: Any) -> ProbeHits:
        """Trace rays; origins and directions are (n, 3) or (3,)."""
        packets, n = _fill_packets(HIT_ROWS, origins, directions, np.inf)
        intersect(self.embree.tracer, packets, n, coherent=False, near=0.0)
        bits = packets.view(np.int32)
        distance, triangle = _rows(packets, TFAR)[:n], _rows(bits, TRIANGLE)[:n].copy()
        triangle[_rows(bits, GEOMETRY)[:n] == MASKED] += self.embree.tracer.first_masked
        missed = _rows(bits, TRIANGLE)[:n] == MISS
        triangle[missed] = -1
        against = (self.normals(triangle) * np.broadcast_to(directions, (n, 3))).sum(axis=1) < 0
        front = (against != self.turned) & ~missed
        return ProbeHits(np.where(missed, np.inf, distance.astype(np.float64)), triangle, front)

    def points(self, origins: Float64, directions: Float64) -> tuple[ProbeHits, Float64]:
        """Trace rays (n, 3); also return points (hits, 3) slightly in front of the surfaces that they meet."""
        seen = self.trace(origins, directions)
        reach = seen.distance[seen.hit, None] * (1 - IN_FRONT)
        return seen, origins[seen.hit] + directions[seen.hit] * reach

    def normals(self, triangle: Int32) -> Float64:
        """(n, 3) normals by winding, not of unit length."""
        corners = self.scene.corners
        if len(corners) < len(triangle):  # most triangles occur several times
            return normals(corners)[triangle]
        return normals(corners[triangle])

    def blocked(self, start: Any, end: Any) -> Flags:
        """(n,) True if anything lies between two points, (n, 3) or (3,) each."""
        start, end = np.broadcast_arrays(np.asarray(start, np.float64), np.asarray(end, np.float64))
        step = end - start
        packets, n = _fill_packets(RAY_ROWS, start + SHORTENED * step, step, 1 - 2 * SHORTENED)
        occlude(self.embree.tracer, packets, n, coherent=False)
        return np.asarray(_rows(packets, TFAR)[:n] < 0)


def normals(corners: Float32) -> Float64:
    """(n, 3) normals of triangles (n, 3, 3) by winding; their lengths are twice the areas."""
    corners64 = corners.astype(np.float64)
    return np.cross(corners64[:, 1] - corners64[:, 0], corners64[:, 2] - corners64[:, 0])


def _fill_packets(rows: int, origins: Any, directions: Any, tfar: float) -> tuple[Any, int]:
    """Fill packets with rays; also return the number of rays."""
    origins, directions = np.broadcast_arrays(np.atleast_2d(origins), np.atleast_2d(directions))
    n = len(origins)
    packets = empty_packets(n, rows)
    for axis in range(3):
        for row, values in ((ORIGIN + axis, origins[:, axis]), (DIRECTION + axis, directions[:, axis])):
            padded = np.ones(packets[:, row].size, np.float32)
            padded[:n] = values
            packets[:, row] = padded.reshape(packets[:, row].shape)
    packets[:, TFAR] = tfar
    return packets, n


def _rows(packets: Any, row: int) -> Any:
    """One row of every packet, ray after ray."""
    return packets[:, row].reshape(-1)


def points_in(low: Float64, high: Float64, n: int) -> Float64:
    """(n, 3) points in a box."""
    return np.asarray(low + (high - low) * ((0.5 + np.arange(1, n + 1)[:, None] * R3) % 1.0))


def directions_around(n: int) -> Float64:
    """(n, 3) unit directions."""
    k = np.arange(n) + 0.5
    height = 1 - 2 * k / n
    level = np.sqrt(1 - height**2)
    turn = k * GOLDEN_ANGLE
    return np.stack([level * np.cos(turn), height, level * np.sin(turn)], axis=1)


def level_directions(n: int, up: int) -> Float64:
    """(n, 3) unit directions around the up axis, evenly spread; the first points to the front of a model.

    The front is +z in a scene with y up, as in glTF, and -y in one with z up.
    """
    turn = 2 * np.pi * np.arange(n) / n
    found = np.zeros((n, 3))
    found[:, 0] = np.sin(turn)
    found[:, 2 if up == 1 else 1] = np.cos(turn) * (1 if up == 1 else -1)
    return found
