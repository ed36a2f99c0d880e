"""Gather rays that meet mirrors: they go on to what the mirrors show, and read the cells there.

    light of a ray = S_1 ... S_n R(Q) E(cell of Q)        S: of the mirrors on the way, Q: where the ray ends

A surface may reflect both ways. Then chance decides, in proportion to the larger of the three channels of each part.
The length of the whole way chooses the cell. Behind the last mirror of a job's depth a mirror counts as diffuse.
"""

from typing import NamedTuple

import numpy as np

from framearray_cli.base.arrays import Float32, Int32, Keys, Rgb

from ...embree.packets import DIRECTION, HIT_ROWS, TFAR, decode_hits, empty_packets, intersect, set_ray
from ...hits.hits import SURFACE, Hits, World, empty_hits, record_hits
from ...hits.rays import NO_RAYS, ORDER, Rays
from ...inputs.random import MIRRORED, mix, r2, random_word
from ...kernels.kernel import inlined, kernel
from ...kernels.simd import LANES, compress, gather, lane_numbers, popcount, width_of_packets
from .lookups import GatherScratch, NearHits, find_cells
from .table import Cells


class MirrorScratch(NamedTuple):
    """Rays that met mirrors; without mirrors `depth` is 0, and all arrays are empty.

    Attributes:
        depth: most mirrors on the way of a ray.
        ray: (n_rays,) number of the ray among those traced together; `left`: rows of rays that go on.
        met: (n_rays, HIT_ROWS) the ray and its hit as they were traced.
        weight: (n_rays, 3) S_1 ... S_n R(Q), over the probability of the choices; without R(Q) where nothing is met.
        length: (n_rays,) of the way so far.
        key: (n_rays,) random word of the next choice.
        packets: of reflected rays; `hits`: what they meet.
    """

    depth: int
    ray: Int32
    left: Int32
    met: Float32
    weight: Rgb
    length: Float32
    key: Keys
    packets: Float32
    hits: Hits


def room_for_mirrors(n_rays: int, depth: int) -> MirrorScratch:
    """Allocate arrays for n rays, of which all may meet mirrors."""
    n = n_rays if depth else 0
    return MirrorScratch(
        depth=depth,
        ray=np.empty(n + LANES, np.int32),
        left=np.empty(n, np.int32),
        met=np.empty((n, HIT_ROWS), np.float32),
        weight=np.empty((n, 3), np.float32),
        length=np.empty(n, np.float32),
        key=np.empty(n, np.uint64),
        packets=empty_packets(n, HIT_ROWS),
        hits=empty_hits(n),
    )


@kernel
def find_ends(
    hits: Hits, world: World, cells: Cells, rays: Rays, n: int, first_ray: int, n_rays: int, room: GatherScratch,
    tests: Rays, near: NearHits, reach: float, mirrors: MirrorScratch,
) -> tuple[int, int]:  # fmt: skip
    """Find the cells that rays read, like `find_cells`, behind mirrors where rays meet any.

    Returns:
        number of rays kept, and of reflected rays.
    """
    surfaces, tracer = world.surfaces, world.tracer
    mirrored = reflected = NO_RAYS
    if mirrors.depth > 0:
        mirrored, reflected = follow_mirrors(hits, world, rays, n, first_ray, n_rays, mirrors)
    kept = find_cells(hits, surfaces, tracer, cells, rays, n, first_ray, n_rays, room, tests, near, reach)
    put_back(rays, mirrored, mirrors, room.reflectivity)
    return kept, reflected


@inlined
def follow_mirrors(
    hits: Hits, world: World, rays: Rays, n: int, first_ray: int, n_rays: int, room: MirrorScratch
) -> tuple[int, int]:
    """Follow those of traced rays 0 to n - 1 that met mirrors; their packets then say where they end, and how far.

    Args:
        hits, first_ray, n_rays: see `find_cells`.

    Returns:
        number of rays that met mirrors, and of reflected ones.
    """
    surfaces, tracer = world.surfaces, world.tracer
    # Loop state
    found = NO_RAYS  # rays that met mirrors
    total = NO_RAYS  # reflected rays
    for first in range(0, n, LANES):
        missed, triangle, _, _ = decode_hits(tracer, rays.packets, first)
        at, nothing = gather(surfaces.material, triangle) * np.int32(3), np.float32(0.0)
        mirrors = (gather(surfaces.specular, at) > nothing) | (gather(surfaces.specular, at + np.int32(1)) > nothing)
        mirrors = mirrors | (gather(surfaces.specular, at + np.int32(2)) > nothing)
        mirrors = mirrors & ~missed & (lane_numbers() < np.int32(n - first))
        compress(mirrors, lane_numbers() + np.int32(first), room.ray, found)
        found += popcount(mirrors)
    for k in range(found):
        _start(hits, rays, first_ray, n_rays, room, k)
    waiting = found
    for bounce in range(room.depth + 1):
        if waiting == 0:
            break
        record_hits(world, room.packets, waiting, True, room.hits)
        sent = NO_RAYS
        for i in range(waiting):
            if _goes_on(room, i, bounce, sent):
                sent += 1
            else:
                _put_hit(rays, room, i)
        intersect(tracer, room.packets, sent, False)
        total, waiting = total + sent, sent
    return found, total


@inlined
def _start(hits: Hits, rays: Rays, first_ray: int, n_rays: int, room: MirrorScratch, k: int) -> None:
    """Keep ray k as it was traced, and begin its way."""
    ray = room.ray[k]
    written = rays.number[ORDER, ray]
    hit = rays.place[written // (LANES * n_rays) * LANES + written % LANES]
    room.key[k] = random_word(hits.key[hit], MIRRORED + first_ray + written // LANES % n_rays)
    room.left[k], room.length[k] = k, 0.0
    for channel in range(3):
        room.weight[k, channel] = 1.0
    width = width_of_packets()
    for row in range(HIT_ROWS):
        value = rays.packets[ray // width, row, ray % width]
        room.met[k, row] = value
        room.packets[k // width, row, k % width] = value


@inlined
def _goes_on(room: MirrorScratch, i: int, bounce: int, to: int) -> bool:
    """Whether the ray at hit i is reflected: then write it into slot `to`, not above i; else complete its weight."""
    k, r, s = room.left[i], room.hits.reflectivity, room.hits.specular
    if room.hits.kind[i] != SURFACE:
        return False
    diffuse, mirror = max(r[i, 0], r[i, 1], r[i, 2]), max(s[i, 0], s[i, 1], s[i, 2])
    both, nothing = diffuse + mirror, np.float32(0.0)
    if not mirror > nothing or bounce == room.depth:
        for channel in range(3):
            room.weight[k, channel] *= r[i, channel] + s[i, channel]
        return False
    a, _ = r2(room.key[k], 0)
    if not a * both < mirror:
        for channel in range(3):
            room.weight[k, channel] *= r[i, channel] * (both / diffuse)
        return False
    for channel in range(3):
        room.weight[k, channel] *= s[i, channel] * (both / mirror)
    room.key[k], room.left[to] = mix(room.key[k]), k
    width = width_of_packets()
    room.length[k] += room.packets[i // width, TFAR, i % width]
    # mirror the direction d at the shading normal m; where that points into the surface, at the geometric normal g
    d, g, m, p = room.hits.incoming, room.hits.geometric, room.hits.shading, room.hits.position
    along = np.float32(2.0) * (d[i, 0] * m[i, 0] + d[i, 1] * m[i, 1] + d[i, 2] * m[i, 2])
    x, y, z = d[i, 0] - along * m[i, 0], d[i, 1] - along * m[i, 1], d[i, 2] - along * m[i, 2]
    if not x * g[i, 0] + y * g[i, 1] + z * g[i, 2] > nothing:
        along = np.float32(2.0) * (d[i, 0] * g[i, 0] + d[i, 1] * g[i, 1] + d[i, 2] * g[i, 2])
        x, y, z = d[i, 0] - along * g[i, 0], d[i, 1] - along * g[i, 1], d[i, 2] - along * g[i, 2]
    e = room.hits.offset[i]
    ox, oy, oz = p[i, 0] + e * g[i, 0], p[i, 1] + e * g[i, 1], p[i, 2] + e * g[i, 2]
    set_ray(room.packets, to, ox, oy, oz, x, y, z, np.float32(np.inf))
    return True


@inlined
def _put_hit(rays: Rays, room: MirrorScratch, i: int) -> None:
    """Write the end of a way, at hit i, into the packet of the ray that it began with."""
    width, k = width_of_packets(), room.left[i]
    ray = room.ray[k]
    for row in range(DIRECTION, HIT_ROWS):
        rays.packets[ray // width, row, ray % width] = room.packets[i // width, row, i % width]
    rays.packets[ray // width, TFAR, ray % width] += room.length[k]


@inlined
def put_back(rays: Rays, n: int, room: MirrorScratch, reflectivity: Float32) -> None:
    """Restore the packets of the n rays that met mirrors, and give each its weight, instead of R(Q)."""
    width = width_of_packets()
    for k in range(n):
        ray = room.ray[k]
        for row in range(HIT_ROWS):
            rays.packets[ray // width, row, ray % width] = room.met[k, row]
        for channel in range(3):
            reflectivity[channel, ray] = room.weight[k, channel]
