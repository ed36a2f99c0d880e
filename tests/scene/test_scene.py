"""Scene arrays: cleaned, centred, ordered, overridden; and the real scenes."""

import json
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from support.scenes import QUAD, QUAD_FACES, QUAD_UVS, Glb, check_shapes, png, shared_scene

from framearray_cli.base.errors import SceneError
from framearray_cli.job.job import MaterialTable
from framearray_cli.scene.files import Material, Meshes, Part
from framearray_cli.scene.scene import Scene, build_scene, load_scene, scene_report_lines
from framearray_cli.scene.selecting import has_area, is_repeated

TRIANGLE = np.array([[[0, 0, 0], [1, 0, 0], [0, 1, 0]]], dtype=np.float64)


def build(*parts: Part, materials: tuple[Material, ...] = (Material(name="M"),), textures=()) -> Scene:
    return build_scene(Meshes(parts=parts, materials=materials, textures=textures, dropped={}, notes=()), {})


def part_of(*triangles: object, **more: object) -> Part:
    return Part(material=0, corners=np.array(triangles, dtype=np.float64), **more)


def quad_file(tmp_path: Path, **node: object) -> Path:
    glb = Glb()
    glb.node(glb.mesh(glb.material("Wall")), **node)
    return glb.save(tmp_path / "quad.glb")


# --- centring -----------------------------------------------------------------------------------------------------


def test_far_away_is_the_same_scene(tmp_path):
    here = load_scene(quad_file(tmp_path))
    far = load_scene(quad_file(tmp_path, translation=[5e6, -5e6, 123.5]))
    assert np.array_equal(here.corners, far.corners)
    assert here.centre.tolist() == [1, 0.5, 0]
    assert far.centre.tolist() == [5e6 + 1, -5e6 + 0.5, 123.5]


@pytest.mark.parametrize("suffix", ["obj", "ply"])
def test_text_formats_far_away(tmp_path, suffix):
    rows = "\n".join(f"{'v ' if suffix == 'obj' else ''}{5e6 + x!r} {y!r} 0" for x, y, _ in (QUAD / 64).tolist())
    if suffix == "obj":
        text = rows + "\nf 1 2 3 4\n"
    else:
        head = "ply\nformat ascii 1.0\nelement vertex 4\nproperty double x\nproperty double y\nproperty double z\n"
        text = head + "element face 1\nproperty list uchar int vertex_index\nend_header\n" + rows + "\n4 0 1 2 3\n"
    (tmp_path / f"a.{suffix}").write_text(text)
    scene = load_scene(tmp_path / f"a.{suffix}")
    assert np.ptp(scene.corners, axis=(0, 1)).tolist() == [2 / 64, 1 / 64, 0]


def test_infinite_and_degenerate_corners_do_not_move_the_centre():
    far_point = [[99, 0, 0]] * 3
    scene = build(part_of(TRIANGLE[0], [[0, 0, 0], [np.inf, 0, 0], [0, np.nan, 0]], far_point))
    assert scene.centre.tolist() == [0.5, 0.5, 0]
    assert scene.report.dropped == {"non-finite": 1, "degenerate": 1}


@pytest.mark.parametrize("scale", [1e-40, 1e-14, 1e14, 1e200])
def test_absurd_scale_is_an_error(scale):
    with pytest.raises(SceneError, match="scale the model"):
        build(part_of(TRIANGLE[0] * scale))


@pytest.mark.parametrize("scale", [1e-11, 1e11])
def test_large_and_small_scenes_are_kept_whole(scale):
    shape = [TRIANGLE[0], [[0, 0, 0], [1, 0, 0], [0.5, 1e-5, 0]]]
    scene = build(part_of(*(np.array(shape) * scale)))
    assert scene.report.triangles == 2
    check_shapes(scene)


# --- cleaning -----------------------------------------------------------------------------------------------------


def test_degenerate_triangles_at_any_scale():
    line = [[0, 0, 0], [1, 1, 1], [3, 3, 3]]
    sliver = [[0, 0, 0], [1, 0, 0], [0.5, 1e-3, 0]]
    for scale in (1e-300, 1e-6, 1.0, 1e6, 1e300):
        corners = np.array([line, sliver, TRIANGLE[0]]) * scale
        assert has_area(corners).tolist() == [False, True, True]


def test_degenerate_only_in_float32_is_dropped_too():
    tiny = np.array([[0, 0, 0], [1e-9, 0, 0], [0, 1e-9, 0]]) + 100  # far smaller than float32 resolves at 100
    scene = build(part_of(TRIANGLE[0], TRIANGLE[0] + 200, tiny))
    assert scene.report.dropped == {"degenerate": 1}


def test_duplicates_in_any_order_and_of_either_zero():
    a = TRIANGLE[0]
    turned = a[[1, 2, 0]]
    flipped = np.where(a[::-1] == 0, -0.0, a[::-1])
    other = np.array([[0, 0, 0], [1, 0, 0], [0, 1, 1e-3]])
    corners = np.array([a, other, turned, flipped], dtype=np.float32)
    assert is_repeated(corners, np.zeros(4, dtype=int)).tolist() == [False, False, True, True]
    assert is_repeated(corners, np.array([0, 0, 1, 1])).tolist() == [False, False, False, True]


def test_repeated_agrees_with_a_set():
    rng = np.random.default_rng(5)
    corners = rng.integers(0, 3, size=(500, 3, 3)).astype(np.float32)
    seen: set[tuple[object, ...]] = set()
    expected = []
    for triangle in corners.tolist():
        key = tuple(sorted(map(tuple, triangle)))
        expected.append(key in seen)
        seen.add(key)
    assert is_repeated(corners, np.zeros(500, dtype=int)).tolist() == expected


def test_nothing_left_is_an_error_that_says_why():
    with pytest.raises(SceneError, match="1 non-finite, 1 degenerate"):
        build(part_of([[0, 0, np.inf]] * 3, [[1, 1, 1]] * 3))
    glass = (Material(name="Glass", left_out="transmissive"), Material(name="Wall"))
    with pytest.raises(SceneError, match="1 transmissive, 1 degenerate"):
        build(part_of(TRIANGLE[0]), replace(part_of([[1, 1, 1]] * 3), material=1), materials=glass)


# --- normals, texture coordinates, colours ------------------------------------------------------------------------


def test_missing_and_broken_normals_become_geometric():
    tilted = np.array([[[0, 0, 5e-30], [0, 0, 0], [np.nan, 0, 1]]])
    smooth, flat = part_of(TRIANGLE[0], normals=tilted), part_of(TRIANGLE[0][:, [1, 2, 0]])
    scene = build(smooth, flat)
    assert np.array_equal(scene.normals[0], [[0, 0, 1]] * 3)
    assert np.array_equal(scene.normals[1], [[0, 1, 0]] * 3)
    assert any("2 corner normals" in note for note in scene.report.notes)
    assert len(build(flat).normals) == 0


def test_far_texture_coordinates_keep_their_place():
    far = [[[1e6 + 0.25, 0.5], [1e6 + 0.75, 0.5], [1e6 + 0.25, 2.5]], [[0.5, np.nan], [0, 0], [1, 1]]]
    uvs = np.array([*far, [[0.0, 1e308], [3.5e38, 0.0], [0.0, -1e308]]])  # the last are wider than float32, and float64
    texture = np.zeros((2, 2, 4), dtype=np.uint8)
    part = part_of(TRIANGLE[0], TRIANGLE[0] + 3, TRIANGLE[0] + 6, uvs=uvs)
    scene = build(part, materials=(Material(name="M", texture=0),), textures=(texture,))
    assert scene.uvs[0].tolist() == [[0.25, 0.5], [0.75, 0.5], [0.25, 2.5]]
    assert scene.uvs[1].tolist() == [[0, 0], [0, 0], [1, 1]]
    assert np.isfinite(scene.uvs[2]).all()
    assert any("texture coordinates" in note for note in scene.report.notes)


def test_texture_without_coordinates_is_not_shown():
    texture = np.zeros((1, 1, 4), dtype=np.uint8)
    material = Material(name="Paint", reflectivity=(0.3, 0.3, 0.3), texture=0)
    scene = build(part_of(TRIANGLE[0]), materials=(material,), textures=(texture,))
    assert scene.reflectivity_texture[scene.material[0]] == -1
    assert scene.material_names[scene.material[0]] == "Paint"
    assert len(scene.uvs) == 0
    assert any("show no texture: Paint" in note for note in scene.report.notes)


def test_parts_without_colours_are_white_beside_coloured_ones():
    coloured = part_of(TRIANGLE[0], colours=np.full((1, 3, 3), 0.25, dtype=np.float32))
    scene = build(coloured, part_of(TRIANGLE[0] + 3))
    assert scene.colours[:, 0, 0].tolist() == [0.25, 1.0]
    assert len(build(part_of(TRIANGLE[0])).colours) == 0


def test_a_scene_pays_only_for_what_it_has(tmp_path):
    scene = load_scene(quad_file(tmp_path))
    assert [len(a) for a in (scene.normals, scene.uvs, scene.colours, scene.texels)] == [0, 0, 0, 0]
    assert scene.n_opaque == 2
    assert not scene.has_mirrors
    check_shapes(scene)


# --- materials ----------------------------------------------------------------------------------------------------


def leaf_and_wall(tmp_path: Path) -> Path:
    glb = Glb()
    texture = glb.texture(png([[[255, 0, 0, 255], [0, 255, 0, 0]]]))
    leaf = glb.material("Leaf", {"baseColorTexture": {"index": texture}}, alphaMode="MASK")
    uvs = glb.accessor(QUAD_UVS)
    glb.node(glb.mesh(leaf, TEXCOORD_0=uvs))
    glb.node(glb.mesh(glb.material("Wall", {"metallicFactor": 1.0, "roughnessFactor": 0.0})), translation=[0, 0, 1])
    glb.node(glb.mesh(glb.material("Glass", {"baseColorFactor": [1, 1, 1, 0.1]}, alphaMode="BLEND")))
    return glb.save(tmp_path / "leaf.glb")


def test_masked_triangles_come_last_and_glass_is_left_out(tmp_path):
    scene = load_scene(leaf_and_wall(tmp_path))
    check_shapes(scene)
    assert scene.n_opaque == 2
    assert [scene.material_names[m] for m in scene.material] == ["Wall", "Wall", "Leaf", "Leaf"]
    assert scene.report.dropped == {"transmissive": 2}
    assert scene.textures.tolist() == [[0, 2, 1]]
    assert scene.texels.tolist() == [[255, 0, 0, 255], [0, 255, 0, 0]]
    assert scene.has_mirrors


def test_report_lines(tmp_path):
    file = leaf_and_wall(tmp_path)
    lines = scene_report_lines(load_scene(file).report, file.name)
    assert lines[0] == "leaf.glb: 4 triangles, 2 materials, 1 texture; left out: 2 transmissive"
    assert any("Glass" in line for line in lines[1:])


def test_overrides_replace_factor_and_texture(tmp_path):
    file = leaf_and_wall(tmp_path)
    overrides = {"Leaf": MaterialTable(reflectivity=(0.1, 0.2, 0.3)), "Wall": MaterialTable(specular=(0.5, 0.5, 0.5))}
    scene = load_scene(file, overrides)
    leaf, wall = scene.material_names.index("Leaf"), scene.material_names.index("Wall")
    assert scene.reflectivity[leaf] == pytest.approx([0.1, 0.2, 0.3])
    assert scene.reflectivity_texture[leaf] == -1
    assert scene.alpha_texture[leaf] == 0  # it stays cut out
    assert scene.specular[wall] == pytest.approx([0.5, 0.5, 0.5])
    assert scene.reflectivity[wall].tolist() == [0, 0, 0]


def test_an_overridden_glass_is_shown(tmp_path):
    scene = load_scene(leaf_and_wall(tmp_path), {"Glass": MaterialTable(reflectivity=(0.5, 0.5, 0.5))})
    assert "Glass" in [scene.material_names[m] for m in scene.material]
    assert "transmissive" not in scene.report.dropped


def test_override_clears_corner_colours():
    coloured = part_of(TRIANGLE[0], colours=np.full((1, 3, 3), 0.25, dtype=np.float32))
    meshes = Meshes(parts=(coloured,), materials=(Material(name="M"),), textures=(), dropped={}, notes=())
    assert len(build_scene(meshes, {"M": MaterialTable(reflectivity=(0.5, 0.5, 0.5))}).colours) == 0
    assert len(build_scene(meshes, {"M": MaterialTable(specular=(0.5, 0.5, 0.5))}).colours) == 1


def test_unknown_override_names_the_nearest(tmp_path):
    file = leaf_and_wall(tmp_path)
    with pytest.raises(SceneError, match=r'"Laef".*it has Leaf, .*"Sky"') as caught:
        load_scene(file, {"Laef": MaterialTable(), "Wall": MaterialTable(), "Sky": MaterialTable()})
    assert str(file) in str(caught.value)


def test_mirrored_and_instanced_nodes_agree(tmp_path):
    glb = Glb()
    mesh = glb.mesh(glb.material("M"), faces=QUAD_FACES)
    glb.node(mesh, translation=[0, 0, 1])
    glb.node(mesh, scale=[-1, 1, 1])
    scene = load_scene(glb.save(tmp_path / "two.glb"))
    a, b, c = scene.corners[:, 0], scene.corners[:, 1], scene.corners[:, 2]
    assert (np.cross(b - a, c - a)[:, 2] > 0).all()
    assert (scene.corners + scene.centre).min(axis=(0, 1)).tolist() == [-2, 0, 0]


# --- real scenes --------------------------------------------------------------------------------------------------

REAL = [
    "cornell_box",
    "grey_white_room",
    "iss_kibo_cabin",
    "modern_hall",
    "modern_hall_obj",
    "utah_teapot",
    "vr_gallery",
]


@pytest.mark.parametrize("name", [*REAL, "country_kitchen"])
def test_real_scene(name, capfd):
    about = json.loads(shared_scene(f"{name}/camera.json").read_text())
    scene = load_scene(shared_scene(f"{name}/{about['scene_file']}"))
    check_shapes(scene)
    report = scene.report
    assert report.triangles + sum(report.dropped.values()) == about["triangles"]
    assert report.dropped.get("transmissive", 0) == about.get("glass_triangles", 0)
    bounds = np.array([scene.corners.min(axis=(0, 1)), scene.corners.max(axis=(0, 1))]) + scene.centre
    np.testing.assert_allclose(bounds, about["bounds"], atol=2e-4)
    listed = {entry["name"]: entry for entry in about.get("materials") or []}
    for m in np.unique(scene.material):
        entry = listed.get(scene.material_names[m])
        if entry is not None:
            assert bool(scene.specular[m].max() > 0) == entry.get("mirror", False)
            assert bool(scene.reflectivity_texture[m] >= 0) == (entry.get("texture") is not None)
            assert bool(scene.alpha_cutoff[m] > 0) == entry.get("alpha_mask", False)
    assert capfd.readouterr() == ("", "")


def test_hall_is_the_same_from_glb_and_obj():
    glb, obj = (load_scene(shared_scene(n)) for n in ("modern_hall/modern_hall.glb", "modern_hall_obj/modern_hall.obj"))
    assert glb.report.triangles == obj.report.triangles
    assert glb.report.dropped == obj.report.dropped

    def areas(scene: Scene) -> dict[str, float]:
        edges = scene.corners[:, 1:].astype(np.float64) - scene.corners[:, :1]
        area = np.linalg.norm(np.cross(edges[:, 0], edges[:, 1]), axis=1) / 2
        return {name: area[scene.material == m].sum() for m, name in enumerate(scene.material_names)}

    expected = {name: area for name, area in areas(glb).items() if area > 0}
    found = {name: area for name, area in areas(obj).items() if area > 0}
    assert found == pytest.approx(expected, rel=1e-4)
    for name in expected:
        a, b = glb.material_names.index(name), obj.material_names.index(name)
        assert glb.reflectivity[a] == pytest.approx(obj.reflectivity[b], abs=1e-5)


def test_the_checks_can_fail(tmp_path):
    scene = load_scene(quad_file(tmp_path))
    with pytest.raises(AssertionError):
        check_shapes(replace(scene, corners=scene.corners + np.float32(1)))
    with pytest.raises(AssertionError):
        check_shapes(replace(scene, n_opaque=0))
