"""Geometry of meshes, for the readers of all formats: polygons -> triangles, tangents of normal maps, places.

Tangents follow the rules of MikkTSpace [Mikkelsen08]. Normal maps are baked in the tangent space of the program that
made them. Most programs use the space of MikkTSpace, and glTF requires it. At a corner of a triangle, the tangent is
the mean direction in which u grows, over all triangles that share its position, normal and texture coordinates and do
not mirror the texture differently. Each direction is brought into the plane of the normal first, and weighs as much as
the angle of its triangle there.

Two differences: MikkTSpace separates triangles around a corner that share no edge; here they share a tangent. And it
finds the front of a triangle by the order of its corners; here normals point to the front, as models with normals
against that order exist.
"""

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from framearray_cli.base.arrays import Flags, Float32, Float64

from ..vectors import cross, hash_rows, lengths
from .assets import Limit
from .model import Notes, Part

Indices = NDArray[np.int64]


# Cutting the ears off a polygon of k corners takes time in proportion to k^2; for this number it takes 0.2 s.
MOST_CORNERS = 2000


def triangulate(corners: Float64, notes: Notes) -> Indices:
    """Split m polygons of k corners each.

    Convex polygons become fans, all at once. Concave ones lose one ear after another; quads are cut at the reflex
    corner.

    Args:
        corners: (m, k, 3) positions, k at least 3.
        notes: gets a note if concave polygons are so large that they become fans.

    Returns:
        (m, k - 2, 3) corner numbers from 0 to k - 1.
    """
    m, k = corners.shape[:2]
    middle = np.arange(1, k - 1)
    fan = np.stack([np.zeros_like(middle), middle, middle + 1], axis=1)
    triangles = np.broadcast_to(fan, (m, k - 2, 3)).copy()
    if k > 3:
        concave, reflex = _concave(corners)
        if k == 4:
            triangles[concave & (reflex % 2 == 1)] = OTHER_DIAGONAL
            return triangles
        if concave.any() and k > MOST_CORNERS:
            notes.add(f"concave polygons of more than {MOST_CORNERS} corners are split as if they were convex")
            return triangles
        for polygon in np.flatnonzero(concave):
            triangles[polygon] = _clip_ears(corners[polygon])
    return triangles


def triangulate_faces(corners: Float64, counts: Indices, kept: Flags, notes: Notes) -> tuple[Indices, Indices]:
    """Split n polygons with any numbers of corners.

    Args:
        corners: (c, 3) positions of the corners of one polygon after another.
        counts: (n,) number of corners of each.
        kept: (n,) True if a polygon is split; it then has at least 3 corners.

    Returns:
        (f, 3) rows of `corners`, and (f,) the polygon of each triangle, in the order of polygons.
    """
    starts = np.cumsum(counts) - counts
    triangles, owners = [np.zeros((0, 3), np.int64)], [np.zeros(0, np.int64)]
    for k in np.unique(counts[kept]):
        some = np.flatnonzero(kept & (counts == k))
        rows = starts[some, None] + np.arange(k)  # (m, k)
        local = triangulate(corners[rows], notes)  # (m, k - 2, 3)
        triangles.append(np.take_along_axis(rows[:, None, :], local, axis=2).reshape(-1, 3))
        owners.append(np.repeat(some, k - 2))
    owner = np.concatenate(owners)
    order = np.argsort(owner, kind="stable")
    return np.concatenate(triangles)[order], owner[order]


OTHER_DIAGONAL = np.array([[1, 2, 3], [1, 3, 0]])


def _concave(corners: Float64) -> tuple[Flags, Indices]:
    """(m,) True if a polygon turns both ways along its outline, and the corner where it turns back the most."""
    with np.errstate(all="ignore"):  # non-finite corners compare false; their triangles are dropped later
        centred = corners - corners.mean(axis=1, keepdims=True)
        normal = np.cross(centred, np.roll(centred, -1, axis=1)).sum(axis=1)  # (m, 3), Newell
        ahead = np.roll(corners, -1, axis=1) - corners
        turn = np.einsum("mkc,mc->mk", np.cross(np.roll(ahead, 1, axis=1), ahead), normal)
        # rounding must not make a flat quad concave
        concave = (turn < -1e-9 * np.abs(turn).max(axis=1, keepdims=True)).any(axis=1)
    return np.asarray(concave), np.asarray(turn.argmin(axis=1))


def _clip_ears(corners: Float64) -> Indices:
    """Triangulate one polygon in the axis plane where its area is largest; (k - 2, 3) corner numbers."""
    centred = corners - corners.mean(axis=0)
    normal = np.cross(centred, np.roll(centred, -1, axis=0)).sum(axis=0)
    flat = np.delete(centred, int(np.argmax(np.abs(normal))), axis=1)  # (k, 2)
    area = _cross(flat, np.roll(flat, -1, axis=0)).sum()
    sign = 1.0 if area > 0 else -1.0
    left = list(range(len(corners)))
    triangles = []
    while len(left) > 3:
        at = _ear(flat, left, sign)
        triangles.append((left[at - 1], left[at], left[(at + 1) % len(left)]))
        del left[at]
    triangles.append((left[0], left[1], left[2]))
    return np.array(triangles, dtype=np.int64)


def _ear(flat: Float64, left: list[int], sign: float) -> int:
    """Find the index in `left` of a corner that can be cut off; 1 if there is none (the outline crosses itself)."""
    points = flat[left]  # (r, 2)
    before, after = np.roll(points, 1, axis=0), np.roll(points, -1, axis=0)
    turn = sign * _cross(points - before, after - points)
    for at in np.flatnonzero(turn > 0):
        a, b, c = before[at], points[at], after[at]
        inside = (
            (sign * _cross(b - a, points - a) >= 0)
            & (sign * _cross(c - b, points - b) >= 0)
            & (sign * _cross(a - c, points - c) >= 0)
        )
        # corners that coincide with corners of the ear (a bridge to a hole) do not block it
        same = (points == a).all(axis=1) | (points == b).all(axis=1) | (points == c).all(axis=1)
        if not (inside & ~same).any():
            return int(at)
    flat_corners = np.flatnonzero(turn == 0)
    return int(flat_corners[0]) if len(flat_corners) else 1


def _cross(a: Float64, b: Float64) -> Float64:
    """The z of the cross product of 2D vectors, last axis."""
    return np.asarray(a[..., 0] * b[..., 1] - a[..., 1] * b[..., 0])


CORNER_BYTES = 300  # memory per corner while tangents are computed (measured: 290)


def compute_tangents(corners: Float64, normals: Float64 | None, uvs: Float64) -> Float64:
    """Compute the tangents of f triangles, one per corner.

    Args:
        corners: (f, 3, 3) positions.
        normals: (f, 3, 3) of any length, or None: the triangles' own, which also replace broken ones.
        uvs: (f, 3, 2) texture coordinates, v upwards.

    Returns:
        (f, 3, 4): a unit vector, and w: the bitangent is w times normal x tangent. All 0 where texture coordinates,
        positions or normals give no direction.
    """
    with np.errstate(all="ignore"):  # what has no direction is NaN in between, and 0 in the end
        first, second = corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0]
        (du1, dv1), (du2, dv2) = (uvs[:, 1] - uvs[:, 0]).T, (uvs[:, 2] - uvs[:, 0]).T
        area = du1 * dv2 - du2 * dv1  # of the texture, twice
        along_u = (dv2[:, None] * first - dv1[:, None] * second) * np.sign(area)[:, None]
        front = unit = np.repeat(_unit(cross(first, second))[:, None], 3, axis=1)
        if normals is not None:
            unit = _unit(normals)
            unit = np.where(np.isfinite(unit), unit, front)
        inside_out = (unit * front).sum(axis=(1, 2)) < 0
        flat = _unit(_into_plane(np.broadcast_to(along_u[:, None], corners.shape), unit))
        weighted = flat * _angles(corners, unit)[..., None]
    # groups of corners with the same position, normal and texture coordinates
    keys, group = np.unique(hash_rows(np.concatenate([corners, unit, uvs], axis=2)), return_inverse=True)
    group, n = group.reshape(corners.shape[:2]), len(keys)
    counts = (area != 0)[:, None] & np.isfinite(weighted).all(axis=2)
    mirrored = np.broadcast_to(((area < 0) ^ inside_out)[:, None], group.shape)
    # sums of each group: of triangles that show the texture as it is, and mirrored
    rows, added = (2 * group + mirrored)[counts], weighted[counts]
    sums = np.stack([np.bincount(rows, added[:, k], 2 * n) for k in range(3)], axis=1)
    # a triangle without texture area takes part in what is there
    only_mirrored = (sums[0::2] == 0).all(axis=1) & (sums[1::2] != 0).any(axis=1)
    mirrored = np.where((area == 0)[:, None], only_mirrored[group], mirrored)
    with np.errstate(all="ignore"):
        tangent = np.nan_to_num(_unit(sums[2 * group + mirrored]))
    w = np.where(mirrored, -1.0, 1.0) * (lengths(tangent) > 0)
    return np.concatenate([tangent, w[..., None]], axis=2)


def tangents_within(limit: Limit, corners: Float64, normals: Float64 | None, uvs: Float64) -> Float64:
    """`compute_tangents`, with its memory counted."""
    with limit.lend("tangents", CORNER_BYTES * 3 * len(corners)):
        return compute_tangents(corners, normals, uvs)


def _unit(vectors: Float64) -> Float64:
    return np.asarray(vectors / lengths(vectors)[..., None])


def _into_plane(vectors: Float64, normals: Float64) -> Float64:
    """Subtract the part of vectors (..., 3) that runs along unit normals."""
    return np.asarray(vectors - (vectors * normals).sum(axis=-1, keepdims=True) * normals)


def _angles(corners: Float64, normals: Float64) -> Float64:
    """(f, 3) angle of each triangle at its corners, seen along the normals there."""
    before, after = np.roll(corners, 1, axis=1) - corners, np.roll(corners, -1, axis=1) - corners
    cosine = (_unit(_into_plane(before, normals)) * _unit(_into_plane(after, normals))).sum(axis=-1)
    return np.asarray(np.arccos(np.clip(cosine, -1.0, 1.0)))


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class Mesh:
    """f triangles of one material between v vertices, in the coordinates of their mesh.

    Attributes:
        material: its index.
        vertices: (v, 3).
        faces: (f, 3), all of them between 0 and v.
        normals: (v, 3) of the file, or None.
        uvs: (v, 2 k) with v upwards, see `Part`, or None.
        colours: (f, 3, 3) linear colours of the corners, or None.
        tangents: (f, 3, 4) of the normal map, see `Part`; None without one.
        normal_uvs: (v, 2) texture coordinates of the normal map with v upwards, or None.
        outside: number of triangles left out because a vertex of theirs does not exist.
    """

    material: int
    vertices: Float64
    faces: Indices
    normals: Float64 | None = None
    uvs: Float64 | None = None
    colours: Float32 | None = None
    tangents: Float64 | None = None
    normal_uvs: Float64 | None = None
    outside: int = 0


def join_sets(sets: Sequence[Float64 | None]) -> Float64 | None:
    """(v, 2 k) texture coordinates of k sets of (v, 2); NaN of sets that are None; None if all are."""
    known = next((one for one in sets if one is not None), None)
    if known is None:
        return None
    return np.column_stack([np.full_like(known, np.nan) if one is None else one for one in sets])


def place_mesh(mesh: Mesh, world_from_mesh: Float64, names: Sequence[str] = ("",)) -> Part:
    """Put a mesh at all of its places, one after another, in float64, one row per corner of a triangle.

    A mirroring transform turns triangles inside out, so their winding is reversed. The cofactors of the matrix are its
    inverse transpose times its determinant, and also exist for singular matrices; they transform the normals.

    Args:
        world_from_mesh: (n, 4, 4), one per place.
        names: of the object at each place, or one for all.
    """
    faces, normals = mesh.faces, mesh.normals
    linear = world_from_mesh[:, :3, :3]
    with np.errstate(all="ignore"):  # the scene counts and drops non-finite triangles later
        world = mesh.vertices @ linear.transpose(0, 2, 1) + world_from_mesh[:, None, :3, 3]
        mirrored = np.linalg.det(linear) < 0
        if normals is not None:
            sign = np.where(mirrored, -1.0, 1.0)[:, None, None]
            normals = normals @ (cofactors(linear) * sign).transpose(0, 2, 1)
        if (tangents := mesh.tangents) is not None:  # if normal x tangent points the other way in a mirror, w does too
            along = np.einsum("nij,fkj->nfki", linear, tangents[..., :3])
            w = np.where(mirrored, -1.0, 1.0)[:, None, None] * tangents[None, ..., 3]
            tangents = np.concatenate([along, w[..., None]], axis=3)

    def join_places(rows: NDArray[Any]) -> NDArray[Any]:
        """Reshape (n, f, 3, k) to (n f, 3, k), the corners of mirrored places in reverse order."""
        if mirrored.any():
            rows = rows.copy()
            rows[mirrored] = rows[mirrored][:, :, ::-1]
        return rows.reshape(-1, *rows.shape[2:])

    def repeat_at_places(rows: NDArray[Any]) -> NDArray[Any]:
        """Repeat (f, 3, k) at all places."""
        return join_places(np.broadcast_to(rows, (len(linear), *rows.shape)))

    return Part(
        material=mesh.material,
        corners=join_places(np.take(world, faces, axis=1)),
        normals=None if normals is None else join_places(np.take(normals, faces, axis=1)),
        uvs=None if mesh.uvs is None else repeat_at_places(mesh.uvs[faces]),
        colours=None if mesh.colours is None else repeat_at_places(mesh.colours),
        tangents=None if tangents is None else join_places(tangents),
        normal_uvs=None if mesh.normal_uvs is None else repeat_at_places(mesh.normal_uvs[faces]),
        objects=tuple(names),
        object=np.repeat(np.arange(len(names), dtype=np.int32), len(faces)) if len(names) > 1 else None,
    )


def cofactors(matrices: Float64) -> Float64:
    """(n, 3, 3) cofactor matrices: each row is the cross product of the two other rows."""
    a, b, c = matrices[:, 0], matrices[:, 1], matrices[:, 2]
    return np.stack([cross(b, c), cross(c, a), cross(a, b)], axis=1)
