"""Shapes of the project's own scenes: closed boxes, cushions, turned, swept and extruded things.

Every function returns a `Mesh` around the origin; `move`, `turn` and `scale` put it in place.
Lengths in metres, y up. Normals are made when the file is written, from each mesh's crease angle.
"""

from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

Array = NDArray[np.float64]
SHARP = 20.0  # crease angle of boxes: every edge stays an edge
BEVELLED = 50.0  # lets a 45 degree bevel shade softly into its two faces
ROUND = 60.0  # crease angle of turned and swept things


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class Mesh:
    """Points (n, 3), faces (m, 3), texture coordinates (n, 2) or None, crease angle in degrees."""

    points: Array
    faces: NDArray[np.int64]
    uvs: Array | None = None
    crease_deg: float = SHARP


def rotation(axis: str, angle_deg: float) -> Array:
    """(3, 3) rotation about "x", "y" or "z", counter-clockwise seen from the axis's tip."""
    c, s = np.cos(np.radians(angle_deg)), np.sin(np.radians(angle_deg))
    i, j = {"x": (1, 2), "y": (2, 0), "z": (0, 1)}[axis]
    matrix = np.eye(3)
    matrix[i, i] = matrix[j, j] = c
    matrix[i, j], matrix[j, i] = -s, s
    return matrix


def move(mesh: Mesh, x: float = 0.0, y: float = 0.0, z: float = 0.0) -> Mesh:
    return replace(mesh, points=mesh.points + np.array([x, y, z]))


def turn(mesh: Mesh, axis: str, angle_deg: float) -> Mesh:
    return replace(mesh, points=mesh.points @ rotation(axis, angle_deg).T)


def scale(mesh: Mesh, x: float, y: float | None = None, z: float | None = None) -> Mesh:
    """Scale by x, y, z, or uniformly by x without y and z; factors are positive."""
    return replace(mesh, points=mesh.points * np.array([x, x if y is None else y, x if z is None else z]))


def mirror_x(mesh: Mesh) -> Mesh:
    """The mesh mirrored at x = 0, its faces still turned outwards."""
    return replace(mesh, points=mesh.points * np.array([-1.0, 1.0, 1.0]), faces=mesh.faces[:, ::-1])


def bend(mesh: Mesh, shape: Callable[[Array], Array]) -> Mesh:
    """The mesh with its points (n, 3) sent through `shape`."""
    return replace(mesh, points=shape(mesh.points))


def box(x: float, y: float, z: float, bevel: float = 0.0) -> Mesh:
    """A box of size x, y, z that stands on y = 0, centred in x and z; `bevel` cuts its edges."""
    half = np.array([x, y, z]) / 2.0
    bevel = min(bevel, 0.45 * float(min(x, y, z)))
    if bevel <= 0.0:
        corners = np.array([[i, j, k] for i in (-1, 1) for j in (-1, 1) for k in (-1, 1)], dtype=float) * half
        quads = [[0, 1, 3, 2], [4, 6, 7, 5], [0, 4, 5, 1], [2, 3, 7, 6], [0, 2, 6, 4], [1, 5, 7, 3]]
        return move(Mesh(points=corners, faces=split_quads(np.array(quads))), y=y / 2.0)
    return move(_bevelled_box(half, bevel), y=y / 2.0)


def _bevelled_box(half: Array, bevel: float) -> Mesh:
    """6 faces, 12 edge strips and 8 corner triangles; each corner of the box is three points, one per face."""
    signs = np.array([[i, j, k] for i in (-1, 1) for j in (-1, 1) for k in (-1, 1)], dtype=float)
    points = np.repeat(signs * (half - bevel), 3, axis=0).reshape(8, 3, 3)
    for axis in range(3):  # point `axis` of a corner lies on the face across that axis
        points[:, axis, axis] = signs[:, axis] * half[axis]
    at = {tuple(int(v) for v in sign): 3 * i for i, sign in enumerate(signs)}
    faces: list[list[int]] = []
    for a in range(3):
        b, c = (a + 1) % 3, (a + 2) % 3
        for s in (-1, 1):
            ring = [_corner(a, s, b, p, c, q) for p, q in ((-1, -1), (1, -1), (1, 1), (-1, 1))]
            faces += _quad([at[k] + a for k in ring])
            for t in (-1, 1):  # the edge strip between the faces a = s and b = t
                lo, hi = _corner(a, s, b, t, c, -1), _corner(a, s, b, t, c, 1)
                faces += _quad([at[lo] + a, at[lo] + b, at[hi] + b, at[hi] + a])
    faces += [[3 * i, 3 * i + 1, 3 * i + 2] for i in range(8)]
    return _outwards(Mesh(points=points.reshape(-1, 3), faces=np.array(faces), crease_deg=BEVELLED))


def _corner(a: int, s: int, b: int, t: int, c: int, u: int) -> tuple[int, int, int]:
    sign = [0, 0, 0]
    sign[a], sign[b], sign[c] = s, t, u
    return (sign[0], sign[1], sign[2])


def _outwards(mesh: Mesh) -> Mesh:
    """Turn every face of a convex mesh around the origin outwards."""
    p = mesh.points[mesh.faces]
    inwards = np.einsum("ij,ij->i", np.cross(p[:, 1] - p[:, 0], p[:, 2] - p[:, 0]), p.mean(axis=1)) < 0
    return replace(mesh, faces=np.where(inwards[:, None], mesh.faces[:, ::-1], mesh.faces))


def between(low: Sequence[float], high: Sequence[float], bevel: float = 0.0) -> Mesh:
    """A box from corner `low` to corner `high`."""
    (x0, y0, z0), (x1, y1, z1) = low, high
    return move(box(x1 - x0, y1 - y0, z1 - z0, bevel), (x0 + x1) / 2.0, y0, (z0 + z1) / 2.0)


def cushion(x: float, y: float, z: float, radius: float, n: int = 6, puff: float = 0.0) -> Mesh:
    """A box with rounded edges that stands on y = 0; `puff` is how far its faces bulge."""
    half = np.array([x, y, z]) / 2.0
    radius = min(radius, 0.98 * float(half.min()))
    steps = _cushion_steps(n)
    patches = []
    for axis in range(3):
        for s in (-1.0, 1.0):
            u, v = np.meshgrid(steps, steps, indexing="ij")
            cube = np.empty((n + 1, n + 1, 3))
            cube[..., axis], cube[..., (axis + 1) % 3], cube[..., (axis + 2) % 3] = s, u * s, v
            core = np.clip(cube * half, -(half - radius), half - radius)
            away = cube * half - core
            away /= np.linalg.norm(away, axis=-1, keepdims=True)
            points = core + radius * away
            points[..., axis] += s * puff * (1 - u**2) * (1 - v**2)
            patches.append(patch(points))
    return replace(move(join(patches), y=y / 2.0), crease_deg=ROUND)


def _cushion_steps(n: int) -> Array:
    """n + 1 values from -1 to 1, closer together near the ends, where the edges are round."""
    t = np.linspace(-1.0, 1.0, n + 1)
    return np.asarray(np.sin(t * np.pi / 2.0) * 0.6 + t * 0.4)


def slab(width: float, height: float, depth: float, holes: Sequence[tuple[float, float, float, float]] = ()) -> Mesh:
    """A wall from x = 0 to width, y = 0 to height, z = -depth to 0, with rectangular holes (x0, y0, x1, y1)."""
    xs = np.unique([0.0, width, *(v for h in holes for v in (h[0], h[2]))])
    ys = np.unique([0.0, height, *(v for h in holes for v in (h[1], h[3]))])
    middle_x, middle_y = (xs[1:] + xs[:-1]) / 2.0, (ys[1:] + ys[:-1]) / 2.0
    solid = np.ones((len(xs) + 1, len(ys) + 1), dtype=bool)  # one cell of air all around
    solid[[0, -1], :] = solid[:, [0, -1]] = False
    for x0, y0, x1, y1 in holes:
        inside = ((middle_x > x0) & (middle_x < x1))[:, None] & ((middle_y > y0) & (middle_y < y1))[None, :]
        solid[1:-1, 1:-1] &= ~inside
    n_y = len(ys)
    grid = np.array([[x, y] for x in xs for y in ys])
    points = np.vstack([np.c_[grid, np.zeros(len(grid))], np.c_[grid, np.full(len(grid), -depth)]])
    back = len(grid)
    faces: list[list[int]] = []
    for i in range(len(xs) - 1):
        for j in range(len(ys) - 1):
            if not solid[i + 1, j + 1]:
                continue
            a, b, c, d = i * n_y + j, (i + 1) * n_y + j, (i + 1) * n_y + j + 1, i * n_y + j + 1
            faces += _quad([a, b, c, d]) + _quad([back + d, back + c, back + b, back + a])
            for neighbour, (p, q) in (
                (solid[i + 1, j], (a, b)),
                (solid[i + 2, j + 1], (b, c)),
                (solid[i + 1, j + 2], (c, d)),
                (solid[i, j + 1], (d, a)),
            ):
                if not neighbour:
                    faces += _quad([q, p, back + p, back + q])
    return Mesh(points=points, faces=np.array(faces))


def join(meshes: Sequence[Mesh]) -> Mesh:
    """One mesh of several; texture coordinates are kept where the first has them, 0 where another lacks them."""
    starts = np.cumsum([0, *(len(m.points) for m in meshes[:-1])])
    with_uvs = meshes[0].uvs is not None
    uvs = np.vstack([np.zeros((len(m.points), 2)) if m.uvs is None else m.uvs for m in meshes]) if with_uvs else None
    return Mesh(
        points=np.vstack([m.points for m in meshes]),
        faces=np.vstack([m.faces + s for m, s in zip(meshes, starts, strict=True)]),
        uvs=uvs,
        crease_deg=meshes[0].crease_deg,
    )


def patch(points: Array, uvs: Array | None = None) -> Mesh:
    """Two triangles per cell of a grid of points (n_u, n_v, 3), outside where u x v points."""
    n_u, n_v = points.shape[:2]
    index = np.arange(n_u * n_v).reshape(n_u, n_v)
    quads = np.stack([index[:-1, :-1], index[1:, :-1], index[1:, 1:], index[:-1, 1:]], axis=-1).reshape(-1, 4)
    return Mesh(points=points.reshape(-1, 3), faces=split_quads(quads), uvs=None if uvs is None else uvs.reshape(-1, 2))


def clean(mesh: Mesh, crease_deg: float) -> Mesh:
    """The mesh without triangles of no area, such as those at the poles of a turned shape."""
    p = mesh.points[mesh.faces]
    area = np.linalg.norm(np.cross(p[:, 1] - p[:, 0], p[:, 2] - p[:, 0]), axis=1)
    return replace(mesh, faces=mesh.faces[area > 1e-10], crease_deg=crease_deg)


def _quad(corners: Sequence[int]) -> list[list[int]]:
    a, b, c, d = corners
    return [[a, b, c], [a, c, d]]


def split_quads(quads: NDArray[np.int64]) -> NDArray[np.int64]:
    return np.concatenate([quads[:, [0, 1, 2]], quads[:, [0, 2, 3]]])
