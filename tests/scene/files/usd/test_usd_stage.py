"""What changes over time in USD files, lenses of all kinds, profiles of lamps, and files that Blender wrote."""

import math
import tomllib
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from support.iesfiles import VARIANTS
from support.usdfiles import mesh, new_stage, pxr, save

from framearray_cli.base.colour import black_body
from framearray_cli.base.errors import SceneError
from framearray_cli.base.openimage import write_environment
from framearray_cli.scene.files import Stage, StageLight, read_stage
from framearray_cli.starter.staged import choose_camera, convert_camera, convert_lights
from framearray_cli.starter.text import camera_lines

pytest.importorskip("pxr", reason="usd-core is not installed (extra usd)")
FIRST, LAST = 0.0, 24.0  # time codes: one second


def shots(tmp_path: Path, **cameras: dict[str, Any]) -> Stage:
    """The stage of a file with these cameras; a list is the values at its first and last frame."""
    stage = new_stage(tmp_path / "a.usda")
    mesh(stage, "/World/M")
    for name, values in cameras.items():
        camera = pxr().UsdGeom.Camera.Define(stage, f"/World/{name}")
        for key, value in {"horizontalAperture": 36.0, "verticalAperture": 24.0, **values}.items():
            attribute = camera.GetPrim().GetAttribute(key)
            for time, each in zip((FIRST, LAST), value, strict=True) if isinstance(value, list) else ():
                attribute.Set(each, time)
            if not isinstance(value, list):
                attribute.Set(value)
    return read_stage(save(stage))


def test_a_lens_that_zooms_and_shifts_is_a_key_per_frame(tmp_path: Path) -> None:
    """Focal length from 12 to 24 mm; the aperture moves by a tenth of its width, which is the longer side."""
    stage = shots(tmp_path, Shot={"focalLength": [12.0, 24.0], "horizontalApertureOffset": 3.6})
    camera = convert_camera(stage, stage.cameras[0], 3, 1.0)
    whole = {key: value for key, value in camera.table.items() if key != "keys"}
    assert whole == {"resolution": [360, 240], "shift": [0.1, 0.0], "frames": 3}
    expected = [math.degrees(2 * math.atan(12 / focal)) for focal in (12.0, 18.0, 24.0)]
    assert [key["fov"] for key in camera.keys] == pytest.approx(expected, abs=1e-4)
    table = tomllib.loads("\n".join(camera_lines(camera)))["camera"]
    assert [key["fov"] for key in table["keys"]] == pytest.approx(expected, abs=1e-4)
    assert table["shift"] == [0.1, 0.0] and "fov" not in table


def test_the_lens_shift_is_a_share_of_the_longer_side(tmp_path: Path) -> None:
    """The aperture moves up by a quarter of its height: also in pictures that are higher than wide."""
    stage = shots(tmp_path, Shot={"focalLength": 24.0, "verticalApertureOffset": 6.0})
    for resolution, share in (((300, 200), 0.25 / 1.5), ((100, 200), 0.25)):
        table = convert_camera(stage, stage.cameras[0], None, 1.0, resolution).table
        assert table["shift"] == pytest.approx([0, share], abs=1e-6)


def test_orthographic_cameras_see_a_tenth_of_their_aperture(tmp_path: Path) -> None:
    """Also one whose aperture changes; a perspective comes first all the same."""
    plan = {"projection": "orthographic", "verticalAperture": [20.0, 40.0]}
    stage = shots(tmp_path, Plan=plan, Shot={"focalLength": 24.0})
    chosen = choose_camera(stage, None, "a.usda")
    assert chosen is not None and chosen.name == "Shot"
    camera = convert_camera(stage, stage.cameras[0], 2, 1.0)
    assert camera.table["type"] == "orthographic" and "height" not in camera.table
    assert [key["height"] for key in camera.keys] == [2.0, 4.0]


def test_a_broken_transform_is_one_error_that_names_the_file(tmp_path: Path, capfd: pytest.CaptureFixture) -> None:
    """It is read as an array, and found out when a path is made of it."""
    file = tmp_path / "a.usda"
    order = 'float3 xformOp:rotateXYZ = (1, 2, 3)\n uniform token[] xformOpOrder = ["xformOp:rotat%XYZ"]'
    file.write_text(f'#usda 1.0\ndef Camera "Shot" {{\n float focalLength = 20\n {order}\n}}\n')
    stage = read_stage(file)
    with pytest.raises(SceneError, match=r"a\.usda: broken, or not USD \(.*rotat%XYZ"):
        convert_camera(stage, stage.cameras[0], None, 1.0)
    assert capfd.readouterr() == ("", "")


def lit(tmp_path: Path, layer: str = "", **lights: dict[str, Any]) -> tuple[Stage, dict[str, StageLight]]:
    """The stage of a file, and its lights by name; a list is the values at its first and last frame."""
    stage = new_stage(tmp_path / "a.usda")
    mesh(stage, "/World/M")
    for name, values in lights.items():
        prim = stage.DefinePrim(f"/World/{name}", values.pop("type", "SphereLight"))
        pxr().UsdLux.ShapingAPI.Apply(prim)
        for key, value in values.items():
            attribute = prim.GetAttribute(key if key == "visibility" else f"inputs:{key}")
            for time, each in zip((FIRST, LAST), value, strict=True) if isinstance(value, list) else ():
                attribute.Set(each, time)
            if not isinstance(value, list):
                attribute.Set(value)
    stage.GetRootLayer().documentation = layer
    stage.SetStartTimeCode(FIRST)
    stage.SetEndTimeCode(LAST)
    found = read_stage(save(stage))
    return found, {light.name: light for light in found.lights}


def test_lights_that_change_are_keys_of_strength_and_size(tmp_path: Path) -> None:
    """One fades in from black, one grows at the same radiance, one goes out by its visibility; one stays."""
    stage, _ = lit(
        tmp_path,
        Fade={"intensity": [0.0, 8.0], "normalize": True},
        Grow={"intensity": 1.0, "radius": [0.5, 1.0]},
        Out={"intensity": 4.0, "normalize": True, "visibility": ["inherited", "invisible"]},
        Stay={"intensity": 4.0, "normalize": True},
    )
    sources, n = convert_lights(stage, 3)
    assert n == 3
    by_name = {source.name: source for source in sources}
    power = {name: [key["intensity"][0] for key in source.keys] for name, source in by_name.items()}
    assert power["Fade"] == pytest.approx([0.0, 1.0, 2.0])
    assert power["Grow"] == pytest.approx([math.pi / 4, math.pi * 0.75**2, math.pi])
    assert [key["radius"] for key in by_name["Grow"].keys] == pytest.approx([0.5, 0.75, 1.0])
    assert power["Out"] == pytest.approx([1.0, 1.0, 0.0])
    assert power["Stay"] == pytest.approx([1.0])
    assert by_name["Fade"].about == ('the point light "Fade" of the file, there at most 2 cd by UsdLux',)


def test_a_profile_is_that_of_the_lamp_in_candela(tmp_path: Path) -> None:
    """The schema multiplies radiance by the candela of the file; one in a package cannot be read."""
    text = next(iter(VARIANTS.values()))
    (tmp_path / "lamp.ies").write_text(text)
    from framearray_cli.job.ies import read_photometry

    web = read_photometry(tmp_path / "lamp.ies")
    peak = web.factor * max(map(max, web.candela))
    _, found = lit(tmp_path, Lamp={"intensity": 2.0, "normalize": True, "shaping:ies:file": "./lamp.ies"})
    assert found["Lamp"].kind == "spot" and found["Lamp"].profile == tmp_path / "lamp.ies"
    assert found["Lamp"].intensity == pytest.approx((0.5 * peak,) * 3)
    pxr().UsdUtils.CreateNewUsdzPackage(str(tmp_path / "a.usda"), str(tmp_path / "b.usdz"))
    packed = read_stage(tmp_path / "b.usdz")
    assert packed.lights[0].profile is None
    assert packed.notes == (
        "light Lamp: its IES file lies inside the package and is left out; save it next to the scene",
    )


@pytest.mark.parametrize(
    ("layer", "turned"), [("Blender v5.0.1", None), ("Blender v5.0.1", (90, 0, 90)), ("", (90, 0, 90))]
)
def test_the_middle_of_an_image_in_blender_lies_towards_x(tmp_path: Path, layer: str, turned: Any) -> None:
    """As its exporter turns it, or would if it did not leave that out."""
    pixels = np.full((16, 32, 3), 0.25, np.float32)
    pixels[4:6, 15:17] = (4.0, 0.0, 0.0)  # in the middle, halfway above the horizon
    write_environment(tmp_path / "sky.exr", pixels)
    stage = new_stage(tmp_path / "a.usda", "Z")
    mesh(stage, "/World/M")
    dome = pxr().UsdLux.DomeLight.Define(stage, "/World/Dome")
    dome.CreateTextureFileAttr("./sky.exr")
    pxr().UsdGeom.XformCommonAPI(dome).SetRotate(turned or (0, 0, 0))
    stage.GetRootLayer().documentation = layer
    around = read_stage(save(stage)).environment
    assert around is not None
    rows, columns = np.nonzero(around.pixels[..., 0] > 2)
    assert set(rows) == {4, 5} and set(columns) == {23, 24}  # x is east, right of north


def test_what_blender_writes_is_read_as_it_means_it(tmp_path: Path) -> None:
    """A sun of 6 W/m2 and 2 degrees, and a white bulb, as Blender 5 writes them; the same by the schema otherwise."""
    sun = {"type": "DistantLight", "intensity": 1.5, "angle": 1.0, "normalize": True}
    bulb = {"intensity": 4.0, "normalize": True, "enableColorTemperature": True}
    spot = {"intensity": 4.0, "normalize": True, "shaping:cone:angle": 60.0, "shaping:cone:softness": 0.5}
    tables = {"Sun": sun, "Bulb": bulb, "Spot": spot}
    _, found = lit(tmp_path, "Blender v5.0.1", **{name: dict(values) for name, values in tables.items()})
    assert found["Sun"].intensity == pytest.approx((6.0,) * 3) and found["Sun"].angle_deg == pytest.approx(2.0)
    assert found["Bulb"].intensity == pytest.approx((1.0,) * 3)
    inner, outer = (math.cos(math.radians(angle)) for angle in found["Spot"].cone_deg or ())
    assert (inner - outer) / (1 - outer) == pytest.approx(0.75 * 0.5)  # three quarters of its edge, in the cosine
    (tmp_path / "other").mkdir()
    _, plain = lit(tmp_path / "other", "Made by hand", **tables)
    assert plain["Sun"].intensity == pytest.approx((1.5,) * 3) and plain["Sun"].angle_deg == pytest.approx(1.0)
    np.testing.assert_allclose(plain["Bulb"].intensity, black_body(6500.0), rtol=1e-6)
