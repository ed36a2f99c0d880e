"""Photometric profiles of sources: the share of its largest intensity that a lamp sends into a direction.

A profile is a table on a grid of even steps of the angle from a pole and of that about it. It is the same at all light
positions; only its axes turn.
"""

from math import gcd
from typing import Any, NamedTuple

import numpy as np

from framearray_cli.base.arrays import Float32, Float64, Real, Triple
from framearray_cli.scene.paths.paths import Lights
from framearray_cli.scene.paths.profiles import Web

from ..kernels.bundle import bundle
from ..kernels.kernel import inlined, step
from ..kernels.simd import floor, gather, integers, row_at, select, sqrt

# Columns of `Profiles.grid`: first number of the table, its cells, first angles and cells per radian.
TABLE, POLAR, AROUND, POLAR_FROM, POLAR_SCALE, AROUND_FROM, AROUND_SCALE = range(7)
COLUMNS = 7

HUNDREDTHS = 100  # of a degree: angles of files have no more digits
MOST_STEPS, MOST_CELLS = 3600, 1_500_000  # of a table; angles that need finer ones are interpolated
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


@bundle
class Profiles(NamedTuple):
    """Profiles of all sources, in the form that kernels read.

    Attributes:
        frame: (n_sources, 9, n_lights) the pole of the table, the direction of angle 0 about it, and of 90
            degrees; no rows where no source has a profile.
        grid: (n_sources, COLUMNS) places of the tables; zeros of sources without.
        table: all tables, one behind the other.
    """

    frame: Float32
    grid: Float64
    table: Float32


NONE = Profiles(np.empty((0, 9, 0), np.float32), np.empty((0, COLUMNS)), np.zeros(1, np.float32))


def profile_arrays(lights: Lights) -> Profiles:
    """Make the arrays of all profiles; sources with the same file share a table."""
    if all(source.profile is None for source in lights.sources):
        return NONE._replace(frame=np.empty((0, 9, lights.n), np.float32))
    frame = np.zeros((len(lights.sources), 9, lights.n), np.float32)
    grid, tables, first = np.zeros((len(lights.sources), COLUMNS)), [], 0
    known: dict[str, Float64] = {}
    for s, source in enumerate(lights.sources):
        if source.profile is None:
            continue
        frame[s] = source.profile.frames.reshape(lights.n, 9).T
        web = source.profile.web
        if web.digest not in known:
            known[web.digest], found = _table(web, first)
            tables.append(found)
            first += len(found)
        grid[s] = known[web.digest]
    return Profiles(frame, grid, np.concatenate(tables))


def _table(web: Web, first: int) -> tuple[Float64, Float32]:
    """Make the row of the grid and the table of a profile; the table starts at number `first` of all."""
    polar, around = _even_angles(web.polar_deg, MOST_STEPS), web.around_deg
    around = _even_angles(around, min(MOST_STEPS, MOST_CELLS // len(polar)))
    share = _bilinear(web, polar, around)
    row = np.zeros(COLUMNS)
    row[TABLE], row[POLAR], row[AROUND] = first, len(polar) - 1, len(around) - 1
    row[POLAR_FROM], row[POLAR_SCALE] = np.radians(polar[0]), 1 / np.radians(polar[1] - polar[0])
    if len(around) > 1:
        row[AROUND_FROM], row[AROUND_SCALE] = np.radians(around[0]), 1 / np.radians(around[1] - around[0])
    return row, share.ravel().astype(np.float32)


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


@step
def profile_share(profiles: Profiles, s: int, l: Any, n: int, x: Real, y: Real, z: Real) -> Real:
    """The share of its largest intensity that source s sends against a vector (x, y, z) to it; see `Web`.

    Args:
        l: light position of n, or sixteen in a row.
    """
    nothing, one = np.float32(0.0), np.float32(1.0)
    grid, table, frame, at = profiles.grid, profiles.table, profiles.frame, np.int32(9 * s * n) + l
    first, cells = np.int32(grid[s, TABLE]), np.int32(grid[s, POLAR]) + np.int32(1)
    # the direction in the axes of the table
    w = -_along(frame, at, n, x, y, z)
    u = -_along(frame, at + np.int32(3 * n), n, x, y, z)
    v = -_along(frame, at + np.int32(6 * n), n, x, y, z)
    # the cell, and the place in it
    polar = (angle_of(sqrt(u * u + v * v), w) - np.float32(grid[s, POLAR_FROM])) * np.float32(grid[s, POLAR_SCALE])
    low, f, within = _cell(polar, np.float32(grid[s, POLAR]))
    i = integers(low) + first
    share = gather(table, i) * (one - f) + gather(table, i + np.int32(1)) * f
    if grid[s, AROUND] > 0:
        around = (angle_of(v, u) - np.float32(grid[s, AROUND_FROM])) * np.float32(grid[s, AROUND_SCALE])
        low, g, aside = _cell(around, np.float32(grid[s, AROUND]))
        i = integers(low) * cells + i
        near = gather(table, i) * (one - f) + gather(table, i + np.int32(1)) * f
        far = gather(table, i + cells) * (one - f) + gather(table, i + cells + np.int32(1)) * f
        share = select(aside, near * (one - g) + far * g, nothing)
    return select(within, share, nothing)


@inlined
def triple_of(array: Float32, at: Any, n: int) -> Triple:
    """Three numbers from `at` on that are n apart, or sixteen times three."""
    return row_at(array, at), row_at(array, at + np.int32(n)), row_at(array, at + np.int32(2 * n))


@inlined
def _along(frame: Float32, at: Any, n: int, x: Real, y: Real, z: Real) -> Real:
    """The scalar product of a vector with an axis of a frame, whose numbers are n apart."""
    a, b, c = triple_of(frame, at, n)
    return x * a + y * b + z * c


@inlined
def _cell(at: Real, cells: Real) -> tuple[Real, Real, Any]:
    """The number of a cell, the place in it from 0 to 1, and True if there is one."""
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
    return select(y < nothing, -a, a)
