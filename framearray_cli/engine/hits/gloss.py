"""What is kept of hits on glossy surfaces, so that composing can find the light that they send to any eye."""

import numpy as np

from framearray_cli.base.arrays import Float32, Int32, Rgb

from ..embree.packets import Tracer, decode_hits
from ..inputs.gloss import DARKEST, Glossy, gloss_at
from ..kernels.kernel import kernel
from ..kernels.simd import LANES, bits, load, put_triples, select, store, triples_at
from .hits import Hits

# Columns of what is kept: alpha, 0 without gloss; metal; both halves of the key; point, shading and geometric normal;
# then LIT, 16 bits per source and packet of light positions; in a scene with glass, which tints light, the irradiance
# of every source, channel and light position in their place. Behind mirrors, then the direction to the viewer and t;
# else, in a scene with glass, the base colour, which tells what passes on the way to an eye.
ALPHA, METAL, KEY, POINT, SHADING, GEOMETRIC, LIT = 0, 1, 2, 4, 7, 10, 13
OF_MIRRORS, OF_GLASS = 6, 3


def gloss_columns(n_sources: int, channels: int, n_lights: int, *, glass: bool, mirrored: bool) -> int:
    """The number of columns of a hit.

    Args:
        glass: whether the scene has any.
        mirrored: whether mirrors show the hit.
    """
    packets = n_sources * -(-n_lights // LANES)
    kept = n_sources * channels * n_lights if glass else -(-packets // 2)
    return LIT + kept + (OF_MIRRORS if mirrored else OF_GLASS * glass)


@kernel
def record_gloss(
    of: Glossy, tracer: Tracer, packets: Float32, n: int, hits: Hits, alpha: Float32, metal: Float32
) -> None:
    """Find how glossy the surfaces are that traced rays 0 to n - 1 meet; a base colour of them is at least DARKEST.

    Args:
        hits: of these rays; changes `reflectivity`.
        alpha, metal: (n or more, a multiple of LANES) overwritten, see `gloss_at`.
    """
    nothing = np.float32(0.0)
    for i in range(0, n, LANES):
        missed, triangle, u, v = decode_hits(tracer, packets, i)
        a, m = gloss_at(of, triangle, u, v)
        a = select(missed, nothing, a)
        store(alpha, i, a)
        store(metal, i, m)
        red, green, blue = triples_at(hits.reflectivity, i)
        least = select(a > nothing, DARKEST, nothing)
        put_triples(
            hits.reflectivity, i, select(red > least, red, least), select(green > least, green, least),
            select(blue > least, blue, least),
        )  # fmt: skip


@kernel
def keep_gloss(hits: Hits, n: int, alpha: Float32, metal: Float32, throughput: Rgb, glass: bool, out: Float32) -> None:
    """Write what is kept of hits 0 to n - 1, but for LIT and what stands in its place, which becomes 0.

    Args:
        glass: whether the scene has any.
        throughput: (>= n, 3) the tint t of the mirrors on the way to each hit, or (0, 3) without mirrors.
        out: (n, columns) overwritten.
    """
    last = out.shape[1] - (OF_MIRRORS if throughput.shape[0] else (OF_GLASS if glass else 0))
    words, keys = out.view(np.int32), hits.key.view(np.int32)
    for i in range(n):
        out[i, ALPHA], out[i, METAL] = alpha[i], metal[i]
        words[i, KEY], words[i, KEY + 1] = keys[2 * i], keys[2 * i + 1]
        for axis in range(3):
            out[i, POINT + axis] = hits.position[i, axis]
            out[i, SHADING + axis] = hits.shading[i, axis]
            out[i, GEOMETRIC + axis] = hits.geometric[i, axis]
        for column in range(LIT, last):
            words[i, column] = 0
        if throughput.shape[0]:
            x, y, z = hits.incoming[i, 0], hits.incoming[i, 1], hits.incoming[i, 2]
            scale = np.float32(-1.0) / np.sqrt(x * x + y * y + z * z)
            out[i, last], out[i, last + 1], out[i, last + 2] = scale * x, scale * y, scale * z
            for channel in range(3):
                out[i, last + 3 + channel] = throughput[i, channel]
        elif glass:
            for channel in range(3):
                out[i, last + channel] = hits.reflectivity[i, channel]


@kernel
def keep_lit(irradiance: Float32, n: int, s: int, out: Int32) -> None:
    """Set the bits of LIT where source s gives light to hits 0 to n - 1.

    Args:
        irradiance: (>= n, channels, n_lights) of that source.
        out: (n, columns) what is kept, as integers.
    """
    channels, n_lights = irradiance.shape[1], irradiance.shape[2]
    first = s * ((n_lights + LANES - 1) // LANES)
    for i in range(n):
        for l in range(0, n_lights, LANES):
            lit = 0
            for channel in range(channels):
                lit |= bits(~(load(irradiance, (i * channels + channel) * n_lights + l) == np.float32(0.0)))
            if l + LANES > n_lights:  # the last packet reads beyond the end
                lit &= (1 << (n_lights - l)) - 1
            at = first + l // LANES
            out[i, LIT + at // 2] |= np.int32(np.uint32(lit << (LANES * (at % 2))))


@kernel
def keep_light(irradiance: Float32, n: int, s: int, out: Float32) -> None:
    """Keep what source s gives to hits 0 to n - 1, in a scene with glass.

    Args:
        irradiance: (>= n, channels, n_lights) of that source.
        out: (n, columns) what is kept.
    """
    channels, n_lights = irradiance.shape[1], irradiance.shape[2]
    first = LIT + s * channels * n_lights
    for i in range(n):
        for channel in range(channels):
            for l in range(n_lights):
                out[i, first + channel * n_lights + l] = irradiance[i, channel, l]
