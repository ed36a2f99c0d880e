"""Direct light with fewer shadow rays: test every k-th light position, and bisect where neighbouring tests differ.

Each run of light positions in front of a hit is tested at its first position, its last and every `step`-th between.
Where two neighbouring tests agree, the positions between take their value; where they differ, bisection finds the
change. The tested positions vary from hit to hit, so that what they miss does not line up in the picture.

`unbiased` tests one random position of every agreed interval of m positions; where it disagrees, the difference counts
m times, the inverse of its probability. The mean is then right, at the price of more rays and of rare, large
corrections. The kernels number tests b * n_lights + l: hit b of the block, light position l.
"""

from typing import NamedTuple

import numpy as np

from framearray_cli.base.arrays import Float32, Int32

from ..embree.packets import Tracer, is_blocked, occlude, room_in, set_ray
from ..hits.hits import Hits, lift, ray_origin, reflects
from ..hits.rays import NO_RAYS, TO, Rays
from ..inputs.lights import DIRECTIONAL, MESH, LightArrays
from ..inputs.maps import map_texel, map_tint
from ..inputs.panes import Sight
from ..inputs.random import STEPS, mix, random_word
from ..kernels.kernel import inlined, kernel, step
from .direct import vector_to_source, write_geometry
from .direct_meshes import FAR_END, add_emitters

# Hits per block: enough to fill packets in the later rounds, which have fewer rays.
BLOCK_HITS = 128


class StepTests(NamedTuple):
    """Arrays for one block of hits.

    Attributes:
        factor: (BLOCK_HITS, n_lights) geometry factor of the irradiance, 0 where the source is not in front.
        visible: (BLOCK_HITS, n_lights) visibility of the source: 0, 1, or beyond where `unbiased` corrected it.
        intervals: (2, n, 2) first and last test of intervals whose ends differ: those of this round, of the next.
        checks: (n, 2) tests of agreed intervals, and the number of positions that each represents.
        in_front: (BLOCK_HITS,) number of positions in front of each hit.
    """

    factor: Float32
    visible: Float32
    intervals: Int32
    checks: Int32
    in_front: Int32


def room_for_steps(n_lights: int) -> StepTests:
    """Allocate arrays for light paths of n_lights positions."""
    n = BLOCK_HITS * n_lights
    return StepTests(
        factor=np.empty((BLOCK_HITS, n_lights), np.float32),
        visible=np.empty((BLOCK_HITS, n_lights), np.float32),
        intervals=np.empty((2, n, 2), np.int32),
        checks=np.empty((n, 2), np.int32),
        in_front=np.empty(BLOCK_HITS, np.int32),
    )


@inlined
def _second_tested(l: int, step: int, phase: int | np.int64) -> int:
    """The second tested position of a run that starts at l; further ones follow at intervals of `step`."""
    return l + 1 + int((phase - l - 1) % step)


@inlined
def _run_end(tests: StepTests, b: int, l: int) -> int:
    """The last position of the run of positions in front of hit b that starts at l."""
    n_lights = tests.factor.shape[1]
    if tests.in_front[b] == n_lights:
        return int(n_lights - 1)
    while l + 1 < n_lights and tests.factor[b, l + 1] > 0.0:
        l += 1
    return l


@step
def _trace_tests(tracer: Tracer, rays: Rays, n: int, visible: Float32) -> None:
    """Trace the n queued shadow rays and record whether each sees its source."""
    occlude(tracer, rays.packets, n, True)
    flat = visible.reshape(visible.size)
    for ray in range(n):
        flat[rays.place[ray]] = np.float32(0.0) if is_blocked(rays.packets, ray) else np.float32(1.0)


@inlined
def _write_ray(hits: Hits, first: int, lights: LightArrays, s: int, test: int, rays: Rays, waiting: int) -> None:
    """Write the shadow ray of a test into slot `waiting`; the block starts at hit `first`."""
    n_lights = lights.vector.shape[2]
    b = test // n_lights
    l = test - b * n_lights
    ox, oy, oz = ray_origin(hits, first + b)
    x, y, z = vector_to_source(hits, first + b, lights, s, l)
    ux, uy, uz = lift(hits, first + b)
    if lights.kind[s] == DIRECTIONAL:
        set_ray(rays.packets, waiting, ox, oy, oz, x, y, z, np.float32(np.inf))
    else:
        set_ray(rays.packets, waiting, ox, oy, oz, x - ux, y - uy, z - uz, FAR_END)
    rays.place[waiting] = test


@inlined
def _prepare_hit(hits: Hits, i: int, lights: LightArrays, s: int, rays: Rays, b: int, tests: StepTests) -> None:
    """Compute the geometry factors of hit i, count the positions in front of it, and reset its visibility."""
    n_lights = tests.factor.shape[1]
    count = 0
    if reflects(hits, i):
        write_geometry(hits, i, lights, s, rays.row, rays.value)
        for l in range(n_lights):
            count += rays.value[0, l] > 0.0
    for l in range(n_lights):
        tests.factor[b, l] = rays.value[0, l] if count > 0 else np.float32(0.0)
        tests.visible[b, l] = 0.0
    tests.in_front[b] = count


@step
def _test_steps(
    hits: Hits, first: int, n: int, lights: LightArrays, s: int, step: int, tracer: Tracer, rays: Rays, tests: StepTests
) -> int:
    """Test both ends of every run of positions, and every step-th between; returns the number of rays."""
    n_lights, capacity, row = tests.factor.shape[1], room_in(rays.packets), rays.row
    reach = np.float32(np.inf) if lights.kind[s] == DIRECTIONAL else FAR_END
    # Loop state
    waiting = NO_RAYS  # rays in the queue
    total = NO_RAYS  #   rays traced
    for b in range(n):
        # geometry factors of hit b; without a position in front of it there is nothing to test
        _prepare_hit(hits, first + b, lights, s, rays, b, tests)
        if tests.in_front[b] == 0:
            continue
        # where its rays start, and the hit's own phase of the tested positions
        ox, oy, oz = ray_origin(hits, first + b)
        ux, uy, uz = lift(hits, first + b)
        if lights.kind[s] == DIRECTIONAL:
            ux, uy, uz = np.float32(0.0), np.float32(0.0), np.float32(0.0)
        phase = np.int64(random_word(hits.key[first + b], STEPS) % np.uint64(step))
        l = 0
        while l < n_lights:
            # the next run of positions in front, l to last
            if not tests.factor[b, l] > 0.0:
                l += 1
                continue
            last = _run_end(tests, b, l)
            following = _second_tested(l, step, phase)
            # its first position, every step-th, and its last
            while True:
                if waiting == capacity:
                    _trace_tests(tracer, rays, waiting, tests.visible)
                    total, waiting = total + waiting, 0
                x, y, z = row[TO, l] - ux, row[TO + 1, l] - uy, row[TO + 2, l] - uz
                set_ray(rays.packets, waiting, ox, oy, oz, x, y, z, reach)
                rays.place[waiting] = b * n_lights + l
                waiting += 1
                if l == last:
                    break
                l, following = min(following, last), following + step
            l = last + 1
    _trace_tests(tracer, rays, waiting, tests.visible)
    return total + waiting


@step
def _compare_tests(hits: Hits, first: int, n: int, step: int, unbiased: bool, tests: StepTests) -> tuple[int, int]:
    """Fill the intervals whose ends agree, and list the others and the checks; returns the length of both lists."""
    n_lights = tests.factor.shape[1]
    # Loop state
    n_intervals = 0  # intervals whose ends differ
    n_checks = 0  #    agreed intervals that `unbiased` checks
    for b in range(n):
        bits = random_word(hits.key[first + b], STEPS)
        phase = np.int64(bits % np.uint64(step))
        l = 0 if tests.in_front[b] > 0 else n_lights
        while l < n_lights:
            # the same runs and tested positions as in `_test_steps`
            if not tests.factor[b, l] > 0.0:
                l += 1
                continue
            last = _run_end(tests, b, l)
            following = _second_tested(l, step, phase)
            while l < last:
                # tested positions l and other, with `between` untested ones; `_bisect` takes those that differ
                other, following = min(following, last), following + step
                between = other - l - 1
                if tests.visible[b, l] != tests.visible[b, other]:
                    if between > 0:
                        tests.intervals[0, n_intervals, 0] = b * n_lights + l
                        tests.intervals[0, n_intervals, 1] = b * n_lights + other
                        n_intervals += 1
                else:
                    # they agree: so do the positions between
                    for m in range(l + 1, other):
                        tests.visible[b, m] = tests.visible[b, l]
                    # check one of these at random
                    if unbiased and between > 0:
                        bits = mix(bits)
                        tests.checks[n_checks, 0] = b * n_lights + l + 1 + np.int64(bits % np.uint64(between))
                        tests.checks[n_checks, 1] = between
                        n_checks += 1
                l = other
            l = last + 1
    return n_intervals, n_checks


@step
def _bisect(
    hits: Hits, first: int, n: int, lights: LightArrays, s: int, tracer: Tracer, rays: Rays, tests: StepTests
) -> int:
    """Find the change in each of n intervals whose ends differ; returns the number of rays."""
    capacity, visible = room_in(rays.packets), tests.visible.reshape(tests.visible.size)
    now, total = 0, NO_RAYS  # list of this round's intervals (the next round's is 1 - now); rays traced
    while n > 0:
        # test the middle of each interval
        waiting = NO_RAYS
        for i in range(n):
            if waiting == capacity:
                _trace_tests(tracer, rays, waiting, tests.visible)
                total, waiting = total + waiting, 0
            middle = (tests.intervals[now, i, 0] + tests.intervals[now, i, 1]) // 2
            _write_ray(hits, first, lights, s, middle, rays, waiting)
            waiting += 1
        _trace_tests(tracer, rays, waiting, tests.visible)
        total += waiting
        # fill the half whose ends agree, and pass on the m halves that have positions left between ends that differ
        m = 0
        for i in range(n):
            low, high = tests.intervals[now, i, 0], tests.intervals[now, i, 1]
            middle = (low + high) // 2
            for side in range(2):
                start, end = (low, middle) if side == 0 else (middle, high)
                if visible[start] == visible[end]:
                    for test in range(start + 1, end):
                        visible[test] = visible[start]
                elif end - start > 1:
                    tests.intervals[1 - now, m, 0], tests.intervals[1 - now, m, 1] = start, end
                    m += 1
        now, n = 1 - now, m
    return total


@step
def _check_agreed(
    hits: Hits, first: int, n: int, lights: LightArrays, s: int, tracer: Tracer, rays: Rays, tests: StepTests
) -> int:
    """Test one position of each of n agreed intervals, and correct it m-fold where it disagrees; returns n."""
    capacity, visible = room_in(rays.packets), tests.visible.reshape(tests.visible.size)
    for start in range(0, n, capacity):
        m = min(capacity, n - start)
        for i in range(m):
            _write_ray(hits, first, lights, s, tests.checks[start + i, 0], rays, i)
        occlude(tracer, rays.packets, m, True)
        for i in range(m):
            test, positions = tests.checks[start + i, 0], tests.checks[start + i, 1]
            seen = np.float32(0.0) if is_blocked(rays.packets, i) else np.float32(1.0)
            visible[test] += positions * (seen - visible[test])
    return n


@kernel
def direct_by_steps(
    hits: Hits, n: int, lights: LightArrays, step: int, unbiased: bool, tracer: Tracer, rays: Rays, tests: StepTests,
    irradiance: Float32,
) -> int:  # fmt: skip
    """Compute the irradiance E_direct of each light position at hits 0 to n - 1, with shadow rays to some positions.

    Args:
        step: largest distance of tested positions, at least 2; `direct` tests all.
        unbiased: check one position of every agreed interval.
        rays, tests: scratch.
        irradiance: (n, channels, n_lights), overwritten; in units of `lights.colour`.
    Returns:
        number of shadow rays.
    """
    total, channels, n_lights = 0, irradiance.shape[1], irradiance.shape[2]  # total: rays traced
    for first in range(0, n, BLOCK_HITS):
        size = min(BLOCK_HITS, n - first)
        irradiance[first : first + size] = 0.0
        for s in range(lights.kind.shape[0]):
            if lights.kind[s] == MESH:
                continue
            total += _test_steps(hits, first, size, lights, s, step, tracer, rays, tests)
            n_intervals, n_checks = _compare_tests(hits, first, size, step, unbiased, tests)
            total += _bisect(hits, first, n_intervals, lights, s, tracer, rays, tests)
            total += _check_agreed(hits, first, n_checks, lights, s, tracer, rays, tests)
            # E_direct: geometry factor, visibility and strength, summed over sources
            for b in range(size):
                for channel in range(channels):
                    tint = map_tint(lights.maps, s, map_texel(lights.maps, s, hits.key[first + b]), channel)
                    for l in range(n_lights):
                        seen = tests.factor[b, l] * tests.visible[b, l]
                        irradiance[first + b, channel, l] += seen * (lights.strength[s, channel, l] * tint)
    meshes: int = add_emitters(hits, n, lights.kind, lights.strength, lights.emitters, Sight(tracer), rays, irradiance)
    return total + meshes
