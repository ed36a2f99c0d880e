"""Environment maps: the direction that a hit draws, in proportion to luminance times solid angle.

The radiance is the same all over a texel. A texel is chosen by an alias table [Walker77], a point in it uniformly, so
that the estimate of irradiance is the same for every texel but for its colour: the luminance of the whole map,
integrated over all directions, times (r, g, b) / luminance of the texel. Nothing here depends on the light position:
that only turns the direction.
"""

from typing import Any, NamedTuple

import numpy as np

from framearray_cli.base.arrays import Float32, Float64, Int32, Rgb, Triple
from framearray_cli.base.colour import LUMINANCE
from framearray_cli.scene.paths.lightpath import LightPath
from framearray_cli.scene.paths.panorama import SUNS, texel_powers

from ..kernels.bundle import bundle
from ..kernels.kernel import has_rows, inlined, outlined
from ..kernels.simd import gather, integers, reals, row_at, select, sqrt
from .random import SOURCES, UNIT_24, r2, random_word

# Columns of `Maps.grid`: first slot of the alias table and the number of slots - 1; first tint; width and height in
# texels; first number of `angles`; first pixel, width and height of what eyes see.
SLOT, MASK, TINT, WIDTH, HEIGHT, ANGLE, SEEN, SEEN_WIDTH, SEEN_HEIGHT = range(9)
COLUMNS = 9
WITHIN = (1 << 20) + (1 << 19)  # and what follows: streams of the places within texels of sources 0, 1, ...


@bundle
class Maps(NamedTuple):
    """Maps of all environments, in the form that kernels read.

    Attributes:
        grid: (n_sources, COLUMNS) places of the numbers of a source; zeros of sources without a map, whose texel is
            then the first, which is white.
        share: (n_slots,) the share of a slot's own texel; `other`: (n_slots,) the texel that has the rest.
        tint: (n_texels, 3) (r, g, b) over luminance; no rows where no source has a map.
        angles: of each map the cosines and sines of the middles of columns, in pairs, and of rows the sines of all
            edges, from the top.
        up: (3,) unit, up in the scene.
        seen: (n_pixels, 3) radiance of all maps as eyes see it.
        inverse: (n_sources,) 1 over the luminance of a map, integrated over all directions; 0 of sources without one.
        density: (n_texels,) with which a direction in the texel is drawn, per steradian.
        row: (n_sources, n_lights) the texel with which the map of a light position begins, counted from the first of
            its source: skies have one per position, others one for all. No rows where there are no skies.
        gathering: (n_sources,) number of gathering rays, next to the one that is drawn from the map, over pi; see
            `terms/environments.py`. 0: none.
    """

    grid: Int32
    share: Float32
    other: Int32
    tint: Float32
    angles: Float32
    up: Float32
    seen: Rgb
    inverse: Float32
    density: Float32
    row: Int32
    gathering: Float32


NO_MAPS = Maps(
    np.empty((0, COLUMNS), np.int32), np.zeros(1, np.float32), np.zeros(1, np.int32), np.empty((0, 3), np.float32),
    np.zeros(2, np.float32), np.zeros(3, np.float32), np.empty((0, 3), np.float32), np.empty(0, np.float32),
    np.ones(1, np.float32), np.empty((0, 0), np.int32), np.empty(0, np.float32),
)  # fmt: skip


def map_arrays(sources: tuple[LightPath, ...]) -> Maps:
    """Make the arrays of all maps; sources with the same file share one."""
    if all(source.environment is None for source in sources):
        return NO_MAPS
    grid = np.zeros((len(sources), COLUMNS), np.int32)
    shares, others, tints, angles = [np.full(1, 2.0)], [np.zeros(1, np.int64)], [np.ones(3)], [np.zeros(2)]
    seen: list[Rgb] = []
    densities = [np.ones(1)]
    known: dict[tuple[str, str], Any] = {}
    up, inverse = np.zeros(3), np.zeros(len(sources), np.float32)
    row = np.zeros((len(sources), len(sources[0].vector)), np.int32)
    for s, source in enumerate(sources):
        if (environment := source.environment) is None:
            continue
        panorama, part, up = environment.panorama, environment.part, environment.up
        maps, name = environment.maps, part if environment.maps is None else str(s)
        if (panorama.digest, name) not in known:
            texels = panorama.part(part)
            height, width, _ = texels.shape
            share, other = alias_table(texel_powers(texels).ravel())
            slot, tint, angle = (sum(map(len, each)) for each in (shares, tints, angles))
            places = (slot, len(share) - 1, tint // 3, width, height, angle)
            visible = panorama.pixels if part != SUNS else panorama.pixels[:0, :0]  # eyes see them with the rest
            known[panorama.digest, name] = (*places, sum(map(len, seen)), *visible.shape[1::-1])
            seen.append((visible if maps is None else maps).reshape(-1, 3))
            luminance = (texels @ LUMINANCE)[..., None]
            densities.append(luminance.ravel() / texel_powers(texels).sum())
            shares.append(share)
            others.append(other)
            shown = texels if maps is None else maps
            tints.append(np.divide(shown, luminance, out=np.zeros_like(luminance * shown), where=luminance > 0).ravel())
            angles.append(_angles(width, height))
        grid[s], inverse[s] = known[panorama.digest, name], 1 / environment.flux
        row[s] = 0 if maps is None else np.arange(len(maps)) * (maps.shape[1] * maps.shape[2])
    return Maps(
        grid,
        np.concatenate(shares).astype(np.float32),
        np.concatenate(others).astype(np.int32),
        np.concatenate(tints).reshape(-1, 3).astype(np.float32),
        np.concatenate(angles).astype(np.float32),
        up.astype(np.float32),
        np.ascontiguousarray(np.concatenate(seen) if len(seen) > 1 else seen[0]),
        inverse,
        np.concatenate(densities).astype(np.float32),
        row if row.any() else row[:0],
        np.zeros(len(sources), np.float32),
    )


def alias_table(weights: Float64) -> tuple[Float64, Any]:
    """Shares and other items of 2^k slots, by which items are drawn in proportion to their weights [Walker77].

    Items below the mean are filled up in their order by those above it, in theirs; so running sums of what is missing
    and of what is left say who fills whom.
    """
    n = 1 << max(len(weights) - 1, 1).bit_length()
    share = np.zeros(n)
    share[: len(weights)] = weights * (n / weights.sum())
    other = np.arange(n)
    few, many = np.flatnonzero(share < 1), np.flatnonzero(share >= 1)
    missing, left = np.cumsum(1 - share[few]), np.cumsum(share[many] - 1)
    filler = np.searchsorted(left, missing - (1 - share[few]), side="right")
    other[few] = many[np.minimum(filler, len(many) - 1)]
    # an item above the mean that gives away more than it can keeps the rest, and the next one fills it up
    spender = np.searchsorted(missing, left, side="right")
    spent = (spender < len(few)) & (np.arange(len(many)) < len(many) - 1)
    share[many] = np.where(spent, np.clip(1 + left - np.append(missing, 0.0)[spender], 0, 1), 1.0)
    other[many[:-1]] = np.where(spent[:-1], many[1:], many[:-1])
    return share, other


def _angles(width: int, height: int) -> Float64:
    """See `Maps.angles`."""
    azimuth = ((np.arange(width) + 0.5) / width - 0.5) * 2 * np.pi
    columns = np.stack([np.cos(azimuth), np.sin(azimuth)], axis=1).ravel()
    return np.concatenate([columns, np.sin(np.linspace(np.pi / 2, -np.pi / 2, height + 1))])


@inlined
def map_texel(maps: Maps, s: int, key: np.uint64) -> Any:
    """The texel of source s that the hit of a random key draws; 0 of sources without a map."""
    if not has_rows(maps.tint):
        return integers(key) & np.int32(0)
    return _drawn_texel(maps, s, key)


@outlined
def _drawn_texel(maps: Maps, s: int, key: np.uint64) -> Any:
    """`map_texel` in a scene with maps."""
    word, grid = random_word(key, SOURCES + s), maps.grid
    slot = integers(word) & np.int32(grid[s, MASK])
    chance = reals((integers(word >> np.uint64(32)) >> np.int32(8)) & np.int32(0xFFFFFF)) * UNIT_24
    at = slot + np.int32(grid[s, SLOT])
    return select(chance < gather(maps.share, at), slot, gather(maps.other, at))


@inlined
def map_row(maps: Maps, s: int, l: Any) -> Any:
    """See `Maps.row`; l: a light position, or sixteen in a row."""
    if not has_rows(maps.row):
        return l & np.int32(0)
    return row_at(maps.row, np.int32(s * maps.row.shape[1]) + l)


@inlined
def map_tint(maps: Maps, s: int, l: Any, texel: Any, channel: int) -> Any:
    """(r, g, b) over luminance of a texel at light positions l; 1 where no source has a map."""
    if not has_rows(maps.tint):
        return reals((texel + l) & np.int32(0)) + np.float32(1.0)
    place = texel + (np.int32(maps.grid[s, TINT]) + map_row(maps, s, l))
    return gather(maps.tint, place * np.int32(3) + np.int32(channel))


@inlined
def map_share(maps: Maps, s: int, l: Any, texel: Any, cosine: Any, channel: int) -> Any:
    """`map_tint` times the weight of the drawn direction next to rays that look around: p / (p + n cos(theta) / pi)."""
    density = gather(maps.density, texel + np.int32(maps.grid[s, TINT]))
    return map_tint(maps, s, l, texel, channel) * (density / (density + maps.gathering[s] * cosine))


@inlined
def map_point(maps: Maps, s: int, key: np.uint64) -> Triple:
    """The unit direction to a point of the texel of a hit: towards the middle of the map, east of it, and up."""
    one, half, nothing = np.float32(1.0), np.float32(0.5), np.float32(0.0)
    texel, grid = map_texel(maps, s, key), maps.grid
    u, v = r2(random_word(key, WITHIN + s), 0)
    width, first = np.int32(grid[s, WIDTH]), np.int32(grid[s, ANGLE])
    row = integers((reals(texel) + half) / np.float32(grid[s, WIDTH]))
    column = texel - row * width
    # the height, uniform between the edges of the row
    edge = first + np.int32(2) * width + row
    top = gather(maps.angles, edge)
    z = top + v * (gather(maps.angles, edge + np.int32(1)) - top)
    level2 = one - z * z
    level = sqrt(select(level2 > nothing, level2, nothing))
    # the azimuth, at most pi / 16 from the middle of the column
    angle = (u - half) * (np.float32(2 * np.pi) / np.float32(grid[s, WIDTH]))
    square = angle * angle
    cosine = one - square * (half - square * np.float32(1 / 24))
    sine = angle * (one - square * (np.float32(1 / 6) - square * np.float32(1 / 120)))
    at = first + np.int32(2) * column
    c, d = gather(maps.angles, at), gather(maps.angles, at + np.int32(1))
    return level * (c * cosine - d * sine), level * (d * cosine + c * sine), z


@inlined
def map_vector(maps: Maps, place: Triple, q: Triple) -> Triple:
    """Turn the direction q of a map into the scene.

    Args:
        place: direction in which the light of its middle travels.
    """
    ux, uy, uz = maps.up[0], maps.up[1], maps.up[2]
    x, y, z = -place[0], -place[1], -place[2]
    return (
        q[0] * x + q[1] * (y * uz - z * uy) + q[2] * ux,
        q[0] * y + q[1] * (z * ux - x * uz) + q[2] * uy,
        q[0] * z + q[1] * (x * uy - y * ux) + q[2] * uz,
    )
