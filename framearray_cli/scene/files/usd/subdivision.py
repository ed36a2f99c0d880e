"""Subdivision surfaces of USD: Catmull-Clark [CatmullClark78] and Loop [Loop87] with creases [DeRose98].

A cage is refined a few times. Each point of a refined mesh is a mean of points of the mesh before. Values at points
move with them; values at corners of faces, such as texture coordinates, are refined as a surface of their own, which
has borders where they jump.
"""

import math
from dataclasses import dataclass
from typing import Any, NamedTuple

import numpy as np

from framearray_cli.base.arrays import Flags, Float64

from ..assets import Limit
from ..geometry import Indices
from ..model import Notes
from .usdcore import numbers

CATMULL_CLARK, LOOP = "catmullClark", "loop"
MOST_LEVELS, MOST_FACES, FACE_BYTES = 4, 400_000, 800  # bytes per face while a mesh is refined
SCENE_FACES = 2_000_000  # of all surfaces of a scene at all of their places
FINEST = 64  # edges are refined until this many would reach across the surface
INFINITE = 10.0  # sharpness that never wears off
# Words of `faceVaryingLinearInterpolation`: what of the values at corners is not smooth, from nothing to everything.
SMOOTH, CORNERS, PLUS_2, SEAMS, LINEAR = "none", "cornersOnly", "cornersPlus2", "boundaries", "all"


class _Mesh(NamedTuple):
    """A polygon mesh.

    Attributes:
        counts: (f,) corners of each face; corners: (c,) their points; n: number of points.
        edge: (c,) the edge from each corner to the next of its face; ends: (e, 2) its points, the lower first.
        sharp: (e,) sharpness of edges, infinite at borders; pinned: (n,) of points.
    """

    counts: Indices
    corners: Indices
    n: int
    edge: Indices
    ends: Indices
    sharp: Float64
    pinned: Float64

    @property
    def starts(self) -> Indices:
        """(f,) the first corner of each face."""
        return np.cumsum(self.counts) - self.counts

    @property
    def face(self) -> Indices:
        """(c,) the face of each corner."""
        return np.repeat(np.arange(len(self.counts)), self.counts)

    @property
    def before(self) -> Indices:
        """(c,) the corner before each corner in its face."""
        found = np.arange(len(self.corners)) - 1
        found[self.starts] = self.starts + self.counts - 1
        return found

    @property
    def border(self) -> Flags:
        """(e,) edges of a single face."""
        return np.asarray(np.bincount(self.edge) == 1)

    def ending(self, edges: Flags) -> Indices:
        """(n,) number of some of the edges that end at each point."""
        return np.bincount(self.ends[edges].reshape(-1), minlength=self.n)


def _mesh(
    counts: Indices, corners: Indices, pairs: Any, sharpness: Any, pinned: Float64, *, corners_pinned: bool = True
) -> _Mesh:
    """Connect faces.

    Args:
        pairs, sharpness: (k, 2) points of sharp edges, and (k,).
        pinned: (n,) sharpness of points.
        corners_pinned: True if points of a single face stay where they are.
    """
    after = np.arange(len(corners)) + 1
    starts, n = np.cumsum(counts) - counts, len(pinned)
    after[starts + counts - 1] = starts
    low, high = np.minimum(corners, corners[after]), np.maximum(corners, corners[after])
    keys, edge, faces = np.unique(low * n + high, return_inverse=True, return_counts=True)
    sharp = np.zeros(len(keys))
    pairs = np.sort(np.asarray(pairs, np.int64).reshape(-1, 2), axis=1)
    wanted = pairs[:, 0] * n + pairs[:, 1]
    at = np.minimum(np.searchsorted(keys, wanted), len(keys) - 1)
    there = keys[at] == wanted
    np.maximum.at(sharp, at[there], np.asarray(sharpness, np.float64)[there])
    sharp[faces != 2] = np.inf
    if corners_pinned:
        pinned = np.where(np.bincount(corners, minlength=n) == 1, np.inf, pinned)
    return _Mesh(counts, corners, n, edge.reshape(-1), np.column_stack([keys // n, keys % n]), sharp, pinned)


def _summed(at: Indices, values: Float64, n: int) -> Float64:
    """(n, width) sums of the values at each index."""
    return np.column_stack([np.bincount(at, column, minlength=n) for column in values.T])


def _smooth(mesh: _Mesh, values: Float64, scheme: str) -> Float64:
    """Values at the points of the next mesh: its old points, its edges, and with Catmull-Clark its faces."""
    n, ends, corners = mesh.n, mesh.ends, mesh.corners
    both, other = ends.reshape(-1), values[ends[:, ::-1]].reshape(-1, values.shape[1])
    middle, valence = values[ends].mean(axis=1), np.maximum(np.bincount(both, minlength=n), 1)[:, None]
    if scheme == LOOP:
        beta = (5 / 8 - (3 / 8 + np.cos(2 * np.pi / valence) / 4) ** 2) / valence
        points = (1 - valence * beta) * values + beta * _summed(both, other, n)
        edges = 3 / 4 * middle + _summed(mesh.edge, values[corners[mesh.before]], len(ends)) / 8
        new: tuple[Float64, ...] = ()
    else:
        faces = np.add.reduceat(values[corners], mesh.starts) / mesh.counts[:, None]
        around = np.maximum(np.bincount(corners, minlength=n), 1)[:, None]
        near = _summed(corners, faces[mesh.face], n) / around
        points = (
            near + 2 * _summed(both, np.repeat(middle, 2, axis=0), n) / valence + (valence - 3) * values
        ) / valence
        edges = middle / 2 + _summed(mesh.edge, faces[mesh.face], len(ends)) / 4
        new = (faces,)
    # Sharp edges: of two at a point these two decide alone; more pin it.
    share = np.minimum(mesh.sharp, 1.0)[:, None]
    edges = share * middle + (1 - share) * edges
    is_sharp = np.repeat(mesh.sharp > 0, 2)
    number = np.bincount(both[is_sharp], minlength=n)
    mean = np.bincount(both, np.repeat(np.minimum(mesh.sharp, 1e3), 2), minlength=n) / np.maximum(number, 1)
    crease = np.where(number == 2, np.minimum(mean, 1.0), 0.0)[:, None]
    along = (6 * values + _summed(both[is_sharp], other[is_sharp], n)) / 8
    points = crease * along + (1 - crease) * points
    pinned = np.minimum(np.maximum(mesh.pinned, np.where(number > 2, mean, 0.0)), 1.0)[:, None]
    points = pinned * values + (1 - pinned) * points
    alone = np.bincount(corners, minlength=n) == 0
    points[alone] = values[alone]
    return np.concatenate([points, edges, *new])


def _linear(mesh: _Mesh, values: Float64, scheme: str) -> Float64:
    """Do as `_smooth` for values that are linear along edges."""
    faces = () if scheme == LOOP else (np.add.reduceat(values[mesh.corners], mesh.starts) / mesh.counts[:, None],)
    return np.concatenate([values, values[mesh.ends].mean(axis=1), *faces])


def _refined(mesh: _Mesh, scheme: str, *, corners_pinned: bool) -> _Mesh:
    """The next mesh: four triangles for each, or a quadrangle for each corner."""
    n, n_edges = mesh.n, len(mesh.ends)
    edge, last = n + mesh.edge, n + mesh.edge[mesh.before]
    if scheme == LOOP:
        outer = np.stack([mesh.corners, edge, last], axis=1).reshape(-1, 9)
        corners, total = np.concatenate([outer, edge.reshape(-1, 3)], axis=1).reshape(-1), n + n_edges
        counts = np.full(len(corners) // 3, 3)
    else:
        corners = np.stack([mesh.corners, edge, n + n_edges + mesh.face, last], axis=1).reshape(-1)
        counts, total = np.full(len(corners) // 4, 4), n + n_edges + len(mesh.counts)
    left = np.maximum(mesh.sharp - 1, 0.0)
    some = np.flatnonzero(left > 0)
    pinned = np.zeros(total)
    pinned[:n] = np.maximum(mesh.pinned - 1, 0.0)
    pairs = np.concatenate([np.column_stack([mesh.ends[some, side], n + some]) for side in (0, 1)])
    return _mesh(counts, corners, pairs, np.tile(left[some], 2), pinned, corners_pinned=corners_pinned)


@dataclass(frozen=True, slots=True, eq=False)
class Subdivision:
    """A cage and what it is refined to.

    Attributes:
        scheme: CATMULL_CLARK or LOOP.
        meshes: the cage, and each that it is refined to.
        faces, rows: faces of the prim that the cage has, and their corners.
        at_corners: the word of `faceVaryingLinearInterpolation`.
    """

    scheme: str
    meshes: tuple[_Mesh, ...]
    faces: Indices
    rows: Indices
    at_corners: str

    @property
    def counts(self) -> Indices:
        """(f,) corners of each face."""
        return self.meshes[-1].counts

    @property
    def corner_points(self) -> Indices:
        """(c,) point of each corner."""
        return self.meshes[-1].corners

    @property
    def parent(self) -> Indices:
        """(f,) the face of the prim that each face is a part of."""
        first = np.repeat(self.faces, 4 if self.scheme == LOOP else self.meshes[0].counts)
        return np.repeat(first, 4 ** (len(self.meshes) - 2))

    def of_points(self, values: Float64, *, linear: bool = False) -> Float64:
        """Values of points, (points of the prim, width), at the points of the last mesh; smooth, or linear."""
        for mesh in self.meshes[:-1]:
            values = (_linear if linear else _smooth)(mesh, values, self.scheme)
        return values

    def of_corners(self, values: Float64) -> Float64:
        """Values at the corners of all faces of the prim, (corners, width), at all corners of the last mesh."""
        cage, values = self.meshes[0], values[self.rows]
        linear, point, of_cage = self.at_corners == LINEAR, np.arange(len(values)), cage.corners
        if not linear:
            known = np.column_stack([cage.corners, values])
            _, first, point = np.unique(known, axis=0, return_index=True, return_inverse=True)
            values, of_cage, point = values[first], cage.corners[first], point.reshape(-1)
        pairs, sharpness = np.column_stack([point[cage.before], point]), cage.sharp[cage.edge[cage.before]]
        some, pinned = sharpness > 0, self.at_corners != SMOOTH
        mesh = _mesh(cage.counts, point, pairs[some], sharpness[some], cage.pinned[of_cage], corners_pinned=pinned)
        mesh = mesh._replace(pinned=np.where(self._stays(mesh, of_cage), np.inf, mesh.pinned))
        for _ in self.meshes[:-1]:
            values = (_linear if linear else _smooth)(mesh, values, self.scheme)
            mesh = _refined(mesh, self.scheme, corners_pinned=pinned)
        return values[mesh.corners]

    def _stays(self, mesh: _Mesh, of_cage: Indices) -> Flags:
        """(n,) values that stay where they are, besides corners; of values at points of the cage."""
        rim, cage = mesh.ending(mesh.border), self.meshes[0]
        if self.at_corners in (SMOOTH, CORNERS, SEAMS):
            return np.asarray((rim > 0) & (self.at_corners == SEAMS))
        number = np.bincount(of_cage, minlength=cage.n)[of_cage]
        stays = (number > 2) | (mesh.ending(mesh.sharp >= INFINITE) > 2)
        if self.at_corners == PLUS_2:  # corners, and the ends of seams
            ends = (number == 1) & (rim > 0) & (cage.ending(cage.border)[of_cage] == 0)
            stays |= (np.bincount(mesh.corners, minlength=mesh.n) == 1) | ends
        return np.asarray(np.bincount(of_cage, stays, minlength=cage.n)[of_cage] > 0)

    def normals(self, points: Float64) -> Float64:
        """(c, 3) normals at corners: means over the faces around a point that no sharp edge parts."""
        mesh = self.meshes[-1]
        shape = points[mesh.corners].reshape(len(mesh.counts), -1, 3)
        own = np.repeat(np.cross(shape[:, 2] - shape[:, 0], shape[:, -1] - shape[:, 1]), mesh.counts, axis=0)
        # Corners at one point belong together if their faces share an edge that is not sharp.
        after, order = np.argsort(mesh.before), np.argsort(mesh.edge, kind="stable")
        same = np.flatnonzero(mesh.edge[order][1:] == mesh.edge[order][:-1])
        a, b = order[same], order[same + 1]
        a, b = (some[mesh.sharp[mesh.edge[a]] == 0] for some in (a, b))
        against = mesh.corners[a] != mesh.corners[b]  # as neighbours run that are turned the same way
        links = (
            np.concatenate([a, after[a]]),
            np.concatenate([np.where(against, after[b], b), np.where(against, b, after[b])]),
        )
        group, known = np.arange(len(own)), np.empty(0, np.int64)
        while not np.array_equal(group, known):
            known = group
            least = np.minimum(group[links[0]], group[links[1]])
            group = known.copy()
            for some in links:
                np.minimum.at(group, some, least)
        total = _summed(group, own, len(group))[group]
        length = np.linalg.norm(total, axis=1, keepdims=True)
        return np.asarray(np.divide(total, length, out=np.zeros_like(total), where=length > 0))


def unbounded(mesh: Any, time: Any, shape: tuple[Indices, Indices, Flags], n: int) -> Flags:
    """(f,) faces at borders, where a surface with `interpolateBoundary = "none"` has no limit; of n points."""
    (counts, corner_points, whole), scheme = shape, mesh.GetSubdivisionSchemeAttr().Get(time)
    open_faces = np.zeros(len(counts), bool)
    if scheme in (CATMULL_CLARK, LOOP) and mesh.GetInterpolateBoundaryAttr().Get(time) == "none":
        cage = _mesh(counts[whole], corner_points[np.repeat(whole, counts)], [], [], np.zeros(n))
        pairs, sharpness = (np.array(some) for some in _creases(mesh, time))
        lasting = np.sort(pairs.reshape(-1, 2)[sharpness >= INFINITE].astype(np.int64), axis=1)
        edges = cage.border & ~np.isin(cage.ends @ [n, 1], lasting @ [n, 1])
        open_faces[whole] = np.bincount(cage.face, cage.ending(edges)[cage.corners]) > 0
    return open_faces


def subdivided(
    mesh: Any, time: Any, points: Float64, shape: tuple[Indices, Indices, Flags], limit: Limit, notes: Notes, most: int
) -> Subdivision | None:
    """Refine a mesh of USD until its edges are short against it; None if it is none, or its cage is short enough.

    Args:
        points: (n, 3).
        shape: counts (f,) and points (c,) of the corners of its faces, and (f,) whether they can be shown.
        notes: gets the name of a mesh that cannot be refined.
        most: faces that it may be refined to.
    """
    scheme, (counts, corner_points, whole) = str(mesh.GetSubdivisionSchemeAttr().Get(time)), shape
    faces, rows = np.flatnonzero(whole), np.flatnonzero(np.repeat(whole, counts))
    if scheme not in (CATMULL_CLARK, LOOP):
        return None
    if scheme == LOOP and (counts[faces] != 3).any():
        most = 0
    pinned, n = np.zeros(len(points)), len(points)
    at, sharpness = (
        numbers(a.Get(time), 1)[:, 0] for a in (mesh.GetCornerIndicesAttr(), mesh.GetCornerSharpnessesAttr())
    )
    known = (at >= 0) & (at < n) if len(at) == len(sharpness) else np.zeros(len(at), bool)
    pinned[at[known].astype(np.int64)] = np.maximum(sharpness[: len(at)][known], 0.0)
    boundary = str(mesh.GetInterpolateBoundaryAttr().Get(time) or "edgeAndCorner")
    corners_pinned = boundary == "edgeAndCorner"
    creases = _creases(mesh, time)
    cage = _mesh(counts[faces], corner_points[rows], *creases, pinned, corners_pinned=corners_pinned)
    used = points[cage.corners]
    size, longest = np.ptp(used, axis=0).max(), np.abs(points[cage.ends[:, 1]] - points[cage.ends[:, 0]]).max()
    if not (np.isfinite(size) and size > 0):
        return None
    levels = min(math.ceil(math.log2(max(longest * FINEST / size, 1.0))), MOST_LEVELS)
    first = 4 * len(faces) if scheme == LOOP else len(rows)
    if levels and first > most:
        notes.add("subdivision surfaces that cannot be refined are shown as their cages", mesh.GetPrim().GetName())
    while levels and first * 4 ** (levels - 1) > most:
        levels -= 1
    if not levels:
        return None
    limit.take("corners", FACE_BYTES * first * 4 ** (levels - 1))
    meshes = [cage]
    for _ in range(levels):
        meshes.append(_refined(meshes[-1], scheme, corners_pinned=corners_pinned))
    linear = str(mesh.GetFaceVaryingLinearInterpolationAttr().Get(time) or "")
    return Subdivision(scheme, tuple(meshes), faces, rows, linear)


def _creases(mesh: Any, time: Any) -> tuple[Any, Any]:
    """Points and sharpness of the sharp edges of a mesh; none if their numbers do not fit together."""
    along, lengths, sharpness = (
        numbers(a.Get(time), 1)[:, 0]
        for a in (mesh.GetCreaseIndicesAttr(), mesh.GetCreaseLengthsAttr(), mesh.GetCreaseSharpnessesAttr())
    )
    edges = lengths.astype(np.int64) - 1
    fits = (edges >= 1).all() and (edges + 1).sum() == len(along) and len(sharpness) in (len(edges), edges.sum())
    if not fits or not len(edges):
        return [], []
    last = np.cumsum(edges + 1) - 1
    pairs = np.column_stack([along[:-1], along[1:]])[np.delete(np.arange(len(along)), last)]
    return pairs, sharpness if len(sharpness) == len(pairs) else np.repeat(sharpness, edges)
