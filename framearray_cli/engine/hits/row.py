"""The row of a hit: one cache line that holds all of it but its light, so that one vector sum adds hits."""

import numpy as np

from framearray_cli.base.arrays import Float32, Rgb

from ..kernels.kernel import inlined, kernel
from ..kernels.simd import LANES, bits, load
from .hits import ESCAPED, Hits

# Columns of a row, and of sums of rows. WEIGHT is 1; INDIRECT R W; LIGHT_INDEPENDENT radiance, the same under every
# light; OBSCURANCE W; REFLECTIVITY R: the first of three channels each. LIT is a whole number with a bit per packet of
# light positions, see `lit_bit`, set where any irradiance is not zero; HALF 1 for an odd sample of its pixel, else 0;
# CLEAR the share of what lies outside the scene that shows: 1 where the ray escaped, else 0.
WEIGHT, INDIRECT, LIGHT_INDEPENDENT, OBSCURANCE, REFLECTIVITY, LIT, HALF, CLEAR = 0, 1, 4, 7, 10, 13, 14, 15
ROW_BYTES = 4 * LANES

# Instead of a half, 0 or 1: each hit has its own, see HALF.
BY_SAMPLE = -1

# A float32 holds whole numbers of this many bits exactly.
LIT_BITS = 24


@inlined
def lit_bit(n_lights: int, l: int) -> int:
    """The bit of LIT for light position l; one bit stands for a packet of LANES positions, or for 2, 4, ... packets."""
    packet, last = l >> 4, n_lights - 1 >> 4
    while last >= LIT_BITS:
        packet, last = packet >> 1, last >> 1
    return packet


@kernel
def write_rows(
    hits: Hits,
    n: int,
    background: Rgb,
    obscurance: Rgb,
    skylight: Rgb,
    throughput: Rgb,
    irradiance: Float32,
    row: Float32,
) -> None:
    """Write the rows of hits 0 to n - 1.

    Args:
        background: (3,) radiance that escaped rays see.
        obscurance: (>= n, 3) W.
        skylight: (>= n, 3) S, the background that reaches each hit, or (0, 3).
        throughput: (>= n, 3) tint t of the mirrors on the way to each hit, or (0, 3) without mirrors.
        irradiance: (n, channels, n_lights) E[l].
        row: (n, LANES) overwritten.
    """
    for i in range(n):
        # 1. R W, B, W and R of each channel, with R tinted by t behind mirrors. B has no l: it is the background where
        #    the ray left the scene, and R S.
        row[i, WEIGHT] = 1.0
        for channel in range(3):
            tint = throughput[i, channel] if throughput.shape[0] else np.float32(1.0)
            reflectivity = tint * hits.reflectivity[i, channel]
            light_independent = tint * background[channel] if hits.kind[i] == ESCAPED else np.float32(0.0)
            if skylight.shape[0]:
                light_independent += reflectivity * skylight[i, channel]
            row[i, INDIRECT + channel] = reflectivity * obscurance[i, channel]
            row[i, LIGHT_INDEPENDENT + channel] = light_independent
            row[i, OBSCURANCE + channel] = obscurance[i, channel]
            row[i, REFLECTIVITY + channel] = reflectivity
        # 2. Where E[l] is not zero, the half of the sample, and whether it shows what lies outside.
        row[i, LIT] = _lit_bits(irradiance, i)
        row[i, HALF] = hits.half[i]
        row[i, CLEAR] = 1.0 if hits.kind[i] == ESCAPED else 0.0


@inlined
def _lit_bits(irradiance: Float32, i: int) -> int:
    """The packets of light positions that give hit i any light, as bits; see `lit_bit`."""
    channels, n_lights = irradiance.shape[1], irradiance.shape[2]
    found = 0
    for channel in range(channels):
        row = (i * channels + channel) * n_lights
        for l in range(0, n_lights, LANES):
            light = bits(~(load(irradiance, row + l) == np.float32(0.0)))  # set for NaN, too
            if l + LANES > n_lights:  # the last packet reads beyond the end
                light &= (1 << (n_lights - l)) - 1
            found |= int(light != 0) << lit_bit(n_lights, l)
    return found
