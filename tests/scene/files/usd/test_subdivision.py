"""Subdivision surfaces of USD, against what is known of their limits."""

from pathlib import Path
from typing import Any

import numpy as np
import pytest
from support.scenes import area_vectors
from support.tiny import box
from support.usdfiles import bind, coordinates, mesh, new_stage, preview, pxr, save

from framearray_cli.scene.scene import load_scene

SIGNS = [(x, y, z) for x in (-1, 1) for y in (-1, 1) for z in (-1, 1)]
FACES = [(0, 1, 3, 2), (4, 6, 7, 5), (0, 4, 5, 1), (2, 3, 7, 6), (0, 2, 6, 4), (1, 5, 7, 3)]
CUBE = {"points": SIGNS, "counts": [4] * 6, "indices": np.ravel(FACES).tolist()}
EDGES = sorted({(min(a, b), max(a, b)) for face in FACES for a, b in zip(face, np.roll(face, -1), strict=True)})
AXES = np.concatenate([np.eye(3), -np.eye(3)])
OCTAHEDRON = [(a, b, c) for a in (0, 3) for b in (1, 4) for c in (2, 5)]
OUTWARDS = [t if np.linalg.det(AXES[list(t)]) > 0 else t[::-1] for t in OCTAHEDRON]


def subdivided(file: Path, shape: Any = None, scheme: str = "catmullClark") -> tuple[Any, Any]:
    """A stage and its only mesh."""
    stage = new_stage(file)
    found = mesh(stage, "/World/Shape", **(shape or CUBE))
    found.GetSubdivisionSchemeAttr().Set(scheme)
    return stage, found


def scene_of(stage: Any, **options: Any) -> Any:
    return load_scene(save(stage), **options)


def test_a_cube_becomes_round(tmp_path: Path) -> None:
    """Limit of a corner of valence 3 with three quadrangles: (9 P + 4 sum of neighbours + sum of opposites) / 24."""
    stage, _ = subdivided(tmp_path / "a.usda")
    scene = scene_of(stage)
    corners = scene.corners.reshape(-1, 3)
    assert len(scene.corners) == 2 * 6 * 4**4
    diagonal = corners[(corners.sum(axis=1) / np.linalg.norm(corners, axis=1)).argmax()]
    np.testing.assert_allclose(diagonal, 0.5, atol=1e-3)
    outward = np.einsum("ij,ij->i", scene.normals.reshape(-1, 3), corners) / np.linalg.norm(corners, axis=1)
    assert outward.min() > 0.9
    assert not any("cage" in note for note in scene.report.notes)


def test_a_left_handed_one_faces_outwards(tmp_path: Path) -> None:
    turned = {**CUBE, "indices": np.ravel([face[::-1] for face in FACES]).tolist()}
    stage, found = subdivided(tmp_path / "a.usda", turned)
    found.CreateOrientationAttr("leftHanded")
    scene = scene_of(stage)
    assert np.einsum("ijk,ijk->ij", scene.normals, scene.corners).min() > 0
    assert np.einsum("ij,ij->i", area_vectors(scene.corners), scene.corners.mean(axis=1)).min() > 0


def test_loop(tmp_path: Path) -> None:
    """Limit of a corner of valence n: (P + n w Q) / (1 + n w) with 1 / w = 3 / (8 beta), Q the neighbours' mean."""
    octahedron = {"points": AXES, "counts": [3] * 8, "indices": np.ravel(OUTWARDS).tolist()}
    stage, _ = subdivided(tmp_path / "a.usda", octahedron, "loop")
    scene = scene_of(stage)
    assert len(scene.corners) == 8 * 4**4
    beta = (5 / 8 - (3 / 8 + np.cos(np.pi / 2) / 4) ** 2) / 4
    limit = 1 - 4 / (3 / (8 * beta) + 4)  # the neighbours' mean is the middle
    assert np.abs(scene.corners).max() == pytest.approx(limit, abs=2e-3)
    assert np.einsum("ijk,ijk->ij", scene.normals, scene.corners).min() > 0


@pytest.mark.parametrize("sharpness", [10.0, 4.0])
def test_sharp_edges_stay(tmp_path: Path, sharpness: float) -> None:
    stage, found = subdivided(tmp_path / "a.usda")
    found.CreateCreaseIndicesAttr(np.ravel(EDGES).tolist())
    found.CreateCreaseLengthsAttr([2] * len(EDGES))
    found.CreateCreaseSharpnessesAttr([sharpness] * len(EDGES))
    scene = scene_of(stage)
    np.testing.assert_allclose(np.abs(scene.corners).max(axis=-1), 1.0, atol=1e-6)
    if sharpness == 10.0:  # four refinements leave it sharp, and normals as they are
        np.testing.assert_allclose(np.abs(scene.normals).max(axis=-1), 1.0, atol=1e-6)


def test_a_crease_around_a_face_is_between_smooth_and_sharp(tmp_path: Path) -> None:
    def reach(sharpness: float) -> float:
        stage, found = subdivided(tmp_path / f"{sharpness}.usda")
        found.CreateCreaseIndicesAttr([*FACES[1], FACES[1][0]])
        found.CreateCreaseLengthsAttr([5])
        found.CreateCreaseSharpnessesAttr([sharpness])
        corners = scene_of(stage).corners.reshape(-1, 3)
        return float(np.ptp(corners[:, 1]))

    found = [reach(sharpness) for sharpness in (0.0, 0.5, 1.0, 2.0, 10.0)]
    assert found == sorted(found) and len(set(found)) == 5


def test_sharp_points_stay(tmp_path: Path) -> None:
    stage, found = subdivided(tmp_path / "a.usda")
    found.CreateCornerIndicesAttr([7])
    found.CreateCornerSharpnessesAttr([10.0])
    scene = scene_of(stage)
    reach = (scene.corners.reshape(-1, 3) + scene.centre) @ np.ones(3)
    assert reach.max() == pytest.approx(3.0) and reach.min() == pytest.approx(-1.5, abs=2e-3)


GRID = [(x, y, 0) for y in range(4) for x in range(4)]
SQUARES = [(4 * y + x, 4 * y + x + 1, 4 * y + x + 5, 4 * y + x + 4) for y in range(3) for x in range(3)]


def area_in(curve: Any) -> float:
    """The area within a closed curve in a plane."""
    x, y = np.asarray(curve).T
    return float(x @ np.roll(y, -1) - y @ np.roll(x, -1)) / 2


def spline(points: Any, n: int = 200) -> Any:
    """A closed uniform cubic B-spline, n points for each of its own."""
    t = np.arange(n)[:, None] / n
    weights = (
        np.concatenate([(1 - t) ** 3, 3 * t**3 - 6 * t**2 + 4, -3 * t**3 + 3 * t**2 + 3 * t + 1, t**3], axis=1) / 6
    )
    points = np.asarray(points, float)
    return np.concatenate([weights @ np.roll(points, -k, axis=0)[:4] for k in range(len(points))])


RING = [0, 1, 2, 3, 7, 11, 15, 14, 13, 12, 8, 4]  # of the grid


@pytest.mark.parametrize("boundary", ["edgeAndCorner", "edgeOnly"])
def test_borders_and_texture_coordinates(tmp_path: Path, boundary: str) -> None:
    """A grid on a plane stays on it, with texture coordinates equal to positions; its border is a cubic B-spline."""
    grid = {"points": GRID, "counts": [4] * 9, "indices": np.ravel(SQUARES).tolist()}
    stage, found = subdivided(tmp_path / "a.usda", grid)
    found.CreateInterpolateBoundaryAttr(boundary)
    coordinates(found, [(x / 3, y / 3) for x, y, _ in GRID], "vertex")
    scene = scene_of(stage, all_uvs=True)
    area = np.linalg.norm(area_vectors(scene.corners), axis=1)
    expected = 9.0 if boundary == "edgeAndCorner" else area_in(spline([GRID[k][:2] for k in RING]))
    assert float(area.sum()) == pytest.approx(expected, rel=1e-3)
    where = scene.corners[..., :2] + scene.centre[:2]
    np.testing.assert_allclose(scene.uvs.reshape(where.shape) * 3, where, atol=1e-5)


@pytest.mark.parametrize("option", ["cornersPlus1", "all"])
def test_seams_of_texture_coordinates_stay(tmp_path: Path, option: str) -> None:
    """Each face of a cube has the whole texture."""
    stage, found = subdivided(tmp_path / "a.usda")
    found.CreateFaceVaryingLinearInterpolationAttr(option)
    coordinates(found, [(0, 0), (1, 0), (1, 1), (0, 1)] * 6)
    scene = scene_of(stage, all_uvs=True)
    uvs = scene.uvs.reshape(-1, 3, 2).astype(float)
    a, b = uvs[:, 1] - uvs[:, 0], uvs[:, 2] - uvs[:, 0]
    assert 0.5 * np.abs(a[:, 0] * b[:, 1] - a[:, 1] * b[:, 0]).sum() == pytest.approx(6.0, rel=1e-5)


def test_holes_and_materials_of_faces(tmp_path: Path) -> None:
    stage, found = subdivided(tmp_path / "a.usda")
    found.CreateHoleIndicesAttr([1])
    subset = pxr().UsdShade.MaterialBindingAPI(found).CreateMaterialBindSubset("top", [3])
    bind(subset.GetPrim(), preview(stage, "Red"))
    scene = scene_of(stage)
    assert len(scene.corners) == 2 * 5 * 4**4
    assert (scene.material == scene.material_names.index("Red")).sum() == 2 * 4**4


def test_others_keep_their_shape(tmp_path: Path) -> None:
    stage, _ = subdivided(tmp_path / "a.usda", scheme="bilinear")
    assert len(scene_of(stage).corners) == len(box((-1,) * 3, (1,) * 3))


def test_what_cannot_be_refined_is_noted(tmp_path: Path) -> None:
    """Loop's scheme is of triangles."""
    stage, _ = subdivided(tmp_path / "a.usda", scheme="loop")
    scene = scene_of(stage)
    assert len(scene.corners) == 12
    assert "subdivision surfaces that cannot be refined are shown as their cages: Shape" in scene.report.notes


def test_many_meshes_are_refined_to_their_share(tmp_path: Path) -> None:
    """2,000,000 faces at 2,000 places of one cube: 1,000 of each, which is three levels of four."""
    stage, cube = subdivided(tmp_path / "a.usda")
    instancer = pxr().UsdGeom.PointInstancer.Define(stage, "/World/Many")
    instancer.CreatePrototypesRel().SetTargets([cube.GetPath()])
    instancer.CreateProtoIndicesAttr([0] * 1999)
    instancer.CreatePositionsAttr([(3.0 * k, 0.0, 5.0) for k in range(1999)])
    assert len(scene_of(stage).corners) == 2000 * 2 * 6 * 4**3
