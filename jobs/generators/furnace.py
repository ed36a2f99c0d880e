"""furnace.glb: the inside of a finely tessellated sphere with the surface area of a sphere of radius 1.

Needs numpy. The edges of an icosahedron are halved six times:
81,920 triangles, whose corners and middles lie within 6e-5 of the mean distance from the centre.
"""

import numpy as np

from .common.glb import Material, Model
from .common.shapes import Mesh

SUBDIVISIONS = 6


def icosphere(subdivisions: int) -> Mesh:
    """A sphere of 20 * 4^subdivisions triangles around the origin, scaled so that its area is exactly 4 pi."""
    golden = (1 + 5**0.5) / 2
    points = np.array([[0, s, t * golden] for s in (-1, 1) for t in (-1, 1)], dtype=float)
    points = np.vstack([points, np.roll(points, 1, axis=1), np.roll(points, 2, axis=1)])
    near = np.isclose(np.linalg.norm(points[:, None] - points[None], axis=-1), 2.0)
    faces = np.array(
        [[i, j, k] for i in range(12) for j in range(i) for k in range(j) if near[i, j] and near[j, k] and near[i, k]]
    )
    inwards = (
        np.einsum(
            "ij,ij->i",
            np.cross(points[faces[:, 1]] - points[faces[:, 0]], points[faces[:, 2]] - points[faces[:, 0]]),
            points[faces].mean(axis=1),
        )
        < 0
    )
    faces = np.where(inwards[:, None], faces, faces[:, ::-1])  # visible from the inside
    points /= np.linalg.norm(points, axis=1, keepdims=True)
    for _ in range(subdivisions):
        points, faces = _halve(points, faces)
    corners = points[faces]
    area = np.linalg.norm(np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0]), axis=1).sum() / 2
    return Mesh(points=points * np.sqrt(4 * np.pi / area), faces=faces)


def _halve(points: np.ndarray, faces: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Four triangles for each one, the new points on the unit sphere."""
    edges = np.sort(np.concatenate([faces[:, [0, 1]], faces[:, [1, 2]], faces[:, [2, 0]]]), axis=1)
    unique, index = np.unique(edges, axis=0, return_inverse=True)
    middle = points[unique].sum(axis=1)
    middle /= np.linalg.norm(middle, axis=1, keepdims=True)
    ab, bc, ca = (index.ravel() + len(points)).reshape(3, -1)
    a, b, c = faces.T
    quarters = [(a, ab, ca), (ab, b, bc), (ca, bc, c), (ab, bc, ca)]
    return np.vstack([points, middle]), np.concatenate([np.stack(q, axis=-1) for q in quarters])


def build() -> Model:
    """The sphere, with flat normals."""
    model = Model(materials={"Wall": Material(colour=(0.5, 0.5, 0.5))}, normals=False, decimals=7)
    model.add("sphere", [("Wall", icosphere(SUBDIVISIONS))])
    return model
