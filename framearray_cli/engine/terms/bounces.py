"""Specular bounces of eye rays: mirrors, reflections in thin glass, and refraction in solid glass.

Bounces depend on the eye, so only native hits have them. A reflected hit is a hit like any other, seen through a tint
t: it has direct light of all light positions and its own W. A mirror pixel needs a list of reflected hits, each with
the product of reflectivities along its path.

A face of glass on the way to a native hit reflects, too. The tint is the share that the face reflects, times the
transmission of the faces before it. A sheet reflects 2 F / (1 + F), a face of a body F.

Solid glass bends rays where they enter and leave it, by Snell's law; beyond the critical angle all light is reflected
inside. A bent ray ends at a hit like any other.
"""

from typing import Any, NamedTuple

import numpy as np

from framearray_cli.base.arrays import Flags, Float32, Float64, Int32, Rgb, Triple
from framearray_cli.scene.panes import BENDS, NORMAL, OFFSET, SHEET, F, G

from ..embree.packets import MISS, TFAR, TNEAR, Tracer, hit_triangle, intersect_on, room_in, set_ray
from ..hits.glass import BEFORE
from ..hits.hits import SURFACE, Hits, World, trace_hits
from ..hits.rays import NO_RAYS, Rays
from ..inputs.panes import NO_PANES, PaneArrays, colour_at, mirrored_by, normal_of, passed_by, reflectance, step_beyond
from ..inputs.random import mix
from ..kernels.kernel import has_rows, inlined, kernel
from ..kernels.simd import width_of_packets

FACES = 4  # of glass on the way to a hit that mirror; those behind only pass
LEAST = np.float32(1e-4)  # share of light that is worth a ray
MOST_FACES = 12  # that bend a ray; what comes after is dark


@inlined
def _is_mirror(hits: Hits, i: int) -> bool:
    s = hits.specular
    return bool(hits.kind[i] == SURFACE and (s[i, 0] > 0.0 or s[i, 1] > 0.0 or s[i, 2] > 0.0))


@inlined
def mirrored(d: Any, s: Any, g: Any) -> Triple:
    """Direction d mirrored at the shading normal s, or at the geometric normal g where that points into the surface."""
    along = np.float32(2.0) * (d[0] * s[0] + d[1] * s[1] + d[2] * s[2])
    x, y, z = d[0] - along * s[0], d[1] - along * s[1], d[2] - along * s[2]
    if not x * g[0] + y * g[1] + z * g[2] > np.float32(0.0):
        along = np.float32(2.0) * (d[0] * g[0] + d[1] * g[1] + d[2] * g[2])
        x, y, z = d[0] - along * g[0], d[1] - along * g[1], d[2] - along * g[2]
    return x, y, z


@inlined
def start_bounce(hits: Hits, i: int, to: Triple, key: np.uint64, packets: Float32, reflected: Hits, m: int) -> None:
    """Write ray m, from slightly above hit i, with the random key, pixel and half of its end."""
    e, p, g = hits.offset[i], hits.position[i], hits.geometric[i]
    ox, oy, oz = p[0] + e * g[0], p[1] + e * g[1], p[2] + e * g[2]
    set_ray(packets, m, ox, oy, oz, to[0], to[1], to[2], np.float32(np.inf))
    reflected.key[m], reflected.pixel[m], reflected.half[m] = key, hits.pixel[i], hits.half[i]


@kernel
def count_mirrors(hits: Hits, n: int) -> int:
    """Number of hits 0 to n - 1 that reflect specularly."""
    total = 0
    for i in range(n):
        total += _is_mirror(hits, i)
    return total


def reflect(
    hits: Hits, n: int, throughput: Rgb, world: World, packets: Float32, reflected: Hits, reflected_throughput: Rgb
) -> int:
    """Follow hits 0 to n - 1 through one mirror bounce; paths at hits that are no mirror end.

    Args:
        throughput: (n, 3) tint t of each path so far.
        reflected: overwritten with the hits (or escapes) behind the mirrors, in order, with their next random streams.
        reflected_throughput: (n, 3) overwritten: t times the mirror's reflectivity.

    Returns:
        number of reflected hits, which is the number of rays.
    """
    m: int = _write_reflected_rays(hits, n, throughput, packets, reflected, reflected_throughput)
    if m:
        trace_hits(world, packets, m, coherent=True, near=0.0, mirrors=True, hits=reflected)
    return m


@kernel
def _write_reflected_rays(
    hits: Hits, n: int, throughput: Rgb, packets: Float32, reflected: Hits, reflected_throughput: Rgb
) -> int:
    """Write the rays of `reflect`, with keys, pixels and halves of their hits."""
    # Loop state
    m = NO_RAYS  # reflected rays
    for i in range(n):
        if not _is_mirror(hits, i):
            continue
        to = mirrored(hits.incoming[i], hits.shading[i], hits.geometric[i])
        start_bounce(hits, i, to, mix(hits.key[i]), packets, reflected, m)
        for channel in range(3):
            reflected_throughput[m, channel] = throughput[i, channel] * hits.specular[i, channel]
        m += 1
    return m


class Fronts:
    """Progress of the eye rays of a batch of hits through glass.

    Attributes:
        near: (n,) the depth from which on they look for glass, in lengths of their directions; infinite: none is left.
        transmission: (n, 3) of the faces met so far.
    """

    def __init__(self, n: int) -> None:
        self.near = np.zeros(n, np.float32)
        self.transmission = np.ones((n, 3), np.float32)


def reflect_at_panes(
    hits: Hits,
    n: int,
    eye: Float32,
    fronts: Fronts,
    panes: PaneArrays,
    world: World,
    rays: Rays,
    reflected: Hits,
    tint: Rgb,
) -> int:
    """Find the reflection in the next face of glass on the way to each of hits 0 to n - 1.

    Args:
        eye: (n, 3) origins of the rays that found the hits, or (1, 3).
        rays: scratch, with rows for hits; of the reflected rays once they are traced.
        reflected: overwritten with the reflected hits, in order.
        tint: (>= n, 3) overwritten: the tint of each.

    Returns:
        number of reflected hits.
    """
    m: int = _write_reflected(hits, n, eye, fronts.near, fronts.transmission, panes, rays, reflected, tint)
    if m:
        trace_hits(world, rays.packets, m, coherent=True, near=0.0, mirrors=True, hits=reflected)
    return m


@kernel
def _write_reflected(
    hits: Hits,
    n: int,
    eye: Float32,
    near: Float32,
    transmission: Rgb,
    panes: PaneArrays,
    rays: Rays,
    reflected: Hits,
    tint: Rgb,
) -> int:
    """Write the rays of `reflect_at_panes`, with keys, pixels and halves of their hits."""
    packets, width = rays.packets, width_of_packets()
    # 1. The next faces of glass.
    waiting = NO_RAYS
    for i in range(n):
        if near[i] == np.inf:
            continue
        dx, dy, dz = hits.incoming[i, 0], hits.incoming[i, 1], hits.incoming[i, 2]
        reach = np.float32(np.inf)
        o = eye[i if eye.shape[0] > 1 else 0]
        if hits.kind[i] == SURFACE:
            x, y, z = hits.position[i, 0] - o[0], hits.position[i, 1] - o[1], hits.position[i, 2] - o[2]
            reach = np.float32((x * dx + y * dy + z * dz) / (dx * dx + dy * dy + dz * dz)) * np.float32(1.0 - 1e-4)
        set_ray(packets, waiting, o[0], o[1], o[2], dx, dy, dz, reach)
        packets[waiting // width, TNEAR, waiting % width] = near[i]
        rays.place[waiting] = i
        waiting += 1
    intersect_on(panes.tracer, packets, waiting)
    # 2. The rays that they reflect: no more than were read, so that packets serve both.
    m = NO_RAYS
    for k in range(waiting):
        i, triangle, t = rays.place[k], hit_triangle(panes.tracer, packets, k), packets[k // width, TFAR, k % width]
        if triangle == MISS:
            near[i] = np.inf
            continue
        d = hits.incoming[i, 0], hits.incoming[i, 1], hits.incoming[i, 2]
        f = reflectance(panes, triangle, d)
        share, passed = mirrored_by(panes, triangle, f), passed_by(panes, triangle, f)
        near[i], colour = t + step_beyond(panes, triangle, d), colour_at(panes, triangle, packets, k)
        if share > LEAST:
            g = normal_of(panes, triangle)
            along = d[0] * g[0] + d[1] * g[1] + d[2] * g[2]
            lift = panes.optics[triangle, OFFSET]
            e = lift if along < 0.0 else -lift
            along = np.float32(2.0) * along
            x, y, z = d[0] - along * g[0], d[1] - along * g[1], d[2] - along * g[2]
            o = eye[i if eye.shape[0] > 1 else 0]
            ox, oy, oz = o[0] + t * d[0] + e * g[0], o[1] + t * d[1] + e * g[1], o[2] + t * d[2] + e * g[2]
            set_ray(packets, m, ox, oy, oz, x, y, z, np.float32(np.inf))
            for channel in range(3):
                tint[m, channel] = transmission[i, channel] * share
            reflected.key[m], reflected.pixel[m], reflected.half[m] = mix(mix(hits.key[i])), hits.pixel[i], hits.half[i]
            m += 1
        for channel in range(3):
            transmission[i, channel] *= passed * colour[channel]
    return m


class Bent(NamedTuple):
    """Rays that leave solid glass for the last time.

    Attributes:
        hit: (m,) the hit that each belongs to.
        origin, way: (m, 3) origins and directions.
        passed: (m, 3) transmission of the faces on the way.
        rays: number of rays traced.
    """

    hit: Int32
    origin: Float32
    way: Float32
    passed: Float32
    rays: int


@kernel
def _nearest(
    tracer: Tracer, origin: Float32, way: Float32, packets: Float32, panes: PaneArrays, t: Float32, triangle: Int32,
    colour: Rgb,
) -> None:  # fmt: skip
    """Find the distances and triangles that rays meet, infinity and -1 for nothing, and the colours of glass."""
    width, capacity = width_of_packets(), room_in(packets)
    for first in range(0, origin.shape[0], capacity):
        n = min(capacity, origin.shape[0] - first) + NO_RAYS
        for k in range(n):
            o, d = origin[first + k], way[first + k]
            set_ray(packets, k, o[0], o[1], o[2], d[0], d[1], d[2], np.float32(np.inf))
            packets[k // width, TNEAR, k % width] = 0.0
        intersect_on(tracer, packets, n)
        for k in range(n):
            triangle[first + k] = hit_triangle(tracer, packets, k)
            t[first + k] = packets[k // width, TFAR, k % width]
            if has_rows(panes.optics) and triangle[first + k] != MISS:
                red, green, blue = colour_at(panes, triangle[first + k], packets, k)
                colour[first + k, 0], colour[first + k, 1], colour[first + k, 2] = red, green, blue


def nearest(
    tracer: Tracer, origin: Float32, way: Float32, packets: Float32, panes: PaneArrays = NO_PANES
) -> tuple[Float32, Int32, Rgb]:
    """Distances and triangles that rays meet, (n,) each, infinity and -1 for nothing; colours of panes, (n, 3)."""
    n = len(origin)
    t, triangle, colour = np.empty(n, np.float32), np.empty(n, np.int32), np.ones((n, 3), np.float32)
    _nearest(tracer, np.ascontiguousarray(origin), np.ascontiguousarray(way), packets, panes, t, triangle, colour)
    return np.where(triangle < 0, np.float32(np.inf), t), triangle, colour


def bend(hits: Hits, n: int, eye: Float32, panes: PaneArrays, tracer: Tracer, packets: Float32) -> Bent:
    """Follow the rays that found hits 0 to n - 1 through solid glass.

    Args:
        eye: (n, 3) origins of the rays, or (1, 3).
        packets: scratch, with rows for hits.
    """
    # --- loop state: rays still on their way ---
    hit = np.arange(n, dtype=np.int32)
    way = hits.incoming[:n] / np.linalg.norm(hits.incoming[:n], axis=1, keepdims=True)
    origin = np.broadcast_to(eye, way.shape).astype(np.float32)
    passed, inside, bent = np.ones((n, 3), np.float32), np.zeros(n, np.bool_), np.zeros(n, np.bool_)
    end = np.linalg.norm(hits.position[:n] - eye, axis=1)  # how far the scene is
    end[hits.kind[:n] != SURFACE] = np.inf
    # ---
    done: list[tuple[Int32, Float32, Float32, Float32]] = []
    total = 0
    for _ in range(MOST_FACES):
        t, triangle, colour = nearest(panes.tracer, origin, way, packets, panes)
        total += len(hit)
        glass = (triangle >= 0) & (t < end * BEFORE)  # a surface in the same place covers glass
        ends = ~glass & bent
        done.append((hit[ends], origin[ends], way[ends], passed[ends]))
        hit, origin, way, passed, inside, bent, t, triangle, colour = (
            array[glass] for array in (hit, origin, way, passed, inside, bent, t, triangle, colour)
        )
        if not len(hit):
            break
        origin, way, share, inside, turned = _beyond(panes.optics[triangle], colour, origin, way, t, inside)
        passed, bent = passed * share, bent | turned
        end, _, _ = nearest(tracer, origin, way, packets)
        total += len(hit)
    found = [np.concatenate(parts) for parts in zip(*done, strict=True)]
    return Bent(found[0], found[1], found[2], found[3], total)


def _beyond(
    optics: Float32, colour: Rgb, origin: Float32, way: Float32, t: Float32, inside: Flags
) -> tuple[Float32, Float32, Float32, Flags, Flags]:
    """Rays beyond faces: origin, direction, transmission, flags of rays inside glass, flags of bent rays."""
    solid = optics[:, BENDS] > 0
    normal = optics[:, NORMAL : NORMAL + 3].astype(np.float64)
    along = (way * normal).sum(axis=1)
    normal = np.where((along > 0)[:, None], -normal, normal)  # on the side that the ray comes from
    cosine = np.minimum(np.abs(along), 1.0)
    index = np.where(solid, np.maximum(optics[:, BENDS], 1.0), 1.0).astype(np.float64)
    ratio = np.where(inside, index, 1 / index)
    square = 1 - ratio**2 * (1 - cosine**2)  # squared cosine beyond the face
    caught = solid & (square < 0)
    beyond = np.sqrt(np.maximum(square, 0.0))
    to: Float64 = ratio[:, None] * way + (ratio * cosine - beyond)[:, None] * normal
    to = np.where(caught[:, None], way + 2 * cosine[:, None] * normal, to)
    to /= np.linalg.norm(to, axis=1, keepdims=True)
    # Schlick's reflectance goes with the angle in air
    outer = np.where(inside, beyond, cosine)
    f = optics[:, F] + optics[:, G] * (1 - outer) ** 5
    share = np.where(optics[:, SHEET] > 0, (1 - f) / (1 + f), 1 - f)[:, None] * colour
    share = np.where(caught[:, None], 1.0, share)
    lift = np.where(caught, 1.0, -1.0)[:, None] * optics[:, OFFSET, None] * normal
    start = origin + t[:, None] * way + lift
    return (
        start.astype(np.float32), to.astype(np.float32), share.astype(np.float32), inside ^ (solid & ~caught), solid,
    )  # fmt: skip


@kernel
def write_bent(bent: Bent, hits: Hits, packets: Float32, reflected: Hits) -> None:
    """Write bent rays, with keys, pixels and halves of their ends."""
    for k in range(bent.hit.shape[0]):
        i, o, d = bent.hit[k], bent.origin[k], bent.way[k]
        set_ray(packets, k, o[0], o[1], o[2], d[0], d[1], d[2], np.float32(np.inf))
        reflected.key[k], reflected.pixel[k], reflected.half[k] = hits.key[i], hits.pixel[i], hits.half[i]
