"""Blur the textures of what eyes see, by what their rays stand for; kernels of other jobs do not contain this."""

from typing import NamedTuple

import numpy as np

from framearray_cli.base.arrays import Float32, Int32, Real, Rgb, Triple

from ..embree.packets import DIRECTION, TFAR, Tracer, decode_hits
from ..inputs.mips import Mips, filtered, footprint
from ..inputs.surfaces import interpolate
from ..kernels.kernel import inlined, kernel
from ..kernels.simd import LANES, gather, load_row, popcount, put_triples, select, sqrt, triples_at
from .hits import Hits


class _Seen(NamedTuple):
    """What sixteen eye rays met.

    Attributes:
        missed: whether they met nothing.
        triangle, material: numbers; u, v: barycentric.
        direction: unit direction of the rays; normal: geometric, on their side.
        side: width of the square that a ray stands for, at the triangle.
    """

    missed: bool
    triangle: int
    material: int
    u: Real
    v: Real
    direction: Triple
    normal: Triple
    side: Real


@kernel
def blur_textures(mips: Mips, tracer: Tracer, packets: Float32, n: int, mirrors: bool, hits: Hits) -> None:
    """Overwrite the reflectivity of hits 0 to n - 1 of eye rays where textures are minified.

    Args:
        packets: the traced rays of the hits.
        mirrors: whether to overwrite `specular`, too.
    """
    s, spread, start = mips.surfaces, np.float32(mips.spread), np.float32(mips.side)
    for i in range(0, n, LANES):
        missed, triangle, u, v = decode_hits(tracer, packets, i)
        material = gather(s.material, triangle)
        x, y = load_row(packets, i, DIRECTION), load_row(packets, i, DIRECTION + 1)
        z = load_row(packets, i, DIRECTION + 2)
        length = np.float32(1.0) / sqrt(x * x + y * y + z * z)
        side = spread * select(missed, np.float32(0.0), load_row(packets, i, TFAR)) + start
        normal = triples_at(hits.geometric, i)
        seen = _Seen(missed, triangle, material, u, v, (x * length, y * length, z * length), normal, side)
        _blur(mips, s.reflectivity, s.reflectivity_texture, seen, i, hits.reflectivity)
        if mirrors:
            _blur(mips, s.specular, s.specular_texture, seen, i, hits.specular)


@inlined
def _blur(mips: Mips, factors: Rgb, textures: Int32, seen: _Seen, i: int, found: Rgb) -> None:
    """`blur_textures` of hits i to i + 15, for the diffuse or the mirror part."""
    texture = gather(textures, seen.material)
    textured = ~seen.missed & (texture >= np.int32(0))
    if popcount(textured) > 0:
        texture = select(textured, texture, np.int32(0))
        f = footprint(mips, texture, seen.triangle, seen.u, seen.v, seen.direction, seen.normal, seen.side)
        blurred = textured & (f.width * f.taps > np.float32(1.0))
        if popcount(blurred) > 0:
            colour = _colour(mips, seen, filtered(mips, texture, f))
            at, (red, green, blue) = seen.material * np.int32(3), triples_at(found, i)
            put_triples(
                found,
                i,
                select(blurred, gather(factors, at) * colour[0], red),
                select(blurred, gather(factors, at + np.int32(1)) * colour[1], green),
                select(blurred, gather(factors, at + np.int32(2)) * colour[2], blue),
            )


@inlined
def _colour(mips: Mips, seen: _Seen, texture: Triple) -> Triple:
    """The texture times the corner colours."""
    s, u, v, w = mips.surfaces, seen.u, seen.v, np.float32(1.0) - seen.u - seen.v
    red, green, blue = texture
    if s.colours.shape[0] > 0:
        red = red * interpolate(s.colours, seen.triangle, 3, 0, u, v, w)
        green = green * interpolate(s.colours, seen.triangle, 3, 1, u, v, w)
        blue = blue * interpolate(s.colours, seen.triangle, 3, 2, u, v, w)
    return red, green, blue
