"""Exports as transforms.json and Hugging Face image folders, read back by other libraries."""

import json
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from support.boxarrays import add_alpha, colour_at, grouped_manifest, plain_manifest, see, write_array, write_groups
from support.making import export_array
from support.movies import DARK

from framearray_cli.array.images import ImageFormat, read_codes
from framearray_cli.array.manifest import Manifest, image_path
from framearray_cli.array.manifest_toml import write_manifest
from framearray_cli.array.pictures import Pictures
from framearray_cli.base.colour import linear_from_srgb8, srgb8_from_linear
from framearray_cli.base.errors import JobError, OutputError


@pytest.fixture
def array(tmp_path: Path) -> Manifest:
    return write_array(plain_manifest(tmp_path / "out"))


def read_set(folder: Path, name: str) -> list[tuple[np.ndarray, np.ndarray, np.ndarray]]:
    """Read a set by its documented format: eye, rays (h, w, 3) of depth 1 and codes of each picture."""
    table = json.loads((folder / f"transforms_{name}.json").read_text(encoding="utf-8"))
    found = []
    for frame in table["frames"]:
        codes = read_codes(folder / f"{frame['file_path']}.png")
        height, width = codes.shape[:2]
        focal = 0.5 * width / np.tan(0.5 * table["camera_angle_x"])
        x, y = np.meshgrid(np.arange(width) + 0.5 - width / 2, np.arange(height) + 0.5 - height / 2)
        pose = np.array(frame["transform_matrix"])
        found.append((pose[:3, 3], np.stack([x / focal, -y / focal, -np.ones_like(x)], -1) @ pose[:3, :3].T, codes))
    return found


def test_rays_of_all_sets_see_the_colours_of_the_scene(array: Manifest, tmp_path: Path) -> None:
    made = export_array(array.directory, tmp_path / "x", "blender")
    assert (made.result.sets, made.result.lights) == ({"train": 2, "val": 1, "test": 1}, 1)
    eyes = []
    for name in ("train", "val", "test"):
        for eye, rays, codes in read_set(tmp_path / "x", name):
            eyes.append(eye.tolist())
            c = next(c for c in range(4) if array.cameras[c].matrix[:3, 3].tolist() == eye.tolist())
            points = eye + see(array, c)[0][..., None] * rays
            wrong = np.abs(linear_from_srgb8(codes) - colour_at(points) * 0.8)
            assert wrong.max() < 0.5 * 0.0092, "half a code where a code is widest in linear light: at white"
    assert sorted(eyes) == sorted(camera.matrix[:3, 3].tolist() for camera in array.cameras), "each camera once"


def test_without_a_set_for_validation_that_of_tests_stands_in(array: Manifest, tmp_path: Path) -> None:
    export_array(array.directory, tmp_path / "x", "blender", split=("test=3",))
    tables = [json.loads((tmp_path / f"x/transforms_{name}.json").read_text()) for name in ("train", "val", "test")]
    assert [[frame["file_path"] for frame in table["frames"]] for table in tables] == [
        [f"./train/c000{c}_l001" for c in range(3)], ["./test/c0003_l001"], ["./test/c0003_l001"]
    ]  # fmt: skip
    assert tables[0]["frames"][1]["pl_pos"] == [0.1, 2.0, -0.5]
    assert not (tmp_path / "x/val").exists()


def test_points_have_the_fields_that_gaussian_splatting_reads(array: Manifest, tmp_path: Path) -> None:
    trimesh = pytest.importorskip("trimesh")
    made = export_array(array.directory, tmp_path / "x", "blender", points=300)
    data = (tmp_path / "x/points3d.ply").read_bytes()
    head = data[: data.index(b"end_header")].decode().splitlines()
    fields = [line.split()[-1] for line in head if line.startswith("property")]
    assert fields == ["x", "y", "z", "nx", "ny", "nz", "red", "green", "blue"]
    cloud = trimesh.load(tmp_path / "x/points3d.ply")
    assert len(cloud.vertices) == made.result.points > 150
    shown = linear_from_srgb8(np.array(cloud.colors)[None, :, :3])[0]
    assert np.abs(shown - colour_at(np.array(cloud.vertices)) * 0.8).max() < 0.01


@pytest.mark.parametrize("extension", ["png", "exr"])
def test_pictures_are_rgba_where_the_array_has_alpha(tmp_path: Path, extension: str) -> None:
    """Colours are not multiplied by alpha, as readers put them over a background of their own."""
    plain = write_array(plain_manifest(tmp_path / "out", extension=extension, layers=False))
    array, alpha = add_alpha(plain)
    export_array(array.directory, tmp_path / "x", "blender")
    for eye, _, codes in read_set(tmp_path / "x", "train"):
        c = next(c for c in range(4) if array.cameras[c].matrix[:3, 3].tolist() == eye.tolist())
        assert codes.shape == (*alpha.shape, 4)
        np.testing.assert_allclose(codes[..., 3], alpha * 255, atol=1)
        solid = alpha > 0.5
        colour = see(array, c)[1] * 0.8
        np.testing.assert_allclose(linear_from_srgb8(codes[solid][:, :3]), colour[solid], atol=0.015)


@pytest.mark.filterwarnings("ignore:unclosed file:ResourceWarning")  # nerfbaselines leaves an image open
@pytest.mark.filterwarnings("ignore::pytest.PytestUnraisableExceptionWarning")
def test_nerfbaselines_reads_the_sets(array: Manifest, tmp_path: Path) -> None:
    module = pytest.importorskip("nerfbaselines.datasets.blender", reason="nerfbaselines is not installed")
    export_array(array.directory, tmp_path / "x", "blender")
    read = module.load_blender_dataset(tmp_path / "x", "train")
    assert len(read["cameras"].poses) == 2


@pytest.mark.parametrize(
    ("options", "error", "message"),
    [
        ({"image_format": ImageFormat(format="exr")}, JobError, "--image-format: expected png for readers of blender"),
        ({"cameras": "0,1"}, JobError, r"--split 80/10/10: expected at least 3 positions on axis camera, got 2"),
    ],
)
def test_what_the_format_cannot_hold(
    array: Manifest, tmp_path: Path, options: dict[str, Any], error: type[Exception], message: str
) -> None:
    with pytest.raises(error, match=message):
        export_array(array.directory, tmp_path / "x", "blender", **options)
    assert not (tmp_path / "x").exists()


def test_several_fields_of_view_are_refused(tmp_path: Path) -> None:
    array = write_array(plain_manifest(tmp_path / "out", fov=(60.0, 60.0, 45.0, 60.0), layers=False))
    with pytest.raises(OutputError, match=r"one camera_angle_x .*, got 60 degrees at camera 0 and 45 at camera 2"):
        export_array(array.directory, tmp_path / "x", "blender")
    export_array(array.directory, tmp_path / "x", "blender", cameras="0,1,3")


AT = {"position": [0.5, 2.0, -1.0], "direction": [0.0, -1.0, 0.0], "intensity": [4.0, 3.0, 2.0]}
SUN = {"azimuth": 180.0, "elevation": 45.0, "time": "2026-06-21T12:00:00+01:00"}


def sources(l: int) -> tuple[dict[str, Any], ...]:
    return (
        {"type": "point", "position": [0.0, 2.0, 0.0], "intensity": [9.0, 7.0, 6.0], "radius": 0.1 * l},
        {"type": "directional", "direction": [0.6, -0.8, 0.0], "irradiance": [3.0, 2.0, 1.0], "angle": 0.53, **SUN},
        {"type": "spot", **AT, "inner": 10.0, "outer": 20.0 + l},
        {"type": "spot", **AT, "ies": "lamp.ies", "up": [1.0, 0.0, 0.0]},
        {"type": "rect", **AT, "across": [1.0, 0.0, 0.0], "width": 0.5, "height": 0.25 * l, "two_sided": False},
        {"type": "disc", **AT, "radius": 0.5, "two_sided": True},
        {"type": "mesh", "material": "Lamp", "radiance": [1.0 * l, 2.0, 3.0], "two_sided": True},
        {"type": "environment", "file": "sky.exr", "rotation": 90.0 * l, "intensity": [1.0, 0.5, 0.25]},
    )


def test_frames_hold_all_sources_of_their_light(tmp_path: Path) -> None:
    at = [replace(DARK, sources=sources(l)) for l in range(3)]
    manifest = write_array(plain_manifest(tmp_path / "out", lights=at))
    folder = export_array(manifest.directory, tmp_path / "ns", "nerfstudio", light="all").target
    frames = json.loads((folder / "transforms.json").read_text(encoding="utf-8"))["frames"]
    assert len(frames) == 3 * manifest.n_cameras
    for frame in frames:
        assert frame["sources"] == list(sources(frame["light"]))
        assert "pl_pos" not in frame, "it names a point that is the only source"
    assert [frame["light"] for frame in frames[:3]] == [0, 1, 2]


LIGHTS = [
    ({"type": "point", "position": [0.0, 2.0, -0.5], "intensity": [8.0, 7.0, 6.0], "radius": 0.1},),
    (
        {"type": "environment", "file": "sky.exr", "rotation": 90.0, "intensity": [1.0, 0.5, 0.25]},
        {"type": "rect", "position": [0.5, 2.0, -1.0], "direction": [0.0, -1.0, 0.0], "intensity": [4.0, 3.0, 2.0],
         "across": [1.0, 0.0, 0.0], "width": 0.5, "height": 0.25, "two_sided": False},
    ),
    ({"type": "directional", "direction": [0.6, -0.8, 0.0], "irradiance": [3.0, 2.0, 1.0], "angle": 0.53},),
]  # fmt: skip
RULES = ("test=3", "val=1")


@pytest.fixture
def table_array(tmp_path: Path) -> Manifest:
    at = [replace(DARK, sources=sources) for sources in LIGHTS]
    return write_array(plain_manifest(tmp_path / "out", lights=at, layers=False))


def test_rows_have_the_same_columns(table_array: Manifest, tmp_path: Path) -> None:
    folder = export_array(table_array.directory, tmp_path / "x", "huggingface", split=RULES).target
    keys, sources = set(), set()
    for name, n in (("train", 6), ("validation", 3), ("test", 3)):
        rows = [json.loads(line) for line in (folder / name / "metadata.jsonl").read_text().splitlines()]
        assert len(rows) == n and {row["file_name"] for row in rows} == {f.name for f in (folder / name).glob("*.png")}
        keys |= {tuple(row) for row in rows}
        sources |= {tuple(source) for row in rows for source in row["sources"]}
        for row in rows:
            given = [{key: value for key, value in source.items() if value is not None} for source in row["sources"]]
            assert given == list(LIGHTS[row["light"]])
    assert len(keys) == len(sources) == 1, "columns of tables want the same keys in every row"


@pytest.mark.parametrize("rules", [(), RULES])
def test_the_library_reads_pictures_and_columns(table_array: Manifest, tmp_path: Path, rules: tuple[str, ...]) -> None:
    datasets = pytest.importorskip("datasets", reason="datasets is not installed")
    folder = export_array(table_array.directory, tmp_path / "x", "huggingface", split=rules).target
    datasets.disable_progress_bars()
    read = datasets.load_dataset(str(folder), cache_dir=str(tmp_path / "cache"))
    wanted = {"train": 6, "validation": 3, "test": 3} if rules else {"train": 12}
    assert {name: len(rows) for name, rows in read.items()} == wanted
    for rows in read.values():
        for row in rows:
            c, l = row["camera"], row["light"]
            np.testing.assert_array_equal(np.asarray(row["image"]), read_codes(image_path(table_array, c, l)))
            np.testing.assert_array_equal(row["transform_matrix"], table_array.cameras[c].matrix)
            given = [{key: value for key, value in source.items() if value is not None} for source in row["sources"]]
            assert given == list(LIGHTS[l])


def test_cameras_of_several_types_have_the_same_columns(table_array: Manifest, tmp_path: Path) -> None:
    kinds = (*table_array.cameras[:3], replace(table_array.cameras[3], type="orthographic", fov=None, height=4.0))
    write_manifest(table_array.directory, replace(table_array, cameras=kinds))
    folder = export_array(table_array.directory, tmp_path / "x", "huggingface", light="0").target
    rows = [json.loads(line) for line in (folder / "train/metadata.jsonl").read_text().splitlines()]
    assert len({tuple(row) for row in rows}) == 1
    assert [row["camera_model"] for row in rows] == [None, None, None, "ORTHOPHOTO"]
    assert [row["camera_angle_x"] is None for row in rows] == [False, False, False, True]


def test_images_that_the_library_cannot_read_are_refused(table_array: Manifest, tmp_path: Path) -> None:
    with pytest.raises(JobError, match="--image-format: expected png or jpg for readers of huggingface, got exr"):
        export_array(table_array.directory, tmp_path / "x", "huggingface", image_format=ImageFormat(format="exr"))


def test_sums_of_groups_and_other_images(tmp_path: Path) -> None:
    array = write_groups(grouped_manifest(tmp_path / "out"))
    jpeg = ImageFormat(format="jpg", exposure=1.0)
    made = export_array(array.directory, tmp_path / "x", "huggingface", cameras="2", image_format=jpeg)
    folder = made.target / "train"
    rows = [json.loads(line) for line in (folder / "metadata.jsonl").read_text().splitlines()]
    assert rows[0]["file_name"] == "c0002_l000_lamps000.jpg"
    (row,) = (row for row in rows if row["file_name"] == "c0002_l001_lamps001.jpg")
    assert (row["light"], row["light_lamps"], row["exposure"]) == (1, 1, 1.0)
    assert [source["group"] for source in row["sources"]] == ["lamps", "sun"]
    expected = srgb8_from_linear(2 * Pictures(array).picture(2, (1, 1))).astype(int)
    assert np.abs(read_codes(folder / row["file_name"]) - expected).mean() < 2  # JPEG
