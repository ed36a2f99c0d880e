"""Direct light with fewer shadow rays: test every k-th light position, and look closer where neighbours differ.

Along the path of a light, a hit sees it for a while and then does not. So of each run of light positions in front of
a hit, the first, the last and every `step`-th are tested; where two neighbouring tests agree, the positions between
them are taken to agree too; where they differ, the change is found by bisection. Which positions are tested differs
from hit to hit, so that what is overlooked does not line up in the picture.

Something that hides the light only between two tests is overlooked. `unbiased` tests one random position of every
agreed interval of m positions; should it disagree, the difference counts m times there, the inverse of its
probability. The mean is then right, at the price of more rays and of rare, large corrections.
"""

from typing import NamedTuple

import numpy as np

from framearray_cli.base.arrays import Float32, Int32

from ..embree.packets import Tracer, is_blocked, occlude, set_ray
from ..hits.hits import Hits, lift, ray_origin, reflects
from ..hits.rays import Rays
from ..inputs.lights import DIRECTIONAL, LightArrays
from ..inputs.random import STEPS, mix, word
from ..kernels.kernel import inlined, kernel
from ..kernels.simd import LANES
from .direct import FAR_END, TO, look

# Hits that are worked on together: enough to fill packets in the later, sparser rounds.
BLOCK = 128


class Steps(NamedTuple):
    """Scratch for one block of hits.

    Attributes:
        factor: (BLOCK, n_lights) geometry factor of the irradiance, 0 where the source is not in front.
        visible: (BLOCK, n_lights) what of the source is seen: 0 or 1, or beyond where a correction was made.
        intervals: (2, n, 2) ends of intervals whose ends differ, as places b * n_lights + l: this round's, the next's.
        checks: (n, 2) places under test, and the number of positions each stands for.
        in_front: (BLOCK,) number of positions in front of each hit.
    """

    factor: Float32
    visible: Float32
    intervals: Int32
    checks: Int32
    in_front: Int32


def room_for_steps(n_lights: int) -> Steps:
    """Scratch for light paths of n_lights positions."""
    n = BLOCK * n_lights
    return Steps(
        factor=np.empty((BLOCK, n_lights), np.float32),
        visible=np.empty((BLOCK, n_lights), np.float32),
        intervals=np.empty((2, n, 2), np.int32),
        checks=np.empty((n, 2), np.int32),
        in_front=np.empty(BLOCK, np.int32),
    )


@inlined
def _second(l: int, step: int, phase: int | np.int64) -> int:
    """The position tested after the first one, l, of a run; the others follow `step` apart, and the run's end."""
    return l + 1 + int((phase - l - 1) % step)


@inlined
def _run_end(room: Steps, b: int, l: int) -> int:
    """The last of the positions from l on that are in front of hit b."""
    n_lights = room.factor.shape[1]
    if room.in_front[b] == n_lights:
        return int(n_lights - 1)
    while l + 1 < n_lights and room.factor[b, l + 1] > 0.0:
        l += 1
    return l


@kernel
def _learn(tracer: Tracer, rays: Rays, n: int, visible: Float32) -> None:
    """Trace the waiting rays and note what they see."""
    occlude(tracer, rays.packets, n, True)
    flat = visible.reshape(visible.size)
    for ray in range(n):
        flat[rays.place[ray]] = np.float32(0.0) if is_blocked(rays.packets, ray) else np.float32(1.0)


@inlined
def _aim(hits: Hits, first: int, lights: LightArrays, s: int, place: int, rays: Rays, waiting: int) -> None:
    """Write the shadow ray of a place, b * n_lights + l, of the block that starts at hit `first`."""
    n_lights = lights.vector.shape[2]
    b = place // n_lights
    l = place - b * n_lights
    ox, oy, oz = ray_origin(hits, first + b)
    x, y, z = lights.vector[s, 0, l], lights.vector[s, 1, l], lights.vector[s, 2, l]
    if lights.kind[s] == DIRECTIONAL:
        set_ray(rays.packets, waiting, ox, oy, oz, -x, -y, -z, np.float32(np.inf))
    else:
        p, (ux, uy, uz) = hits.position, lift(hits, first + b)
        x, y, z = x - p[first + b, 0] - ux, y - p[first + b, 1] - uy, z - p[first + b, 2] - uz
        set_ray(rays.packets, waiting, ox, oy, oz, x, y, z, FAR_END)
    rays.place[waiting] = place


@inlined
def _start(hits: Hits, i: int, lights: LightArrays, s: int, rays: Rays, b: int, room: Steps) -> None:
    """Compute the geometry factors of hit i and count the positions in front of it; nothing is seen yet."""
    n_lights = room.factor.shape[1]
    count = 0
    if reflects(hits, i):
        look(hits, i, lights, s, rays.row, rays.value)
        for l in range(n_lights):
            count += rays.value[0, l] > 0.0
    for l in range(n_lights):
        room.factor[b, l] = rays.value[0, l] if count > 0 else np.float32(0.0)
        room.visible[b, l] = 0.0
    room.in_front[b] = count


@kernel
def _test_every(
    hits: Hits, first: int, n: int, lights: LightArrays, s: int, step: int, tracer: Tracer, rays: Rays, room: Steps
) -> int:
    """Test the ends of every run of positions, and every step-th position between; returns the number of rays."""
    n_lights, capacity, row = room.factor.shape[1], rays.packets.shape[0] * LANES, rays.row
    reach = np.float32(np.inf) if lights.kind[s] == DIRECTIONAL else FAR_END
    waiting = total = 0
    for b in range(n):
        _start(hits, first + b, lights, s, rays, b, room)
        if room.in_front[b] == 0:
            continue
        ox, oy, oz = ray_origin(hits, first + b)
        ux, uy, uz = lift(hits, first + b)
        if lights.kind[s] == DIRECTIONAL:
            ux, uy, uz = np.float32(0.0), np.float32(0.0), np.float32(0.0)
        phase = np.int64(word(hits.key[first + b], STEPS) % np.uint64(step))
        l = 0
        while l < n_lights:
            if not room.factor[b, l] > 0.0:
                l += 1
                continue
            last = _run_end(room, b, l)
            following = _second(l, step, phase)
            while True:
                if waiting == capacity:
                    _learn(tracer, rays, waiting, room.visible)
                    total, waiting = total + waiting, 0
                x, y, z = row[TO, l] - ux, row[TO + 1, l] - uy, row[TO + 2, l] - uz
                set_ray(rays.packets, waiting, ox, oy, oz, x, y, z, reach)
                rays.place[waiting] = b * n_lights + l
                waiting += 1
                if l == last:
                    break
                l, following = min(following, last), following + step
            l = last + 1
    _learn(tracer, rays, waiting, room.visible)
    return total + waiting


@kernel
def _compare(hits: Hits, first: int, n: int, step: int, unbiased: bool, room: Steps) -> tuple[int, int]:
    """Fill intervals whose ends agree; list those that do not, and the checks; returns how many of each."""
    n_lights = room.factor.shape[1]
    n_intervals = n_checks = 0
    for b in range(n):
        bits = word(hits.key[first + b], STEPS)
        phase = np.int64(bits % np.uint64(step))
        l = 0 if room.in_front[b] > 0 else n_lights
        while l < n_lights:
            if not room.factor[b, l] > 0.0:
                l += 1
                continue
            last = _run_end(room, b, l)
            following = _second(l, step, phase)
            while l < last:
                other, following = min(following, last), following + step
                between = other - l - 1
                if room.visible[b, l] != room.visible[b, other]:
                    if between > 0:
                        room.intervals[0, n_intervals, 0] = b * n_lights + l
                        room.intervals[0, n_intervals, 1] = b * n_lights + other
                        n_intervals += 1
                else:
                    for m in range(l + 1, other):
                        room.visible[b, m] = room.visible[b, l]
                    if unbiased and between > 0:
                        bits = mix(bits)
                        room.checks[n_checks, 0] = b * n_lights + l + 1 + np.int64(bits % np.uint64(between))
                        room.checks[n_checks, 1] = between
                        n_checks += 1
                l = other
            l = last + 1
    return n_intervals, n_checks


@kernel
def _bisect(
    hits: Hits, first: int, n: int, lights: LightArrays, s: int, tracer: Tracer, rays: Rays, room: Steps
) -> int:
    """Find, in each of n intervals whose ends differ, where that changes; returns the number of rays."""
    capacity, visible = rays.packets.shape[0] * LANES, room.visible.reshape(room.visible.size)
    now, total = 0, 0
    while n > 0:
        waiting = 0
        for i in range(n):
            if waiting == capacity:
                _learn(tracer, rays, waiting, room.visible)
                total, waiting = total + waiting, 0
            middle = (room.intervals[now, i, 0] + room.intervals[now, i, 1]) // 2
            _aim(hits, first, lights, s, middle, rays, waiting)
            waiting += 1
        _learn(tracer, rays, waiting, room.visible)
        total += waiting
        m = 0
        for i in range(n):
            low, high = room.intervals[now, i, 0], room.intervals[now, i, 1]
            middle = (low + high) // 2
            for side in range(2):
                start, end = (low, middle) if side == 0 else (middle, high)
                if visible[start] == visible[end]:
                    for place in range(start + 1, end):
                        visible[place] = visible[start]
                elif end - start > 1:
                    room.intervals[1 - now, m, 0], room.intervals[1 - now, m, 1] = start, end
                    m += 1
        now, n = 1 - now, m
    return total


@kernel
def _check(hits: Hits, first: int, n: int, lights: LightArrays, s: int, tracer: Tracer, rays: Rays, room: Steps) -> int:
    """Test one position of each of n agreed intervals, and correct it m-fold where it disagrees; returns n."""
    capacity, visible = rays.packets.shape[0] * LANES, room.visible.reshape(room.visible.size)
    for start in range(0, n, capacity):
        m = min(capacity, n - start)
        for i in range(m):
            _aim(hits, first, lights, s, room.checks[start + i, 0], rays, i)
        occlude(tracer, rays.packets, m, True)
        for i in range(m):
            place, positions = room.checks[start + i, 0], room.checks[start + i, 1]
            seen = np.float32(0.0) if is_blocked(rays.packets, i) else np.float32(1.0)
            visible[place] += positions * (seen - visible[place])
    return n


@kernel
def direct_by_steps(
    hits: Hits,
    n: int,
    lights: LightArrays,
    step: int,
    unbiased: bool,
    tracer: Tracer,
    rays: Rays,
    room: Steps,
    irradiance: Float32,
) -> int:
    """Compute the irradiance of each light position at hits 0 to n - 1, with shadow rays at some positions only.

    Args:
        step: at most this far apart are tested positions, at least 2; `direct` tests all.
        unbiased: check one position of every interval that is taken for granted.
        rays, room: scratch.
        irradiance: (n, channels, n_lights), overwritten; in units of `lights.colour`.
    Returns:
        number of shadow rays.
    """
    channels, n_lights = irradiance.shape[1], irradiance.shape[2]
    total = 0
    for first in range(0, n, BLOCK):
        size = min(BLOCK, n - first)
        for s in range(lights.kind.shape[0]):
            total += _test_every(hits, first, size, lights, s, step, tracer, rays, room)
            n_intervals, n_checks = _compare(hits, first, size, step, unbiased, room)
            total += _bisect(hits, first, n_intervals, lights, s, tracer, rays, room)
            total += _check(hits, first, n_checks, lights, s, tracer, rays, room)
            for b in range(size):
                for channel in range(channels):
                    for l in range(n_lights):
                        sum_so_far = irradiance[first + b, channel, l] if s > 0 else np.float32(0.0)
                        seen = room.factor[b, l] * room.visible[b, l]
                        irradiance[first + b, channel, l] = sum_so_far + seen * lights.strength[s, channel, l]
    return total
