"""The table of cells: the cell of a surface point, and the light there.

A cell of level s is a cube of edge h_s = h_0 2^s of space, for surfaces that face one of six directions. Levels are
shifted against each other at random, so that no border lies on a wall. Cell 0 stands for all surfaces together: the
last resort where no other cell is known.

A wall may cut a cell. Rays to guards tell on which side of the wall a point is: a guard is a point above a sample of
the cell, and a point that does not see the guard reads another cell.
"""

from typing import NamedTuple

import numpy as np

from framearray_cli.base.arrays import (
    Addresses,
    Bytes,
    Directions,
    Float32,
    Int32,
    Keys,
    Points,
    Real,
    Rgb,
    Triple,
    with_room,
)

from ...embree.packets import Tracer, is_blocked, occlude, room_in, set_ray
from ...hits.rays import NO_RAYS, Rays
from ...inputs.random import CELLS, mix, r2, random_word
from ...kernels.bundle import bundle
from ...kernels.kernel import inlined, kernel

# Height of guards and of the points that look for them, in edges of the cell: above the curvature of most surfaces.
GUARD_HEIGHT = 0.15
# Columns of guards: a point, and its height above the surface.
HEIGHT, GUARD_COLUMNS = 3, 4
# A ray to a guard ends at this fraction of the way.
_FAR_END = np.float32(1.0 - 1e-3)
# Counts up when cells of a job get other bits: tables in output folders are then solved again.
VERSION = 1
LEVELS = 7
# Rays read cells up to this level; coarser ones take their places where they are missing.
COARSEST_READ = 4
# A cell with fewer samples is left out of the table, and a coarser one takes its place.
FEWEST_SAMPLES = 4
# Share of a ray's length that the edge of the cell it reads has.
EDGE_OF_LENGTH = 0.15
ALL = 0  # the cell of all surfaces together
NOWHERE = -1  # instead of a cell, for a ray that left the scene
# Bits of a key per axis; places this many cells apart share a cell.
_AXIS_BITS = 19
# Cells side by side that differ wherever their borders lie.
MOST_CELLS = (1 << _AXIS_BITS) - 2
_EMPTY = np.int64(-1)
# Columns of `Cells.tint`.
TINT, MEAN, CONSTANT = 0, 3, 4


@inlined
def write_guard_ray(
    guard: Float32, k: int, point: Triple, normal: Triple, rays: Rays, waiting: int, place: int
) -> None:
    """Write the ray from above a point to guard k into slot `waiting`; `place` is what it is for."""
    height: Real = guard[k, HEIGHT]
    x, y, z = point[0] + height * normal[0], point[1] + height * normal[1], point[2] + height * normal[2]
    set_ray(rays.packets, waiting, x, y, z, guard[k, 0] - x, guard[k, 1] - y, guard[k, 2] - z, _FAR_END)
    rays.place[waiting] = place


@kernel
def choose_slots(tracer: Tracer, rays: Rays, n: int, other: Int32, cells: Int32) -> None:
    """Trace the n queued rays, and give those that do not see the guard of their cell the other slot.

    Args:
        other: see `Cells`; cells: the cell of each place, replaced where a ray is blocked.
    """
    occlude(tracer, rays.packets, n, False)
    for ray in range(n):
        if is_blocked(rays.packets, ray):
            cells[rays.place[ray]] = other[cells[rays.place[ray]]]


@kernel
def see_guards(
    position: Points, normal: Directions, rows: Int32, guard: Float32, tracer: Tracer, rays: Rays, seen: Bytes
) -> None:
    """Write whether point rows[i] sees guard i, for all i, into `seen`."""
    capacity, n = room_in(rays.packets), rows.shape[0]
    for first in range(0, n, capacity):
        m = min(capacity, n - first) + NO_RAYS
        for ray in range(m):
            i, k = rows[first + ray], first + ray
            point = (position[i, 0], position[i, 1], position[i, 2])
            write_guard_ray(guard, k, point, (normal[i, 0], normal[i, 1], normal[i, 2]), rays, ray, k)
        occlude(tracer, rays.packets, m, False)
        for ray in range(m):
            seen[first + ray] = 0 if is_blocked(rays.packets, ray) else 1


@bundle
class Grid(NamedTuple):
    """Borders of cells.

    Attributes:
        edge: h_0, edge of the finest cells, scene units.
        jitter: (LEVELS, 3) shift of each level, in edges of its cells.
    """

    edge: float
    jitter: Float32


@bundle
class Cells(NamedTuple):
    """The light of all cells, as kernels read it.

    The irradiance of cell k under light l is tint[k] light[k, l] in units of the lights' colour. With three channels it
    is light[k, channel, l].

    Attributes:
        grid: borders of cells.
        slots: (2 n_slots,) hash table: keys, and the cell of each; n_slots is a power of two.
        other: (n_cells,) the cell that a ray reads which does not see the guard, or NOWHERE where all see it.
        guard: (n_cells, GUARD_COLUMNS) a point above a sample of the cell; see `guards.py`.
        tint: (n_cells, 8) columns TINT: colour of the light, with a mean by `weights` of 1; MEAN: mean of `light` over
            all light positions of the job; CONSTANT: radiance E / pi of the light that is the same at all positions.
        light: (n_cells, channels, n_lights) irradiance by sources.
        weights: (3,) of channels, which add up to 1.
        background: (3,) radiance outside the scene.
    """

    grid: Grid
    slots: Addresses
    other: Int32
    guard: Float32
    tint: Float32
    light: Float32
    weights: Rgb
    background: Rgb

    def at(self, positions: slice | list[int]) -> "Cells":
        """The cells at some of the light positions; their values there stay the same to the last bit."""
        some = self.light[:, :, positions]
        light = with_room(some.shape, np.float32, fill=0)
        light[:] = some
        return self._replace(light=light)


@inlined
def side_of(x: Real, y: Real, z: Real) -> int:
    """The direction, 0 to 5, that a surface of normal (x, y, z) faces: axis and sign of its largest component."""
    ax, ay, az = np.abs(x), np.abs(y), np.abs(z)
    if ax >= ay and ax >= az:
        return 0 if x > 0.0 else 1
    if ay >= az:
        return 2 if y > 0.0 else 3
    return 4 if z > 0.0 else 5


@inlined
def key_of(grid: Grid, level: int, side: int, x: Real, y: Real, z: Real) -> int:
    """The key of the cell of a level that holds a point of a surface that faces `side`."""
    scale, mask = 1.0 / (grid.edge * (1 << level)), (1 << _AXIS_BITS) - 1
    i = int(np.floor(x * scale + grid.jitter[level, 0])) & mask
    j = int(np.floor(y * scale + grid.jitter[level, 1])) & mask
    k = int(np.floor(z * scale + grid.jitter[level, 2])) & mask
    return ((((level << 3 | side) << _AXIS_BITS | i) << _AXIS_BITS) | j) << _AXIS_BITS | k


@inlined
def level_of(grid: Grid, length: Real) -> int:
    """The level of the cell that a ray of some length reads."""
    wanted, level = EDGE_OF_LENGTH * length, 0
    while level < COARSEST_READ and wanted > 1.4142135623730951 * grid.edge * (1 << level):
        level += 1
    return level


@inlined
def first_slot(key: int, n_slots: int) -> int:
    """First slot of a key in the hash table; further slots follow."""
    return int(np.int64(mix(np.uint64(key)) & np.uint64(n_slots - 1)))


@inlined
def cell_of_key(slots: Addresses, key: int) -> int:
    """The cell of a key, or ALL if it is not in the table."""
    n_slots = slots.shape[0] >> 1
    slot = first_slot(key, n_slots)
    while slots[2 * slot] != key:
        if slots[2 * slot] == _EMPTY:
            return ALL
        slot = (slot + 1) & (n_slots - 1)
    return int(slots[2 * slot + 1])


@inlined
def coarser_cell(grid: Grid, slots: Addresses, level: int, side: int, point: Triple) -> int:
    """The cell at a point of the first coarser level that has one there."""
    found = ALL
    while found == ALL and level + 1 < LEVELS:
        level += 1
        found = cell_of_key(slots, key_of(grid, level, side, point[0], point[1], point[2]))
    return found


@inlined
def tangents(x: Real, y: Real, z: Real) -> tuple[Triple, Triple]:
    """Two unit vectors that form a frame with the unit vector (x, y, z), after Duff et al. (2017)."""
    one = np.float32(1.0)
    sign = one if z >= np.float32(0.0) else -one
    a = -one / (sign + z)
    b = x * y * a
    return (one + sign * x * x * a, sign * b, -sign * x), (b, sign + y * y * a, -y)


@inlined
def shifts(normal: Triple, a: Real, b: Real) -> tuple[Triple, Triple]:
    """Two vectors of up to half a length within a surface, by two random numbers; their sum is the shift."""
    u, v = tangents(normal[0], normal[1], normal[2])
    a, b = a - np.float32(0.5), b - np.float32(0.5)
    return (a * u[0], a * u[1], a * u[2]), (b * v[0], b * v[1], b * v[2])


@kernel
def write_keys(grid: Grid, level: int, position: Points, normal: Directions, keys: Addresses) -> None:
    """Write the key of the cell of each of n points, by their geometric normals."""
    for i in range(position.shape[0]):
        side = side_of(normal[i, 0], normal[i, 1], normal[i, 2])
        keys[i] = key_of(grid, level, side, position[i, 0], position[i, 1], position[i, 2])


@kernel
def fill_slots(keys: Addresses, first: int, slots: Addresses) -> None:
    """Put the keys of cells `first` and following into the hash table."""
    n_slots = slots.shape[0] >> 1
    for i in range(keys.shape[0]):
        slot = first_slot(keys[i], n_slots)
        while slots[2 * slot] != _EMPTY:
            slot = (slot + 1) & (n_slots - 1)
        slots[2 * slot], slots[2 * slot + 1] = keys[i], first + i


@kernel
def find_cells_at(
    cells: Cells, n: int, position: Points, normal: Directions, length: Float32, key: Keys, tracer: Tracer, tests: Rays,
    found: Int32,
) -> int:  # fmt: skip
    """Find the cells that n rays read where they end: of the level of their length, or of a coarser level.

    Args:
        position, normal: (>= n, 3) ends and geometric normals.
        length: (>= n,) lengths of the rays; infinite for rays that left the scene.
        key: (>= n,) random keys, which shift the ends within their surfaces by up to half a cell; (0,) for no shift. If
            there is no cell at the shifted end, beyond a corner for instance, the end itself is looked up.
        tests: scratch.
        found: (>= n,) overwritten; NOWHERE for rays that left the scene.

    Returns:
        number of rays to guards.
    """
    grid, slots, capacity = cells.grid, cells.slots, room_in(tests.packets)
    # Loop state
    waiting = NO_RAYS  # rays to guards in the queue
    total = NO_RAYS  #   rays traced
    for i in range(n):
        found[i] = NOWHERE
        if not length[i] < np.inf:
            continue
        point, facing = (position[i, 0], position[i, 1], position[i, 2]), (normal[i, 0], normal[i, 1], normal[i, 2])
        side, level = side_of(facing[0], facing[1], facing[2]), level_of(grid, length[i])
        cell = ALL
        if key.shape[0] > 0:
            a, b = r2(random_word(key[i], CELLS), 0)
            along, across = shifts(facing, a, b)
            h = np.float32(grid.edge * (1 << level))
            dx, dy, dz = h * (along[0] + across[0]), h * (along[1] + across[1]), h * (along[2] + across[2])
            cell = cell_of_key(slots, key_of(grid, level, side, point[0] + dx, point[1] + dy, point[2] + dz))
        if cell == ALL:
            cell = coarser_cell(grid, slots, level - 1, side, point)
        found[i] = cell
        if cells.other[cell] != NOWHERE:
            write_guard_ray(cells.guard, cell, point, facing, tests, waiting, i)
            waiting += 1
            if waiting == capacity:
                choose_slots(tracer, tests, waiting, cells.other, found)
                total, waiting = total + waiting, NO_RAYS
    choose_slots(tracer, tests, waiting, cells.other, found)
    return total + waiting


def empty_slots(n: int) -> Addresses:
    """Allocate a hash table for n cells, at most half full."""
    return np.full(2 << max(int(2 * n - 1), 1).bit_length(), _EMPTY, np.int64)


def are_sound(cells: Cells, n_lights: int) -> bool:
    """Return True if cells from a file have the shapes of a table, and name no cell or slot beyond it."""
    n, channels = len(cells.other), cells.light.shape[1] if cells.light.ndim == 3 else 0
    shapes = {"other": (n,), "guard": (n, GUARD_COLUMNS), "tint": (n, 8), "light": (n, channels, n_lights)}
    shapes |= {"weights": (3,), "background": (3,), "slots": (cells.slots.size,)}
    kinds = {"slots": np.int64, "other": np.int32}
    arrays = {name: getattr(cells, name) for name in shapes}
    known = all(a.shape == shapes[name] and a.dtype == kinds.get(name, np.float32) for name, a in arrays.items())
    jitter, n_slots = cells.grid.jitter, cells.slots.size >> 1
    known = known and jitter.shape == (LEVELS, 3) and jitter.dtype == np.float32 and channels in (1, 3)
    if not known or n == 0 or n_slots < 1 or cells.slots.size != 2 * n_slots or n_slots & (n_slots - 1):
        return False
    used = cells.slots[::2] != _EMPTY
    named = cells.slots[1::2][used]
    inside = ((named >= 0) & (named < n)).all() and ((cells.other >= NOWHERE) & (cells.other < n)).all()
    return bool(inside and not used.all() and np.isfinite(cells.grid.edge) and cells.grid.edge > 0)
