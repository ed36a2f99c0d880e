"""Light of glossy hits beyond a diffuse surface: f for the eye of an image, with the weights of all hits.

    sum of w t ((f(v, d_s[l]) - R / pi) E_s[l] + (A(v) - R) / pi E_indirect[l])

`accumulate` sums w R / pi E[l] of every hit; this is what is missing. A clear coat of weight c adds its own f and A
times c, and leaves 1 - c F(m . v) of those under it. d_s[l] is the direction in which the hit found
source s, by its key, E_s[l] the irradiance from there, and A(v) the albedo of the surface towards the eye: indirect
light counts as if it came evenly from all sides.
"""

from typing import Any, NamedTuple

import numpy as np

from framearray_cli.base.arrays import Addresses, Float32, Int32, Real, Triple

from ..features.gloss import (
    ALPHA,
    GEOMETRIC,
    KEY,
    LIT_WORDS,
    METAL,
    OF_GLASS,
    OF_MIRRORS,
    POINT,
    SHADING,
    Gloss,
    kept_words,
)
from ..frames.kept_light import HEAD_BYTES, PACKET_BYTES, SHORT_BYTES
from ..frames.setup import FrameSetup
from ..hits.row import HALF, INDIRECT, LIGHT_INDEPENDENT, LIT, OBSCURANCE, REFLECTIVITY, ROW_BYTES, lit_bit
from ..inputs.emitters import Emitters, emitted_colour, kept_point
from ..inputs.gloss import DIELECTRIC, STEPS, albedo_at, coat_of, coat_share, evaluate_lobe, facing, followed_share
from ..inputs.lights import MESH, NO_LIGHTS, LightArrays
from ..inputs.maps import map_texel, map_tint
from ..inputs.shapes import is_plain, source_point, vector_and_factor
from ..kernels.bundle import bundle
from ..kernels.kernel import has_rows, inlined, integer_at, outlined, prefetch, real_at, step
from ..kernels.simd import LANES, bits, lane_numbers, lanes_from, load, select, shorts_from, sqrt, store, words
from ..terms.cells.gather import COLOUR
from .accumulate import direct_light, gathered_light, light_of, packed_column, row_of, weight_of
from .band import INVERSE_PI, Band
from .sourcelists import EYE, MIRRORED, ODD_SCALE, ORDER, ROW, SCALE, START

_LANE_BITS = (1 << np.arange(LANES)).astype(np.int32)


@bundle
class GlossView(NamedTuple):
    """An eye's view of glossy hits.

    Attributes:
        eye: (1, 3) its position; no rows where nothing is glossy.
        lights: at all light positions.
        albedo: see `albedo_table`.
        lobes: whether rays have followed what hits reflect; not behind mirrors.
        glass: whether hits keep the irradiance of each source, which glass dims, and not only whether there is any.
        kept: see `kept_words`.
        bits: (LANES,) the bit of each lane.
    """

    eye: Float32
    lights: LightArrays
    albedo: Float32
    lobes: bool
    glass: bool
    kept: int
    bits: Int32


NO_GLOSS = GlossView(
    np.empty((0, 3), np.float32), NO_LIGHTS, np.empty((0, STEPS, STEPS), np.float32), False, False, 0, _LANE_BITS
)


def gloss_view(setup: FrameSetup) -> GlossView:
    """Views of gloss of all eyes; NO_GLOSS in a scene without."""
    gloss = setup.feature(Gloss)
    if gloss is None:
        return NO_GLOSS
    kept, albedo = kept_words(setup.stored, glass=gloss.glass), gloss.glossy.albedo
    return GlossView(setup.cams.position[:1], setup.lights, albedo, gloss.follows, gloss.glass, kept, _LANE_BITS)


class Coat(NamedTuple):
    """A glossy hit.

    Attributes:
        at: address of what is kept of it.
        alpha, v, m: see `evaluate_lobe`.
        p, g: point and geometric normal.
        key: random key, in lanes.
        even: the share of indirect light in the lobe that counts as even; rays have followed the rest.
        share: w t of each channel.
        base, f0, diffuse: colours; `base` over what a clear coat leaves.
    """

    at: int
    alpha: Real
    v: Triple
    m: Triple
    p: Triple
    g: Triple
    key: Any
    even: Real
    share: Triple
    base: Triple
    f0: Triple
    diffuse: Triple


@outlined
def find_mesh(emitters: Emitters, key: Any, s: int, p: Triple, g: Triple, m: Triple, room: Float32) -> None:
    """Write the vector to the point that a hit keeps of a mesh, the factor of its irradiance, and its texture."""
    kept, (x, y, z), factor = kept_point(emitters, key, s, p, g, m)
    store(room, 0, x)
    store(room, LANES, y)
    store(room, 2 * LANES, z)
    store(room, 3 * LANES, factor)
    colour = emitted_colour(emitters, kept)
    for channel in range(3):
        store(room, (4 + channel) * LANES, colour[channel])


# Rows of `Band.room` with light that was kept, of each channel.
TAKEN = 7
# Prefetch the gloss of the hit that comes this many hits later.
AHEAD = 12


@inlined
def _triple_at(address: int, column: int) -> Triple:
    return real_at(address, column), real_at(address, column + 1), real_at(address, column + 2)


@step
def add_gloss(
    band: Band,
    first_pixel: int,
    n: int,
    sources: Addresses,
    view: GlossView,
    channels: int,
    n_lights: int,
    mean: bool,
    positive: bool,
) -> None:
    """Add what glossy hits send beyond diffuse light to the sums of pixels first_pixel to first_pixel + n - 1.

    Args:
        sources, channels, n_lights, mean: as `accumulate` took them.
        positive: whether sums below 0 are rounding errors, as of metals, whose diffuse light is taken away again.
    """
    if not has_rows(view.eye):
        return
    for i in range(n):
        pixel, inverse = first_pixel + i, np.float32(1.0)
        if mean:
            total = np.float32(0.0)
            for s in range(sources.shape[0]):
                listed = sources[s]
                if listed[START] == 0:
                    continue
                for entry in range(integer_at(listed[START], pixel), integer_at(listed[START], pixel + 1)):
                    total += _weight(sources, s, pixel, entry)
            inverse = np.float32(1.0) / total if total > 0.0 else np.float32(0.0)
        for s in range(sources.shape[0]):
            listed = sources[s]
            if listed[START] == 0:
                continue
            last = integer_at(listed[START], first_pixel + n)
            for entry in range(integer_at(listed[START], pixel), integer_at(listed[START], pixel + 1)):
                source, hit = sources[row_of(listed, s, entry)], integer_at(listed[ORDER], entry)
                if entry + AHEAD < last:
                    _fetch(sources[row_of(listed, s, entry + AHEAD)], integer_at(listed[ORDER], entry + AHEAD), view)
                at = packed_column(light_of(source, hit), _kept_bytes(source, view))
                if at == 0:
                    continue
                w = inverse * _weight(sources, s, pixel, entry)
                if w != 0.0:
                    _add_hit(band, i, source, hit, at, w, view, channels, n_lights)
        if positive:
            _cut_at_zero(band, i)


@inlined
def _kept_bytes(source: Addresses, view: GlossView) -> int:
    """The bytes of what is kept of a glossy hit of a source."""
    more = OF_MIRRORS if source[MIRRORED] != 0 else (OF_GLASS if view.glass else 0)
    return 4 * (LIT_WORDS + view.kept + more)


@inlined
def _fetch(source: Addresses, hit: int, view: GlossView) -> None:
    """Prefetch what is kept of a hit that comes soon."""
    n_bytes = _kept_bytes(source, view)
    at = packed_column(light_of(source, hit), n_bytes)
    if at != 0:
        prefetch(at, n_bytes)


@inlined
def _cut_at_zero(band: Band, i: int) -> None:
    """Set negative sums of pixel i of the band to 0."""
    nothing = np.float32(0.0)
    for channel in range(3):
        for column in (INDIRECT + channel, LIGHT_INDEPENDENT + channel):
            band.sums[i, column] = max(band.sums[i, column], nothing)
        for l in range(0, band.direct.shape[2], LANES):
            at = (3 * i + channel) * band.direct.shape[2] + l
            value = load(band.direct, at)
            store(band.direct, at, select(value < nothing, nothing, value))


@inlined
def _weight(sources: Addresses, s: int, pixel: int, entry: int) -> Real:
    """The weight of an entry of the list in row s, with the factor of its pixel."""
    listed = sources[s]
    hit = integer_at(listed[ORDER], entry)
    row = sources[row_of(listed, s, entry)][ROW] + ROW_BYTES * hit
    even = real_at(listed[SCALE], pixel) if listed[SCALE] != 0 else np.float32(1.0)
    odd = real_at(listed[ODD_SCALE], pixel) if listed[ODD_SCALE] != 0 else even
    found: Real = (odd if real_at(row, HALF) > 0.0 else even) * weight_of(listed, entry, hit)
    return found


@inlined
def _add_hit(
    band: Band, i: int, source: Addresses, hit: int, at: int, w: Real, view: GlossView, channels: int, n_lights: int
) -> None:
    """Add what one glossy hit sends beyond diffuse light to pixel i of the band; `at` is the address of its gloss."""
    one, nothing = np.float32(1.0), np.float32(0.0)
    row, black = source[ROW] + ROW_BYTES * hit, (nothing, nothing, nothing)
    # 1. The direction to the viewer, the tint of mirrors, and the colours of the surface.
    p, m = _triple_at(at, POINT), _triple_at(at, SHADING)
    last = LIT_WORDS + view.kept
    direct = direct_light(light_of(source, hit), channels, n_lights)
    mirrored = source[MIRRORED] != 0
    eye = (view.eye[0, 0], view.eye[0, 1], view.eye[0, 2])
    if source[EYE] != 0:
        eye = _triple_at(source[EYE], 0)
    x, y, z = eye[0] - p[0], eye[1] - p[1], eye[2] - p[2]
    tint: Triple = (one, one, one)
    if mirrored:
        x, y, z = _triple_at(at, last)
        tint = _triple_at(at, last + 3)
    scale = one / sqrt(x * x + y * y + z * z)
    v = (scale * x, scale * y, scale * z)
    alpha, code = real_at(at, ALPHA), integer_at(at, METAL)
    metal, weight, rough = coat_of(code) if code < 0 else (real_at(at, METAL), nothing, one)
    left = coat_share(weight, m, v) if code < 0 else one
    seen = _triple_at(row, REFLECTIVITY)  # t R
    if view.glass and not mirrored:
        base = _triple_at(at, last)
        tint = (seen[0] / base[0], seen[1] / base[1], seen[2] / base[2])
    else:
        base = (
            seen[0] / tint[0] if tint[0] > nothing else nothing,
            seen[1] / tint[1] if tint[1] > nothing else nothing,
            seen[2] / tint[2] if tint[2] > nothing else nothing,
        )
    of_coat = DIELECTRIC * (one - metal)
    f0 = (of_coat + metal * base[0], of_coat + metal * base[1], of_coat + metal * base[2])
    diffuse = ((one - metal) * base[0], (one - metal) * base[1], (one - metal) * base[2])
    low = words(lane_numbers() * np.int32(0)) + np.uint64(np.uint32(integer_at(at, KEY)))
    key = low + (np.uint64(np.uint32(integer_at(at, KEY + 1))) << np.uint64(32))
    # 2. Of the surface, which is diffuse in sums of pixels; then of its clear coat, which these lack.
    lessened = (base[0] / left, base[1] / left, base[2] / left)
    w *= left
    for _ in range(2 if code < 0 else 1):
        share = (w * tint[0], w * tint[1], w * tint[2])
        even = one if mirrored or not view.lobes else one - followed_share(alpha)
        coat = Coat(at, alpha, v, m, p, _triple_at(at, GEOMETRIC), key, even, share, lessened, f0, diffuse)
        _add_indirect(band, i, source, hit, row, coat, view, channels, n_lights)
        _add_all_direct(band, i, coat, view, row, direct, channels, n_lights)
        w, alpha = w / left * weight, rough * rough
        f0, lessened, diffuse = (DIELECTRIC, DIELECTRIC, DIELECTRIC), black, black


@inlined
def _add_all_direct(
    band: Band, i: int, coat: Coat, view: GlossView, row: int, direct: int, channels: int, n_lights: int
) -> None:
    """Add (f - R / pi) E of all sources.

    Args:
        row, direct: addresses of the row of the hit, and of its direct light.
    """
    n_sources, packets = view.lights.kind.shape[0], (n_lights + LANES - 1) // LANES
    for s in range(n_sources):
        drawn = _drawn(view.lights, coat.key, s)
        for packet in range(packets):
            number = s * packets + packet
            if view.glass:
                kept = direct
                if n_sources == 1:
                    known = (int(real_at(row, LIT)) >> lit_bit(n_lights, LANES * packet)) & 1
                    direct += known * channels * PACKET_BYTES
                else:
                    known, kept = 1, coat.at + 4 * LIT_WORDS + number * channels * PACKET_BYTES
                lit = _take_light(band.room, kept, channels) if known != 0 else 0
            else:
                lit = (integer_at(coat.at, LIT_WORDS + number // 2) >> (LANES * (number % 2))) & 0xFFFF
            if lit != 0:
                _add_direct(band, i, coat, view, s, LANES * packet, lit, channels, drawn)


@inlined
def _drawn(lights: LightArrays, key: Any, s: int) -> tuple[bool, Triple, Any]:
    """True if source s is plain, see `is_plain`; the point and the texel that the hit of a random key draws of it."""
    plain = is_plain(lights, s)
    return plain, source_point(lights, key, s, plain or lights.kind[s] == MESH), map_texel(lights.maps, s, key)


@inlined
def _take_light(room: Float32, kept: int, channels: int) -> int:
    """Copy a packet of the irradiance of a source from an address; return whether there is any light."""
    found = 0
    for channel in range(channels):
        values = lanes_from(kept + channel * PACKET_BYTES)
        store(room, (TAKEN + channel) * LANES, values)
        found |= bits(~(values == np.float32(0.0)))
    return found


@inlined
def _add_indirect(
    band: Band, i: int, source: Addresses, hit: int, row: int, coat: Coat, view: GlossView, channels: int,
    n_lights: int,
) -> None:  # fmt: skip
    """Add (A - R) W and (A - R) S, and (A - R) / pi E of cells."""
    one = np.float32(1.0)
    face_on, edge, through = albedo_at(view.albedo, coat.alpha, facing(coat.m, coat.v))
    cells = gathered_light(light_of(source, hit))
    for channel in range(3):
        base, f0 = coat.base[channel], coat.f0[channel]
        albedo = coat.diffuse[channel] * (one - f0 - (one - f0) * through)
        albedo += coat.even * (f0 * face_on + edge)
        more = coat.share[channel] * (albedo - base)
        band.sums[i, INDIRECT + channel] += more * real_at(row, OBSCURANCE + channel)
        seen = real_at(row, REFLECTIVITY + channel)
        if seen > 0.0:
            band.sums[i, LIGHT_INDEPENDENT + channel] += more / seen * real_at(row, LIGHT_INDEPENDENT + channel)
        if cells != 0:
            factor = more * INVERSE_PI * real_at(cells, COLOUR + channel)
            light = cells + HEAD_BYTES + (channel * SHORT_BYTES if channels == 3 else 0)
            for l in range(0, n_lights, LANES):
                here = (3 * i + channel) * band.direct.shape[2] + l
                store(band.direct, here, load(band.direct, here) + shorts_from(light) * factor)
                light += channels * SHORT_BYTES


@inlined
def _add_direct(
    band: Band, i: int, coat: Coat, view: GlossView, s: int, l: int, lit: int, channels: int,
    drawn: tuple[bool, Triple, Any],
) -> None:  # fmt: skip
    """Add (f - R / pi) E_s at light positions l to l + 15, of which the bits of `lit` have light of source s.

    Args:
        drawn: see `_drawn`.
    """
    lights, one, nothing, (plain, q, texel) = view.lights, np.float32(1.0), np.float32(0.0), drawn
    n_lights, stride = lights.lit.shape[1], band.direct.shape[2]
    # 1. The vector to the source, and the geometry factor of its irradiance.
    if lights.kind[s] == MESH:
        find_mesh(lights.emitters, coat.key, s, coat.p, coat.g, coat.m, band.room)
        x, y, z, factor = (
            load(band.room, 0),
            load(band.room, LANES),
            load(band.room, 2 * LANES),
            load(band.room, 3 * LANES),
        )
    else:
        x, y, z, factor = vector_and_factor(lights, s, plain, lane_numbers() + np.int32(l), coat.p, coat.g, coat.m, q)
    square = x * x + y * y + z * z
    scale = one / sqrt(select(square > nothing, square, one))
    lobe, fresnel = evaluate_lobe(coat.alpha, coat.m, coat.v, (scale * x, scale * y, scale * z))
    if not view.glass:
        none = (load(view.bits, 0) & np.int32(lit)) == np.int32(0)
        factor = select(none, nothing, factor)
    # 2. F D V + (1 - F) diffuse / pi - R / pi of each channel.
    for channel in range(3):
        f0 = coat.f0[channel]
        reflected = fresnel * (one - f0) + f0
        more = reflected * lobe + ((one - reflected) * coat.diffuse[channel] - coat.base[channel]) * INVERSE_PI
        of = channel if channels == 3 else 0
        strength = load(lights.strength, (s * channels + of) * n_lights + l)
        light = factor * strength
        if view.glass:
            light = load(band.room, (TAKEN + of) * LANES)
        elif channels == 3:
            light = light * (
                load(band.room, (4 + channel) * LANES)
                if lights.kind[s] == MESH
                else map_tint(lights.maps, s, lane_numbers() + np.int32(l), texel, channel)
            )
        at = (3 * i + channel) * stride + l
        store(band.direct, at, load(band.direct, at) + light * more * coat.share[channel])
