"""Scenes as the arrays that kernels read: centring, selection, normals, materials, textures and smaller copies."""

import json
import tempfile
from dataclasses import replace
from itertools import pairwise
from pathlib import Path
from random import Random
from typing import Any

import numpy as np
import pytest
from fuzz.covered.mutators import with_tree
from fuzz.hostile import HOSTILE
from fuzz.sceneseeds import Seed, made_seeds
from fuzz.tables import mutated_json
from fuzz.texts import BYTES, LINES
from hypothesis import HealthCheck, given, settings
from hypothesis import strategies as st
from numpy.testing import assert_array_equal
from support.scenes import QUAD, QUAD_UVS, Glb, area_vectors, check_shapes, png, shared_scene, split_glb

from framearray_cli.base.colour import linear_from_srgb8, srgb8_from_linear
from framearray_cli.base.errors import SceneError
from framearray_cli.job.job import MaterialTable
from framearray_cli.scene.files import Material, Meshes, Part, read_stage
from framearray_cli.scene.merge import first_alike, has_area
from framearray_cli.scene.scene import MOST_LEVELS, Scene, add_mips, build_scene, halved, load_scene, scene_report_lines
from framearray_cli.scene.vectors import are_finite, cross, largest, lengths, rows_of

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
    assert first_alike(corners, np.zeros(4, dtype=int)).tolist() == [0, 1, 0, 0]
    assert first_alike(corners, np.array([0, 0, 1, 1])).tolist() == [0, 1, 2, 2]


def test_repeated_agrees_with_a_dict():
    rng = np.random.default_rng(5)
    corners = rng.integers(0, 3, size=(500, 3, 3)).astype(np.float32)
    seen: dict[tuple[object, ...], int] = {}
    expected = [seen.setdefault(tuple(sorted(map(tuple, corners[i].tolist()))), i) for i in range(500)]
    assert first_alike(corners, np.zeros(500, dtype=int)).tolist() == expected


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
    mesh = glb.mesh(glb.material("M"))
    glb.node(mesh, translation=[0, 0, 1])
    glb.node(mesh, scale=[-1, 1, 1])
    scene = load_scene(glb.save(tmp_path / "two.glb"))
    assert (area_vectors(scene.corners)[:, 2] > 0).all()
    assert (scene.corners + scene.centre).min(axis=(0, 1)).tolist() == [-2, 0, 0]


# --- real scenes --------------------------------------------------------------------------------------------------

REAL = [
    "cornell_box",
    "country_kitchen",
    "grey_white_room",
    "iss_kibo_cabin",
    "modern_hall",
    "modern_hall_obj",
    "utah_teapot",
    "vr_gallery",
]


@pytest.mark.parametrize("name", REAL)
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
        area = np.linalg.norm(area_vectors(scene.corners.astype(np.float64)), axis=1)
        return {name: area[scene.material == m].sum() for m, name in enumerate(scene.material_names)}

    expected = {name: area for name, area in areas(glb).items() if area > 0}
    found = {name: area for name, area in areas(obj).items() if area > 0}
    assert found == pytest.approx(expected, rel=1e-4)
    for name in expected:
        a, b = glb.material_names.index(name), obj.material_names.index(name)
        assert glb.reflectivity[a] == pytest.approx(obj.reflectivity[b], abs=1e-5)


def test_the_checks_can_fail(tmp_path):
    scene = load_scene(quad_file(tmp_path))
    for broken in ({"corners": scene.corners + np.float32(1)}, {"corners": scene.corners * np.nan}, {"n_opaque": 0}):
        with pytest.raises(AssertionError):
            check_shapes(replace(scene, **broken))


RANDOM = np.random.default_rng(1)
ODD = np.array(
    [[0.0, -0.0, -3.0], [np.nan, 1.0, 2.0], [1.0, -np.inf, np.nan], [np.inf, 1e200, -1e200], [4.0, 0.0, -3.0]]
)


@pytest.mark.parametrize(
    "vectors", [RANDOM.normal(size=(50, 3)), RANDOM.normal(size=(9, 3, 2)).astype(np.float32), ODD]
)
def test_reductions_are_those_of_numpy(vectors: np.ndarray) -> None:
    with np.errstate(all="ignore"):
        assert_array_equal(largest(vectors), np.abs(vectors).max(axis=-1))
        assert_array_equal(are_finite(vectors), np.isfinite(vectors).all(axis=-1))
        np.testing.assert_allclose(lengths(vectors), np.linalg.norm(vectors, axis=-1), rtol=1e-6)
        assert largest(vectors).dtype == lengths(vectors).dtype == vectors.dtype


def test_cross_products_are_those_of_numpy() -> None:
    a, b = RANDOM.normal(size=(2, 40, 3))
    assert_array_equal(cross(a, b), np.cross(a, b))


@pytest.mark.parametrize("rows", [[0, 1, 2], [2, 1, 0], [0, 2], [0, 0, 1], []])
def test_rows_in_their_order_are_the_array_itself(rows: list[int]) -> None:
    array = np.arange(6.0).reshape(3, 2)
    found = rows_of(array, np.array(rows, np.int64))
    assert_array_equal(found, array[rows])
    assert (found is array) == (rows == [0, 1, 2])


def noise(height: int, width: int) -> Any:
    return np.random.default_rng(height * width).integers(0, 256, (height, width, 4), dtype=np.uint8)


def test_four_texels_become_their_mean_in_linear_light() -> None:
    texture = noise(6, 4)
    small = halved(texture)
    assert small.shape == (3, 2, 4)
    blocks = texture.reshape(3, 2, 2, 2, 4).swapaxes(1, 2).reshape(3, 2, 4, 4)
    right = linear_from_srgb8(blocks[..., :3]).mean(axis=2)
    # 0.54 code values, which are at most 2.3 / 255 of linear light wide
    assert linear_from_srgb8(small[..., :3]) == pytest.approx(right, abs=0.54 * 2.3 / 255)
    assert abs(small[..., 3] - blocks[..., 3].mean(axis=2)).max() <= 0.5


@pytest.mark.parametrize("shape", [(1, 1), (1, 9), (7, 1), (5, 3), (3, 8), (255, 17)])
def test_odd_sizes_keep_the_mean(shape: tuple[int, int]) -> None:
    texture = noise(*shape)
    small = halved(texture)
    assert small.shape == (max(shape[0] // 2, 1), max(shape[1] // 2, 1), 4)
    before, after = (linear_from_srgb8(t[..., :3]).mean(axis=(0, 1)) for t in (texture, small))
    assert after == pytest.approx(before, abs=0.54 * 2.3 / 255)
    grey = np.full((*shape, 4), 99, np.uint8)
    assert (halved(grey) == 99).all()


@pytest.mark.parametrize("shape", [(3, 1), (5, 3), (255, 17), (33, 4099), (20_001, 7)])
def test_every_part_of_odd_sizes_is_that_of_the_twin(shape: tuple[int, int]) -> None:
    texture = noise(*shape)
    means = np.concatenate([linear_from_srgb8(texture[..., :3]), texture[..., 3:].astype(np.float32)], axis=2)
    means = mean_of_parts(mean_of_parts(means).swapaxes(0, 1)).swapaxes(0, 1)
    small = halved(texture)
    assert small[..., :3].tolist() == srgb8_from_linear(means[..., :3]).tolist()
    assert small[..., 3].tolist() == np.rint(means[..., 3]).tolist()


def mean_of_parts(values: Any) -> Any:
    """Means of n // 2 equal parts of the n rows, part by part."""
    n = len(values)
    edges = np.arange(n // 2 + 1) * (n / (n // 2)) if n > 1 else np.arange(2)
    found = np.zeros((len(edges) - 1, *values.shape[1:]), np.float32)
    for k, (low, high) in enumerate(pairwise(edges)):
        rows = np.arange(int(low), min(int(np.ceil(high - 1e-9)), n))
        weight = np.minimum(rows + 1, high) - np.maximum(rows, low)
        found[k] = np.tensordot(weight / weight.sum(), values[rows], 1)
    return found


def test_levels_of_wanted_textures() -> None:
    textures = [noise(4, 2), noise(3, 3), noise(1, 1)]
    copies, levels = add_mips(textures, {0, 2})
    assert levels.shape == (3, MOST_LEVELS, 3)
    assert [copy.shape[:2] for copy in copies] == [(2, 1), (1, 1)]
    assert levels[0, :4].tolist() == [[0, 2, 4], [18, 1, 2], [20, 1, 1], [20, 1, 1]]
    assert levels[1].tolist() == [[8, 3, 3]] * MOST_LEVELS
    assert levels[2].tolist() == [[17, 1, 1]] * MOST_LEVELS


def test_only_surfaces_as_the_file_has_them_get_copies(tmp_path: Path) -> None:
    glb = Glb()
    paint = {"baseColorTexture": {"index": glb.texture(png(noise(8, 8)[..., :3]))}}
    bumps = {"index": glb.texture(png(noise(16, 16)[..., :3]))}
    mesh = glb.mesh(glb.material("Wall", paint, normalTexture=bumps), TEXCOORD_0=glb.accessor(QUAD_UVS))
    glb.node(mesh)
    file = glb.save(tmp_path / "a.glb")
    plain, by_file = load_scene(file), load_scene(file, as_file=True)
    assert (len(plain.texels), plain.levels.shape) == (64, (0, MOST_LEVELS, 3))
    assert len(by_file.texels) == 64 + 256 + 16 + 4 + 1
    assert by_file.textures.tolist() == [[0, 8, 8], [64, 16, 16]]
    assert by_file.levels[:, 3].tolist() == [[340, 1, 1], [64, 16, 16]]


SUFFIXES = ("glb", "gltf", "obj", "ply", "stl", "off", "3mf", "dae", "txt")
FEW = settings(max_examples=250, derandomize=True, deadline=None, suppress_health_check=[HealthCheck.too_slow])
SEEDS = st.integers(0, 2**32)
with tempfile.TemporaryDirectory() as scratch:
    MADE = {seed.name: seed for seed in made_seeds(Path(scratch))}
TREES = [seed for seed in MADE.values() if seed.suffix in (".glb", ".gltf")]
TEXTS = [seed for seed in MADE.values() if seed.suffix in (".obj", ".off", ".ply", ".stl") and seed.data.isascii()]


def scene_or_error(files: dict[str, bytes]) -> Scene | None:
    """Read the first of some files and check the result."""
    with tempfile.TemporaryDirectory() as folder:
        for name, data in files.items():
            (Path(folder) / name).write_bytes(data)
        file = Path(folder) / next(iter(files))
        try:
            scene = load_scene(file, memory=2**30)
            read_stage(file)
        except SceneError as error:
            assert str(error).startswith(f"{file}: ")
            assert "\n" not in str(error)
            assert len(str(error)) < 3000
            return None
    check_shapes(scene)
    return scene


@pytest.mark.parametrize("name", MADE)
def test_seeds_are_whole(name: str) -> None:
    """The seeds can be read: otherwise mutations would only break what is broken already."""
    seed = MADE[name]
    assert scene_or_error({f"scene{seed.suffix}": seed.data, **seed.beside}) is not None


@FEW
@given(seed=st.sampled_from(TREES), number=SEEDS)
def test_changed_trees(seed: Seed, number: int) -> None:
    tree = split_glb(seed.data)[0] if seed.suffix == ".glb" else json.loads(seed.data)
    _, text = mutated_json(Random(number), tree)
    scene_or_error({f"scene{seed.suffix}": with_tree(seed.data, text), **seed.beside})


@FEW
@given(seed=st.sampled_from(TEXTS), how=st.sampled_from(sorted(LINES)), number=SEEDS)
def test_changed_texts(seed: Seed, how: str, number: int) -> None:
    scene_or_error({f"scene{seed.suffix}": LINES[how](Random(number), seed.data), **seed.beside})


@FEW
@given(seed=st.sampled_from(list(MADE.values())), how=st.sampled_from(sorted(BYTES)), number=SEEDS)
def test_changed_bytes(seed: Seed, how: str, number: int) -> None:
    scene_or_error({f"scene{seed.suffix}": BYTES[how](Random(number), seed.data), **seed.beside})


@FEW
@given(data=st.binary(max_size=200), suffix=st.sampled_from(SUFFIXES))
def test_any_bytes(data: bytes, suffix: str) -> None:
    scene_or_error({f"scene.{suffix}": data})


@settings(FEW, max_examples=100)
@given(how=st.sampled_from(sorted(HOSTILE)), number=SEEDS)
def test_files_that_were_made_to_do_harm(how: str, number: int) -> None:
    scene_or_error(HOSTILE[how](Random(number)))


def test_glass_alone_is_a_scene(tmp_path: Path) -> None:
    """A line that no ray meets stands for surfaces, with the bounds of the glass."""
    scene = load_scene(quad_file(tmp_path), {"Wall": MaterialTable(transmission=1.0)}, as_file=True)
    assert (scene.report.triangles, len(scene.pane_corners), len(scene.corners)) == (0, 2, 1)
    for bound in (np.min, np.max):
        assert_array_equal(bound(scene.corners, axis=(0, 1)), bound(scene.pane_corners, axis=(0, 1)))
    assert not has_area(scene.corners).any()
