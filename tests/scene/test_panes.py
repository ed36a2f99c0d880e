"""Thin glass as scene files describe it."""

from pathlib import Path
from typing import Any

import numpy as np
import pytest
from support import tiny
from support.scenes import Glb

from framearray_cli.scene.files import read_meshes
from framearray_cli.scene.panes import COLOUR, NORMAL, SHEET, F, G, in_closed_mesh
from framearray_cli.scene.scene import Scene, load_scene

CLEAR = {"KHR_materials_transmission": {"transmissionFactor": 1.0}}
BOX = tiny.box((0, 0, 0), (1, 2, 0.1))


def scene_with(tmp_path: Path, pbr: dict[str, Any], corners: Any = BOX, **more: Any) -> Scene:
    glb = Glb()
    glb.node(glb.mesh(glb.material("Wall", {})))
    positions = np.asarray(corners, np.float32).reshape(-1, 3)
    faces = np.arange(len(positions), dtype=np.uint16)
    glb.node(glb.mesh(glb.material("Pane", pbr, **more), positions=positions, faces=faces))
    return load_scene(glb.save(tmp_path / "a.glb"), as_file=True)


def test_a_closed_box_has_two_faces_and_an_open_one_sheets(tmp_path: Path) -> None:
    pbr = {"baseColorFactor": [0.81, 0.64, 0.25, 1.0]}
    closed = scene_with(tmp_path, pbr, extensions=CLEAR).pane_optics
    np.testing.assert_allclose(closed[:, COLOUR : COLOUR + 3], np.tile([0.9, 0.8, 0.5], (12, 1)), rtol=1e-6)
    assert (closed[:, SHEET] == 0).all()
    scene = scene_with(tmp_path, pbr, BOX[:-2], extensions=CLEAR)
    np.testing.assert_allclose(
        scene.pane_optics[:, COLOUR : COLOUR + 3], np.tile([0.81, 0.64, 0.25], (10, 1)), rtol=1e-6
    )
    np.testing.assert_allclose(scene.pane_optics[:, F], 0.04, rtol=1e-6)
    np.testing.assert_allclose(scene.pane_optics[:, G], 0.96, rtol=1e-6)
    assert (scene.pane_optics[:, SHEET] == 1).all()
    assert scene.has_glass and len(scene.corners) == 2
    assert "glass: 10 triangles of sheets" in scene.report.notes
    assert scene.report.dropped == {}


def test_meshes_close_one_by_one() -> None:
    """An open mesh beside a closed one, and one that shares a corner with it."""
    sheet = tiny.quad((3, 0, 0), (4, 0, 0), (4, 1, 0), (3, 1, 0))
    closed = in_closed_mesh(np.concatenate([BOX, sheet, BOX[:-1] + 7]).astype(np.float32))
    assert closed.tolist() == [True] * 12 + [False] * 13
    flap = np.array([[[0, 0, 0], [-1, 0, 0], [-1, 1, 0]]])
    assert not in_closed_mesh(np.concatenate([BOX, flap]).astype(np.float32)).any()


def test_normals_are_units(tmp_path: Path) -> None:
    optics = scene_with(tmp_path, {}, extensions=CLEAR).pane_optics
    np.testing.assert_allclose(np.linalg.norm(optics[:, NORMAL : NORMAL + 3], axis=1), 1.0, rtol=1e-6)


@pytest.mark.parametrize(
    ("extensions", "colour", "f"),
    [
        ({"KHR_materials_ior": {"ior": 2.0}}, (0.8, 0.8, 0.8), 1 / 9),
        ({"KHR_materials_ior": {"ior": 0.0}}, (0.8, 0.8, 0.8), 0.0),
        (
            {
                "KHR_materials_volume": {
                    "thicknessFactor": 0.5,
                    "attenuationDistance": 0.25,
                    "attenuationColor": [1, 0.5, 0],
                }
            },
            (0.8, 0.2, 0.0),
            0.04,
        ),
        ({"KHR_materials_volume": {"thicknessFactor": 0.5}}, (0.8, 0.8, 0.8), 0.04),
    ],
)
def test_index_and_volume(tmp_path: Path, extensions: dict[str, Any], colour: Any, f: float) -> None:
    pbr = {"baseColorFactor": [0.8, 0.8, 0.8, 1.0]}
    optics = scene_with(tmp_path, pbr, BOX[:2], extensions={**CLEAR, **extensions}).pane_optics
    np.testing.assert_allclose(optics[0, COLOUR : COLOUR + 3], colour, atol=1e-6)
    assert optics[0, F] == pytest.approx(f)


def test_a_nearly_clear_blend_covers_and_reflects_nothing(tmp_path: Path) -> None:
    optics = scene_with(tmp_path, {"baseColorFactor": [0.1, 0.5, 1.0, 0.2]}, alphaMode="BLEND").pane_optics
    np.testing.assert_allclose(optics[:, COLOUR : COLOUR + 3], 0.8, rtol=1e-6)
    assert (optics[:, F] == 0).all() and (optics[:, G] == 0).all()


@pytest.mark.parametrize(
    ("lines", "colour", "ior"),
    [
        ("d 0.1", (0.9, 0.9, 0.9), 1.0),
        ("d 0.2\nTf 0.5 1 0.25\nNi 1.4", (0.4, 0.8, 0.2), 1.4),
        ("Tr 0.9\nillum 4", (0.9, 0.9, 0.9), 1.5),
    ],
)
def test_mtl(tmp_path: Path, lines: str, colour: Any, ior: float) -> None:
    (tmp_path / "m.mtl").write_text(f"newmtl G\nKd 1 1 1\n{lines}\n")
    (tmp_path / "a.obj").write_text("mtllib m.mtl\nv 0 0 0\nv 1 0 0\nv 0 1 0\nusemtl G\nf 1 2 3\n")
    glass = read_meshes(tmp_path / "a.obj", as_file=True).materials[0].glass
    assert glass is not None
    assert (glass.colour, glass.ior) == (pytest.approx(colour), pytest.approx(ior))
    assert glass.covers == (ior == 1.0)
    assert read_meshes(tmp_path / "a.obj").materials[0].left_out == "transmissive"
