"""Rays in packets, and how kernels trace them.

Kernels write 16 rays at a time where Embree reads them, in its own layout (RTCRay16, RTCRayHit16, or the types of 8 or
4 rays if the processor has no wider ones). A packet is (rows, width) float32: 12 rows of ray (origin xyz, tnear,
direction xyz, time, tfar, mask, id, flags) and, for first hits, the hit (Ng xyz, u, v, triangle, geometry, instance),
then padding. A lane with tfar < 0 is idle.
"""

from typing import Any, NamedTuple

import numpy as np
from llvmlite import ir
from numba import types
from numba.extending import intrinsic

from framearray_cli.base.arrays import Float32, Real

from ..kernels.bundle import bundle
from ..kernels.kernel import inlined, kernel
from ..kernels.simd import LANES, load_row, select, store_row, width_of_packets
from .library import packet_width

RAY_ROWS = 12
HIT_ROWS = 24  # RTCRayHit16 has 20 to 22 rows, depending on how Embree was built; the rest is padding
ORIGIN, TNEAR, DIRECTION, TFAR, MASK, ID, NORMAL, U, V, TRIANGLE, GEOMETRY = 0, 3, 4, 8, 9, 10, 12, 15, 16, 17, 18

MISS = -1
OPAQUE, MASKED = 0, 1  # geometry numbers
ALL_RAYS = -1  # a ray mask with every bit set; Embree skips geometry whose mask shares no bit with the ray's
# ID of rays without rows for a hit. If they begin at tnear 0, they run from a surface to an eye; all others run the way
# that an eye looks.
TO_EYE = 1


@bundle
class Tracer(NamedTuple):
    """Addresses and numbers with which a kernel traces rays; it has no constant of a process, so numba can cache it.

    Attributes:
        scene, intersect, occluded: addresses of the scene, and of the two functions that trace a packet of rays
            through it: `(valid, scene, packet, arguments)`.
        coherent: address of the arguments that mark the rays of a packet as coherent; `scattered`: of arguments for
            other rays, or 0.
        lanes: address of 16 words of -1: the mask of a packet in which all lanes count.
        first_masked: index of the first triangle with an alpha mask; such triangles form a geometry of their own.
    """

    scene: int
    intersect: int
    occluded: int
    coherent: int
    scattered: int
    lanes: int
    first_masked: int


@intrinsic
def _call(typingctx: Any, function: Any, a: Any, b: Any, c: Any, d: Any) -> Any:
    """Call the C function `void (intptr, intptr, intptr, intptr)` at an address known only at run time."""
    signature = types.void(*[types.intp] * 5)

    def codegen(context: Any, builder: Any, sig: Any, args: Any) -> Any:
        word = ir.IntType(64)
        pointer = ir.FunctionType(ir.VoidType(), [word] * 4).as_pointer()
        builder.call(builder.inttoptr(args[0], pointer), list(args[1:]))
        return context.get_dummy_value()

    return signature, codegen


@kernel
def _trace(tracer: Tracer, function: int, packets: Float32, n_packets: int, coherent: bool) -> None:
    """Call one of the tracer's functions for packets 0 to n_packets - 1."""
    address = packets.ctypes.data
    arguments = tracer.coherent if coherent else tracer.scattered
    size = 4 * width_of_packets() * packets.shape[1]
    for p in range(n_packets):
        _call(function, tracer.lanes, tracer.scene, address + p * size, arguments)


def aligned_zeros(n_words: int) -> Float32:
    """Allocate (n_words,) zeros that start at a cache line, as Embree requires."""
    block = np.zeros(n_words + LANES, np.float32)
    start = ((-block.ctypes.data) % 64) // 4
    return block[start : start + n_words]


def empty_packets(n_rays: int, rows: int) -> Float32:
    """Allocate packets for n rays, (n_packets, rows, width) float32, with tnear 0 and the mask of all rays.

    There are packets for a multiple of 16 rays, because kernels read and write 16 at a time.

    Where Embree has no packets of 16 of its own, it traces their rays singly and writes each back with all rows of a
    hit, into shadow rays too, which end before those. It writes what it read there; yet if another thread had written
    in between, that would be lost. So such rows lie behind the last packet as well.
    """
    words = -(-n_rays // LANES) * rows * LANES
    packets = aligned_zeros(words + max(HIT_ROWS - rows, 0) * LANES)[:words].reshape(-1, rows, packet_width())
    packets.view(np.int32)[:, MASK] = ALL_RAYS
    packets.view(np.int32)[:, ID] = TO_EYE if rows == RAY_ROWS else 0
    return packets


@inlined
def room_in(packets: Float32) -> int:
    """The number of rays that packets have room for."""
    return packets.shape[0] * width_of_packets()


@inlined
def place_in(packets: Float32, i: Any) -> Any:
    """Places of row 0 of rays i, in lanes, in the flat array of packets; row k is k times the width further."""
    width = width_of_packets()
    packet = i >> np.int32(2 + (width >= 8) + (width >= 16))
    return packet * np.int32(packets.shape[1] * width) + (i & np.int32(width - 1))


@inlined
def set_ray(packets: Float32, i: int, ox: Real, oy: Real, oz: Real, dx: Real, dy: Real, dz: Real, tfar: Real) -> None:
    """Write ray i of an array of packets; it ends at tfar, in lengths of its direction."""
    p, lane = i // width_of_packets(), i % width_of_packets()
    packets[p, ORIGIN, lane] = ox
    packets[p, ORIGIN + 1, lane] = oy
    packets[p, ORIGIN + 2, lane] = oz
    packets[p, DIRECTION, lane] = dx
    packets[p, DIRECTION + 1, lane] = dy
    packets[p, DIRECTION + 2, lane] = dz
    packets[p, TFAR, lane] = tfar


@inlined
def _idle_from(packets: Float32, n_rays: int) -> int:
    """Make the lanes after the last ray idle, up to a multiple of 16, and return the number of packets with rays."""
    width: int = width_of_packets()
    n_packets = (n_rays + width - 1) // width
    for i in range(n_rays, (n_rays + LANES - 1) // LANES * LANES):
        set_ray(packets, i, 0.0, 0.0, 0.0, 0.0, 0.0, 1.0, -1.0)
    return n_packets


@kernel
def intersect(tracer: Tracer, packets: Float32, n_rays: int, coherent: bool, near: float) -> None:
    """Find the first hits of rays 0 to n_rays - 1; see `hit_triangle`.

    Args:
        coherent: the rays of a packet run close together. Embree then traverses them together, which halves the time
            of shadow rays and saves a fifth of the time of eye rays; for rays that scatter it saves nothing.
        near: ignore hits nearer than this, in lengths of the directions.
    """
    n_packets = _idle_from(packets, n_rays)
    bits = packets.view(np.int32)
    for first in range(0, n_rays, LANES):
        store_row(packets, first, TNEAR, np.float32(near))
        store_row(bits, first, TRIANGLE, np.int32(MISS))
        store_row(bits, first, GEOMETRY, np.int32(MISS))
    _trace(tracer, tracer.intersect, packets, n_packets, coherent)


@kernel
def intersect_on(tracer: Tracer, packets: Float32, n_rays: int) -> None:
    """Find the first hits of rays 0 to n_rays - 1 beyond row TNEAR of each; idle rays meet nothing."""
    n_packets = _idle_from(packets, n_rays)
    bits = packets.view(np.int32)
    for first in range(0, n_rays, LANES):
        store_row(bits, first, TRIANGLE, np.int32(MISS))
        store_row(bits, first, GEOMETRY, np.int32(MISS))
    _trace(tracer, tracer.intersect, packets, n_packets, False)


@kernel
def occlude(tracer: Tracer, packets: Float32, n_rays: int, coherent: bool) -> None:
    """Test rays 0 to n_rays - 1: row TFAR becomes -inf where something blocks the ray (`is_blocked`).

    Args:
        coherent: see `intersect`.
    """
    _trace(tracer, tracer.occluded, packets, _idle_from(packets, n_rays), coherent)


@inlined
def is_blocked(packets: Float32, i: int) -> bool:
    """Return True if something blocks ray i, after `occlude`."""
    return packets[i // width_of_packets(), TFAR, i % width_of_packets()] < 0.0


@inlined
def scene_triangle(tracer: Tracer, triangle: int, geometry: int) -> int:
    """The index in the scene of a triangle of a geometry; for one ray or for lanes."""
    return triangle + select(geometry > np.int32(OPAQUE), np.int32(tracer.first_masked), np.int32(0))


@inlined
def hit_triangle(tracer: Tracer, packets: Float32, i: int) -> int:
    """The index in the scene of the triangle that ray i hit, or MISS, after `intersect`."""
    bits = packets.view(np.int32)
    p, lane = i // width_of_packets(), i % width_of_packets()
    return scene_triangle(tracer, bits[p, TRIANGLE, lane], bits[p, GEOMETRY, lane])


@inlined
def decode_hits(tracer: Tracer, packets: Float32, i: int) -> tuple[bool, int, Real, Real]:
    """For rays i to i + 15: True after a miss, and the triangle and the place (u, v) of the hit, 0 after a miss."""
    bits = packets.view(np.int32)
    triangle = load_row(bits, i, TRIANGLE)
    missed = triangle < np.int32(0)
    triangle = select(missed, 0, scene_triangle(tracer, triangle, load_row(bits, i, GEOMETRY)))
    u, v = load_row(packets, i, U), load_row(packets, i, V)
    return missed, triangle, select(missed, 0.0, u), select(missed, 0.0, v)
