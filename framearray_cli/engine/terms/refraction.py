"""What eyes see through solid glass: rays are bent where they enter and leave it, and end at a hit like any other.

Like mirrors this depends on the eye, so only native hits have it. At each face goes on what passes it, bent by Snell's
law; beyond the critical angle all of it is reflected inside. What a face mirrors outside is found in `panes.py`.
"""

from typing import NamedTuple

import numpy as np

from framearray_cli.base.arrays import Flags, Float32, Float64, Int32
from framearray_cli.scene.panes import BENDS, COLOUR, NORMAL, OFFSET, SHEET, F, G

from ..embree.packets import TFAR, TNEAR, Tracer, hit_triangle, intersect_on, room_in, set_ray
from ..hits.hits import SURFACE, Hits
from ..hits.rays import NO_RAYS
from ..inputs.panes import Panes
from ..kernels.kernel import kernel
from ..kernels.simd import width_of_packets

MOST_FACES = 12  # that bend a ray; what comes after is dark


class Bent(NamedTuple):
    """Rays that leave solid glass for the last time.

    Attributes:
        hit: (m,) the hit that each belongs to.
        origin, way: (m, 3) where they start, and whereto.
        passed: (m, 3) what the faces on the way leave.
        rays: number of rays traced.
    """

    hit: Int32
    origin: Float32
    way: Float32
    passed: Float32
    rays: int


@kernel
def _nearest(tracer: Tracer, origin: Float32, way: Float32, packets: Float32, t: Float32, triangle: Int32) -> None:
    """Find how far rays go and what they meet; infinity and -1 for nothing."""
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


def nearest(tracer: Tracer, origin: Float32, way: Float32, packets: Float32) -> tuple[Float32, Int32]:
    """How far rays go, (n,), and what they meet, (n,); infinity and -1 for nothing."""
    t, triangle = np.empty(len(origin), np.float32), np.empty(len(origin), np.int32)
    _nearest(tracer, np.ascontiguousarray(origin), np.ascontiguousarray(way), packets, t, triangle)
    return np.where(triangle < 0, np.float32(np.inf), t), triangle


def bend(hits: Hits, n: int, eye: Float32, panes: Panes, tracer: Tracer, packets: Float32) -> Bent:
    """Follow the rays that found hits 0 to n - 1 through solid glass.

    Args:
        eye: (n, 3) where they come from, or (1, 3).
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
        t, triangle = nearest(panes.tracer, origin, way, packets)
        total += len(hit)
        glass = (triangle >= 0) & (t < end)
        ends = ~glass & bent
        done.append((hit[ends], origin[ends], way[ends], passed[ends]))
        hit, origin, way, passed, inside, bent, t, triangle = (
            array[glass] for array in (hit, origin, way, passed, inside, bent, t, triangle)
        )
        if not len(hit):
            break
        origin, way, share, inside, turned = _beyond(panes.optics[triangle], origin, way, t, inside)
        passed, bent = passed * share, bent | turned
        end, _ = nearest(tracer, origin, way, packets)
        total += len(hit)
    found = [np.concatenate(parts) for parts in zip(*done, strict=True)]
    return Bent(found[0], found[1], found[2], found[3], total)


def _beyond(
    optics: Float32, origin: Float32, way: Float32, t: Float32, inside: Flags
) -> tuple[Float32, Float32, Float32, Flags, Flags]:
    """What becomes of rays at faces: where they start, whereto, what passes, whether they are inside, and were bent."""
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
    share = np.where(optics[:, SHEET] > 0, (1 - f) / (1 + f), 1 - f)[:, None] * optics[:, COLOUR : COLOUR + 3]
    share = np.where(caught[:, None], 1.0, share)
    lift = np.where(caught, 1.0, -1.0)[:, None] * optics[:, OFFSET, None] * normal
    start = origin + t[:, None] * way + lift
    return (
        start.astype(np.float32), to.astype(np.float32), share.astype(np.float32), inside ^ (solid & ~caught), solid,
    )  # fmt: skip


@kernel
def write_bent(bent: Bent, hits: Hits, packets: Float32, reflected: Hits) -> None:
    """Write bent rays, and what is known of their ends."""
    for k in range(bent.hit.shape[0]):
        i, o, d = bent.hit[k], bent.origin[k], bent.way[k]
        set_ray(packets, k, o[0], o[1], o[2], d[0], d[1], d[2], np.float32(np.inf))
        reflected.key[k], reflected.pixel[k], reflected.half[k] = hits.key[i], hits.pixel[i], hits.half[i]
