"""Summing the hits of a band of pixels in one pass over all sources.

Notation of the kernels: a hit has weight w, reflectivity R, irradiance E[l] and a row, see `hits/row.py`. Its share of
the direct light is w R / pi.
"""

import numpy as np

from framearray_cli.base.arrays import Addresses, Real

from ..features.emission import EMISSION_COLUMNS, SOURCE, TEXTURE
from ..frames.kept_light import FLAGS, HEAD_BYTES, INDIRECT_LIGHT, PACKED, PACKET_BYTES, SHORT_BYTES, indirect_bytes
from ..hits.row import HALF, LIT, REFLECTIVITY, ROW_BYTES, WEIGHT, lit_bit
from ..kernels.kernel import index, inlined, integer_at, kernel, long_at, prefetch, real_at
from ..kernels.simd import LANES, lane_numbers, lanes_from, load, reals, shorts_from, store
from ..terms.cells.gather import COLOUR
from .band import HITS_AT_ONCE, INVERSE_PI, Band
from .sourcelists import EMISSION, LIGHTS, ODD_SCALE, OF, ORDER, ROW, SCALE, SHARES, START, WEIGHTS

# Prefetch the irradiance of the hit that comes this many hits later, and the row of the one twice as far ahead: memory
# answers in about the time that the sums of this many hits take.
AHEAD = 8
# In a list over all eyes a pixel has as many hits as in the lists of some seven eyes together.
AHEAD_OF_ALL = 56


@kernel
def accumulate(
    band: Band, first_pixel: int, n: int, sources: Addresses, channels: int, n_lights: int, mean: bool
) -> None:
    """Sum the hits of pixels first_pixel to first_pixel + n - 1, pixel by pixel, source by source.

    Args:
        sources: of a `SourceList`.
        channels: of irradiance, 1 or 3.
        n_lights: of irradiance; 0 leaves direct light out.
        mean: replace what the band holds by means over the weights, zero in a pixel without hits; else add sums to it.
    """
    for i in range(n):
        # --- loop state ---
        pixel = first_pixel + i
        n_hits = 0  # hits of the pixel
        waiting = 0  # lit hits whose share and address are noted in the band, but not yet summed
        fresh = mean  # whether the pixel's direct sums still hold something else, to be overwritten
        total = reals(lane_numbers()) * np.float32(0.0)  # sum of w row, in a register; its first lane sums w

        for s in range(sources.shape[0]):
            # 1. The hits of the pixel in this list, and the factors of its even and odd samples.
            listed = sources[s]
            if listed[START] == 0:  # no list, but a source of the one before
                continue
            start, end = integer_at(listed[START], pixel), integer_at(listed[START], pixel + 1)
            last = integer_at(listed[START], first_pixel + n)
            even = real_at(listed[SCALE], pixel) if listed[SCALE] != 0 else np.float32(1.0)
            odd = real_at(listed[ODD_SCALE], pixel) if listed[ODD_SCALE] != 0 else even
            ahead = AHEAD_OF_ALL if listed[OF] != 0 else AHEAD
            n_hits += end - start
            for entry in range(start, end):
                _fetch(sources, s, entry, ahead, last, channels, n_lights)
                # 2. The source and the weight w of the hit.
                source, hit = sources[row_of(listed, s, entry)], integer_at(listed[ORDER], entry)
                row = source[ROW] + ROW_BYTES * hit
                w = (odd if real_at(row, HALF) > 0.0 else even) * weight_of(listed, entry, hit)
                # 3. What has no l: w R W, w B, w W and w R at once.
                total = total + lanes_from(row) * w
                # 4. Note where the light of a hit is, and its share w R / pi.
                lit, light, own = int(real_at(row, LIT)), light_of(source, hit), _own_light(source, hit)
                gathered = gathered_light(light)
                if (lit == 0 and gathered == 0 and own == 0) or n_lights == 0:
                    continue
                if waiting >= HITS_AT_ONCE:
                    _add_light(band, i, waiting, channels, n_lights, fresh)
                    waiting, fresh = 0, False
                direct = direct_light(light, channels, n_lights)
                waiting = _note_light(band, waiting, lit, direct, gathered, own, row, w)

        # 5. Divide by sum(w) for means, else add to the band; then sum the direct light of the hits that still wait.
        if mean:
            store(band.sums, LANES * i, total)
            weight = band.sums[i, WEIGHT]
            inverse = np.float32(1.0) / weight if weight > 0.0 else np.float32(0.0)
            store(band.sums, LANES * i, total * inverse)
            band.hits[i] = n_hits
            _scale(band, i, waiting, n_lights, fresh, inverse)
        else:
            store(band.sums, LANES * i, load(band.sums, LANES * i) + total)
        _add_light(band, i, waiting, channels, n_lights, fresh)


@inlined
def row_of(listed: Addresses, s: int, entry: int) -> int:
    """The row of the source of an entry, for the list in row s: that row itself, or one after it."""
    return s + (integer_at(listed[OF], entry) if listed[OF] != 0 else 0)


@inlined
def weight_of(source: Addresses, entry: int, hit: int) -> Real:
    """The weight of a hit: of its entry, else its own, else 1."""
    w = real_at(source[WEIGHTS], hit) if source[WEIGHTS] != 0 else np.float32(1.0)
    if source[SHARES] != 0:
        w = real_at(source[SHARES], entry)
    return w


@inlined
def _add_light(band: Band, i: int, n: int, channels: int, n_lights: int, fresh: bool) -> None:
    """Add the direct light of the n waiting hits to pixel i of the band; each sum is read and written once."""
    # --- loop state ---
    stride = band.direct.shape[2]  # from channel to channel of a pixel
    any_lit = 0  # LIT of all hits q of the queue together: packets of light positions with light for any of them
    for q in range(n):
        any_lit |= band.lit[q]

    for l in range(0, n_lights, LANES):
        # 1. Sum w R / pi E[l] of the hits lit by light positions l to l + 15, in registers.
        at, bit = 3 * i * stride + l, lit_bit(n_lights, l)
        red = green = blue = reals(lane_numbers()) * np.float32(0.0)
        for q in range(n if (any_lit >> bit) & 1 else 0):
            if (band.lit[q] >> bit) & 1 == 0:
                continue
            place = band.places[q]
            if place >= 0 and place & 1:  # indirect light; packets follow each other
                first = second = third = shorts_from(place - 1)
                if channels == 3:
                    second, third = shorts_from(place - 1 + SHORT_BYTES), shorts_from(place - 1 + 2 * SHORT_BYTES)
                band.places[q] = place + channels * SHORT_BYTES
            else:  # direct light, or strengths of a source
                start, step = (place, PACKET_BYTES) if place >= 0 else (4 * l - place, 4 * n_lights)
                first = second = third = lanes_from(start)
                if channels == 3:
                    second, third = lanes_from(start + step), lanes_from(start + 2 * step)
                if place >= 0:
                    band.places[q] = place + channels * PACKET_BYTES
            red = red + first * band.shares[q, 0]
            green = green + second * band.shares[q, 1]
            blue = blue + third * band.shares[q, 2]

        # 2. Only then add the sum before: in a sum of a million hits each single one would lose its last digits.
        if not fresh:
            red, green = red + load(band.direct, at), green + load(band.direct, at + stride)
            blue = blue + load(band.direct, at + 2 * stride)
        store(band.direct, at, red)
        store(band.direct, at + stride, green)
        store(band.direct, at + 2 * stride, blue)


@inlined
def light_of(source: Addresses, hit: int) -> int:
    """The address of the light of a hit with its flags, see `frames/kept_light.py`."""
    return long_at(source[LIGHTS], hit) if source[LIGHTS] != 0 else 0


@inlined
def gathered_light(light: int) -> int:
    """The address of indirect light; 0 if there is none."""
    return light & ~FLAGS if light & INDIRECT_LIGHT else 0


@inlined
def direct_light(light: int, channels: int, n_lights: int) -> int:
    """The address of direct light, if there is any."""
    return (light & ~FLAGS) + (indirect_bytes(channels, n_lights) if light & INDIRECT_LIGHT else 0)


@inlined
def packed_column(light: int, n_bytes: int) -> int:
    """The address of the packed column of a hit, of so many bytes; 0 if it has none."""
    return (light & ~FLAGS) - n_bytes if light & PACKED else 0


@inlined
def _note_light(band: Band, waiting: int, lit: int, direct: int, gathered: int, own: int, row: int, w: Real) -> int:
    """Note the direct light of a lit hit with its share w R / pi, its light from cells with w R c / pi, and its own.

    Of what the hit sends out itself the share is w times its texture, and the light is the strength of its source.

    Args:
        waiting: length of the queue; direct, gathered, own: addresses of the light, gathered and own 0 for none.

    Returns:
        the new length.
    """
    if lit != 0:
        at = index(waiting)
        band.places[at], band.lit[at] = direct, lit
        for channel in range(3):
            band.shares[at, channel] = w * INVERSE_PI * real_at(row, REFLECTIVITY + channel)
        waiting += 1
    if gathered != 0:
        at = index(waiting)
        band.places[at], band.lit[at] = (gathered + HEAD_BYTES) | 1, -1
        for channel in range(3):
            share = w * INVERSE_PI * real_at(row, REFLECTIVITY + channel)
            band.shares[at, channel] = share * real_at(gathered, COLOUR + channel)
        waiting += 1
    if own != 0:
        at = index(waiting)
        band.places[at], band.lit[at] = -band.strength[int(real_at(own, SOURCE))], -1
        for channel in range(3):
            band.shares[at, channel] = w * real_at(own, TEXTURE + channel)
        waiting += 1
    return waiting


@inlined
def _own_light(source: Addresses, hit: int) -> int:
    """The address of what a hit sends out itself, see `record_emission`; 0 for nothing."""
    address = 0
    if source[EMISSION] != 0:
        at = source[EMISSION] + 4 * EMISSION_COLUMNS * hit
        address = at if real_at(at, SOURCE) >= 0.0 else 0
    return address


@inlined
def _fetch(sources: Addresses, s: int, entry: int, ahead: int, last: int, channels: int, n_lights: int) -> None:
    """Prefetch row, weight and address of a hit that comes soon, and the light of an earlier one."""
    listed, later, next_one = sources[s], entry + 2 * ahead, entry + ahead
    if later < last:
        hit, source = integer_at(listed[ORDER], later), sources[row_of(listed, s, later)]
        prefetch(source[ROW] + ROW_BYTES * hit, 1)
        prefetch(source[LIGHTS] + 8 * hit, 1)
        if listed[WEIGHTS] != 0:
            prefetch(listed[WEIGHTS] + 4 * hit, 1)
    if next_one < last:
        hit, source = integer_at(listed[ORDER], next_one), sources[row_of(listed, s, next_one)]
        light = light_of(source, hit)
        if light != 0:
            n_bytes, lit = (
                indirect_bytes(channels, n_lights) if light & INDIRECT_LIGHT else 0,
                int(real_at(source[ROW], LANES * hit + LIT)),
            )
            while lit != 0:
                n_bytes, lit = n_bytes + channels * PACKET_BYTES, lit & (lit - 1)
            prefetch(light & ~FLAGS, n_bytes)


@inlined
def _scale(band: Band, i: int, n: int, n_lights: int, fresh: bool, factor: Real) -> None:
    """Multiply the shares of the n waiting hits, and the direct sums of pixel i of the band unless they are fresh."""
    for q in range(n):
        for channel in range(3):
            band.shares[q, channel] *= factor
    if not fresh:
        for channel in range(3):
            for l in range(n_lights):
                band.direct[i, channel, l] *= factor
