"""Subdivision surfaces of USD, against what is known of their limits."""

from pathlib import Path
from typing import Any

import numpy as np
import pytest
from support.scenes import area_vectors
from support.tiny import box
from support.usdfiles import bind, coordinates, mesh, new_stage, preview, pxr, save

from framearray_cli.scene.files.assets import Limit
from framearray_cli.scene.files.model import Notes
from framearray_cli.scene.files.usd.meshes import read_surface
from framearray_cli.scene.files.usd.subdivision import Subdivision
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


def crease(surface: Any, points: Any, sharpness: float) -> None:
    """Make one crease along these points."""
    surface.CreateCreaseIndicesAttr(list(points))
    surface.CreateCreaseLengthsAttr([len(points)])
    surface.CreateCreaseSharpnessesAttr([sharpness])


def once(surface: Any) -> Subdivision:
    """The mesh after one refinement."""
    found = read_surface(surface.GetPrim(), pxr().Usd.TimeCode.Default(), Limit(), Notes(), most=64)
    assert found is not None and found.refined is not None and len(found.refined.meshes) == 2
    return found.refined


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
        crease(found, [*FACES[1], FACES[1][0]], sharpness)
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


@pytest.mark.parametrize(
    ("boundary", "scheme"),
    [
        ("edgeAndCorner", "catmullClark"),
        ("edgeOnly", "catmullClark"),
        ("none", "catmullClark"),
        ("none", "loop"),
        ("none, creased", "catmullClark"),
    ],
)
def test_borders_and_texture_coordinates(tmp_path: Path, boundary: str, scheme: str) -> None:
    """A grid on a plane stays on it, with texture coordinates equal to positions; its border is a cubic B-spline.

    With none only the middle square is left, unless the border is a crease itself.
    """
    faces = [half for a, b, c, d in SQUARES for half in ((a, b, c), (a, c, d))] if scheme == "loop" else SQUARES
    grid = {"points": GRID, "counts": [len(face) for face in faces], "indices": np.ravel(faces).tolist()}
    stage, found = subdivided(tmp_path / "a.usda", grid, scheme)
    found.CreateInterpolateBoundaryAttr(boundary.split(",")[0])
    if "creased" in boundary:
        crease(found, [*RING, RING[0]], 10.0)
    coordinates(found, [(x / 3, y / 3) for x, y, _ in GRID], "vertex")
    scene = scene_of(stage, all_uvs=True)
    area = np.linalg.norm(area_vectors(scene.corners), axis=1)
    expected = {"edgeAndCorner": 9.0, "none": 1.0}.get(boundary) or area_in(spline([GRID[k][:2] for k in RING]))
    assert float(area.sum()) == pytest.approx(expected, rel=1e-3)
    assert any('interpolateBoundary = "none"' in note for note in scene.report.notes) == (boundary == "none")
    where = scene.corners[..., :2] + scene.centre[:2]
    np.testing.assert_allclose(scene.uvs.reshape(where.shape) * 3, where, atol=1e-5)


FIVE = {(x, y): 5 * y + x for y in range(5) for x in range(5)}  # points of four times four squares
CORNERS = [[(x, y), (x + 1, y), (x + 1, y + 1), (x, y + 1)] for y in range(4) for x in range(4)]


@pytest.mark.parametrize(
    ("option", "moves"),
    [
        ("none", "corner side third crease ring dart middle"),
        ("cornersOnly", "side third crease ring dart middle"),
        ("cornersPlus1", "side ring dart middle"),
        ("cornersPlus2", "side middle"),
        ("boundaries", "middle"),
        ("all", ""),
    ],
)
def test_values_at_seams(tmp_path: Path, option: str, moves: str) -> None:
    """An island of 2 x 2 squares in a ring that is cut once, and a cut to the middle: values after one refinement.

    A crease runs from the island to the border.
    """
    rng = np.random.default_rng(3)
    island, ring, far = ({point: rng.normal(size=2) for point in FIVE} for _ in range(3))
    grid = {"points": [(*point, 0) for point in FIVE], "counts": [4] * 16}
    _, found = subdivided(tmp_path / "a.usda", grid | {"indices": [FIVE[point] for face in CORNERS for point in face]})
    found.CreateFaceVaryingLinearInterpolationAttr(option)
    crease(found, [FIVE[2, 3], FIVE[2, 4]], 10.0)
    refined = once(found)

    def at(values: Any, face: tuple[int, int], point: tuple[int, int]) -> Any:
        """Refined values of a face, by its lower left corner: of one of its corners, and of the edge after it."""
        number = 4 * face[1] + face[0]
        return refined.of_corners(values).reshape(16, 4, 4, 2)[number, CORNERS[number].index(point), :2]

    def of(face: tuple[int, int], point: tuple[int, int]) -> Any:
        values = island if set(face) <= {1, 2} else ring
        return far[point] if face == (0, 2) and point in ((0, 2), (1, 2)) else values[point]

    islands = np.array([of(face[0], point) for face in CORNERS for point in face])
    cut = np.array(
        [
            (far if face[0] in ((2, 0), (2, 1)) and point in ((2, 0), (2, 1)) else ring)[point]
            for face in CORNERS
            for point in face
        ]
    )
    near = sum(island[point] for point in ((2, 1), (1, 2), (3, 2), (2, 3)))
    across = sum(island[point] for point in ((1, 1), (3, 1), (1, 3), (3, 3)))
    for name, values, face, point, moved in (
        ("corner", islands, (2, 1), (3, 1), (6 * island[3, 1] + island[2, 1] + island[3, 2]) / 8),
        ("side", islands, (2, 1), (2, 1), (6 * island[2, 1] + island[1, 1] + island[3, 1]) / 8),
        ("third", islands, (1, 1), (1, 2), (6 * island[1, 2] + island[1, 1] + island[1, 3]) / 8),
        ("crease", islands, (1, 2), (2, 3), (6 * island[2, 3] + island[1, 3] + island[3, 3]) / 8),
        ("ring", islands, (3, 1), (3, 1), (6 * ring[3, 1] + ring[2, 1] + ring[3, 2]) / 8),
        ("dart", cut, (1, 1), (2, 2), (6 * ring[2, 2] + ring[2, 1] + far[2, 1]) / 8),
        ("middle", islands, (1, 1), (2, 2), 9 / 16 * island[2, 2] + 3 / 32 * near + across / 64),
    ):
        own = ring if name in ("ring", "dart") else island
        np.testing.assert_allclose(at(values, face, point)[0], moved if name in moves else own[point], err_msg=name)
    np.testing.assert_allclose(at(islands, (2, 1), (2, 1))[1], (island[2, 1] + island[3, 1]) / 2)


@pytest.mark.parametrize("sharpness", [10.0, 0.25])
def test_loop_with_creases(tmp_path: Path, sharpness: float) -> None:
    """An octahedron after one refinement: sharp around, smooth at its poles."""
    _, found = subdivided(
        tmp_path / "a.usda", {"points": AXES, "counts": [3] * 8, "indices": np.ravel(OUTWARDS).tolist()}, "loop"
    )
    around = [0, 1, 3, 4]
    crease(found, [*around, 0], sharpness)
    refined, share = once(found), min(sharpness, 1.0)
    points = refined.of_points(AXES)
    beta = (5 / 8 - (3 / 8 + np.cos(np.pi / 2) / 4) ** 2) / 4
    smooth = (1 - 4 * beta) * AXES  # the neighbours' mean is the middle
    sharp = 6 / 8 * AXES  # as is the mean along the crease
    np.testing.assert_allclose(points[around], share * sharp[around] + (1 - share) * smooth[around], atol=1e-15)
    np.testing.assert_allclose(points[[2, 5]], smooth[[2, 5]], atol=1e-15)
    for (a, b), point in zip(refined.meshes[0].ends, points[6:], strict=True):
        middle = (AXES[a] + AXES[b]) / 2
        creased = share if {a, b} <= set(around) else 0.0
        np.testing.assert_allclose(point, creased * middle + (1 - creased) * 3 / 4 * middle, atol=1e-15)


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
