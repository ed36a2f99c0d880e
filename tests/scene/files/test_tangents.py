"""Tangents: a slow twin of MikkTSpace, and cases whose answer is plain."""

from typing import Any

import numpy as np
import pytest
from support import tiny

from framearray_cli.scene.files.geometry import compute_tangents

QUAD = tiny.quad((0, 0, 0), (2, 0, 0), (2, 1, 0), (0, 1, 0))
UVS = np.array([[[0, 0], [1, 0], [1, 1]], [[0, 0], [1, 1], [0, 1]]], np.float64)


def unit(vector: Any) -> Any:
    return vector / np.linalg.norm(vector)


def angle(a: Any, b: Any) -> float:
    return float(np.arccos(np.clip(unit(a) @ unit(b), -1, 1)))


def slowly(corners: Any, normals: Any, uvs: Any) -> Any:
    """As MikkTSpace has it: for each corner a loop over all corners that are the same vertex, one line per formula."""
    found = np.zeros((len(corners), 3, 4))

    def flat(f: int, normal: Any) -> Any:
        """Where u grows on triangle f, in the plane of a normal."""
        edges = np.stack([corners[f, 1] - corners[f, 0], corners[f, 2] - corners[f, 0]])
        along_u, _ = np.linalg.solve(np.stack([uvs[f, 1] - uvs[f, 0], uvs[f, 2] - uvs[f, 0]]), edges)
        return unit(along_u - along_u @ normal * normal)

    def turns(f: int) -> float:
        (a, b), (c, d) = uvs[f, 1] - uvs[f, 0], uvs[f, 2] - uvs[f, 0]
        return float(np.sign(a * d - b * c))

    for f in range(len(corners)):
        for k in range(3):
            vertex, n, total = (corners[f, k], uvs[f, k]), unit(normals[f, k]), np.zeros(3)
            for g in range(len(corners)):
                for j in range(3):
                    same = (corners[g, j] == vertex[0]).all() and (uvs[g, j] == vertex[1]).all()
                    if not same or (normals[g, j] != normals[f, k]).any() or turns(f) != turns(g):
                        continue
                    edges = [corners[g, i] - corners[g, j] for i in range(3) if i != j]
                    one, other = (edge - edge @ n * n for edge in edges)
                    total += angle(one, other) * flat(g, n)
            found[f, k] = [*unit(total), turns(f)]
    return found


def test_a_quad_has_its_edges() -> None:
    for normals in (None, np.broadcast_to([0.0, 0, 3], QUAD.shape)):
        assert compute_tangents(QUAD, normals, UVS).reshape(-1, 4) == pytest.approx(np.array([[1, 0, 0, 1]] * 6))


@pytest.mark.parametrize(
    ("matrix", "expected"),
    [
        ([[-1, 0], [0, 1]], [-1, 0, 0, -1]),  # the picture mirrored, left to right
        ([[1, 0], [0, -1]], [1, 0, 0, -1]),  # upside down
        ([[-1, 0], [0, -1]], [-1, 0, 0, 1]),  # turned by half
        ([[0, 1], [-1, 0]], [0, -1, 0, 1]),  # turned by a quarter: u grows where v did fall
        ([[5, 0], [0, 0.01]], [1, 0, 0, 1]),  # stretched
    ],
)
def test_pictures_that_are_mirrored_and_turned(matrix: Any, expected: Any) -> None:
    found = compute_tangents(QUAD, None, UVS @ np.array(matrix, np.float64))
    assert found.reshape(-1, 4) == pytest.approx(np.array([expected] * 6))


def test_a_smooth_ball_is_that_of_the_slow_twin() -> None:
    """On one half of the ball the picture is mirrored; corners between the halves have a tangent for each."""
    corners, normals = tiny.ball((0.1, 0.2, 0.3), 0.7, 4)
    corners, normals = corners[:, ::-1], normals[:, ::-1]  # their order shows the outside
    x, y, z = np.moveaxis(normals, -1, 0)
    uvs = np.stack([abs(np.arctan2(x, z)) + 0.3 * y, y - 0.2 * x * z], axis=-1)
    found = compute_tangents(corners, normals, uvs)
    assert {-1.0, 1.0} == set(found[..., 3].ravel())
    assert found == pytest.approx(slowly(corners, normals, uvs), abs=1e-9)
    assert abs((found[..., :3] * normals).sum(axis=-1)).max() < 1e-9


def test_the_bitangent_is_where_v_grows_even_if_corners_run_the_other_way() -> None:
    """On models whose normals point to the back of their triangles, too."""
    for order in (slice(None), slice(None, None, -1)):
        found = compute_tangents(QUAD[:, order], np.broadcast_to([0.0, 0, 1], QUAD.shape), UVS[:, order]).reshape(-1, 4)
        assert (found[:, 3:] * np.cross([0, 0, 1], found[:, :3])) == pytest.approx(np.array([[0, 1, 0]] * 6))


def test_triangles_without_texture_area_take_part_in_their_neighbours() -> None:
    flat = UVS.copy()
    flat[1] = UVS[0, 0]  # the second triangle shows one point of the texture, that of the corner it shares
    found = compute_tangents(QUAD, None, flat)
    assert found[0] == pytest.approx(np.array([[1, 0, 0, 1]] * 3))
    assert found[1, 0] == pytest.approx([1, 0, 0, 1])
    assert not found[1, 1:].any()


@pytest.mark.parametrize("broken", ["corners", "normals", "uvs"])
def test_what_has_no_direction_is_zero(broken: str) -> None:
    arrays = {"corners": QUAD.copy(), "normals": np.broadcast_to([0.0, 0, 1], QUAD.shape).copy(), "uvs": UVS.copy()}
    arrays[broken][0] = np.nan
    found = compute_tangents(**arrays)
    assert found[0].any() == (broken == "normals")  # the triangle's own stand in
    assert np.isfinite(found).all()
    assert found[1, 2] == pytest.approx([1, 0, 0, 1])
    assert (compute_tangents(QUAD, np.zeros_like(QUAD), UVS) == compute_tangents(QUAD, None, UVS)).all()
    assert compute_tangents(np.zeros((0, 3, 3)), None, np.zeros((0, 3, 2))).shape == (0, 3, 4)
