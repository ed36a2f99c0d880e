"""glTF files: triangles against trimesh, cameras and lights, refusals of broken trees."""

import json
import math
import re
import time
from pathlib import Path
from typing import Any

import numpy as np
import pytest
import trimesh
from support import ROOT
from support.scenes import QUAD, Glb, packed_quad, png, quad_of
from support.staged import QUARTER, animate, camera, light, shift, turn_y

from framearray_cli.base.errors import SceneError
from framearray_cli.scene.files import StageLens, read_meshes, read_stage
from framearray_cli.scene.files.model import Meshes
from framearray_cli.scene.scene import load_scene

JOBS = ROOT / "jobs" / "scenes"
SQUARE = np.array([[0, 0, 0], [1, 0, 0], [0, 1, 0], [1, 1, 0], [0, 2, 0]], dtype=np.float32)


def corners(meshes: Meshes) -> Any:
    """(n, 3, 3) of all parts."""
    return np.concatenate([part.corners for part in meshes.parts])


def in_order(triangles: Any) -> Any:
    """(n, 9), sorted, to compare triangles that two readers return in different orders."""
    rows = np.round(triangles.reshape(len(triangles), 9), 4) + 0.0
    return rows[np.lexsort(rows.T)]


@pytest.mark.parametrize("name", ["kitchen", "stairs", "cabin", "furnace"])
def test_trimesh_finds_the_same_triangles(name: str) -> None:
    file = JOBS / f"{name}.glb"
    if not file.is_file():
        pytest.skip(f"no {file.name}; `make render` makes it")
    theirs = [
        trimesh.transform_points(mesh.vertices, matrix)[mesh.faces]
        for mesh, matrix in (
            (scene.geometry[key], transform)
            for scene in [trimesh.load_scene(file, process=False)]
            for node in scene.graph.nodes_geometry
            for transform, key in [scene.graph[node]]
        )
    ]
    found, expected = in_order(corners(read_meshes(file))), in_order(np.concatenate(theirs))
    assert found.shape == expected.shape
    # rounding to 4 digits may put a triangle elsewhere in the order; sums show the rest
    np.testing.assert_allclose(found.sum(axis=0), expected.sum(axis=0), rtol=1e-6)
    assert (np.abs(found - expected).max(axis=1) < 1e-3).mean() > 0.99


@pytest.mark.parametrize(
    ("mode", "indices", "faces"),
    [
        (4, [0, 1, 2, 3, 2, 1], [[0, 1, 2], [3, 2, 1]]),
        (5, [0, 1, 2, 3, 4], [[0, 1, 2], [3, 2, 1], [2, 3, 4]]),
        (6, [0, 1, 3, 2], [[0, 1, 3], [0, 3, 2]]),
        (6, None, [[0, 1, 2], [0, 2, 3], [0, 3, 4]]),
        (5, None, [[0, 1, 2], [3, 2, 1], [2, 3, 4]]),
        (4, [4, 3, 2, 1], [[4, 3, 2]]),
    ],
)
def test_lists_strips_and_fans(mode: int, indices: list[int] | None, faces: Any, tmp_path: Path) -> None:
    """A strip turns every second triangle, so that all of them face the same way [glTF 2.0, 3.7.2.1]."""
    glb = Glb()
    given = None if indices is None else np.array(indices, np.uint16)
    glb.node(glb.mesh(positions=SQUARE, faces=given, mode=mode))
    meshes = read_meshes(glb.save(tmp_path / "scene.glb"))
    np.testing.assert_array_equal(corners(meshes), SQUARE[np.array(faces)])
    assert any("multiple of three" in note for note in meshes.notes) == (indices == [4, 3, 2, 1])


def test_parts_come_in_the_order_of_the_file(tmp_path: Path) -> None:
    glb = Glb()
    meshes = [glb.mesh(glb.material(name)) for name in ("a", "b", "c")]
    for k, mesh in enumerate((2, 0, 1, 0)):
        glb.node(meshes[mesh], translation=[0.0, 0.0, float(k)])
    found = read_meshes(glb.save(tmp_path / "scene.glb"))
    assert [part.material for part in found.parts] == [2, 0, 1, 0]
    assert [float(part.corners[0, 0, 2]) for part in found.parts] == [0, 1, 2, 3]


def test_small_primitives_of_a_large_block_of_vertices(tmp_path: Path) -> None:
    """Each copies only its own vertices; a triangle with a missing vertex is left out and counted."""
    glb, rng = Glb(), np.random.default_rng(3)
    positions = rng.normal(size=(500, 3)).astype(np.float32)
    shared = glb.accessor(positions)
    turned = rng.normal(size=(500, 3)).astype(np.float32)
    normals = glb.accessor(turned)
    faces = rng.integers(0, 500, (4, 2, 3)).astype(np.uint16)
    faces[3, 1, 2] = 500
    primitives = [
        {"attributes": {"POSITION": shared, "NORMAL": normals}, "indices": glb.accessor(f.reshape(-1))} for f in faces
    ]
    glb.node(glb.add("meshes", {"primitives": primitives}))
    found = read_meshes(glb.save(tmp_path / "scene.glb"))
    kept = faces.reshape(-1, 3)[:7]
    np.testing.assert_array_equal(corners(found), positions[kept])
    ways = np.concatenate([part.normals for part in found.parts if part.normals is not None])
    np.testing.assert_allclose(ways, turned[kept], rtol=1e-6)
    assert found.dropped == {"index out of range": 1}


def test_draco(tmp_path: Path) -> None:
    pytest.importorskip("DracoPy")
    found = corners(read_meshes(packed_quad().save(tmp_path / "scene.glb")))
    np.testing.assert_allclose(found, QUAD[np.array([[0, 1, 2], [0, 2, 3]])], atol=1e-3)


def test_draco_without_its_library(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr("importlib.util.find_spec", lambda name: None)
    glb = quad_of()
    glb.tree["extensionsUsed"] = ["KHR_draco_mesh_compression"]
    with pytest.raises(SceneError, match=r"is compressed with Draco; export without it, or install DracoPy .*draco\]"):
        read_meshes(glb.save(tmp_path / "scene.glb"))


def test_half_a_letter_in_a_name_is_replaced(tmp_path: Path) -> None:
    """JSON can hold half a surrogate pair, UTF-8 cannot; the name goes into the manifest."""
    assert read_meshes(quad_of("a\ud800b").save(tmp_path / "scene.glb")).materials[0].name == "a?b"


def test_a_file_without_any_has_none(tmp_path: Path) -> None:
    stage = read_stage(quad_of().save(tmp_path / "a.glb"))
    assert stage.cameras == () and stage.lights == () and stage.notes == ()
    assert read_stage(tmp_path / "scene.obj").cameras == ()  # of such a format nothing is read


def test_a_camera_is_where_its_ancestors_put_it(tmp_path: Path) -> None:
    """A translated camera below a node with a matrix, below one that is turned and scaled."""
    glb = Glb()
    shot = camera(glb, translation=[1.0, 2.0, 3.0])
    matrix = shift(0, 5, 0) @ turn_y(0.3)
    middle = glb.add("nodes", {"matrix": matrix.T.reshape(-1).tolist(), "children": [shot]})
    glb.node(children=[middle], rotation=[0.0, QUARTER, 0.0, QUARTER], scale=[2.0, 2.0, 2.0])
    stage = read_stage(glb.save(tmp_path / "a.glb"))
    (found,) = stage.cameras
    assert (found.name, found.aspect) == ("Shot", 1.5)
    assert found.lens.fov_deg == pytest.approx(50)
    expected = turn_y(math.pi / 2) @ np.diag([2.0, 2.0, 2.0, 1.0]) @ matrix @ shift(1, 2, 3)
    np.testing.assert_allclose(stage.world_from(found.node, [0.0])[0], expected, atol=1e-6)
    assert stage.span([found.node]) is None


def test_a_rotating_ancestor_carries_the_camera_around(tmp_path: Path) -> None:
    glb = Glb()
    shot = camera(glb, translation=[0.0, 0.0, 4.0])
    arm = glb.node(children=[shot])
    animate(glb, arm, "rotation", [1.0, 3.0], [[0, 0, 0, 1], [0, QUARTER, 0, QUARTER]])
    stage = read_stage(glb.save(tmp_path / "a.glb"))
    assert stage.span([shot]) == (1.0, 3.0)
    times = [0.0, 1.0, 1.5, 2.0, 3.0, 9.0]
    for second, matrix in zip(times, stage.world_from(shot, times), strict=True):
        angle = math.pi / 2 * min(max((second - 1) / 2, 0), 1)  # at constant speed; at rest before and after
        np.testing.assert_allclose(matrix, turn_y(angle) @ shift(0, 0, 4), atol=1e-6)


def moved(folder: Path, seconds: list[float], path: str, *keys: Any) -> Any:
    """Matrices of an animated camera at some times."""
    glb = Glb()
    shot = glb.root(camera(glb))
    animate(glb, shot, path, *keys)
    return read_stage(glb.save(folder / "a.glb")).world_from(shot, seconds)


def test_rotations_take_the_shorter_way(tmp_path: Path) -> None:
    """The second key is the same quarter turn with all signs changed."""
    (matrix,) = moved(tmp_path, [0.5], "rotation", [0.0, 1.0], [[0, 0, 0, 1], [0, -QUARTER, 0, -QUARTER]])
    np.testing.assert_allclose(matrix, turn_y(math.pi / 4), atol=1e-6)


def test_steps_stay_until_the_next_key(tmp_path: Path) -> None:
    times, places = [0.0, 1.0, 2.0], [[0, 0, 0], [1, 0, 0], [5, 0, 0]]
    found = moved(tmp_path, [0.0, 0.99, 1.0, 1.99, 2.0, 3.0], "translation", times, places, "STEP")
    np.testing.assert_array_equal(found[:, 0, 3], [0, 0, 1, 1, 5, 5])


def test_a_cubic_spline_follows_its_tangents(tmp_path: Path) -> None:
    """x = t^3 - 2 t has value and slope -1 and 1 at 1, 4 and 10 at 2; two keys with those are that very cubic."""
    values = [[9, 9, 9], [-1, 0, 0], [1, 0, 0], [10, 0, 0], [4, 0, 0], [9, 9, 9]]  # arriving, value, leaving
    times = np.array([1.0, 1.25, 1.5, 1.9, 2.0])
    found = moved(tmp_path, times.tolist(), "translation", [1.0, 2.0], values, "CUBICSPLINE")
    np.testing.assert_allclose(found[:, 0, 3], times**3 - 2 * times, atol=1e-6)


def test_scale_is_animated_too_and_animations_add_up(tmp_path: Path) -> None:
    """Blender writes one animation per object; all of them count."""
    glb = Glb()
    shot = camera(glb, translation=[1.0, 0.0, 0.0])
    root = glb.node(children=[shot])
    animate(glb, root, "scale", [0.0, 1.0], [[1, 1, 1], [3, 1, 1]])
    animate(glb, root, "translation", [0.0, 2.0], [[0, 0, 0], [0, 8, 0]])
    stage = read_stage(glb.save(tmp_path / "a.glb"))
    assert stage.span([shot]) == (0.0, 2.0)
    np.testing.assert_allclose(stage.world_from(shot, [0.5])[0, :3, 3], [2.0, 2.0, 0.0], atol=1e-6)


def test_lights_have_their_kind_colour_and_strength(tmp_path: Path) -> None:
    glb = Glb()
    glb.node(name="Lamp", **light(glb, intensity=20.0, color=[1.0, 0.5, 0.25]))
    glb.node(name="Sun", **light(glb, "directional", intensity=3.0))
    glb.node(**light(glb, "spot", name="Beam", spot={"outerConeAngle": 0.5}))
    stage = read_stage(glb.save(tmp_path / "a.glb"))
    assert [(one.name, one.kind, one.intensity) for one in stage.lights] == [
        ("Lamp", "point", (20.0, 10.0, 5.0)),
        ("Sun", "directional", (3.0, 3.0, 3.0)),
        ("Beam", "spot", (1.0, 1.0, 1.0)),
    ]
    assert [one.cone_deg for one in stage.lights] == [None, None, (0.0, pytest.approx(np.degrees(0.5)))]


LIGHTS = "extensions.KHR_lights_punctual.lights"


@pytest.mark.parametrize(
    ("place", "value", "note"),
    [
        (
            "cameras.0.perspective",
            {"znear": 1},
            "cameras[0].perspective.yfov: missing; expected a number; the camera of nodes[1]",
        ),
        ("cameras.0", {}, "cameras[0]: missing; the camera of nodes[1]"),
        ("cameras.0", {"type": "orthographic"}, "cameras[0].orthographic: missing; the camera"),
        (
            "cameras.0.perspective.yfov",
            "wide",
            'cameras[0].perspective.yfov: expected a number, got "wide"; the camera',
        ),
        ("nodes.1.camera", 7, "cameras[7]: missing; the camera of nodes[1]"),
        (f"{LIGHTS}.0", {}, f"{LIGHTS}[0].type: missing; expected"),
        (f"{LIGHTS}.0.type", "area", f'{LIGHTS}[0].type: expected "point", "directional" or "spot", got "area"; the'),
        (f"{LIGHTS}.0.color", [1, 1], f"{LIGHTS}[0].color: expected 3 numbers, at least 3, got 2; the light"),
        (
            f"{LIGHTS}.0.spot",
            {"outerConeAngle": 0},
            f"{LIGHTS}[0].spot: expected cone angles in this order, got 0 and 0",
        ),
        (f"{LIGHTS}.0.spot", {"innerConeAngle": 1.0}, "cone angles in this order, got 1 and 0.785398; the light"),
        (f"{LIGHTS}.0.spot", {"outerConeAngle": 3.0}, "spot.outerConeAngle: expected a number from 0 to 1.570"),
        ("nodes.2.extensions.KHR_lights_punctual.light", [], f"{LIGHTS}[[]]: missing; the light of nodes[2]"),
    ],
)
def test_a_broken_camera_or_light_is_left_out(place: str, value: Any, note: str, tmp_path: Path) -> None:
    """The others stay, and so do the meshes."""
    glb = quad_of()
    for broken in (True, False):
        glb.root(camera(glb, name=str(broken)))
        glb.node(name=str(broken), **light(glb, "spot"))
    found = read_stage(changed(glb, place, value).save(tmp_path / "a.glb"))
    (line,) = found.notes
    assert note in line and line.endswith(" is left out")
    assert sorted(one.name for one in (*found.cameras, *found.lights)) == ["False", "False", "True"]
    assert read_meshes(tmp_path / "a.glb").lights == 2


def test_what_the_default_scene_does_not_show_is_left_out(tmp_path: Path) -> None:
    glb = quad_of()
    camera(glb)
    assert read_stage(glb.save(tmp_path / "a.glb")).cameras == ()


def test_an_orthographic_camera_sees_twice_its_magnification(tmp_path: Path) -> None:
    """One that sees nothing is left out."""
    glb = Glb()
    for name, tall in (("Plan", 1.5), ("Flat", 0.0)):
        lens = {"type": "orthographic", "orthographic": {"xmag": 3, "ymag": tall, "znear": 0, "zfar": 9}}
        glb.node(name=name, camera=glb.add("cameras", lens))
    stage = read_stage(glb.save(tmp_path / "a.glb"))
    (plan,) = stage.cameras
    assert (plan.lens, plan.aspect) == (StageLens(height=3.0), 2.0)
    assert stage.notes == ("camera Flat: sees nothing and is left out",)


@pytest.mark.parametrize(
    ("times", "values", "message"),
    [
        ([0.0, 0.0], [[0, 0, 0], [1, 0, 0]], "do not rise"),
        ([0.0, 1.0], [[0, 0, 0]], "2 times and 1 value"),
        ([0.0, math.nan], [[0, 0, 0], [1, 0, 0]], "do not rise, or are not finite"),
    ],
)
def test_broken_animations_are_left_out(times: Any, values: Any, message: str, tmp_path: Path) -> None:
    glb = quad_of()
    animate(glb, glb.root(camera(glb)), "translation", times, values)
    file = glb.save(tmp_path / "a.glb")
    for notes in (read_stage(file).notes, read_meshes(file).notes):
        (note,) = (note for note in notes if note.startswith("animations[0].channels[0] is left out: "))
        assert message in note


def notes_of(glb: Glb, tmp_path: Path) -> tuple[str, ...]:
    return read_meshes(glb.save(tmp_path / "a.glb")).notes


def test_animations_of_cameras_and_lights_are_no_loss(tmp_path: Path) -> None:
    """Jobs have paths for them; a note is on meshes only."""
    glb = Glb()
    mesh = glb.node(glb.mesh())
    eye = camera(glb, translation=[0, 0, 5])
    lamp = glb.add("nodes", light(glb))
    glb.tree["scenes"][0]["nodes"] += [eye, lamp]
    for node in (eye, lamp):
        animate(glb, node, "translation", [0, 1], [[0, 0, 0], [1, 0, 0]])
    assert read_meshes(glb.save(tmp_path / "a.glb")).lights == 1
    assert not any("move" in note or "light" in note for note in notes_of(glb, tmp_path))
    above = glb.add("nodes", {"children": [mesh]})
    glb.tree["scenes"][0]["nodes"].remove(mesh)
    glb.tree["scenes"][0]["nodes"].append(above)
    animate(glb, above, "translation", [0, 1], [[0, 0, 0], [1, 0, 0]])
    said = "meshes that move are shown at 0 s of 0 to 1 s; scene.time selects another time"
    assert said in notes_of(glb, tmp_path)


def quad() -> Glb:
    """A textured quad."""
    return quad_of("Paint", {"baseColorTexture": png(np.full((2, 2, 3), 200, np.uint8))})


def changed(glb: Glb, place: str, value: Any) -> Glb:
    """Set a value of the tree by its place, `nodes.0.mesh`."""
    box: Any = glb.tree
    *way, last = place.split(".")
    for key in way:
        box = box[int(key)] if isinstance(box, list) else box.setdefault(key, {})
    box[int(last) if isinstance(box, list) else last] = value
    return glb


@pytest.mark.parametrize(
    ("place", "value", "message"),
    [
        ("nodes.0.mesh", 5, "nodes[0].mesh: expected the number of one of 1 meshes, from 0, got 5"),
        ("nodes.0.mesh", -1, "nodes[0].mesh: expected a whole number of at least 0, got -1"),
        ("nodes.0.mesh", True, "nodes[0].mesh: expected a whole number of at least 0, got true"),
        ("nodes.0.children", [[0]], "nodes[0].children[0]: expected a whole number of at least 0, got [0]"),
        ("nodes.0.matrix", [1.0] * 15, "nodes[0].matrix: expected 16 numbers, at least 16, got 15"),
        ("nodes.0.scale", [1, 1, "1"], 'nodes[0].scale[2]: expected a number, got "1"'),
        ("nodes.0.rotation", [0, 0, 0, 10**400], "rotation[3]: expected a number, got a number beyond 64 bits"),
        ("nodes.0.translation", [0, float("nan"), 0], "nodes[0].translation[1]: expected a number, got nan"),
        ("materials.0.alphaCutoff", float("inf"), "materials[0].alphaCutoff: expected a number, got inf"),
        ("nodes", {"0": {}}, "nodes: expected a list of tables, got a table"),
        ("scene", 1, "scene: expected the number of one of 1 scenes, from 0, got 1"),
        ("meshes.0", 3, "meshes[0]: expected a table, got 3"),
        ("meshes.0.primitives.0.attributes", [], "meshes[0].primitives[0].attributes: expected a table, got a list"),
        ("meshes.0.primitives.0.mode", 7, "meshes[0].primitives[0].mode: expected a whole number from 0 to 6, got 7"),
        ("meshes.0.primitives.0.material", 9, "expected the number of one of 1 materials, from 0, got 9"),
        ("accessors.1.type", "VEC5", 'accessors[1].type: expected "SCALAR", "VEC2", "VEC3", "VEC4"'),
        ("accessors.1.componentType", 5124, "accessors[1].componentType: expected 5120, 5121, 5122, 5123, 5125 or"),
        ("accessors.1.count", 4.0, "accessors[1].count: expected a whole number of at least 0, got 4.0"),
        ("bufferViews.2.byteOffset", -4, "bufferViews[2].byteOffset: expected a whole number of at least 0"),
        ("bufferViews.2.buffer", 1, "bufferViews[2].buffer: expected the number of one of 1 buffers, from 0, got 1"),
        ("materials.0.pbrMetallicRoughness.baseColorFactor", [1, 1], "expected 4 numbers, at least 4, got 2"),
        ("materials.0.pbrMetallicRoughness.baseColorTexture.index", "a", "expected a whole number of at least 0"),
        ("materials.0.pbrMetallicRoughness.baseColorTexture", {}, "baseColorTexture.index: missing"),
        ("textures.0.source", 3, "textures[0].source: expected the number of one of 1 images, from 0, got 3"),
        ("images.0.uri", 3, "images[0].uri: expected a text, got 3"),
        ("extensionsUsed", "KHR", 'extensionsUsed: expected a list of tables, got "KHR"'),
        ("asset", 3, "asset: expected a table, got 3"),
    ],
)  # fmt: skip
def test_an_error_is_reported_with_its_place(tmp_path: Path, place: str, value: Any, message: str) -> None:
    file = changed(quad(), place, value).save(tmp_path / "a.glb")
    for read in (read_meshes, read_stage):
        with pytest.raises(SceneError) as caught:
            read(file)
        assert str(caught.value).startswith(f"{file}: broken glTF: ")
        assert message in str(caught.value)
        assert "\n" not in str(caught.value)


def test_the_first_problems_are_reported(tmp_path: Path) -> None:
    glb = quad()
    glb.tree["nodes"] += [{"mesh": 9}] * 9
    with pytest.raises(
        SceneError, match=r"nodes\[1\].*; nodes\[2\].*; nodes\[3\].*; and 6 more problems; export it anew"
    ):
        read_meshes(glb.save(tmp_path / "a.glb"))


@pytest.mark.parametrize(
    "place", ["nodes.0.children", "scene", "materials.0.name", "animations", "nodes.0.matrix", "asset"]
)
def test_null_counts_as_missing(tmp_path: Path, place: str) -> None:
    assert load_scene(changed(quad(), place, None).save(tmp_path / "a.glb")).report.triangles == 2


@pytest.mark.parametrize("text", ["[" * 100_000, '{"a":' * 50_000])
def test_deep_nesting(tmp_path: Path, text: str) -> None:
    """Python 3.14 nests deeper, and comes to the end of the file."""
    file = tmp_path / "a.gltf"
    file.write_text(text)
    with pytest.raises(SceneError, match=r"nested too deeply|broken, or not GLTF"):
        read_meshes(file)


def test_values_beyond_their_view(tmp_path: Path) -> None:
    for place, value in (("accessors.1.byteOffset", 1), ("bufferViews.2.byteLength", 40)):
        with pytest.raises(SceneError, match=r"bufferViews\[2\] is too short for 4 elements"):
            read_meshes(changed(quad(), place, value).save(tmp_path / "a.glb"))


def test_sparse_places_out_of_range(tmp_path: Path) -> None:
    glb = quad()
    glb.tree["accessors"][1]["sparse"] = glb.sparse(np.uint8([255]), np.zeros(3, np.float32))
    with pytest.raises(SceneError, match="expected sparse places below 4, got 255"):
        read_meshes(glb.save(tmp_path / "a.glb"))


# --- small files of huge scenes --------------------------------------------------------------------------------------


def test_values_without_data_count(tmp_path: Path) -> None:
    glb = quad()
    del glb.tree["accessors"][1]["bufferView"]
    glb.tree["accessors"][1]["count"] = 2**31
    with pytest.raises(SceneError, match=r"accessors 24\.0 GiB\), 8\.0 GiB may be used"):
        read_meshes(glb.save(tmp_path / "a.glb"), memory=2**33)


def test_every_instance_of_a_mesh_counts(tmp_path: Path) -> None:
    glb = Glb()
    corners = np.random.default_rng(0).random((30_000, 3)).astype(np.float32)
    mesh = glb.mesh(positions=corners, faces=None)
    for _ in range(2_000):
        glb.node(mesh)
    file = glb.save(tmp_path / "a.glb")
    started = time.perf_counter()
    with pytest.raises(SceneError, match=r"triangles \d\.\d GiB.*, 4\.0 GiB may be used"):
        read_meshes(file, memory=2**32)
    assert time.perf_counter() - started < 5


@pytest.mark.parametrize(
    ("attributes", "message"),
    [
        ({"TRANSLATION": 9}, "EXT_mesh_gpu_instancing.attributes.TRANSLATION: expected the number of one of"),
        ([], "EXT_mesh_gpu_instancing.attributes: expected a table, got a list"),
        ({"ROTATION": 1}, "ROTATION of instances: expected 4 numbers for each, got 3"),
        ({"TRANSLATION": 3}, "places 186.3 GiB"),
    ],
)
def test_broken_or_endless_instances_are_refused(tmp_path: Path, attributes: Any, message: str) -> None:
    glb = quad()
    assert glb.add("accessors", {"componentType": 5120, "count": 200_000_000, "type": "SCALAR"}) == 3
    glb.tree["nodes"][0]["extensions"] = {"EXT_mesh_gpu_instancing": {"attributes": attributes}}
    with pytest.raises(SceneError, match=re.escape(message)):
        read_meshes(glb.save(tmp_path / "a.glb"), memory=2**33)


def test_a_graph_that_doubles_at_each_level_is_refused(tmp_path: Path) -> None:
    """Forty levels of two references each are 2^40 meshes."""
    glb = quad()
    glb.tree["nodes"] += [{"children": [k, k]} for k in range(40)]
    with pytest.raises(SceneError, match="a node has several parents"):
        read_meshes(glb.save(tmp_path / "a.glb"))


def test_a_deep_graph_takes_no_longer_than_a_wide_one(tmp_path: Path) -> None:
    """Each of 3,000 nodes is a child of the one before, one step to the side; in float64."""
    glb = Glb()
    mesh = glb.mesh()
    glb.node(mesh)
    for k in range(1, 3000):
        glb.tree["nodes"].append({"mesh": mesh, "translation": [3, 0, 0]})
        glb.tree["nodes"][k - 1]["children"] = [k]
    started = time.process_time()
    scene = load_scene(glb.save(tmp_path / "a.glb"))
    assert time.process_time() - started < 5
    assert scene.report.triangles == 6000
    assert np.ptp(scene.corners[..., 0]) == 3 * 2999 + 2


def test_rotations_that_are_no_rotations(tmp_path: Path) -> None:
    """A quaternion of length 2 counts as its unit quaternion, one of length 0 as no rotation."""
    scenes = []
    for rotation in ([0, 0.6, 0, 0.8], [0, 1.2, 0, 1.6], [0, 0, 0, 0], [0, 0, 0, 1]):
        glb = quad()
        glb.tree["nodes"][0]["rotation"] = rotation
        scenes.append(load_scene(glb.save(tmp_path / "a.glb")).corners)
    assert scenes[0] == pytest.approx(scenes[1], abs=1e-6)
    assert (scenes[2] == scenes[3]).all()


@pytest.mark.parametrize("name", ["\ud800", "\0", "", "x" * 100_000])
def test_names_do_not_matter(tmp_path: Path, name: str) -> None:
    glb = quad()
    glb.tree["meshes"][0] |= {"name": name, "extras": {"faces": name, name: name}}
    glb.tree["nodes"][0]["name"] = name
    assert load_scene(glb.save(tmp_path / "a.glb")).report.triangles == 2


def test_attributes_of_another_length_are_left_out(tmp_path: Path) -> None:
    glb = quad()
    glb.tree["meshes"][0]["primitives"][0]["attributes"]["NORMAL"] = glb.accessor(np.ones((3, 3), np.float32))
    meshes = read_meshes(glb.save(tmp_path / "a.glb"))
    assert meshes.parts[0].normals is None
    assert "NORMAL of another length than POSITION is left out" in meshes.notes


def test_data_that_is_not_there(tmp_path: Path) -> None:
    glb = quad()
    file = tmp_path / "a.gltf"
    for uri in ("data:", "data:,abc", "data:application/octet-stream;base64", "data:text/plain,a"):
        glb.tree["buffers"] = [{"byteLength": len(glb.blob), "uri": uri}]
        file.write_text(json.dumps(glb.tree))
        with pytest.raises(SceneError, match="expected data in base64"):
            read_meshes(file)
