"""The script that Blender runs: its formulas and text here, and with Blender itself its lights against Cycles."""

import json
import math
import os
import re
import runpy
import subprocess
import sys
import tomllib
from pathlib import Path
from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest
from support import ROOT
from support.program import run

from framearray_cli.base.arrays import Float64
from framearray_cli.base.openimage import read_rgb

# A Python with the package bpy; it needs an older numpy than this program.
BPY = os.environ.get("FRAMEARRAY_BPY", "")
SCRIPT = ROOT / "contrib" / "blender" / "framearray_export.py"
SCENES = Path(__file__).parent / "blenderscenes.py"
CASES = ("point", "sun", "spot", "panel", "disk", "warm", "raw")
VIEWS = ("orthographic", "stretched", "panorama")
BLOCK = 10  # pixels, whose mean has a hundredth of their noise


def script() -> Any:
    return SimpleNamespace(**runpy.run_path(str(SCRIPT)))


@pytest.mark.parametrize(("size", "blend"), [(0.6, 0.0), (1.0, 0.3), (2.5, 1.0)])
def test_a_cone_lets_as_much_light_through_as_that_of_blender(size: float, blend: float) -> None:
    """Both edges integrated over the cosine: smoothstep in Blender, a square in glTF."""
    inner, outer = (math.cos(math.radians(angle)) for angle in script().spot_cone(size, blend))
    cosine = np.linspace(math.cos(size / 2), 1.0, 200_001)
    t = np.clip((cosine - outer) / max((1 - outer) * blend, 1e-12), 0, 1)
    blender = (t * t * (3 - 2 * t)).mean()
    gltf = (np.clip((cosine - outer) / max(inner - outer, 1e-12), 0, 1) ** 2).mean()
    assert gltf == pytest.approx(blender, rel=1e-3)


def test_its_tables_are_toml() -> None:
    keys = [{"frame": 0, "eye": [0.1, -2.0, 1e-7]}, {"frame": 1, "eye": [0.0, 1.0, 2.0]}]
    table = {"name": 'a "b" \\ \x7f', "camera": {"fov": 40.0, "keys": keys}}
    table |= {"light": {"frames": 1, "sources": [{"# about": ["Lamp"], "type": "point", "two_sided": False}]}}
    read = tomllib.loads("\n".join(script().toml(table)))
    del table["light"]["sources"][0]["# about"]
    assert read == table


def test_what_stands_still_has_one_key() -> None:
    still, moving = [{"eye": [0.0]}] * 3, [{"eye": [0.0]}, {"eye": [1.0]}]
    assert script().keys_of(still) == [{"frame": 0, "eye": [0.0]}]
    assert [key["frame"] for key in script().keys_of(moving)] == [0, 1]


def test_things_that_move_come_or_go_are_named() -> None:
    still, here, there = [0.0, 1.0], [2.0, 2.0], [2.0, 2.5]
    frames = [{"floor": still, "door": here, "ghost": still}, {"floor": still, "door": there, "bird": here}]
    assert script().moving(frames) == ["door", "ghost", "bird"]
    assert script().moving([{"floor": still}, {"floor": [0.0, 1.00001]}]) == []


def test_a_job_says_what_moves(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    """With a stub of Blender: a door that swings open while the floor lies still."""

    def thing(name: str, moves: bool) -> Any:
        def posed(frame: float) -> Any:
            return SimpleNamespace(matrix_world=np.eye(3) * frame**moves, bound_box=[(1.0, 2.0, 3.0)])

        return SimpleNamespace(name=name, type="MESH", hide_render=False, evaluated_get=posed)

    at = [0.0]
    scene = SimpleNamespace(camera="Eye", frame_start=1, frame_end=5, frame_step=1)
    scene.objects = [thing("floor", False), thing("door", True)]
    scene.frame_set = lambda frame, subframe=0.0: at.append(frame + subframe)
    scene.render, scene.view_settings = SimpleNamespace(fps=24, fps_base=1), SimpleNamespace(exposure=0)
    context = SimpleNamespace(scene=scene, evaluated_depsgraph_get=lambda: at[-1])
    monkeypatch.setitem(sys.modules, "bpy", SimpleNamespace(context=context, data=SimpleNamespace(filepath="a.blend")))
    export = script().Export(SimpleNamespace(format="exr"))
    lamp = {"type": "point", "keys": [{"frame": 0}]}
    parts = {"camera": {"frames": 1}, "lights": [lamp], "shining": [], "world": ([], 0.0), "write_glb": 5.0}
    for name, value in parts.items():
        monkeypatch.setattr(export, name, lambda *_, found=value, **__: found)
    monkeypatch.setattr(export, "vector", np.array)
    export.write(tmp_path / "a.toml")
    note = "note: what moves or changes stands as at the first frame: door\n"
    assert note in capsys.readouterr().out and f"# {note}" in (tmp_path / "a.toml").read_text()
    assert at[1:] == [1, 2, 3, 4, 5, 1]


def test_what_all_frames_have_in_common_is_taken_out_of_their_rows() -> None:
    rows = [{"eye": [k], "fov": 40.0 + k, "shift": [0.1, 0.0]} for k in range(2)]
    same, own = script().common_keys(rows, ("fov", "height", "shift"))
    assert same == {"shift": [0.1, 0.0]}
    assert own == [{"eye": [0], "fov": 40.0}, {"eye": [1], "fov": 41.0}]


def camera(kind: str, tall: float, **more: Any) -> Any:
    """What Blender has of a camera of 4:3 whose picture lies a quarter of its width to the right of the axis."""
    half = tall / 2
    sides = [(4 / 3 * half, half), (4 / 3 * half, -half), (-4 / 3 * half, -half), (-4 / 3 * half, half)]
    corners = [SimpleNamespace(x=x + tall / 3, y=y, z=-1.0) for x, y in sides]
    return SimpleNamespace(type=kind, view_frame=lambda scene: corners, **more)


def test_lenses_are_those_of_the_frame_that_blender_shows() -> None:
    """At a distance of 1: 90 degrees are 2 units high; the shift is a share of the longer side in pixels."""
    row = script().lens_row
    assert row(camera("PERSP", 2.0), None, (80, 60)) == {"fov": 90.0, "shift": [0.25, 0.0]}
    assert row(camera("ORTHO", 3.0), None, (80, 60)) == {"height": 3.0, "shift": [0.25, 0.0]}
    assert row(camera("ORTHO", 3.0), None, (40, 60)) == {"height": 3.0, "shift": [0.166667, 0.0]}  # wide pixels
    assert row(camera("PANO", 3.0), None, (80, 40)) == {}


@pytest.mark.parametrize(
    ("longitude", "size", "problem"),
    [(math.pi, (80, 40), ""), (math.pi, (80, 60), "got 80 x 60 pixels"), (1.0, (80, 40), "360 x 180 degrees")],
)
def test_panoramas_are_whole(longitude: float, size: tuple[int, int], problem: str) -> None:
    ends = {"longitude_min": -longitude, "longitude_max": longitude, "latitude_min": -math.pi / 2}
    data = SimpleNamespace(type="PANO", panorama_type="EQUIRECTANGULAR", latitude_max=math.pi / 2, **ends)
    found = SimpleNamespace(name="Eye", data=data)
    if not problem:
        assert script().Export.camera_type(None, found, size) == "panorama"
        return
    with pytest.raises(SystemExit, match=f"Eye: expected a panorama of .*{problem}"):
        script().Export.camera_type(None, found, size)


@pytest.fixture(scope="module")
def exported(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """Jobs of small scenes, and what Cycles renders of them."""
    if not BPY:
        pytest.skip("FRAMEARRAY_BPY names no Python with the package bpy")
    folder = tmp_path_factory.mktemp("blender")
    subprocess.run(
        [BPY, str(SCENES), str(SCRIPT), str(folder), *CASES, *VIEWS, "walk", "zoom"],
        check=True,
        stdout=subprocess.DEVNULL,
    )
    return folder


def pictures(name: str, exported: Path, capsys: pytest.CaptureFixture[str]) -> tuple[Float64, Float64]:
    """Ours and that of Cycles, of a white floor under one light, all of it direct."""
    job = exported / f"{name}.toml"
    text = re.sub(r"hits = \d+", "hits = 32", job.read_text())
    # the floor has no gloss in Blender; glTF says so by KHR_materials_specular, which would be read as gloss here
    job.write_text(text.replace('surfaces = "file"', 'surfaces = "diffuse"'))
    assert run(capsys, "render", "-q", job).code == 0
    ours = next((exported / "out" / name).glob("*.l000.exr"))
    return read_rgb(ours).astype(float), read_rgb(exported / f"{name}.exr").astype(float)


@pytest.mark.slow
@pytest.mark.parametrize("name", CASES)
def test_lights_are_as_bright_as_in_cycles(name: str, exported: Path, capsys: pytest.CaptureFixture[str]) -> None:
    ours, theirs = pictures(name, exported, capsys)
    np.testing.assert_allclose(ours.mean(axis=(0, 1)), theirs.mean(axis=(0, 1)), rtol=0.02)


@pytest.mark.slow
@pytest.mark.parametrize("name", VIEWS)
def test_lenses_see_what_those_of_cycles_see(name: str, exported: Path, capsys: pytest.CaptureFixture[str]) -> None:
    """Block by block: a lamp is to the side, and the lens shifted, so that no picture is its own mirror image."""
    blocks = [
        picture.reshape(60 // BLOCK, BLOCK, -1, BLOCK, 3).mean(axis=(1, 3))
        for picture in pictures(name, exported, capsys)
    ]
    np.testing.assert_allclose(blocks[0], blocks[1], atol=0.02 * blocks[1].max())


@pytest.mark.slow
def test_a_focal_length_that_changes(exported: Path, capsys: pytest.CaptureFixture[str]) -> None:
    job = tomllib.loads((exported / "zoom.toml").read_text())
    assert run(capsys, "check", exported / "zoom.toml").code == 0
    known = json.loads((exported / "zoom.json").read_text())
    assert [key["fov"] for key in job["camera"]["keys"]] == pytest.approx(known, rel=1e-5)


@pytest.mark.slow
def test_a_camera_and_a_lamp_that_move(exported: Path, capsys: pytest.CaptureFixture[str]) -> None:
    """Positions that the scene has by its key frames, at all frames of both."""
    known = json.loads((exported / "walk.json").read_text())
    job = tomllib.loads((exported / "walk.toml").read_text())
    assert run(capsys, "check", exported / "walk.toml").code == 0
    assert job["output"]["fps"] == known["fps"]
    assert job["camera"]["frames"] == len(known["eyes"])
    eyes = [key["eye"] for key in job["camera"]["keys"]]
    np.testing.assert_allclose(eyes, [[x, z, -y] for x, y, z in known["eyes"]], atol=1e-5)
    (lamp,) = job["light"]["sources"]
    places = [key["position"] for key in lamp["keys"]]
    np.testing.assert_allclose(places, [[x, z, -y] for x, y, z in known["lamps"]], atol=1e-5)
