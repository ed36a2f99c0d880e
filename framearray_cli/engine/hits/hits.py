"""Hits: the surface points at which the terms are estimated, and how traced rays become hits.

A batch of hits is a few thousand points in arrays that stay in the cache while every term is computed.
"""

from functools import cached_property
from typing import NamedTuple

import numpy as np

from framearray_cli.base.arrays import Bytes, Directions, Float32, Int32, Keys, Points, Rgb, Triple

from ..embree.packets import DIRECTION, Tracer, decode_hits, intersect
from ..inputs.mips import SHARP, Mips
from ..inputs.panes import NOWHERE, PaneArrays, Sight
from ..inputs.surfaces import (
    FLAT,
    Relief,
    Surfaces,
    geometric_normal,
    mapped_normal,
    position_at,
    reflectivity_at,
    shading_normal,
    specular_at,
)
from ..kernels.bundle import bundle
from ..kernels.kernel import has_rows, inlined, kernel, step
from ..kernels.simd import (
    LANES,
    gather,
    lane_numbers,
    load,
    load_row,
    popcount,
    put_triples,
    select,
    sqrt,
    store,
    triples_at,
)

ESCAPED, SURFACE = 0, 1


@bundle
class Hits(NamedTuple):
    """Arrays of n hits.

    Attributes:
        kind: (n,) SURFACE, or ESCAPED for a ray that left the scene.
        position: (n, 3) the point, centred; for an escaped ray its unit direction.
        geometric: (n, 3) unit normal of the triangle, on the viewer's side: offsets, reprojection, sides.
        shading: (n, 3) unit interpolated normal, turned by a normal map, on that same side: direct light, hemisphere,
            mirror.
        offset: (n,) height above the triangle at which rays start.
        reflectivity, specular: (n, 3) diffuse and mirror part; specular is not written in scenes without mirrors.
        incoming: (n, 3) direction of the ray that found the hit, not normalised.
        key: (n,) random stream.
        pixel: (n,) the pixel of the eye that found the hit.
        half: (n,) half of its pixel's samples that a hit belongs to, 0 or 1.
    """

    kind: Bytes
    position: Points
    geometric: Directions
    shading: Directions
    offset: Float32
    reflectivity: Rgb
    specular: Rgb
    incoming: Float32
    key: Keys
    pixel: Int32
    half: Bytes


@bundle
class World(NamedTuple):
    """A scene for kernels.

    Attributes:
        surfaces: that rays meet.
        sight: visibility between two points of the scene: the tracer that finds the surfaces, and thin glass.
        relief, mips: normal maps, and smaller copies of textures.
        looking: the tracer of eyes, if back faces are hidden from them.
    """

    surfaces: Surfaces
    sight: Sight
    relief: Relief = FLAT
    mips: Mips = SHARP
    looking: Tracer = NOWHERE

    @property
    def tracer(self) -> Tracer:
        """The tracer that finds the surfaces."""
        return self.sight.tracer

    @property
    def eyes(self) -> Tracer:
        """The tracer that finds the surfaces that eyes see, also in mirrors."""
        return self.looking if self.looking.scene else self.tracer

    @property
    def panes(self) -> PaneArrays:
        """Thin glass, which the tracer does not find."""
        return self.sight.panes

    @cached_property
    def sharp(self) -> "World":
        """The scene with full textures, as hits without footprints see it."""
        return self._replace(mips=SHARP)

    @cached_property
    def whole(self) -> "World":
        """The scene as light meets it, with all back faces."""
        return self._replace(looking=NOWHERE)


def empty_hits(n: int) -> Hits:
    """Allocate n hits with arbitrary contents.

    Each array has memory to the end of a packet, because kernels read and write whole packets of hits.
    """
    whole = -(-n // LANES) * LANES

    def vectors() -> Float32:
        return np.empty((whole, 3), np.float32)[:n]

    return Hits(
        kind=np.empty(whole, np.uint8)[:n],
        position=vectors(),
        geometric=vectors(),
        shading=vectors(),
        offset=np.empty(whole, np.float32)[:n],
        reflectivity=vectors(),
        specular=vectors(),
        incoming=vectors(),
        key=np.empty(whole, np.uint64)[:n],
        pixel=np.empty(whole, np.int32)[:n],
        half=np.empty(whole, np.uint8)[:n],
    )


@inlined
def reflects(hits: Hits, i: int) -> bool:
    """True if hit i is on a surface that reflects diffusely; other hits need no light."""
    r = hits.reflectivity
    return bool(hits.kind[i] == SURFACE and (r[i, 0] > 0.0 or r[i, 1] > 0.0 or r[i, 2] > 0.0))


@inlined
def reflects_in_lanes(hits: Hits, i: int, n: int) -> bool:
    """`reflects` of hits i to i + 15; False from hit n on."""
    red, green, blue = triples_at(hits.reflectivity, i)
    of_any = (red > np.float32(0.0)) | (green > np.float32(0.0)) | (blue > np.float32(0.0))
    surface = load(hits.kind, i) == np.uint8(SURFACE)
    wanted: bool = surface & of_any & (lane_numbers() < np.int32(n - i))
    return wanted


@inlined
def lift(hits: Hits, i: int) -> Triple:
    """Vector from hit i to the start of its rays: above the triangle, on the viewer's side."""
    g, e = hits.geometric, hits.offset[i]
    return e * g[i, 0], e * g[i, 1], e * g[i, 2]


@inlined
def ray_origin(hits: Hits, i: int) -> Triple:
    """Point at which rays from hit i start."""
    p, (x, y, z) = hits.position, lift(hits, i)
    return p[i, 0] + x, p[i, 1] + y, p[i, 2] + z


@inlined
def triple(array: Float32, i: int) -> Triple:
    """Row i of an (n, 3) array, or one row per lane."""
    at = i * np.int32(3)
    return gather(array, at), gather(array, at + np.int32(1)), gather(array, at + np.int32(2))


def trace_hits(
    world: World, packets: Float32, n: int, *, coherent: bool, near: float, mirrors: bool, hits: Hits
) -> None:
    """Trace rays of eyes 0 to n - 1 and turn them into hits; see `intersect` and `record_hits`.

    Kernels that write rays do not call these two themselves: they would be compiled into each of them.
    """
    intersect(world.eyes, packets, n, coherent, near)
    record_hits(world.sharp, packets, n, mirrors, hits)


@kernel
def record_hits(world: World, packets: Float32, n: int, mirrors: bool, hits: Hits) -> None:
    """Turn traced rays 0 to n - 1 into hits; does not write key, pixel and half.

    Args:
        mirrors: whether to write `specular`.
    """
    surfaces, tracer = world.surfaces, world.sight.tracer
    for i in range(0, n, LANES):
        # Read everything before the first write, so that the compiler loads shared values once.
        # direction, triangle and place (u, v)
        dx, dy = load_row(packets, i, DIRECTION), load_row(packets, i, DIRECTION + 1)
        dz = load_row(packets, i, DIRECTION + 2)
        missed, triangle, u, v = decode_hits(tracer, packets, i)
        # point P, normals on the viewer's side, and R
        x, y, z = position_at(surfaces, triangle, u, v)
        length = sqrt(dx * dx + dy * dy + dz * dz)
        gx, gy, gz = geometric_normal(surfaces, triangle, dx, dy, dz)
        nx, ny, nz = shading_normal(surfaces, triangle, u, v, gx, gy, gz)
        red, green, blue = reflectivity_at(surfaces, triangle, u, v)
        offset = gather(surfaces.offset, triangle)
        if mirrors:
            s_red, s_green, s_blue = specular_at(surfaces, triangle, u, v)
            put_triples(
                hits.specular, i, select(missed, 0.0, s_red), select(missed, 0.0, s_green), select(missed, 0.0, s_blue)
            )
        # a miss is a hit without reflectivity whose position is the unit direction
        put_triples(hits.incoming, i, dx, dy, dz)
        x, y, z = select(missed, dx / length, x), select(missed, dy / length, y), select(missed, dz / length, z)
        put_triples(hits.position, i, x, y, z)
        put_triples(hits.geometric, i, gx, gy, gz)
        put_triples(hits.shading, i, nx, ny, nz)
        store(hits.offset, i, offset)
        put_triples(
            hits.reflectivity, i, select(missed, 0.0, red), select(missed, 0.0, green), select(missed, 0.0, blue)
        )
        store(hits.kind, i, select(missed, np.uint8(ESCAPED), np.uint8(SURFACE)))
    turn_normals(world.relief, tracer, packets, n, hits.geometric, hits.shading)


@step
def turn_normals(
    relief: Relief, tracer: Tracer, packets: Float32, n: int, geometric: Directions, shading: Directions
) -> None:
    """Overwrite the shading normals of hits 0 to n - 1 whose material has a normal map.

    Args:
        packets: the traced rays of the hits.
        geometric, shading: see `Hits`.
    """
    if not has_rows(relief.tangents):
        return
    for i in range(0, n, LANES):
        missed, triangle, u, v = decode_hits(tracer, packets, i)
        texture = gather(relief.texture, gather(relief.surfaces.material, triangle))
        mapped = ~missed & (texture >= np.int32(0))
        if popcount(mapped) > 0:
            g, m = triples_at(geometric, i), triples_at(shading, i)
            x, y, z = mapped_normal(relief, triangle, select(mapped, texture, np.int32(0)), u, v, g, m)
            put_triples(shading, i, select(mapped, x, m[0]), select(mapped, y, m[1]), select(mapped, z, m[2]))
