"""Sums over light positions: options, environments, and curves of movies."""

from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from scipy.spatial import SphericalVoronoi
from support.making import assemble_movie, export_array, make_sheet
from support.movies import DARK, grouped, path_file, plain
from support.program import run

from framearray_cli.array.images import ImageFormat, read_image, read_layers, write_image
from framearray_cli.array.manifest import Manifest, image_path
from framearray_cli.array.manifest_toml import write_manifest
from framearray_cli.array.mixtures import Mixture
from framearray_cli.array.pictures import Pictures
from framearray_cli.base.errors import JobError, OutputError
from framearray_cli.scene.paths.placing import dome_directions
from framearray_cli.tools.mixing import (
    LightField,
    SumOptions,
    environment_weights,
    light_field,
    make_mixer,
    mean_around,
    read_map,
)
from framearray_cli.tools.movie.pathfile import Sweep

UP = np.array([0.0, 1.0, 0.0])


def field(n: int, *, whole: bool = True, up: str = "y") -> LightField:
    top = UP if up == "y" else np.array([0.0, 0.0, 1.0])
    return LightField(to_light=dome_directions(n, top, whole=whole), irradiance=np.ones((n, 3)), up=up)


def with_sources(manifest: Manifest, sources: Any) -> Manifest:
    """Give an array one source at each light position, and a job."""
    lights = tuple(replace(DARK, sources=(each,)) for each in sources)
    changed = replace(manifest, lights=lights, job={"scene": {"up": "y"}, "ambient": {}})
    write_manifest(manifest.directory, changed)
    return changed


def directional(to_light: Any, irradiance: float = 1.0) -> dict[str, Any]:
    return {"type": "directional", "direction": (-np.array(to_light)).tolist(), "irradiance": [irradiance] * 3}


@pytest.fixture
def array(tmp_path: Path) -> Manifest:
    """Light from north, east, south, west, above and below; image l is l + 1 everywhere."""
    ways = [(0, 0, -1), (1, 0, 0), (0, 0, 1), (-1, 0, 0), (0, 1, 0), (0, -1, 0)]
    made = plain(tmp_path / "out", 2, 6, picture=lambda c, l: np.full((8, 12, 3), l + 1.0, np.float32))
    return with_sources(made, [directional(way) for way in ways])


def write_map(file: Path, panorama: Any) -> Path:
    write_image(file, panorama, ImageFormat(half="never"))
    return file


def sky(folder: Path, azimuth_deg: float, elevation_deg: float) -> Path:
    """Write a map that is black but for one bright texel."""
    panorama = np.zeros((18, 36, 3), np.float32)
    panorama[int((90 - elevation_deg) / 10), int((azimuth_deg + 180) / 10) % 36] = 100.0
    return write_map(folder / "sky.exr", panorama)


def weights_of(array: Manifest, sums: SumOptions) -> dict[int, Any]:
    """Return the weight of each light position in a sum, RGB."""
    mixer = make_mixer(array, sums, pytest.fail)
    assert mixer is not None
    mixture = mixer(0.0, 0.0)
    assert isinstance(mixture, Mixture)
    return dict(mixture.weights)


def frames(folder: Path, *ks: int) -> list[float]:
    """The first number of some frames."""
    return [float(read_image(folder / f"f.{k:02d}.exr")[0, 0, 0]) for k in ks]


# environments


def test_an_hdr_map_has_the_radiance_of_its_mantissas_and_exponents(tmp_path: Path) -> None:
    """Twin: the definition of RGBE, (m + 1/2) 2^(e - 136), written byte by byte."""
    random = np.random.default_rng(3)
    mantissa, exponent = random.integers(128, 256, (16, 32, 3)), random.integers(120, 140, (16, 32, 1))
    mantissa[0, 0] = 200  # two bytes of 2 would announce run lengths
    texels = np.concatenate([mantissa, exponent], axis=2).astype(np.uint8)
    header = b"#?RADIANCE\nFORMAT=32-bit_rle_rgbe\n\n-Y 16 +X 32\n"
    (tmp_path / "sky.hdr").write_bytes(header + texels.tobytes())
    radiance = (mantissa + 0.5) * 2.0 ** (exponent - 136)
    np.testing.assert_allclose(read_map(tmp_path / "sky.hdr")[0], radiance, rtol=1 / 256)


def test_texels_that_are_no_radiance_are_repaired_with_a_warning(array: Manifest, tmp_path: Path) -> None:
    file, warnings = sky(tmp_path, 0, 0), list[str]()
    panorama, _ = read_map(file)
    panorama[0, :3] = -1.0
    write_map(file, panorama)
    assert make_mixer(array, SumOptions(environment=file), warnings.append)
    assert [text.split(":")[:2] for text in warnings] == [["sky.exr", " radiance is negative in 3 texels (taken as 0)"]]


@pytest.mark.parametrize("n", [24, 96])
def test_weights_of_a_constant_sky_are_solid_angles(n: int) -> None:
    """Twin: the areas of scipy's spherical Voronoi diagram."""
    light = field(n)
    weights, covered = environment_weights(light, np.ones((128, 256, 3), np.float32), 0.0)
    assert covered == pytest.approx(1, abs=1e-12)
    assert weights.sum(axis=0) == pytest.approx(4 * np.pi)
    areas = SphericalVoronoi(light.to_light).calculate_areas()
    # A texel belongs to one cell: the error is half a texel (0.0123 wide) along the border, of both signs.
    border = 0.5 * (2 * np.pi / 256) * 2 * np.sqrt(np.pi * areas)
    assert (np.abs(weights[:, 0] - areas) < border / 4).all()


def test_a_hemisphere_leaves_out_what_is_below() -> None:
    light = field(64, whole=False)
    weights, covered = environment_weights(light, np.ones((128, 256, 3), np.float32), 0.0)
    # The lowest positions reach below the horizon by at most their distance from each other: sqrt(2 pi / 64) = 0.31.
    assert 0.5 <= covered < 0.5 + 0.31 / 2 * 1.1
    assert weights.sum() / 3 == pytest.approx(covered * 4 * np.pi)


def test_weights_are_divided_by_what_was_rendered() -> None:
    light = field(8)
    ones = environment_weights(light, np.ones((16, 32, 3), np.float32), 0.0)[0]
    strong = replace(light, irradiance=np.tile([2.0, 4.0, 0.0], (8, 1)))
    weights = environment_weights(strong, np.ones((16, 32, 3), np.float32), 0.0)[0]
    np.testing.assert_allclose(weights, ones / [2.0, 4.0, np.inf])


@pytest.mark.parametrize(
    ("azimuth", "elevation", "rotate", "l"),
    [(0, 0, 0, 0), (90, 0, 0, 1), (180, 0, 0, 2), (-90, 0, 0, 3), (0, 85, 0, 4), (40, -85, 0, 5), (0, 0, 90, 1),
     (0, 0, 180, 2), (90, 0, 270, 0), (90, 0, -90, 0)],
)  # fmt: skip
def test_north_is_in_the_middle_of_a_map_and_east_right_of_it(
    array: Manifest, tmp_path: Path, azimuth: float, elevation: float, rotate: float, l: int
) -> None:
    options = SumOptions(environment=sky(tmp_path, azimuth, elevation), rotate=(rotate, rotate))
    low, high = np.radians(np.floor(elevation / 10) * 10 + np.array([0, 10]))
    power = 100 * (np.sin(high) - np.sin(low)) * np.radians(10)
    assert weights_of(array, options) == {l: pytest.approx((power,) * 3, rel=1e-5)}


def test_north_of_a_scene_with_z_up() -> None:
    panorama = np.zeros((32, 64, 3), np.float32)
    panorama[16, 32] = 1.0
    light = field(200, up="z")
    weights, _ = environment_weights(light, panorama, 0.0)
    np.testing.assert_allclose(light.to_light[weights[:, 0].argmax()], [0, 1, 0], atol=0.3)


def test_points_of_a_dome_light_its_middle(array: Manifest) -> None:
    middle, radius = np.array([1.0, 2.0, 3.0]), 2.0
    ways = dome_directions(6, UP, whole=False)
    points = [{"type": "point", "position": (middle + radius * way).tolist(), "intensity": [8.0] * 3} for way in ways]
    found = light_field(with_sources(array, points))
    np.testing.assert_allclose(found.to_light, ways, atol=1e-9)
    np.testing.assert_allclose(found.irradiance, 2.0)


@pytest.mark.parametrize("positions", [np.arange(18.0).reshape(6, 3), np.random.default_rng(3).random((6, 3))])
def test_points_on_no_sphere_are_refused(array: Manifest, positions: Any) -> None:
    points = [{"type": "point", "position": list(map(float, p)), "intensity": [8.0] * 3} for p in positions]
    with pytest.raises(OutputError, match="needs light from a dome or from directions; got points that lie on no"):
        light_field(with_sources(array, points))


def test_lamps_that_shine_one_way_light_no_environment(array: Manifest) -> None:
    ways = dome_directions(6, UP, whole=False)
    spots = [directional(way) | {"type": "spot", "position": way.tolist(), "intensity": [8.0] * 3} for way in ways]
    with pytest.raises(OutputError, match="from points or directions, got type 'spot', which does not shine to all"):
        light_field(with_sources(array, spots))


def test_light_from_all_sides_or_surfaces_lights_no_environment(array: Manifest) -> None:
    turning = [{"type": "environment", "rotation": 60.0 * l, "intensity": [1.0] * 3} for l in range(6)]
    with pytest.raises(OutputError, match="got type 'environment', which comes from all sides"):
        light_field(with_sources(array, turning))
    shining = [{"type": "mesh", "material": "Lamp", "radiance": [float(l)] * 3} for l in range(6)]
    with pytest.raises(OutputError, match="got type 'mesh', which comes from surfaces of the scene"):
        light_field(with_sources(array, shining))


def test_light_from_elsewhere_is_named(array: Manifest, tmp_path: Path) -> None:
    ways = [(0, 1, 0), (0.2, 1, 0), (0, 1, 0.2), (-0.2, 1, 0), (0, 1, -0.2), (0.3, 1, 0)]
    changed = with_sources(array, [directional(np.array(way) / np.linalg.norm(way)) for way in ways])
    said: list[str] = []
    make_mixer(changed, SumOptions(environment=sky(tmp_path, 0, 0)), said.append)
    assert said == [f"{tmp_path / 'sky.exr'}: 100% of its light comes from where the array has no light position"]


def test_maps_that_are_none(array: Manifest, tmp_path: Path) -> None:
    (tmp_path / "bad.exr").write_bytes(b"nothing")
    cases = [
        (tmp_path / "a.png", "expected an environment map with linear light"),
        (tmp_path / "gone.exr", "gone.exr"),
        (tmp_path / "bad.exr", "bad.exr"),
        (write_map(tmp_path / "square.exr", np.ones((8, 8, 3))), "twice as wide as high, got 8 x 8 pixels"),
        (write_map(tmp_path / "black.exr", np.zeros((4, 8, 3))), "expected an environment that shines"),
        (write_map(tmp_path / "dark.exr", np.full((4, 8, 3), -1.0)), "got no radiance above 0"),
    ]
    for file, text in cases:
        with pytest.raises(OutputError, match=text):
            make_mixer(array, SumOptions(environment=file), pytest.fail)


# means and files


def test_a_mean_takes_equal_parts_and_ends_with_the_axis() -> None:
    def shares(*args: Any) -> dict[int, float]:
        return {l: pytest.approx(r) for l, (r, g, b) in mean_around(*args).weights}

    assert shares(5.0, 3.0, 12) == {4: 1 / 3, 5: 1 / 3, 6: 1 / 3}
    assert shares(5.0, 1.0, 12) == {5: 1.0}
    assert shares(5.25, 1.0, 12) == {5: 0.75, 6: 0.25}
    assert shares(5.0, 4.0, 12) == {3: 1 / 8, 4: 1 / 4, 5: 1 / 4, 6: 1 / 4, 7: 1 / 8}
    assert shares(0.0, 5.0, 12) == {0: 1 / 3, 1: 1 / 3, 2: 1 / 3}
    assert shares(0.0, 9.0, 1) == {0: 1.0}
    assert mean_around(3.7, 4.4, 9).is_mean


# what arrays allow


def test_sums_need_linear_light(tmp_path: Path) -> None:
    manifest = plain(tmp_path / "out", 1, 3, "png")
    with pytest.raises(OutputError, match="need linear light, and images are"):
        make_mixer(manifest, SumOptions(soft=2), pytest.fail)


def test_images_with_light_from_cells_add_up_whatever_the_ambient_light(array: Manifest, tmp_path: Path) -> None:
    ambient = {"intensity": [0.1, 0.1, 0.1]}
    options = SumOptions(environment=sky(tmp_path, 0, 0))
    for indirect, refused in ({"method": "obscurance"}, True), ({"method": "cells"}, False):
        changed = replace(array, job={"ambient": ambient, "indirect": indirect})
        if refused:
            with pytest.raises(OutputError, match="ambient light"):
                make_mixer(changed, options, pytest.fail)
        else:
            assert make_mixer(changed, options, pytest.fail) is not None
    lit = replace(changed, job={**changed.job, "scene": {"background": [0.1, 0.1, 0.1]}})
    with pytest.raises(OutputError, match="every image holds the background"):
        make_mixer(lit, options, pytest.fail)


def test_only_one_kind_of_sum(array: Manifest, tmp_path: Path) -> None:
    with pytest.raises(JobError, match="expected only one of --environment and --soft"):
        make_mixer(array, SumOptions(environment=tmp_path / "a.exr", soft=3), pytest.fail)


# pictures


def test_a_sheet_an_export_and_a_sequence_of_a_sum(array: Manifest, tmp_path: Path) -> None:
    sums = SumOptions(environment=sky(tmp_path, 90, 0))
    wanted = 2 * weights_of(array, sums)[1][0]
    made = make_sheet(array.directory, tmp_path / "sheet.exr", sums=sums)
    assert (len(made.cameras), len(made.lights), made.size) == (2, 1, (24, 8))
    np.testing.assert_allclose(read_image(tmp_path / "sheet.exr"), wanted, rtol=2**-11)
    shown = make_sheet(array.directory, tmp_path / "sheet.exr", sums=SumOptions(soft=3), cameras="0", light="0,2")
    assert shown.lights == (0, 2)
    np.testing.assert_allclose(read_image(tmp_path / "sheet.exr")[[0, -1], 0, 0], [1.5, 3], rtol=2**-11)
    export_array(array.directory, tmp_path / "x", "nerfstudio", sums=sums, image_format=ImageFormat(half="never"))
    (_, second) = sorted((tmp_path / "x" / "images").iterdir())
    np.testing.assert_allclose(read_image(second), wanted, rtol=1e-5)
    assemble_movie(array.directory, _path(tmp_path, "frames = 3\nlight = 2"), tmp_path / "f.##.exr", sums=sums)
    np.testing.assert_allclose(read_image(tmp_path / "f.02.exr"), wanted, rtol=2**-11)


@pytest.mark.parametrize("kind", ["rti", "olat"])
def test_an_export_of_single_lights_has_no_sums(array: Manifest, tmp_path: Path, kind: str) -> None:
    with pytest.raises(JobError, match="as a sum of light has no direction"):
        export_array(array.directory, tmp_path / "x", kind, sums=SumOptions(environment=sky(tmp_path, 0, 0)))


def _path(folder: Path, segment: str, more: str = "") -> Path:
    return path_file(folder, f"{more}\n[[segments]]\n{segment}\n")


def test_an_environment_that_turns_along_a_path(array: Manifest, tmp_path: Path) -> None:
    sky(tmp_path, 0, 0)
    power = 100 * np.sin(np.radians(10)) * np.radians(10)
    turn = '[environment]\nfile = "sky.exr"\nrotate = [{time = 0, value = 0}, {time = "100%", value = 270}]\n'
    path = _path(tmp_path, "frames = 4\ncamera = 1", turn + "intensity = 0.5")
    assemble_movie(array.directory, path, tmp_path / "f.##.exr")
    np.testing.assert_allclose(frames(tmp_path, 0, 1, 2), 0.5 * power * np.array([1, 2, 3]), rtol=2**-10)


def test_options_turn_an_environment_during_a_sweep(array: Manifest, tmp_path: Path) -> None:
    sums = SumOptions(environment=sky(tmp_path, 90, 0), rotate=(0.0, 180.0))
    assemble_movie(array.directory, Sweep(kind="walk"), tmp_path / "f.##.exr", sums=sums)
    first, last = frames(tmp_path, 0, 1)
    assert last / first == pytest.approx(4 / 2, rel=2**-9)


def test_an_environment_turns_where_nothing_else_moves(array: Manifest, tmp_path: Path, capsys: Any) -> None:
    panorama, files = sky(tmp_path, 90, 0), tmp_path / "f.##.exr"
    options = ("assemble", array.directory, "--environment", panorama, "--rotate", "0-180", "-o", files)
    result = run(capsys, *options)
    assert (result.code, result.out) == (2, "")
    assert result.err.startswith("--seconds: missing; expected the length of the movie, as only the environment moves")
    assert run(capsys, *options, "--cameras", "1", "--seconds", "0.25").code == 0
    first, last = frames(tmp_path, 0, 5)
    assert last / first == pytest.approx(4 / 2, rel=2**-9)


def test_a_soft_path(array: Manifest, tmp_path: Path) -> None:
    assemble_movie(array.directory, _path(tmp_path, 'frames = 2\nlight = "1-4"', "soft = 3"), tmp_path / "f.##.exr")
    for k, wanted in ((0, 2.0), (1, 5.0)):
        np.testing.assert_allclose(read_image(tmp_path / f"f.{k:02d}.exr"), wanted, rtol=2**-11)


def test_broken_sums_of_a_path(array: Manifest, tmp_path: Path) -> None:
    cases = {
        'soft = 2\n[environment]\nfile = "a.exr"': "soft: expected either environment or soft, got both",
        "soft = 0": "soft: expected a number from 1 to 100000, got 0",
        "[environment]\nrotate = 3": "environment.file: missing; expected a text",
        '[environment]\nfile = "a.exr"\nrotate = "x"': "environment.rotate: expected a number",
        '[environment]\nfile = "sky.exr"\nrotate = [{time = 1, value = 0}, {time = 0, value = 0}]':
            "environment.rotate[1].time: expected at least the time before",
        "soft = [{time = 0, value = 0.5}]": "soft[0].value: expected a number from 1 to 100000, got 0.5",
        "soft = [{time = 1, value = 2}, {time = 0, value = 3}]": "soft[1].time: expected at least the time before",
    }  # fmt: skip
    sky(tmp_path, 0, 0)
    for text, message in cases.items():
        with pytest.raises(JobError) as caught:
            assemble_movie(array.directory, _path(tmp_path, "frames = 2", text), tmp_path / "f.##.exr")
        assert message in str(caught.value), text


def test_other_axes_stay_where_they_are(tmp_path: Path) -> None:
    manifest = grouped(tmp_path / "out")
    pictures = Pictures(manifest)
    axes = list(manifest.axes)
    assert axes == ["light", "lamp"]
    mixture = Mixture(((0, (0.5,) * 3), (2, (0.5,) * 3)))
    made = pictures.picture(0, (mixture, 1))
    wanted = (pictures.picture(0, (0, 1)) + pictures.picture(0, (2, 1))) / 2
    np.testing.assert_allclose(made, wanted, rtol=1e-5, atol=1e-6)


def test_differences_of_halves_add_up(array: Manifest, tmp_path: Path) -> None:
    rng = np.random.default_rng(5)
    halved = replace(array, job=array.job | {"samples": {"halves": True}})
    write_manifest(array.directory, halved)
    signed = rng.normal(size=(6, 8, 12, 3)).astype(np.float16).astype(np.float32)
    for l in range(6):
        image = np.full((8, 12, 3), l + 1.0, np.float32)
        write_image(image_path(array, 0, l), image, ImageFormat(), more={"difference": signed[l]})
    panorama = np.linspace(0.1, 2, 18 * 36 * 3, dtype=np.float32).reshape(18, 36, 3)
    sums = SumOptions(environment=write_map(tmp_path / "sky.exr", panorama.mean(axis=2, keepdims=True).repeat(3, 2)))
    wanted = sum(np.array(weight) * signed[l] for l, weight in weights_of(array, sums).items())
    assemble_movie(array.directory, _path(tmp_path, "frames = 1"), tmp_path / "f.#.exr", sums=sums)
    options = {"cameras": "0", "sums": sums, "image_format": ImageFormat()}
    export_array(array.directory, tmp_path / "x", "colmap", **options)
    for file in (tmp_path / "f.0.exr", *(tmp_path / "x" / "images").iterdir()):
        layers = read_layers(file)
        made = np.stack([layers[f"difference.{channel}"] for channel in "RGB"], axis=-1)
        np.testing.assert_allclose(made, wanted, rtol=2**-11, atol=1e-6)
    assemble_movie(array.directory, _path(tmp_path, "frames = 1"), tmp_path / "g.#.exr")
    assert Pictures(halved).differences(0, (0,)) == {}, "a single image is linked, with its own layers"


def test_light_that_grows_softer(array: Manifest, tmp_path: Path) -> None:
    """At the first position a mean of N reaches to the left end of the axis and (N - 1) / 2 steps to the right."""
    text = 'soft = [{time = 0, value = 1}, {time = "100%", value = 5}]'
    assemble_movie(array.directory, _path(tmp_path, "frames = 5\nlight = 0", text), tmp_path / "f.##.exr")

    def mean(width: float) -> float:
        parts = np.clip(width / 2 + 0.5 - np.arange(6), 0, 1)
        return float((parts * np.arange(1, 7)).sum() / parts.sum())

    found = frames(tmp_path, *range(5))
    np.testing.assert_allclose(found, [mean(width) for width in (1, 2, 3, 4, 5)], rtol=2**-10)
