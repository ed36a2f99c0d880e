"""Tangents of meshes that have normal maps but no tangents of their own, by the rules of MikkTSpace [Mikkelsen08].

Normal maps are baked in the tangent space of the program that made them. Most programs take that of MikkTSpace, and
glTF asks for it. At a corner of a triangle, the tangent is the mean direction in which u grows, over all triangles
that share its position, normal and texture coordinates and do not mirror the texture differently. Each direction is
brought into the plane of the normal first, and weighs as much as the angle of its triangle there.

Two differences: MikkTSpace separates triangles around a corner that share no edge; here they share a tangent. And it
takes the front of a triangle from the order of its corners; here it is where the normals point, as models with normals
against that order exist.
"""

from dataclasses import replace

import numpy as np
from numpy.typing import NDArray

from framearray_cli.base.arrays import Float64

from ..cleaning import hash_rows
from ..vectors import cross, lengths
from .limit import Limit
from .model import Part

CORNER_BYTES = 300  # memory per corner while tangents are computed (measured: 290)


def compute_tangents(corners: Float64, normals: Float64 | None, uvs: Float64) -> Float64:
    """Compute the tangents of f triangles, one per corner.

    Args:
        corners: (f, 3, 3) positions.
        normals: (f, 3, 3) of any length, or None: those of the triangles, which also replace broken ones.
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
    group, n = _groups(corners, unit, uvs)
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


def with_tangents(part: Part, limit: Limit) -> Part:
    """Give a part that has texture coordinates of a normal map its tangents."""
    if part.normal_uvs is None:
        return part
    with limit.lend("tangents", CORNER_BYTES * 3 * len(part.corners)):
        return replace(part, tangents=compute_tangents(part.corners, part.normals, part.normal_uvs))


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


def _groups(corners: Float64, normals: Float64, uvs: Float64) -> tuple[NDArray[np.int64], int]:
    """(f, 3) number of the group of corners with the same position, normal and texture coordinates, and their count."""
    keys = hash_rows(np.concatenate([corners, normals, uvs], axis=2).reshape(-1, 8))
    unique, group = np.unique(keys, return_inverse=True)
    return group.reshape(corners.shape[:2]), len(unique)
