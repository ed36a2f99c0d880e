"""Frame arrays from Python: pictures, layers, cameras, lights and other light."""

import pickle
from dataclasses import replace
from datetime import datetime
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from support import boxarrays, handmade

import framearray
from framearray_cli.array.images import ImageFormat, read_codes, read_image, write_image
from framearray_cli.array.manifest import BACKGROUND, Manifest, image_path, manifest_camera
from framearray_cli.array.manifest_toml import write_manifest
from framearray_cli.array.pictures import Pictures, Relight
from framearray_cli.base.lens import Lens
from framearray_cli.tools.mixing import SumOptions, open_pictures


@pytest.fixture(scope="module")
def plain(tmp_path_factory: pytest.TempPathFactory) -> framearray.FrameArray:
    return framearray.open(handmade.circled(tmp_path_factory.mktemp("plain")).directory)


@pytest.fixture(scope="module")
def grouped(tmp_path_factory: pytest.TempPathFactory) -> framearray.FrameArray:
    return framearray.open(handmade.grouped(tmp_path_factory.mktemp("grouped")).directory)


def test_names_and_sizes(plain: framearray.FrameArray, grouped: framearray.FrameArray) -> None:
    assert repr(plain) == "<FrameArray 'room': 7 camera positions x 5 of light, 64 x 48 pixels>"
    assert repr(grouped.relight(ambient=2)).endswith("x 3 of light x 2 of lamps, 64 x 48 pixels, relit>")
    assert (plain.resolution, plain.fps, plain.name) == ((64, 48), 24.0, "room")
    assert plain.shape == (7, 5, 48, 64, 3) and grouped.shape == (4, 3, 2, 48, 64, 3)
    assert plain.groups == () and grouped.groups == ("lamps", "sun", BACKGROUND)
    assert plain.is_radiance and plain.is_complete


def test_a_picture_is_its_file_and_belongs_to_the_caller(plain: framearray.FrameArray) -> None:
    picture = plain.picture(3, 2)
    assert picture.dtype == np.float32 and picture.shape == (48, 64, 3)
    np.testing.assert_array_equal(picture, handmade.soft(3, 2, top=6.0))
    np.testing.assert_array_equal(plain.picture(-4, -3), picture)
    picture[:] = 7
    between = plain.picture(3, 2.25)
    np.testing.assert_allclose(between, 0.75 * plain.picture(3, 2) + 0.25 * plain.picture(3, 3), rtol=1e-6)
    between[:] = 7
    assert plain.picture(3, 2.25).max() < 7
    assert plain.file(3, 2) == image_path(plain.manifest, 3, 2)


@pytest.mark.parametrize(
    ("place", "error", "message"),
    [
        ((7, 0), IndexError, r"camera: expected one of 7 camera positions \(0 to 6, or -7 to -1\), got 7"),
        ((0, 4.5), IndexError, r"light: expected one of 5 light positions \(0 to 4, or -5 to -1\), got 4.5"),
        ((0, {"lamps": 0}), KeyError, "no light axis 'lamps'; the array has light"),
        ((1.5, 0), TypeError, "camera: expected a whole number, got 1.5"),
        ((0, float("nan")), TypeError, "light: expected a number, got nan"),
        ((True, 0), TypeError, "camera: expected a whole number, got True"),
    ],
)
def test_positions_that_an_array_lacks(plain, place, error, message) -> None:
    with pytest.raises(error, match=message):
        plain.picture(*place)


def test_pictures_of_groups_are_their_sums(grouped: framearray.FrameArray) -> None:
    right = Pictures(grouped.manifest)
    np.testing.assert_array_equal(grouped.picture(1, {"light": 2, "lamps": 0}), right.picture(1, (2, 0)))
    np.testing.assert_array_equal(grouped.picture(1, 2), right.picture(1, (2, 1)), "the middle of the other axis")
    factors = {"lamps": (0.5, 2.0, 1.0), BACKGROUND: (0.0,) * 3}
    relit = grouped.relight(groups={"lamps": (0.5, 2.0, 1.0)}).relight(groups={BACKGROUND: 0}, ambient=0.25)
    wanted = right.picture(1, (2, 0), Relight(groups=factors, ambient=(0.25,) * 3))
    np.testing.assert_array_equal(relit.picture(1, {"light": 2, "lamps": 0}), wanted)
    assert grouped.file(1, 2, group="sun").name == "room.sun.c0001.l002.exr"
    with pytest.raises(framearray.OutputError, match="expected one of lamps, sun"):
        grouped.file(1, 2)
    with pytest.raises(KeyError, match="no group 'moon'; the array has lamps, sun\""):
        grouped.file(0, 0, group="moon")


def test_sums_are_those_of_the_command_line(plain: framearray.FrameArray, tmp_path: Path) -> None:
    sky = handmade.write_sky(tmp_path / "sky.exr")
    for relit, options in (
        (plain.relight(environment=sky, rotate=90.0), SumOptions(environment=sky, rotate=(90.0, 90.0))),
        (plain.relight(environment=read_image(sky), rotate=90.0), SumOptions(environment=sky, rotate=(90.0, 90.0))),
        (plain.relight(soft=3), SumOptions(soft=3)),
    ):
        pictures, _ = open_pictures(plain.manifest, options)
        np.testing.assert_array_equal(relit.picture(4, 0), pictures.picture(4, (0.0,)))
        assert relit.axes["light"] == (1 if options.collapses else 5)
    assert np.abs(relit.picture(4, 0) - plain.picture(4, 0)).max() > 0.01, "the comparison can fail"


def test_weights_add_pictures_up(plain: framearray.FrameArray) -> None:
    weights = np.array([0.5, 0, 0, 0.25, 0])
    wanted = 0.5 * plain.picture(4, 0) + 0.25 * plain.picture(4, 3)
    for given in (weights, {0: 0.5, -2: (0.25,) * 3}):
        relit = plain.relight(weights=given)
        assert relit.axes["light"] == 1
        np.testing.assert_allclose(relit.picture(4, 0), wanted, rtol=1e-6)
    with pytest.raises(IndexError, match="expected 0, the only light position"):
        plain.relight(weights=weights).picture(0, 1)


@pytest.mark.parametrize(
    ("changes", "error", "message"),
    [
        ({"weights": np.ones(4)}, ValueError, r"weights: expected the shape \(5,\) or \(5, 3\), got \(4,\)"),
        ({"weights": [np.inf] * 5}, ValueError, "weights: expected finite numbers"),
        ({"weights": {5: 1.0}}, IndexError, "weights: expected light positions from 0 to 4, got 5"),
        ({"weights": np.ones(5), "soft": 2}, ValueError, "only one of weights, environment and soft"),
        ({"weights": ["x"] * 5}, ValueError, "weights: expected numbers"),
        ({"soft": "x"}, ValueError, "soft: expected a number of light positions of at least 1, got 'x'"),
        ({"soft": 0.5}, ValueError, "soft: expected a number of light positions of at least 1"),
        ({"ambient": 2.0}, framearray.OutputError, "stores it all together"),
        ({"environment": np.ones((8, 8, 3))}, framearray.OutputError, r"environment: expected a panorama of shape"),
        ({"groups": {"moon": 1}}, KeyError, "no group 'moon'; the array has lamps, sun, background"),
        (
            {"groups": {"lamps": [1, 2]}},
            ValueError,
            r"groups\['lamps'\]: expected a finite number or 3 of them, got \[1, 2\]",
        ),
        ({"groups": {"sun": "x"}}, ValueError, r"groups\['sun'\]: expected a finite number or 3 of them, got 'x'"),
    ],
)
def test_light_that_an_array_cannot_have(plain, grouped, changes, error, message) -> None:
    with pytest.raises(error, match=message):
        (grouped if "groups" in changes else plain).relight(**changes)


def test_light_of_a_map_that_no_position_stands_for_is_a_warning(plain: framearray.FrameArray) -> None:
    near = [
        replace(light, sources=({**light.sources[0], "direction": [0.1 * (l % 3), -1.0, 0.1 * (l // 3)]},))
        for l, light in enumerate(plain.manifest.lights)
    ]
    above = replace(plain, manifest=replace(plain.manifest, lights=tuple(near)))
    with pytest.warns(UserWarning, match="of its light comes from where the array has no light position") as found:
        above.relight(environment=np.ones((16, 32, 3)))
    assert found[0].filename == __file__


@pytest.mark.parametrize("extension", ["png", "exr"])
def test_alpha_is_beside_the_pictures(tmp_path: Path, extension: str) -> None:
    manifest = boxarrays.write_array(boxarrays.plain_manifest(tmp_path, extension=extension, layers=False))
    opaque = framearray.open(tmp_path).picture(1, 2)
    assert framearray.open(tmp_path).alpha(1) is None
    _, alpha = boxarrays.add_alpha(manifest)
    array = framearray.open(tmp_path)
    np.testing.assert_allclose(array.alpha(1), alpha, atol=0.002)
    assert array.picture(1, 2).shape == array.srgb(1, 2).shape == opaque.shape
    np.testing.assert_allclose(array.picture(1, 2), opaque * alpha[..., None], atol=0.01)
    assert (array.srgb(1, 2)[:, 0] == 0).all(), "as before black"


def test_pngs_are_decoded_and_are_no_radiance(tmp_path: Path) -> None:
    manifest = boxarrays.write_array(boxarrays.plain_manifest(tmp_path, layers=False))
    array = framearray.open(tmp_path / "manifest.toml")
    assert not array.is_radiance
    np.testing.assert_array_equal(array.picture(1, 2), read_image(image_path(manifest, 1, 2)))
    np.testing.assert_array_equal(array.srgb(1, 2), read_codes(image_path(manifest, 1, 2)))
    assert array.srgb(1, 2, exposure=1.0).mean() > array.srgb(1, 2).mean() + 20
    with pytest.raises(framearray.OutputError, match="sums of light positions need linear light"):
        array.relight(soft=2)
    with pytest.raises(framearray.OutputError, match="written without layers"):
        array.layers(0)


def test_images_that_are_missing_or_of_another_size(tmp_path: Path) -> None:
    manifest = handmade.plain(tmp_path, n_c=2, n_l=2, layers=False)
    array = framearray.open(tmp_path)
    image_path(manifest, 1, 1).unlink()
    assert not array.is_complete
    with pytest.raises(framearray.OutputError, match="no such file"):
        array.picture(1, 1)
    write_image(image_path(manifest, 1, 1), np.zeros((4, 6, 3), np.float32), ImageFormat())
    with pytest.raises(framearray.OutputError, match="expected 64 x 48 pixels, got 6 x 4"):
        array.picture(1, 1)
    with pytest.raises(framearray.OutputError, match="no such file; expected the output folder"):
        framearray.open(tmp_path / "nowhere")


def test_layers_by_name(tmp_path: Path) -> None:
    handmade.plain(tmp_path, n_c=1, n_l=1)
    layers, channels = framearray.open(tmp_path).layers(0), handmade.layer_channels(0)
    assert set(layers) == {"obscurance", "indirect", "reflectivity", "normal", "depth", "samples"}
    np.testing.assert_allclose(layers["normal"][..., 2], channels["normal.Z"], atol=1e-3)
    np.testing.assert_array_equal(layers["depth"], channels["depth.Z"])
    np.testing.assert_allclose(layers["reflectivity"][..., 0], channels["reflectivity.R"], atol=1e-3)


def cameras_that_agree(manifest: Manifest) -> framearray.Cameras:
    """Compare the points of pixels, and the pixels of points, with pictures in closed form; return the cameras."""
    cameras, (width, height) = framearray.Cameras.of(manifest), manifest.resolution
    for c, camera in enumerate(cameras):
        depth, colour = boxarrays.see(manifest, c)
        points = camera.points(depth)
        np.testing.assert_allclose(boxarrays.colour_at(points.reshape(-1, 3)), colour.reshape(-1, 3), atol=1e-9)
        pixels, depths = camera.project(points)
        x, y = np.meshgrid(np.arange(width) + 0.5, np.arange(height) + 0.5)
        np.testing.assert_allclose(pixels, np.stack([x, y], axis=-1), atol=1e-9)
        np.testing.assert_allclose(depths, depth)
    return cameras


def test_cameras_agree_with_pictures_in_closed_form() -> None:
    cameras = cameras_that_agree(boxarrays.plain_manifest(fov=(60.0, 50.0, 70.0, 60.0)))
    assert len(cameras) == 4 and [camera.index for camera in cameras[1:3]] == [1, 2]
    for c, camera in enumerate(cameras):
        ahead = camera.world_from_camera_cv @ [0, 0, 1, 1]  # along +z of OpenCV
        np.testing.assert_allclose(ahead[:3] - camera.position, -camera.world_from_camera[:3, 2])
        np.testing.assert_allclose(cameras.camera_cv_from_world[c] @ camera.world_from_camera_cv, np.eye(4), atol=1e-12)
    pixels, depths = cameras[0].project(cameras[0].position + cameras[0].world_from_camera[:3, 2])
    assert depths == pytest.approx(-1.0) and np.isnan(pixels).all(), "behind the camera"
    assert np.isnan(cameras[0].points(np.zeros((40, 60)))).all(), "no surface"
    with pytest.raises(IndexError, match=r"camera: expected one of 4 camera positions \(0 to 3, or -4 to -1\), got 4"):
        cameras[4]
    assert cameras[-1].index == 3 and [camera.index for camera in cameras[2:]] == [2, 3]


@pytest.mark.parametrize("kind", ["shifted", "orthographic", "panorama"])
def test_other_cameras_agree_with_pictures_in_closed_form(kind: str) -> None:
    lens = {"orthographic": Lens(type=kind, height=0.9, shift=(0.1, 0.0)), "panorama": Lens(type=kind)}.get(
        kind, Lens(fov=60.0, shift=(0.2, -0.1), pixel_aspect=1.2)
    )
    plain = boxarrays.plain_manifest()
    eyes = tuple(manifest_camera(camera.world_from_camera, lens) for camera in plain.cameras)
    camera = cameras_that_agree(replace(plain, cameras=eyes, resolution=(60, 30)))[-1]
    assert camera.lens == lens and np.isnan(camera.intrinsics).any() == (kind == "panorama")
    assert np.isnan(camera.fov) == (kind != "shifted")


def test_lights(plain: framearray.FrameArray, grouped: framearray.FrameArray, tmp_path: Path) -> None:
    lights = plain.lights
    assert len(lights) == 5 and lights[1].sources[0]["type"] == "directional" and lights[1].time is None
    np.testing.assert_allclose(lights.to_light[1], [1, 0, 0], atol=1e-12)
    assert lights.times is None and repr(lights) == "<Lights: 5 positions along 'light', directional>"
    assert len(grouped.lights_along("lamps")) == 2
    np.testing.assert_allclose(grouped.lights_along("lamps").ambient, [[0.5, 0.4, 0.3], [0.1, 0.1, 0.1]])
    with pytest.raises(KeyError, match="no light axis 'moon'; the array has light, lamps"):
        grouped.lights_along("moon")
    with pytest.raises(IndexError, match=r"lamps: expected one of 2 positions of lamps \(0 to 1, or -2 to -1\), got 2"):
        grouped.lights_along("lamps")[2]
    sunny = [
        replace(light, sources=({**light.sources[0], "time": f"2026-06-21T{6 + l:02d}:00:00+02:00"},))
        for l, light in enumerate(plain.manifest.lights)
    ]
    write_manifest(tmp_path, replace(plain.manifest, lights=tuple(sunny)))
    times = framearray.open(tmp_path).lights.times
    assert times is not None and times[2].replace(tzinfo=None) == datetime(2026, 6, 21, 8)


def test_directions_are_those_of_their_own_axis(grouped: framearray.FrameArray) -> None:
    sun, lamps = ({"type": "directional", "irradiance": [1.0] * 3, "direction": d} for d in ([0, -1, 0], [0, 0, -1]))

    def turned(source: dict[str, Any], n: int, slope: float) -> tuple[Any, ...]:
        down = [{**source, "direction": [slope * l, *source["direction"][1:]]} for l in range(n)]
        return tuple(replace(handmade.light(0, 0, 0), sources=(each,)) for each in down)

    first, second = grouped.manifest.groups
    groups = (replace(first, lights=turned(lamps, 2, 1.0)), replace(second, lights=turned(sun, 3, -1.0)))
    moving = replace(grouped, manifest=replace(grouped.manifest, groups=groups))
    np.testing.assert_allclose(moving.lights_along("lamps").to_light, [[0, 0, 1], [-(0.5**0.5), 0, 0.5**0.5]])
    assert moving.lights.to_light.shape == (3, 3)
    np.testing.assert_allclose(moving.lights.to_light[1], [0.5**0.5, 0.5**0.5, 0])
    stays = replace(first, lights=turned(lamps, 2, 0.0))
    still = replace(moving, manifest=replace(moving.manifest, groups=(stays, groups[1])))
    with pytest.raises(framearray.OutputError, match="to_light needs one source that moves along the light axis lamps"):
        _ = still.lights_along("lamps").to_light


def test_arrays_can_be_pickled(plain: framearray.FrameArray) -> None:
    relit = pickle.loads(pickle.dumps(plain.relight(soft=2)))
    np.testing.assert_array_equal(relit.picture(2, 2), plain.relight(soft=2).picture(2, 2))


def test_sheets_are_shown_by_notebooks(grouped: framearray.FrameArray, tmp_path: Path) -> None:
    sheet = grouped.sheet(cameras="0-2", light="all", at={"lamps": "last"}, exposure=-1.0)
    assert sheet.cameras == (0, 1, 2) and sheet.lights == (0, 1, 2) and sheet.warnings == ()
    assert sheet._repr_png_().startswith(b"\x89PNG") and np.asarray(sheet).shape == sheet.codes.shape
    sheet.save(tmp_path / "sheet.png")
    np.testing.assert_array_equal(read_codes(tmp_path / "sheet.png"), sheet.codes)
    with pytest.raises(framearray.JobError, match=r"^width: .*; try fewer columns$"):
        grouped.sheet(cameras="all", width=10)
    with pytest.raises(framearray.JobError, match=r"^cameras: expected one of 4 camera positions"):
        grouped.sheet(cameras="9")
    dark = grouped.relight(groups=dict.fromkeys(grouped.groups, 0)).sheet(cameras="0-2", light="all")
    assert (dark.codes == 0).all(-1).sum() == 9 * 64 * 48, "no light, no picture"
    shown = grouped._repr_html_()
    assert "4 camera positions x 3 of light x 2 of lamps" in shown and "data:image/png;base64," in shown
    with pytest.raises(framearray.JobError, match="expected one of the axes light, lamps"):
        grouped.sheet(side="moon")


def test_notebooks_show_arrays_that_are_not_there_yet(tmp_path: Path) -> None:
    write_manifest(tmp_path, handmade.grouped_manifest(tmp_path))
    shown = framearray.open(tmp_path)._repr_html_()
    assert "goes on with the rest" in shown and "<img" not in shown
