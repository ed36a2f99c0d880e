"""Names of objects, and texture coordinates of surfaces that have no texture, from every kind of file."""

from pathlib import Path

import numpy as np
import pytest
from support.scenes import Glb

from framearray_cli.base.arrays import Int32
from framearray_cli.scene.files import Meshes, read_meshes
from framearray_cli.scene.merge import merge
from framearray_cli.scene.scene import load_scene

SQUARE = "v 0 0 0\nv 1 0 0\nv 1 1 0\nv 0 1 0\nvt 0 0\nvt 2 0\nvt 2 3\nvt 0 3\n"
FACE = "f 1/1 2/2 3/3\n"


def named(meshes: Meshes) -> dict[str, int]:
    """Number of triangles of each object."""
    merged = merge(meshes.parts)
    objects: Int32 = merged.object
    return dict(zip(merged.objects, np.bincount(objects, minlength=len(merged.objects)).tolist(), strict=True))


def test_nodes_of_gltf_have_their_name_or_that_of_their_mesh(tmp_path: Path) -> None:
    glb = Glb()
    mesh = glb.mesh()
    glb.node(mesh, name="Table")
    glb.node(mesh, name="Table", translation=[0, 2, 0])
    glb.node(mesh, translation=[0, 4, 0])
    glb.node(glb.mesh(), name="")
    glb.tree["meshes"][1]["name"] = "Chair"
    assert named(read_meshes(glb.save(tmp_path / "a.glb"))) == {"Table": 4, "node 2": 2, "Chair": 2}


@pytest.mark.parametrize(
    ("text", "expected"),
    [
        (f"{SQUARE}o Box\n{FACE}g side\n{FACE}o Lid\n{FACE}", {"Box": 2, "Lid": 1}),
        (f"{SQUARE}{FACE}g left arm\n{FACE}g right\n{FACE}", {"default": 1, "left arm": 1, "right": 1}),
        (f"{SQUARE}{FACE}", {"default": 1}),
        (f"{SQUARE}o Box\nusemtl A\n{FACE}o Lid\n{FACE}usemtl B\n{FACE}{FACE}", {"Box": 1, "Lid": 3}),
    ],
)
def test_objects_of_obj_are_by_o_or_else_by_g(tmp_path: Path, text: str, expected: dict[str, int]) -> None:
    (tmp_path / "a.obj").write_text(text)
    assert named(read_meshes(tmp_path / "a.obj")) == expected


def test_instances_of_usd_have_the_paths_of_their_prims(tmp_path: Path) -> None:
    pytest.importorskip("pxr", reason="usd-core is not installed (extra usd)")
    from support.usdfiles import coordinates, mesh, new_stage, pxr, save

    stage = new_stage(tmp_path / "a.usda")
    stage.CreateClassPrim("/Proto")
    coordinates(mesh(stage, "/Proto/M"), [(0, 0), (1, 0), (1, 1), (0, 1)], "vertex")
    for k in range(2):
        prim = stage.DefinePrim(f"/World/I{k}", "Xform")
        prim.GetReferences().AddInternalReference("/Proto")
        prim.SetInstanceable(True)
    many = pxr().UsdGeom.PointInstancer.Define(stage, "/World/Many")
    mesh(stage, "/World/Many/P/Card")
    many.CreatePrototypesRel().SetTargets(["/World/Many/P/Card"])
    many.CreateProtoIndicesAttr([0, 0])
    many.CreatePositionsAttr([(0.0, 0.0, 5.0), (0.0, 0.0, 6.0)])
    file = save(stage)
    assert named(read_meshes(file)) == {"/World/I0/M": 2, "/World/I1/M": 2, "/World/Many/P/Card": 4}
    assert not len(load_scene(file).uvs)
    uvs = load_scene(file, all_uvs=True).uvs
    assert uvs[:4].max() == 1 and not uvs[4:].any(), "a mesh without has 0"


def test_texture_coordinates_are_read_without_a_texture_where_they_are_asked_for(tmp_path: Path) -> None:
    (tmp_path / "a.obj").write_text(f"{SQUARE}{FACE}")
    corners = np.array([[[0, 0], [2, 0], [2, 3]]], np.float32)
    glb = Glb()
    uvs = np.array([[0, 1], [2, 1], [2, -2], [0, -2]], np.float32)  # v downwards
    glb.node(glb.mesh(faces=np.array([0, 1, 2], np.uint16), TEXCOORD_0=glb.accessor(uvs)))
    for file in (tmp_path / "a.obj", glb.save(tmp_path / "a.glb")):
        assert not len(load_scene(file).uvs)
        np.testing.assert_allclose(load_scene(file, all_uvs=True).uvs, corners)
