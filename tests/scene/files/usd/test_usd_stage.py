"""Materials, lights and cameras of USD files."""

import math
import tomllib
import zlib
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from support.scenes import made_png, png
from support.triangles import QUANTITIES, find_numbers
from support.usdfiles import bind, coordinates, mesh, new_stage, preview, pxr, save

from framearray_cli.base.colour import black_body, linear_from_srgb8, srgb_from_linear
from framearray_cli.base.errors import SceneError
from framearray_cli.engine.inputs.surfaces import surfaces
from framearray_cli.scene.files import Stage, StageLight, read_meshes, read_stage, textures
from framearray_cli.scene.files.model import BLACK, CLAMP, MIRROR, REPEAT, WRAP_V
from framearray_cli.scene.scene import load_scene
from framearray_cli.starter.draft import camera_lines
from framearray_cli.starter.staged import choose_camera, convert_camera, convert_lights

pytest.importorskip("pxr", reason="usd-core is not installed (extra usd)")
FIRST, LAST = 0.0, 24.0  # time codes: one second


def put(attribute: Any, value: Any) -> None:
    """Set a value, or those of a list at the first and last frame."""
    if isinstance(value, list):
        for time, each in zip((FIRST, LAST), value, strict=True):
            attribute.Set(each, time)
    else:
        attribute.Set(value)


def shots(tmp_path: Path, **cameras: dict[str, Any]) -> Stage:
    """The stage of a file with these cameras."""
    stage = new_stage(tmp_path / "a.usda")
    mesh(stage, "/World/M")
    for name, values in cameras.items():
        camera = pxr().UsdGeom.Camera.Define(stage, f"/World/{name}")
        for key, value in {"horizontalAperture": 36.0, "verticalAperture": 24.0, **values}.items():
            put(camera.GetPrim().GetAttribute(key), value)
    return read_stage(save(stage))


def test_a_lens_that_shifts_is_that_of_the_first_frame(tmp_path: Path) -> None:
    """Focal length from 12 to 24 mm; the aperture moves by a tenth of its width, which is the longer side."""
    stage = shots(tmp_path, Shot={"focalLength": [12.0, 24.0], "horizontalApertureOffset": 3.6})
    camera = convert_camera(stage, stage.cameras[0], 3, 1.0)
    assert camera.table["shift"] == [0.1, 0.0] and camera.table["fov"] == pytest.approx(90.0, abs=1e-4)
    table = tomllib.loads("\n".join(camera_lines(camera)))["camera"]
    assert table["shift"] == [0.1, 0.0] and table["fov"] == pytest.approx(90.0, abs=1e-4)


def test_the_lens_shift_is_a_share_of_the_longer_side(tmp_path: Path) -> None:
    """The aperture moves up by a quarter of its height: also in pictures that are higher than wide."""
    stage = shots(tmp_path, Shot={"focalLength": 24.0, "verticalApertureOffset": 6.0})
    for resolution, share in (((300, 200), 0.25 / 1.5), ((100, 200), 0.25)):
        table = convert_camera(stage, stage.cameras[0], None, 1.0, resolution).table
        assert table["shift"] == pytest.approx([0, share], abs=1e-6)


def test_orthographic_cameras_see_a_tenth_of_their_aperture(tmp_path: Path) -> None:
    """A perspective comes first all the same."""
    plan = {"projection": "orthographic", "verticalAperture": 20.0}
    stage = shots(tmp_path, Plan=plan, Shot={"focalLength": 24.0})
    chosen = choose_camera(stage, None, "a.usda")
    assert chosen is not None and chosen.name == "Shot"
    camera = convert_camera(stage, stage.cameras[0], 2, 1.0)
    assert (camera.table["type"], camera.table["height"]) == ("orthographic", 2.0)


def test_a_broken_transform_is_one_error_that_names_the_file(tmp_path: Path, capfd: pytest.CaptureFixture) -> None:
    """It is read as an array, and found out when a path is made of it."""
    file = tmp_path / "a.usda"
    order = 'float3 xformOp:rotateXYZ = (1, 2, 3)\n uniform token[] xformOpOrder = ["xformOp:rotat%XYZ"]'
    file.write_text(f'#usda 1.0\ndef Camera "Shot" {{\n float focalLength = 20\n {order}\n}}\n')
    stage = read_stage(file)
    with pytest.raises(SceneError, match=r"a\.usda: broken, or not USD \(.*rotat%XYZ"):
        convert_camera(stage, stage.cameras[0], None, 1.0)
    assert capfd.readouterr() == ("", "")


def test_a_broken_camera_or_light_is_left_out(tmp_path: Path) -> None:
    """Values that are no numbers; a light next to them stays."""
    file = tmp_path / "a.usda"
    camera = 'def Camera "Shot" { \n string focalLength = "long"\n}'
    lamp = 'def SphereLight "Lamp" { \n double3 inputs:radius = (1, 2, 3)\n}'
    good = 'def SphereLight "Good" {\n double3 inputs:color = (1, 0, 0)\n asset inputs:shaping:ies:file = @a.ies@\n}'
    file.write_text(f"#usda 1.0\n{camera}\n{lamp}\n{good}\n")
    stage = read_stage(file)
    assert stage.cameras == () and [light.name for light in stage.lights] == ["Good"]
    assert stage.notes[:2] == (
        "/Shot.focalLength: expected a value of type float; Shot is left out",
        "/Lamp.inputs:radius: expected a value of type float; Lamp is left out",
    )


def lit(tmp_path: Path, **lights: dict[str, Any]) -> tuple[Stage, dict[str, StageLight]]:
    """The stage of a file, and its lights by name."""
    stage = new_stage(tmp_path / "a.usda")
    mesh(stage, "/World/M")
    for name, values in lights.items():
        prim = stage.DefinePrim(f"/World/{name}", values.pop("type", "SphereLight"))
        pxr().UsdLux.ShapingAPI.Apply(prim)
        pxr().UsdGeom.XformCommonAPI(prim).SetScale((values.pop("scale", 1.0),) * 3)
        for key, value in values.items():
            put(prim.GetAttribute(key if key == "visibility" else f"inputs:{key}"), value)
    stage.SetStartTimeCode(FIRST)
    stage.SetEndTimeCode(LAST)
    found = read_stage(save(stage))
    return found, {light.name: light for light in found.lights}


def test_lights_that_change_have_the_values_of_the_first_frame(tmp_path: Path) -> None:
    stage, found = lit(
        tmp_path,
        Grow={"intensity": 1.0, "radius": [0.5, 1.0]},
        Out={"intensity": 4.0, "normalize": True, "visibility": ["inherited", "invisible"]},
    )
    sources, n = convert_lights(stage, 3)
    assert n == 1 and [source.name for source in sources] == ["Grow", "Out"]
    assert found["Grow"].intensity == pytest.approx((math.pi / 4,) * 3) and found["Grow"].radius == 0.5
    assert found["Out"].intensity == pytest.approx((1.0,) * 3)


def test_a_profile_is_left_out_with_its_remedy(tmp_path: Path) -> None:
    stage, found = lit(tmp_path, Lamp={"intensity": 2.0, "normalize": True, "shaping:ies:file": "./lamp.ies"})
    assert found["Lamp"].kind == "point"
    assert stage.notes == ('light Lamp: its IES file is left out; in the job, ies = "./lamp.ies" gives it',)


ST = [(0, 0), (1, 0), (1, 1), (0, 1)]


def shown(tmp_path: Path, **inputs):
    """The material, part and meshes of a square with these inputs of its shader."""
    stage = new_stage(tmp_path / "a.usda")
    shape = mesh(stage, "/World/M")
    coordinates(shape, ST)
    bind(shape.GetPrim(), preview(stage, "Look", **inputs))
    found = read_meshes(save(stage), as_file=True)
    (part,) = found.parts
    return found.materials[part.material], part, found


def test_constants(tmp_path: Path) -> None:
    material, _, _ = shown(tmp_path, diffuseColor=(0.2, 0.4, 0.6), roughness=0.3, metallic=0.25)
    assert material.reflectivity == pytest.approx((0.2, 0.4, 0.6))
    assert (material.roughness, material.metallic) == pytest.approx((0.3, 0.25))


def test_smooth_metal_is_a_mirror_and_clear_surfaces_are_glass(tmp_path: Path) -> None:
    mirror, _, _ = shown(tmp_path, diffuseColor=(0.9, 0.8, 0.7), roughness=0.0, metallic=1.0)
    assert mirror.specular == pytest.approx((0.9, 0.8, 0.7))
    pane, _, _ = shown(tmp_path, opacity=0.1, ior=1.4)
    assert pane.glass is not None and pane.glass.ior == pytest.approx(1.4)
    assert pane.glass.colour == pytest.approx((0.9, 0.9, 0.9))


def test_textures_are_placed_by_their_transform(tmp_path: Path) -> None:
    """Scale, then a quarter turn counter-clockwise, then a move."""
    (tmp_path / "t.png").write_bytes(png(np.full((2, 2, 3), 200, np.uint8)))
    place = {"scale": (2.0, 1.0), "rotation": 90.0, "translation": (0.25, 0.0)}
    material, part, found = shown(tmp_path, diffuseColor=("./t.png", "rgb", place))
    assert material.texture == 0 and found.textures[0][0, 0].tolist() == [200, 200, 200, 255]
    assert material.reflectivity == (1.0, 1.0, 1.0)
    u, v = np.array(ST).T
    expected = np.column_stack([0.25 - v, 2 * u])
    assert part.uvs is not None
    np.testing.assert_allclose(part.uvs.reshape(-1, 2), expected[[0, 1, 2, 0, 2, 3]], atol=1e-12)


@pytest.mark.parametrize(
    ("wrap", "sampler", "columns"),
    [
        ("repeat", REPEAT, (0, 1)),
        ("clamp", CLAMP, (0, 0)),
        ("mirror", MIRROR, (1, 0)),
        ("black", BLACK, None),
        ("useMetadata", REPEAT, (0, 1)),
        (None, REPEAT, (0, 1)),
    ],
)
def test_textures_continue_by_their_wraps(
    tmp_path: Path, wrap: str | None, sampler: int, columns: tuple[int, int] | None
) -> None:
    """At u = -0.75 and -0.25, below the lowest row of two."""
    codes = np.array([[40, 90], [150, 220]], np.uint8)
    (tmp_path / "t.png").write_bytes(png(np.repeat(codes[..., None], 3, axis=2)))
    place = {"scale": (3.0, 3.0), "translation": (-1.0, -1.0), "wrapS": wrap, "wrapT": "clamp"}
    material, _, found = shown(tmp_path, diffuseColor=("./t.png", "rgb", place))
    assert found.samplers[material.texture] == sampler | CLAMP << WRAP_V
    s = surfaces(load_scene(tmp_path / "a.usda", as_file=True))
    np.testing.assert_allclose(s.uvs[0], [(-1, -1), (2, -1), (2, 2)], atol=1e-6)
    points = np.float32([[0.05, 0.65 / 3], [0.1 / 3, 0.1 / 3]])  # (u + v, v) times 3, less 1, in the texture
    out = np.empty((len(QUANTITIES), 3, 2), np.float32)
    find_numbers(s, np.zeros(2, np.int32), points, np.float32([[0, 0], [0, 0], [-1, -1]]), out)
    expected = linear_from_srgb8(codes[1, list(columns)]) if columns else np.zeros(2)
    np.testing.assert_allclose(out[QUANTITIES.index("diffuse"), 0], expected, atol=1e-5)


COLOURED, GREY = png(np.full((1, 1, 3), 100, np.uint8)), png(np.full((1, 1), 100, np.uint8))
DEEP = bytes([0, *[100, 0] * 3])
PROFILE = (b"iCCP", b"sRGB\0\0" + zlib.compress(b"any"))


@pytest.mark.parametrize(
    ("image", "space", "linear"),
    [
        (COLOURED, "raw", True),
        (COLOURED, "sRGB", False),
        (COLOURED, "auto", False),
        (COLOURED, "", False),
        (GREY, "auto", True),
        (GREY, "sRGB", False),
        (made_png(1, 1, DEEP, depth=16), "auto", True),
        (made_png(1, 1, DEEP, depth=16, before=[PROFILE]), "auto", False),
    ],
    ids=("raw", "sRGB", "auto", "none", "grey", "grey sRGB", "deep", "deep with profile"),
)
def test_colours_of_linear_images_become_srgb(tmp_path: Path, image: bytes, space: str, linear: bool) -> None:
    """Without a space: linear if it is grey, or has 16 bits and no profile; numbers stay as they are."""
    (tmp_path / "t.png").write_bytes(image)
    options = {"sourceColorSpace": space}
    inputs = {key: ("./t.png", "rgb", options) for key in ("diffuseColor", "emissiveColor")}
    material, _, found = shown(tmp_path, **inputs, roughness=("./t.png", "r", options))
    expected = round(float(srgb_from_linear(np.array(100 / 255))) * 255) if linear else 100
    for number in (material.texture, material.emission_texture):
        assert found.textures[number][0, 0].tolist() == [expected, expected, expected, 255]
    assert found.textures[material.gloss_texture][0, 0, 1] == 100


def tile(folder: Path, number: int, grey: int, size: int = 2) -> None:
    """Write a tile of a texture, `size` texels wide."""
    (folder / f"t.{number}.png").write_bytes(png(np.full((size, size, 3), grey, np.uint8)))


def test_tiles_lie_one_after_another(tmp_path: Path) -> None:
    """Two to the right and one above; the first of the second row is missing, as a broken one is."""
    for number, grey in ((1001, 50), (1002, 100), (1012, 150)):
        tile(tmp_path, number, grey)
    (tmp_path / "t.1011.png").write_bytes(b"no image")
    material, part, found = shown(tmp_path, diffuseColor=("./t.<UDIM>.png", "rgb", {"scale": (2.0, 1.0)}))
    texels = found.textures[material.texture]
    assert texels[::2, ::2, 0].tolist() == [[0, 150], [50, 100]] and (texels[..., 3] == 255).all()
    assert part.uvs is not None
    np.testing.assert_allclose(part.uvs.reshape(-1, 2), np.multiply(ST, (1, 0.5))[[0, 1, 2, 0, 2, 3]], atol=1e-12)
    assert [note for note in found.notes if "texture" in note] == [
        "texture left out, material Look: not an image that can be read; PNG, JPEG and EXR are"
    ]


def test_the_mean_of_tiles_is_of_those_that_there_are(tmp_path: Path) -> None:
    tile(tmp_path, 1001, 102)
    tile(tmp_path, 1012, 204)
    (tmp_path / "r.png").write_bytes(png(np.full((2, 2, 3), 51, np.uint8)))
    tiles = {"clearcoat": 1.0, "clearcoatRoughness": ("./t.<UDIM>.png", "r")}  # elsewhere than the roughness
    material, _, found = shown(tmp_path, roughness=("./r.png", "r"), **tiles)
    assert found.textures[material.gloss_texture][0, 0].tolist() == [255, 51, 0, 153]
    assert material.coat == 1.0 and "count by their mean" in found.notes[0]


def test_tiles_of_all_sizes_are_joined_and_very_large_ones_reduced(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    tile(tmp_path, 1001, 50)
    tile(tmp_path, 1002, 100, size=8)
    *_, found = shown(tmp_path, diffuseColor=("./t.<UDIM>.png", "rgb"))
    assert found.textures[0].shape == (8, 16, 4) and found.textures[0][0, 7:9, 0].tolist() == [50, 100]
    assert not found.notes
    monkeypatch.setattr(textures, "MOST_TILED", 32)
    *_, found = shown(tmp_path, diffuseColor=("./t.<UDIM>.png", "rgb"))
    assert found.textures[0].shape == (4, 8, 4) and found.textures[0][0, 3:5, 0].tolist() == [50, 100]
    assert found.notes == ("material Look: tiles are reduced to 4 x 4 pixels",)


def test_no_tile_is_a_missing_texture(tmp_path: Path) -> None:
    material, _, found = shown(tmp_path, diffuseColor=("./t.<UDIM>.png", "rgb"))
    assert material.texture == -1
    assert "texture left out, t.1001.png: no such file next to the scene" in found.notes


def test_tiles_lie_next_to_the_layer_that_names_them(tmp_path: Path) -> None:
    """Also in a package."""
    folder = tmp_path / "inner"
    folder.mkdir()
    tile(folder, 1001, 50)
    tile(folder, 1003, 150)
    shown(folder, diffuseColor=("t.<UDIM>.png", "rgb"))
    stage = new_stage(tmp_path / "b.usda")
    stage.GetDefaultPrim().GetReferences().AddReference("inner/a.usda")
    files = [save(stage), tmp_path / "b.usdz"]
    pxr().UsdUtils.CreateNewUsdzPackage(str(folder / "a.usda"), str(files[1]))
    for file in files:
        assert read_meshes(file).textures[0][0, ::2, 0].tolist() == [50, 0, 150]


def test_roughness_and_metal_come_from_any_channels(tmp_path: Path) -> None:
    """Of two images of different sizes, into the green and blue of one."""
    texels = np.zeros((2, 2, 3), np.uint8)
    texels[..., 0] = [[60, 120], [180, 240]]
    (tmp_path / "r.png").write_bytes(png(texels))
    (tmp_path / "m.png").write_bytes(png(np.full((1, 1, 3), 77, np.uint8)))
    material, _, found = shown(tmp_path, roughness=("./r.png", "r"), metallic=("./m.png", "b"))
    packed = found.textures[material.gloss_texture]
    assert packed[..., 1].tolist() == [[60, 120], [180, 240]]
    assert (packed[..., 2] == 77).all()
    assert (material.roughness, material.metallic) == (1.0, 1.0)


def test_missing_textures_are_notes_and_those_elsewhere_refused(tmp_path: Path) -> None:
    material, _, found = shown(tmp_path, diffuseColor=("./gone.png", "rgb"))
    assert material.texture == -1
    assert any("gone.png: no such file" in note for note in found.notes)
    folder = tmp_path / "inner"
    folder.mkdir()
    *_, found = shown(folder, diffuseColor=("../gone.png", "rgb"))  # perhaps of a layer in a folder below
    assert any("gone.png: no such file" in note for note in found.notes)
    (tmp_path / "t.png").write_bytes(png(np.full((2, 2, 3), 200, np.uint8)))
    with pytest.raises(SceneError, match=r"refused to read .*t\.png: it lies outside the scene's folder"):
        shown(folder, diffuseColor=("../t.png", "rgb"))


def test_lights_have_the_strengths_of_the_schema(tmp_path: Path) -> None:
    """Radiance times area, with exposure, temperature and world scale; `normalize` divides by the area."""
    _, found = lit(
        tmp_path,
        Ball={"radius": 0.5, "intensity": 3.0, "exposure": 2.0, "scale": 2.0},
        Even={"radius": 0.1, "intensity": 8.0, "normalize": True},
        Panel={"type": "RectLight", "width": 2.0, "height": 0.5, "intensity": 10.0, "normalize": True}
        | {"enableColorTemperature": True, "colorTemperature": 3000.0},
        Disc={"type": "DiskLight", "radius": 0.3, "intensity": 4.0},
        Sun={"type": "DistantLight", "angle": 1.0, "intensity": 1000.0},
        Spot={"intensity": 1.0, "shaping:cone:angle": 30.0},
    )
    assert found["Ball"].intensity == pytest.approx((12 * math.pi,) * 3) and found["Ball"].radius == pytest.approx(1)
    assert found["Even"].intensity == pytest.approx((2.0,) * 3)
    assert found["Panel"].intensity == pytest.approx([10 * c for c in black_body(3000.0)], rel=1e-6)
    assert found["Panel"].size == pytest.approx((2.0, 0.5))
    assert (found["Disc"].kind, found["Disc"].intensity) == ("disc", pytest.approx((4.0,) * 3))
    sky = math.pi * math.sin(math.radians(0.5)) ** 2
    assert found["Sun"].intensity == pytest.approx((1000 * sky,) * 3)
    assert found["Spot"].cone_deg == pytest.approx((30.0, 30.0))


def test_a_dome_is_left_out_with_its_remedy(tmp_path: Path) -> None:
    stage = new_stage(tmp_path / "a.usda")
    mesh(stage, "/World/M")
    pxr().UsdLux.DomeLight.Define(stage, "/World/Dome").CreateTextureFileAttr("./sky.exr")
    (note,) = read_stage(save(stage)).notes
    assert note.startswith("light Dome: light from all around is left out; ") and note.endswith('file = "./sky.exr"')


def test_cameras_move_by_the_time_codes(tmp_path: Path) -> None:
    library = pxr()
    stage = new_stage(tmp_path / "a.usda", "Z")
    stage.SetTimeCodesPerSecond(48)
    stage.SetFramesPerSecond(25)
    library.UsdGeom.SetStageMetersPerUnit(stage, 0.01)
    mesh(stage, "/World/M")
    camera = library.UsdGeom.Camera.Define(stage, "/World/Shot")
    camera.CreateHorizontalApertureAttr(36.0)
    camera.CreateVerticalApertureAttr(24.0)
    camera.CreateFocalLengthAttr(12.0)
    move = library.UsdGeom.Xformable(camera).AddTranslateOp()
    move.Set((0.0, 0.0, 0.0), 48.0)
    move.Set((4.0, 0.0, 8.0), 144.0)
    found = read_stage(save(stage))
    (shot,) = found.cameras
    assert (shot.name, shot.aspect) == ("Shot", 1.5)
    assert shot.lens.fov_deg == pytest.approx(90.0)
    assert (found.up, found.metres, found.fps) == ("z", pytest.approx(0.01), 25.0)
    assert found.span([shot.node]) == pytest.approx((1.0, 3.0))
    np.testing.assert_allclose(found.world_from(shot.node, [2.0])[0][:3, 3], (2, 0, 4))
    stage.SetTimeCodesPerSecond(-1)  # counts as 24
    stage.SetFramesPerSecond(1e9)
    found = read_stage(save(stage))
    assert found.fps is None and found.span([found.cameras[0].node]) == pytest.approx((2.0, 6.0))


def test_packages_hold_their_own_images(tmp_path: Path) -> None:
    (tmp_path / "t.png").write_bytes(png(np.full((2, 2, 3), 90, np.uint8)))
    shown(tmp_path, diffuseColor=("./t.png", "rgb"))
    pxr().UsdUtils.CreateNewUsdzPackage(str(tmp_path / "a.usda"), str(tmp_path / "b.usdz"))
    (tmp_path / "t.png").unlink()
    found = read_meshes(tmp_path / "b.usdz")
    assert found.textures[0][0, 0].tolist() == [90, 90, 90, 255]


def test_specular_colours_become_base_colour_and_metal(tmp_path: Path) -> None:
    material, _, _ = shown(
        tmp_path, useSpecularWorkflow=1, diffuseColor=(0.0, 0.0, 0.0), specularColor=(0.9, 0.6, 0.3), roughness=0.5
    )
    assert material.metallic == pytest.approx(1.0)
    assert material.reflectivity == pytest.approx((0.9, 0.6, 0.3), abs=1e-6)


def test_textures_of_specular_colours_and_coats_count_texel_by_texel(tmp_path: Path) -> None:
    """A texel of gold and one of paint, with a roughness in the same places."""
    shine = np.array([[[231, 200, 100, 204], [56, 56, 56, 51]]], np.uint8)  # 56: sRGB of 0.04
    for name, texels in (("s", shine), ("d", np.array([[[0, 0, 0, 255], [188, 188, 188, 255]]], np.uint8))):
        (tmp_path / f"{name}.png").write_bytes(png(texels))
    inputs = {"diffuseColor": ("./d.png", "rgb"), "specularColor": ("./s.png", "rgb"), "roughness": ("./s.png", "a")}
    coat = {"clearcoat": ("./s.png", "r"), "clearcoatRoughness": 0.2}
    material, _, found = shown(tmp_path, useSpecularWorkflow=1, **inputs, **coat)
    base, gloss = (found.textures[texture].astype(int)[0] for texture in (material.texture, material.gloss_texture))
    np.testing.assert_allclose(base[:, :3], [[231, 200, 100], [188, 188, 188]], atol=2)
    np.testing.assert_allclose(gloss, [[231, 204, 255, 51], [56, 51, 0, 51]], atol=1)
    assert (material.roughness, material.metallic, material.coat, material.coat_roughness) == (1, 1, 1, 1)
    assert not found.notes
