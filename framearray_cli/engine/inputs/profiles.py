"""Photometric profiles of sources: the share of its largest intensity that a lamp sends into a direction.

A profile is a table on a grid of even steps of the angle from a pole and of that about it. It is the same at all light
positions; only its axes turn. Behind each table stands a second one, by which particles choose their directions.
"""

from math import gcd
from typing import Any, NamedTuple

import numpy as np

from framearray_cli.base.arrays import Float32, Float64, Real, Triple
from framearray_cli.scene.paths.paths import Lights
from framearray_cli.scene.paths.profiles import Web

from ..kernels.kernel import inlined
from ..kernels.simd import floor, gather, integers, load, select, sqrt

# Columns of `Profiles.grid`: of the table its first number, its cells, first angles and cells per radian;
# the integral of the share over all directions, sr; of the table of particles its first number and its cells.
TABLE, POLAR, AROUND, POLAR_FROM, POLAR_SCALE, AROUND_FROM, AROUND_SCALE = range(7)
FLUX, CHOICE, CHOICE_POLAR, CHOICE_AROUND = range(7, 11)
COLUMNS = 11

HUNDREDTHS = 100  # of a degree: angles of files have no more digits
MOST_STEPS, MOST_CELLS = 3600, 1_500_000  # of a table; angles that need finer ones are interpolated
CHOICE_POLAR_DEG, CHOICE_AROUND_DEG = 1.0, 3.0  # largest cells of the table of particles
EDGE = np.float32(1e-3)  # cells beyond the outermost angles that count as within, as directions are rounded

# atan(x) for |x| <= tan(pi / 8), to 1e-7 [Cephes].
ATAN = (
    np.float32(8.05374449538e-2),
    np.float32(-1.38776856032e-1),
    np.float32(1.99777106478e-1),
    np.float32(-0.333329491539),
)
TAN_EIGHTH = np.float32(0.4142135623730950)
PI = np.float32(np.pi)


class Profiles(NamedTuple):
    """Profiles of all sources, in the form that kernels read.

    Attributes:
        frame: (n_sources, 9, n_lights) the pole of the table, the direction of angle 0 about it, and that of 90
            degrees; (0,) where no source has a profile: kernels are then compiled without them.
        grid: (n_sources, COLUMNS) where a source's table stands; zeros of sources without.
        table: all tables, one behind the other.
    """

    frame: Float32
    grid: Float64
    table: Float32


NONE = Profiles(np.empty(0, np.float32), np.empty((0, COLUMNS)), np.zeros(1, np.float32))


def profile_arrays(lights: Lights) -> Profiles:
    """Make the arrays of all profiles; sources with the same file share a table."""
    if all(source.profile is None for source in lights.sources):
        return NONE
    frame = np.zeros((len(lights.sources), 9, lights.n), np.float32)
    grid, tables, first = np.zeros((len(lights.sources), COLUMNS)), [], 0
    known: dict[str, Float64] = {}
    for s, source in enumerate(lights.sources):
        if source.profile is None:
            continue
        frame[s] = source.profile.frames.reshape(lights.n, 9).T
        web = source.profile.web
        if web.digest not in known:
            known[web.digest], found = _tables(web, first)
            tables.append(found)
            first += len(found)
        grid[s] = known[web.digest]
    return Profiles(frame, grid, np.concatenate(tables))


def _tables(web: Web, first: int) -> tuple[Float64, Float32]:
    """The row of the grid and the tables of a profile that stand from number `first` on."""
    polar, around = _even_angles(web.polar_deg, MOST_STEPS), web.around_deg
    around = _even_angles(around, min(MOST_STEPS, MOST_CELLS // len(polar)))
    share = _bilinear(web, polar, around)
    choice = _cells(polar, CHOICE_POLAR_DEG), _cells(around, CHOICE_AROUND_DEG) if len(around) > 1 else np.zeros(1)
    cells = _power_of_cells(web, *choice)
    row = np.zeros(COLUMNS)
    row[TABLE], row[POLAR], row[AROUND] = first, len(polar) - 1, len(around) - 1
    row[POLAR_FROM], row[POLAR_SCALE] = np.radians(polar[0]), 1 / np.radians(polar[1] - polar[0])
    if len(around) > 1:
        row[AROUND_FROM], row[AROUND_SCALE] = np.radians(around[0]), 1 / np.radians(around[1] - around[0])
    row[FLUX] = web.flux
    row[CHOICE], row[CHOICE_POLAR], row[CHOICE_AROUND] = first + share.size, cells.shape[1], cells.shape[0]
    bands = np.cumsum(cells.sum(axis=0))
    within = np.cumsum(cells.T, axis=1)
    return row, np.concatenate([share.ravel(), bands, within.ravel()]).astype(np.float32)


def _even_angles(angles: Float64, most: int) -> Float64:
    """Evenly spaced angles from the first to the last, which hold all of them if `most` steps suffice."""
    if len(angles) == 1:
        return angles
    whole = np.rint(angles * HUNDREDTHS).astype(int)
    n = most
    if np.allclose(whole, angles * HUNDREDTHS, atol=1e-6):
        n = min(int(whole[-1] - whole[0]) // gcd(*np.diff(whole).tolist()), most)
    return np.linspace(angles[0], angles[-1], n + 1)


def _bilinear(web: Web, polar: Float64, around: Float64) -> Float64:
    """The share at a grid of angles, (n_around, n_polar)."""
    rows = np.stack([np.interp(polar, web.polar_deg, row) for row in web.share])
    if len(rows) == 1:
        return np.tile(rows, (len(around), 1))
    return np.stack([np.interp(around, web.around_deg, column) for column in rows.T], axis=1)


def _cells(angles: Float64, widest: float) -> Float64:
    """Divide even angles into cells that are not wider."""
    steps = max(len(angles) - 1, int(np.ceil((angles[-1] - angles[0]) / widest)))
    return np.linspace(angles[0], angles[-1], steps + 1)


def _power_of_cells(web: Web, polar: Float64, around: Float64) -> Float64:
    """The integral of the share over each cell, (n_around, n_polar), sr: its middle times its solid angle."""
    height = -np.diff(np.cos(np.radians(polar)))
    if len(around) == 1:
        return np.asarray(_bilinear(web, (polar[1:] + polar[:-1]) / 2, around) * height * 2 * np.pi)
    width = np.radians(around[1] - around[0])
    middle = _bilinear(web, (polar[1:] + polar[:-1]) / 2, (around[1:] + around[:-1]) / 2)
    return np.asarray(middle * height * width)


@inlined
def frame_at(profiles: Profiles, s: int, l: int, n: int) -> tuple[Real, ...]:
    """The frame of source s at light position l of n."""
    frame, at = profiles.frame, 9 * s * n + l
    return (
        gather(frame, at), gather(frame, at + n), gather(frame, at + 2 * n),
        gather(frame, at + 3 * n), gather(frame, at + 4 * n), gather(frame, at + 5 * n),
        gather(frame, at + 6 * n), gather(frame, at + 7 * n), gather(frame, at + 8 * n),
    )  # fmt: skip


@inlined
def frame_in_lanes(profiles: Profiles, s: int, l: int, n: int) -> tuple[Real, ...]:
    """The frames of source s at light positions l to l + 15 of n."""
    frame, at = profiles.frame, 9 * s * n + l
    return (
        load(frame, at), load(frame, at + n), load(frame, at + 2 * n),
        load(frame, at + 3 * n), load(frame, at + 4 * n), load(frame, at + 5 * n),
        load(frame, at + 6 * n), load(frame, at + 7 * n), load(frame, at + 8 * n),
    )  # fmt: skip


@inlined
def profile_share(profiles: Profiles, s: int, frame: tuple[Real, ...], x: Real, y: Real, z: Real) -> Real:
    """The share of its largest intensity that source s sends against a vector (x, y, z) to it; see `Web`.

    Args:
        frame: of the source at these light positions.
    """
    nothing, one = np.float32(0.0), np.float32(1.0)
    grid, table = profiles.grid, profiles.table
    first, n = np.int32(grid[s, TABLE]), np.int32(grid[s, POLAR]) + np.int32(1)
    # the direction in the axes of the table
    w = -(x * frame[0] + y * frame[1] + z * frame[2])
    u = -(x * frame[3] + y * frame[4] + z * frame[5])
    v = -(x * frame[6] + y * frame[7] + z * frame[8])
    # the cell, and the place in it
    polar = (angle_of(sqrt(u * u + v * v), w) - np.float32(grid[s, POLAR_FROM])) * np.float32(grid[s, POLAR_SCALE])
    low, f, within = _cell(polar, np.float32(grid[s, POLAR]))
    i = integers(low) + first
    share = gather(table, i) * (one - f) + gather(table, i + np.int32(1)) * f
    if grid[s, AROUND] > 0:
        around = (angle_of(v, u) - np.float32(grid[s, AROUND_FROM])) * np.float32(grid[s, AROUND_SCALE])
        low, g, beside = _cell(around, np.float32(grid[s, AROUND]))
        i = integers(low) * n + i
        near = gather(table, i) * (one - f) + gather(table, i + np.int32(1)) * f
        far = gather(table, i + n) * (one - f) + gather(table, i + n + np.int32(1)) * f
        share = select(beside, near * (one - g) + far * g, nothing)
    found: Real = select(within, share, nothing)
    return found


@inlined
def _cell(at: Real, cells: Real) -> tuple[Real, Real, Any]:
    """The number of a cell, the place in it from 0 to 1, and whether there is one."""
    nothing, one = np.float32(0.0), np.float32(1.0)
    within = (at >= -EDGE) & (at <= cells + EDGE)
    low = floor(at)
    low = select(low > nothing, low, nothing)
    low = select(low < cells - one, low, cells - one)
    f = at - low
    f = select(f > nothing, f, nothing)
    return low, select(f < one, f, one), within


@inlined
def angle_of(y: Real, x: Real) -> Real:
    """The angle of a vector (x, y) from the first axis, from -pi to pi; 0 of the zero vector."""
    nothing, one, tiny = np.float32(0.0), np.float32(1.0), np.float32(1e-30)
    across, along = select(y < nothing, -y, y), select(x < nothing, -x, x)
    steep = across > along
    least, most = select(steep, along, across), select(steep, across, along)
    t = least / select(most > tiny, most, tiny)
    beyond = t > TAN_EIGHTH
    t = select(beyond, (t - one) / (t + one), t)
    s = t * t
    a = (((ATAN[0] * s + ATAN[1]) * s + ATAN[2]) * s + ATAN[3]) * s * t + t
    a = a + select(beyond, PI / np.float32(4.0), nothing)
    a = select(steep, PI / np.float32(2.0) - a, a)
    a = select(x < nothing, PI - a, a)
    found: Real = select(y < nothing, -a, a)
    return found


@inlined
def profile_direction(profiles: Profiles, s: int, l: int, n: int, a: Real, b: Real) -> Triple:
    """Direction of a particle of source s at light position l of n, with the density of its share."""
    grid, table, frame = profiles.grid, profiles.table, frame_at(profiles, s, l, n)
    first, bands, cells = int(grid[s, CHOICE]), int(grid[s, CHOICE_POLAR]), int(grid[s, CHOICE_AROUND])
    # a band about the pole, and the place in it
    band, f = _choose(table, first, bands, b)
    step = grid[s, POLAR] / (grid[s, POLAR_SCALE] * bands)
    start = grid[s, POLAR_FROM] + band * step
    c = np.cos(start) + f * (np.cos(start + step) - np.cos(start))
    # a cell of the band, and the place in it
    cell, g = _choose(table, first + bands + band * cells, cells, a)
    turn = 2.0 * np.pi * g
    if grid[s, AROUND] > 0:
        turn = grid[s, AROUND_FROM] + (cell + g) * (grid[s, AROUND] / (grid[s, AROUND_SCALE] * cells))
    r = np.sqrt(max(1.0 - c * c, 0.0))
    p, q = r * np.cos(turn), r * np.sin(turn)
    return (
        c * frame[0] + p * frame[3] + q * frame[6],
        c * frame[1] + p * frame[4] + q * frame[7],
        c * frame[2] + p * frame[5] + q * frame[8],
    )


@inlined
def _choose(table: Float32, first: int, n: int, a: Real) -> tuple[int, Real]:
    """Choose one of n numbers by their running sums, and return which, and where in it from 0 to 1."""
    wanted = a * table[first + n - 1]
    low, high = 0, n - 1
    while low < high:
        middle = (low + high) // 2
        if table[first + middle] > wanted:
            high = middle
        else:
            low = middle + 1
    before = table[first + low - 1] if low > 0 else np.float32(0.0)
    width = table[first + low] - before
    place = (wanted - before) / width if width > 0.0 else 0.5
    return low, min(max(place, 0.0), 1.0)
