"""COLLADA and 3MF through trimesh: triangles, colours, the up axis and the unit."""

import zipfile
from pathlib import Path

import numpy as np
import pytest

from framearray_cli.scene.files import read_stage
from framearray_cli.scene.scene import load_scene

DAE = """<?xml version="1.0" encoding="utf-8"?>
<COLLADA xmlns="http://www.collada.org/2005/11/COLLADASchema" version="1.4.1">
  <asset><unit name="inch" meter="0.0254"/><up_axis>Z_UP</up_axis></asset>
  <library_effects><effect id="paint"><profile_COMMON><technique sid="common"><lambert>
    <diffuse><color>0.25 0.5 0.75 1</color></diffuse>
  </lambert></technique></profile_COMMON></effect></library_effects>
  <library_materials><material id="blue" name="Blue"><instance_effect url="#paint"/></material></library_materials>
  <library_geometries><geometry id="g" name="sheet"><mesh>
    <source id="p"><float_array id="a" count="12">0 0 0 4 0 0 4 2 0 0 2 0</float_array><technique_common>
      <accessor source="#a" count="4" stride="3"><param name="X" type="float"/><param name="Y" type="float"/>
      <param name="Z" type="float"/></accessor></technique_common></source>
    <vertices id="v"><input semantic="POSITION" source="#p"/></vertices>
    <triangles material="m" count="2"><input semantic="VERTEX" source="#v" offset="0"/><p>0 1 2 0 2 3</p></triangles>
  </mesh></geometry></library_geometries>
  <library_visual_scenes><visual_scene id="s"><node id="n" name="Sheet"><translate>1 0 3</translate>
    <instance_geometry url="#g"><bind_material><technique_common><instance_material symbol="m" target="#blue"/>
    </technique_common></bind_material></instance_geometry></node></visual_scene></library_visual_scenes>
  <scene><instance_visual_scene url="#s"/></scene>
</COLLADA>
"""
MODEL = """<?xml version="1.0" encoding="utf-8"?>
<model unit="inch" xmlns="http://schemas.microsoft.com/3dmanufacturing/core/2015/02"
  xmlns:m="http://schemas.microsoft.com/3dmanufacturing/material/2015/02"><resources>
  <basematerials id="5"><base name="Red" displaycolor="#BC0000"/><base name="White" displaycolor="#FFFFFFFF"/>
  </basematerials><m:colorgroup id="6"><m:color color="#00BC00"/><m:color color="#0000BC"/></m:colorgroup>
  <object id="1" pid="5" pindex="1"><mesh><vertices><vertex x="0" y="0" z="0"/><vertex x="4" y="0" z="0"/>
    <vertex x="4" y="2" z="0"/><vertex x="0" y="2" z="0"/><vertex x="0" y="0" z="3"/></vertices><triangles>
    <triangle v1="0" v2="1" v3="2"/><triangle v1="0" v2="2" v3="3" p1="0"/>
    <triangle v1="0" v2="1" v3="4" pid="6" p1="0" p2="1" p3="0"/></triangles></mesh></object>
  <object id="2"><mesh><vertices><vertex x="0" y="0" z="0"/><vertex x="1" y="0" z="0"/><vertex x="0" y="1" z="0"/>
    </vertices><triangles><triangle v1="0" v2="1" v3="2"/></triangles></mesh></object>
  </resources><build><item objectid="1" transform="1 0 0 0 1 0 0 0 1 10 0 0"/><item objectid="2"/></build></model>
"""


@pytest.fixture
def file(tmp_path: Path) -> Path:
    (tmp_path / "sheet.dae").write_text(DAE)
    return tmp_path / "sheet.dae"


def test_triangles_and_colours(file: Path) -> None:
    pytest.importorskip("collada", reason="reads COLLADA")
    scene = load_scene(file)
    np.testing.assert_allclose(scene.corners.min(axis=(0, 1)) + scene.centre, (1, 0, 3))
    np.testing.assert_allclose(scene.corners.max(axis=(0, 1)) + scene.centre, (5, 2, 3))
    np.testing.assert_allclose(scene.reflectivity[scene.material[0]], (0.25, 0.5, 0.75), atol=1 / 255)


def test_the_up_axis_and_the_unit(file: Path) -> None:
    stage = read_stage(file)
    assert (stage.up, stage.metres) == ("z", 0.0254)
    file.write_text(DAE.replace("Z_UP", "Y_UP").replace('<unit name="inch" meter="0.0254"/>', ""))
    assert (read_stage(file).up, read_stage(file).metres) == ("y", 1.0)


@pytest.mark.parametrize(
    ("unit", "metres"), [(' unit="inch"', 0.0254), ("", 1e-3), (' unit="meter"', 1.0), (' unit="parsec"', None)]
)
def test_colours_and_the_unit_of_a_3mf(tmp_path: Path, unit: str, metres: float | None) -> None:
    """By its object, by a material, corner by corner, and without any."""
    pytest.importorskip("networkx", reason="reads 3MF")
    with zipfile.ZipFile(tmp_path / "a.3mf", "w") as archive:
        archive.writestr("3D/3dmodel.model", MODEL.replace(' unit="inch"', unit))
    assert (read_stage(tmp_path / "a.3mf").up, read_stage(tmp_path / "a.3mf").metres) == ("z", metres)
    scene = load_scene(tmp_path / "a.3mf")
    np.testing.assert_allclose(scene.corners.max(axis=(0, 1)) + scene.centre, (14, 2, 3), rtol=1e-6)
    half, shown = 0.502886, scene.colours * scene.reflectivity[scene.material][:, None]
    green, blue = (0, half, 0), (0, 0, half)
    expected = [[(1, 1, 1)] * 3, [(half, 0, 0)] * 3, [green, blue, green], [(0.5, 0.5, 0.5)] * 3]
    np.testing.assert_allclose(shown, expected, atol=1e-5)
