"""Triangles of glTF files: against trimesh, which reads them in another way; and forms that it does not read."""

import time
from pathlib import Path
from typing import Any

import numpy as np
import pytest
import trimesh
from support import ROOT
from support.scenes import QUAD, Glb

from framearray_cli.base.errors import SceneError
from framearray_cli.scene.files.model import Meshes
from framearray_cli.scene.files.read import read_meshes

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
    draco = pytest.importorskip("DracoPy")
    data = draco.encode(QUAD.astype(np.float64), faces=np.array([[0, 1, 2], [0, 2, 3]]), preserve_order=True)
    glb = Glb()
    number = draco.decode(data).attributes[0]["unique_id"]
    position = glb.add("accessors", {"componentType": 5126, "count": 4, "type": "VEC3"})
    indices = glb.add("accessors", {"componentType": 5123, "count": 6, "type": "SCALAR"})
    packed = {"bufferView": glb.view(data), "attributes": {"POSITION": number}}
    extension = {"extensions": {"KHR_draco_mesh_compression": packed}}
    primitive = {"attributes": {"POSITION": position}, "indices": indices} | extension
    glb.node(glb.add("meshes", {"primitives": [primitive]}))
    glb.tree["extensionsUsed"] = ["KHR_draco_mesh_compression"]
    found = corners(read_meshes(glb.save(tmp_path / "scene.glb")))
    np.testing.assert_allclose(found, QUAD[np.array([[0, 1, 2], [0, 2, 3]])], atol=1e-3)


def test_draco_without_its_library(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr("importlib.util.find_spec", lambda name: None)
    glb = Glb()
    glb.node(glb.mesh())
    glb.tree["extensionsUsed"] = ["KHR_draco_mesh_compression"]
    with pytest.raises(SceneError, match=r"is compressed with Draco; export without it, or install DracoPy .*draco\]"):
        read_meshes(glb.save(tmp_path / "scene.glb"))


@pytest.mark.parametrize("n", [200_000, pytest.param(1_000_000, marks=pytest.mark.slow)])
def test_many_places_are_filled_at_once(n: int, tmp_path: Path) -> None:
    """One after the other a million would take a minute; only mirrored ones are turned."""
    glb = Glb()
    scale = np.ones((n, 3), np.float32)
    scale[1::2, 0] = -1
    move = np.arange(3 * n, dtype=np.float32).reshape(n, 3)
    rows = {"TRANSLATION": glb.accessor(move), "SCALE": glb.accessor(scale)}
    mesh = glb.mesh(positions=QUAD[:3], faces=None)
    glb.node(mesh, extensions={"EXT_mesh_gpu_instancing": {"attributes": rows}})
    file = glb.save(tmp_path / "scene.glb")
    started = time.process_time()
    found = corners(read_meshes(file))
    assert time.process_time() - started < 1e-5 * n
    assert found.shape == (n, 3, 3)
    for k in (0, 1, 2, 99_999, n - 1):
        expected = QUAD[:3] * scale[k] + move[k]
        np.testing.assert_array_equal(found[k], expected[::-1] if k % 2 else expected)


def test_half_a_letter_in_a_name_is_replaced(tmp_path: Path) -> None:
    """JSON can hold half a surrogate pair, UTF-8 cannot; the name goes into the manifest."""
    glb = Glb()
    glb.node(glb.mesh(glb.material("a\ud800b")))
    assert read_meshes(glb.save(tmp_path / "scene.glb")).materials[0].name == "a?b"
