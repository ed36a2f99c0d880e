"""glTF files that break the format: reported with the place, before any of it is used."""

import json
import time
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from support.scenes import QUAD_UVS, Glb, png

from framearray_cli.base.errors import SceneError
from framearray_cli.scene.files import read_meshes, read_stage
from framearray_cli.scene.scene import load_scene


def quad() -> Glb:
    """A textured quad."""
    glb = Glb()
    image = glb.texture(png(np.full((2, 2, 3), 200, np.uint8)))
    glb.node(glb.mesh(glb.material("Paint", {"baseColorTexture": {"index": image}}), TEXCOORD_0=glb.accessor(QUAD_UVS)))
    return glb


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
        ("nodes.0.mesh", 5, "nodes[0].mesh: expected 0, the only one of meshes, got 5"),
        ("nodes.0.mesh", -1, "nodes[0].mesh: expected 0, the only one of meshes, got -1"),
        ("nodes.0.mesh", True, "nodes[0].mesh: expected 0, the only one of meshes, got true"),
        ("nodes.0.children", [[0]], "nodes[0].children[0]: expected 0, the only one of nodes, got [0]"),
        ("nodes.0.matrix", [1.0] * 15, "nodes[0].matrix: expected 16 numbers, got a list of 15 values"),
        ("nodes.0.scale", [1, 1, "1"], 'nodes[0].scale: expected a number, got "1"'),
        ("nodes.0.rotation", [0, 0, 0, 10**400], "nodes[0].rotation: expected a number, got a number beyond 64 bits"),
        ("nodes.0.translation", [0, float("nan"), 0], "nodes[0].translation: expected a number, got nan"),
        ("materials.0.alphaCutoff", float("inf"), "materials[0].alphaCutoff: expected a number, got inf"),
        ("nodes", {"0": {}}, "nodes: expected a list, got an object"),
        ("scene", 1, "scene: expected 0, the only one of scenes, got 1"),
        ("meshes.0", 3, "meshes[0]: expected an object, got 3"),
        ("meshes.0.primitives.0.attributes", [], "meshes[0].primitives[0].attributes: expected an object, got a list"),
        ("meshes.0.primitives.0.mode", 7, "meshes[0].primitives[0].mode: expected a whole number from 0 to 6, got 7"),
        ("meshes.0.primitives.0.material", 9, "expected 0, the only one of materials, got 9"),
        ("meshes.0.primitives.0.indices", 0, "indices: expected an accessor of unsigned whole numbers"),
        ("meshes.0.primitives.0.attributes.NORMAL", 0, "attributes.NORMAL: expected an accessor of VEC3, got VEC2"),
        ("accessors.1.type", "VEC5", "accessors[1].type: expected SCALAR, VEC2, VEC3, VEC4, MAT2, MAT3 or MAT4, got"),
        ("accessors.1.componentType", 5124, "accessors[1].componentType: expected 5120, 5121, 5122, 5123, 5125 or"),
        ("accessors.1.count", 4.0, "accessors[1].count: expected a whole number from 0 to 9.0072e+15, got 4.0"),
        ("accessors.1.count", 2**31, "accessors[1]: its 2,147,483,648 values end at byte 25769803776 of 48"),
        ("accessors.1.byteOffset", 1, "accessors[1]: its 4 values end at byte 49 of 48"),
        ("bufferViews.2.byteStride", 4, "accessors[1]: expected a byteStride of at least 12, got 4"),
        ("bufferViews.2.byteLength", 10**9, "of a buffer of"),
        ("bufferViews.2.byteOffset", -4, "bufferViews[2].byteOffset: expected a whole number from 0 to"),
        ("bufferViews.2.buffer", 1, "bufferViews[2].buffer: expected 0, the only one of buffers, got 1"),
        ("materials.0.pbrMetallicRoughness.baseColorFactor", [1, 1], "baseColorFactor: expected 4 numbers, got [1, 1]"),
        ("materials.0.pbrMetallicRoughness.baseColorTexture.index", "a", "expected 0, the only one of textures"),
        ("materials.0.pbrMetallicRoughness.baseColorTexture", {}, "baseColorTexture.index: is missing"),
        ("textures.0.source", 3, "textures[0].source: expected 0, the only one of images, got 3"),
        ("images.0.uri", 3, "images[0].uri: expected text, got 3"),
        ("extensionsUsed", "KHR", 'extensionsUsed: expected a list, got "KHR"'),
        ("extensions.KHR_lights_punctual.lights", [{}], "extensions.KHR_lights_punctual.lights[0].type: is missing"),
        ("animations", [{"channels": [{"sampler": 0, "target": {"path": "scale"}}]}], "a channel has no sampler"),
        ("asset", 3, "asset: expected an object, got 3"),
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
    with pytest.raises(SceneError, match=r"nodes\[1\].*; nodes\[2\].*; nodes\[3\].*; and more; export it anew"):
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


def test_sparse_places_out_of_range(tmp_path: Path) -> None:
    glb = quad()
    sparse = {
        "count": 1,
        "indices": {"bufferView": glb.view(b"\xff"), "componentType": 5121},
        "values": {"bufferView": glb.view(bytes(12))},
    }
    glb.tree["accessors"][1]["sparse"] = sparse
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


def test_instances_without_data_count(tmp_path: Path) -> None:
    glb = quad()
    rows = glb.add("accessors", {"componentType": 5126, "count": 200_000_000, "type": "VEC3"})
    glb.tree["nodes"][0]["extensions"] = {"EXT_mesh_gpu_instancing": {"attributes": {"TRANSLATION": rows}}}
    with pytest.raises(SceneError, match=r"instances [\d.]+ GiB"):
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
    started = time.perf_counter()
    scene = load_scene(glb.save(tmp_path / "a.glb"))
    assert time.perf_counter() - started < 5
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
