"""Exports to nerfstudio, and the folder of an export."""

import json
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from scipy.spatial.transform import Rotation
from support.boxarrays import HIGH, LOW, colour_at, grouped_manifest, light, plain_manifest, write_array, write_groups
from support.making import export_array

from framearray_cli.array.images import ImageFormat, read_codes, read_image
from framearray_cli.array.manifest import Manifest, image_path, manifest_camera, matrix_rows
from framearray_cli.array.pictures import Pictures
from framearray_cli.base.colour import linear_from_srgb8, srgb8_from_linear
from framearray_cli.base.errors import JobError, OutputError
from framearray_cli.base.lens import Lens
from framearray_cli.tools.export import EXPORT_KINDS
from framearray_cli.tools.export.format import axis_keys


@pytest.fixture
def array(tmp_path: Path) -> Manifest:
    return write_array(plain_manifest(tmp_path / "out"))


def off_the_box(points: np.ndarray) -> np.ndarray:
    """Distance of points (n, 3) inside the box to its nearest side."""
    to_planes = np.minimum(np.abs(points - LOW), np.abs(points - HIGH)).min(-1)
    outside = np.maximum(np.maximum(LOW - points, points - HIGH), 0).max(-1)
    return np.maximum(to_planes * (outside <= 1e-3), outside)


# nerfstudio


def rays_of(table: dict[str, Any], frame: dict[str, Any], axes: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Starts and rays (h, w, 3) of depth 1 through the middle of each pixel, as nerfstudio makes them: x right, y up,
    looking along -z, ORTHOPHOTO in pixels per unit, EQUIRECTANGULAR with -1 to 1 and -1/2 to 1/2; `axes` are factors
    of these three, to try others."""
    both = table | frame
    x, y = np.meshgrid(np.arange(both["w"]) + 0.5, np.arange(both["h"]) + 0.5)
    s, t = (x - both["cx"]) / both["fl_x"], (both["cy"] - y) / both["fl_y"]
    nothing, one = np.zeros_like(s), np.ones_like(s)
    local, start = [s, t, -one], np.zeros(3)
    if both["camera_model"] == "ORTHOPHOTO":
        local, start = [nothing, nothing, -one], np.stack([s, t, nothing], -1)
    if both["camera_model"] == "EQUIRECTANGULAR":
        theta, phi = -np.pi * s, np.pi * (0.5 - t)
        local = [-np.sin(theta) * np.sin(phi), np.cos(phi), -np.cos(theta) * np.sin(phi)]
    pose = np.array(both["transform_matrix"])
    return start @ pose[:3, :3].T + pose[:3, 3], np.stack(local, -1) * axes @ pose[:3, :3].T


def worst_of(folder: Path, axes: tuple[float, ...] = (1.0, 1.0, 1.0)) -> tuple[float, float]:
    """Over all frames: the largest distance of a pixel's point to the box, and the largest error of its colour."""
    table = json.loads((folder / "transforms.json").read_text(encoding="utf-8"))
    off, wrong = 0.0, 0.0
    for frame in table["frames"]:
        start, rays = rays_of(table, frame, np.array(axes))
        depth = np.load(folder / frame["depth_file_path"]) * 1e-3
        points = start + depth[..., None] * rays
        off = max(off, float(off_the_box(points).max()))
        shown = linear_from_srgb8(read_codes(folder / frame["file_path"]))
        expected = colour_at(points) * 0.8 ** frame["light"]
        wrong = max(wrong, float(np.abs(shown - expected).max()))
    return off, wrong


def test_rays_of_transforms_json_meet_the_scene_at_its_depths(array: Manifest, tmp_path: Path) -> None:
    result = export_array(array.directory, tmp_path / "ns", "nerfstudio", light="all")
    assert (result.result.cameras, result.result.lights, result.notes) == (4, 3, ())
    off, wrong = worst_of(tmp_path / "ns")
    assert off < 1e-5  # depths are float32, up to 6
    assert wrong < 0.5 * 0.0092  # half a code where a code is widest in linear light: at white


@pytest.mark.parametrize(
    ("lens", "model"),
    [
        (Lens(fov=60.0, shift=(0.2, -0.1), pixel_aspect=1.2), "OPENCV"),
        (Lens(type="orthographic", height=0.9, shift=(0.1, 0.0)), "ORTHOPHOTO"),
        (Lens(type="panorama"), "EQUIRECTANGULAR"),
    ],
)
def test_rays_of_other_cameras_meet_the_scene_at_its_depths(tmp_path: Path, lens: Lens, model: str) -> None:
    plain = plain_manifest(tmp_path / "out")
    cameras = tuple(manifest_camera(camera.world_from_camera, lens) for camera in plain.cameras)
    write_array(replace(plain, cameras=cameras, resolution=(60, 30)))
    export_array(tmp_path / "out", tmp_path / "ns", "nerfstudio", light="all")
    assert json.loads((tmp_path / "ns/transforms.json").read_text(encoding="utf-8"))["camera_model"] == model
    off, wrong = worst_of(tmp_path / "ns")
    assert off < 1e-5 and wrong < 0.5 * 0.0092


@pytest.mark.parametrize("axes", [(-1, 1, 1), (1, -1, 1), (1, 1, -1), (1, -1, -1)])
def test_a_flipped_axis_is_seen(array: Manifest, tmp_path: Path, axes: tuple[float, ...]) -> None:
    export_array(array.directory, tmp_path / "ns", "nerfstudio")
    off, wrong = worst_of(tmp_path / "ns", axes)
    assert off > 0.1 and wrong > 0.1


def test_transforms_json_has_what_nerfstudio_needs(array: Manifest, tmp_path: Path) -> None:
    export_array(array.directory, tmp_path / "ns", "nerfstudio")
    table = json.loads((tmp_path / "ns/transforms.json").read_text(encoding="utf-8"))
    assert (table["camera_model"], table["w"], table["h"], table["cx"], table["cy"]) == ("OPENCV", 60, 40, 30.0, 20.0)
    focal = 20 / np.tan(np.radians(30))
    assert table["fl_x"] == table["fl_y"] == pytest.approx(focal, rel=1e-14)
    assert table["camera_angle_x"] == pytest.approx(2 * np.arctan(30 / focal), rel=1e-14)
    names = [frame["file_path"] for frame in table["frames"]]
    assert names == sorted(names) == [f"images/c{c:04d}_l001.png" for c in range(4)]  # the middle light position
    for c, frame in enumerate(table["frames"]):
        assert (frame["camera"], frame["light"]) == (c, 1)
        np.testing.assert_array_equal(frame["transform_matrix"], array.cameras[c].matrix)
        assert frame["pl_pos"] == [0.1, 2.0, -0.5]
        assert frame["pl_intensity"] == [9.0, 7.0, 6.0]
        assert frame["depth_file_path"] == f"depths/c{c:04d}.npy"


@pytest.mark.parametrize("lights", [[light(0, 2)], [light(0, kind="directional")], [light(0, 0)]])
def test_only_a_single_point_source_has_keys_of_its_own(tmp_path: Path, lights: list) -> None:
    array = write_array(plain_manifest(tmp_path / "out", lights=lights))
    export_array(array.directory, tmp_path / "ns", "nerfstudio")
    frame = json.loads((tmp_path / "ns/transforms.json").read_text(encoding="utf-8"))["frames"][0]
    assert "pl_pos" not in frame and "pl_intensity" not in frame


def test_each_frame_has_its_own_lens_where_they_differ(tmp_path: Path) -> None:
    array = write_array(plain_manifest(tmp_path / "out", fov=(60.0, 60.0, 45.0, 60.0)))
    export_array(array.directory, tmp_path / "ns", "nerfstudio")
    table = json.loads((tmp_path / "ns/transforms.json").read_text(encoding="utf-8"))
    assert "fl_x" not in table
    assert len({frame["fl_x"] for frame in table["frames"]}) == 2
    assert worst_of(tmp_path / "ns")[0] < 1e-5


def test_points_lie_on_the_scene(array: Manifest, tmp_path: Path) -> None:
    trimesh = pytest.importorskip("trimesh")
    result = export_array(array.directory, tmp_path / "ns", "nerfstudio", points=900)
    cloud = trimesh.load(tmp_path / "ns/points.ply")
    assert len(cloud.vertices) == result.result.points
    assert 450 < result.result.points <= 900
    assert off_the_box(np.array(cloud.vertices)).max() < 1e-5
    expected = srgb8_from_linear(colour_at(np.array(cloud.vertices)) * 0.8)
    assert np.abs(expected.astype(int) - np.array(cloud.colors)[:, :3]).max() <= 1


def placed(folder: Path) -> tuple[np.ndarray, np.ndarray]:
    """Eyes and points of an export, (n, 3) each, by the published formats."""
    if (model := folder / "sparse/0").exists():
        lines = (model / "images.txt").read_text().splitlines()
        poses = np.array([line.split()[1:8] for line in lines if line.endswith(".png")], float)
        turns = Rotation.from_quat(poses[:, :4], scalar_first=True)
        return turns.inv().apply(-poses[:, 4:]), np.loadtxt(model / "points3D.txt", usecols=(1, 2, 3))
    tables = [json.loads(file.read_text()) for file in sorted(folder.glob("transforms*.json"))]
    eyes = [np.array(frame["transform_matrix"])[:3, 3] for table in tables for frame in table["frames"]]
    return np.array(eyes), np.array(pytest.importorskip("trimesh").load(next(folder.glob("*.ply"))).vertices)


@pytest.mark.parametrize("kind", ["colmap", "nerfstudio", "blender"])
def test_distances_stay_far_from_the_origin(kind: str, tmp_path: Path) -> None:
    """A scene in metres of a national grid, with a point cloud."""
    at = (500000.3, 30.1, 4600000.2)
    array = write_array(plain_manifest(tmp_path / "out", at=at), at)
    eyes, points = placed(export_array(array.directory, tmp_path / "x", kind, points=400).target)
    expected = np.array([camera.matrix[:3, 3] for camera in plain_manifest().cameras])
    assert len(points) > 200 and off_the_box(points - at).max() < 1e-5
    assert np.linalg.norm((eyes - at)[:, None] - expected, axis=-1).min(axis=0).max() < 1e-5


@pytest.mark.filterwarnings("ignore:unclosed file:ResourceWarning")  # nerfbaselines leaves an image open
@pytest.mark.filterwarnings("ignore::pytest.PytestUnraisableExceptionWarning")
def test_nerfbaselines_reads_transforms_json(array: Manifest, tmp_path: Path) -> None:
    module = pytest.importorskip("nerfbaselines.datasets.nerfstudio", reason="nerfbaselines is not installed")
    export_array(array.directory, tmp_path / "ns", "nerfstudio")
    found = {}
    for split in ("train", "test"):
        read = module.load_nerfstudio_dataset(tmp_path / "ns", split)
        found |= dict(zip(read["image_paths"], read["cameras"].poses, strict=True))
        for lens in read["cameras"].intrinsics:
            np.testing.assert_allclose(lens, [20 * 3**0.5, 20 * 3**0.5, 30, 20], rtol=1e-6)
    assert len(found) == 4
    for c, name in enumerate(sorted(found)):
        ours = array.cameras[c].matrix[:3]
        np.testing.assert_allclose(found[name], ours * [1, -1, -1, 1], atol=1e-6)  # theirs: y down, z forward
        assert Path(name).is_file()


def test_groups_are_summed(tmp_path: Path) -> None:
    array = write_groups(grouped_manifest(tmp_path / "out"))
    exr, pictures = ImageFormat(format="exr"), Pictures(array)
    folder = export_array(
        array.directory, tmp_path / "a", "nerfstudio", light="all", at=["lamps=all"], image_format=exr
    )
    frames = json.loads((folder.target / "transforms.json").read_text(encoding="utf-8"))["frames"]
    assert len(frames) == 4 * 3 * 2
    for frame in frames:
        c, l, k = frame["camera"], frame["light"], frame["light_lamps"]
        assert frame["file_path"] == f"images/c{c:04d}_l{l:03d}_lamps{k:03d}.exr"
        expected = pictures.picture(c, (l, k))
        np.testing.assert_allclose(read_image(folder.target / frame["file_path"]), expected, rtol=1e-3)
    result = export_array(array.directory, tmp_path / "b", "nerfstudio", at=["lamps=0"])
    frame = json.loads((result.target / "transforms.json").read_text(encoding="utf-8"))["frames"][0]
    assert (frame["light"], frame["light_lamps"], "pl_pos" in frame) == (1, 0, False)
    np.testing.assert_array_equal(
        read_codes(result.target / frame["file_path"]), srgb8_from_linear(pictures.picture(0, (1, 0)))
    )


def test_keys_of_axes_are_plain_and_differ() -> None:
    assert axis_keys({"light": 2, "lamps": 3}) == {"light": "light", "lamps": "light_lamps"}
    names = axis_keys({"light": 2, "a b": 3, "a/b": 2, "ö": 1})
    assert names == {"light": "light", "a b": "light_a_b", "a/b": "light_a_b_", "ö": "light_"}


# the folder


def names(folder: Path) -> list[str]:
    return sorted(path.relative_to(folder).as_posix() for path in folder.rglob("*"))


def sizes(folder: Path) -> dict[str, int]:
    return {name: (folder / name).stat().st_size for name in names(folder)}


def test_pictures_are_links_where_they_are_the_same(array: Manifest, tmp_path: Path) -> None:
    source = image_path(array, 0, 1).stat().st_ino
    file = "images/c0000_l001.png"
    linked = export_array(array.directory, tmp_path / "a", "colmap").target / file
    copied = export_array(array.directory, tmp_path / "b", "colmap", copy=True).target / file
    brighter = ImageFormat(format="png", exposure=1.0)
    shown = export_array(array.directory, tmp_path / "c", "colmap", image_format=brighter).target / file
    assert (linked.stat().st_ino == source, copied.stat().st_ino == source) == (True, False)
    np.testing.assert_array_equal(read_codes(copied), read_codes(linked))
    np.testing.assert_array_equal(read_codes(shown), srgb8_from_linear(2 * read_image(linked)))
    jpeg = export_array(array.directory, tmp_path / "d", "rti", image_format=ImageFormat(format="jpg")).target
    assert len(list((jpeg / "images").glob("*.jpg"))) == 12


@pytest.mark.parametrize("kind", EXPORT_KINDS)
def test_an_earlier_export_is_replaced_only_by_force(array: Manifest, tmp_path: Path, kind: Any) -> None:
    target = tmp_path / "x"
    export_array(array.directory, target, kind, cameras="all")
    before = sizes(target)
    with pytest.raises(OutputError, match=r"x: an earlier export is there; .* give --force"):
        export_array(array.directory, target, kind, cameras="0-2")
    assert sizes(target) == before
    export_array(array.directory, target, kind, cameras="0,1,last", force=True)
    assert sizes(target) != before
    if kind in ("nerfstudio", "colmap", "rti"):
        assert len(list((target / "images").glob("*.png"))) == (9 if kind == "rti" else 3)
    assert sorted(path.name for path in tmp_path.iterdir()) == ["out", "x"]


@pytest.mark.parametrize("force", [False, True])
def test_other_folders_and_files_are_kept(array: Manifest, tmp_path: Path, force: bool) -> None:
    before = names(array.directory)
    with pytest.raises(OutputError, match=r"holds other files, and no transforms\.json of an earlier export"):
        export_array(array.directory, array.directory, "nerfstudio", force=force)
    assert names(array.directory) == before
    (tmp_path / "file").write_text("mine")
    with pytest.raises(OutputError, match="a file of that name is there"):
        export_array(array.directory, tmp_path / "file", "nerfstudio", force=force)
    (tmp_path / "empty").mkdir()
    export_array(array.directory, tmp_path / "empty", "nerfstudio", force=force)


def test_an_error_leaves_nothing_but_the_old_export(array: Manifest, tmp_path: Path) -> None:
    target = tmp_path / "x"
    export_array(array.directory, target, "nerfstudio", copy=True)
    before = names(target)
    image_path(array, 3, 1).write_bytes(image_path(array, 3, 1).read_bytes()[:200])
    for force, place in ((True, target), (False, tmp_path / "new")):
        with pytest.raises(OutputError, match=r"box\.c0003\.l001\.png"):
            export_array(array.directory, place, "nerfstudio", force=force)
    assert names(target) == before
    assert sorted(path.name for path in tmp_path.iterdir()) == ["out", "x"]


def test_without_layers_there_are_no_points(array: Manifest, tmp_path: Path) -> None:
    bare = write_array(plain_manifest(tmp_path / "bare", layers=False))
    result = export_array(bare.directory, tmp_path / "y", "nerfstudio")
    assert result.notes == ("no points and no depth: the array was rendered without layers (output.layers)",)
    table = json.loads((tmp_path / "y/transforms.json").read_text(encoding="utf-8"))
    assert "ply_file_path" not in table and "depth_file_path" not in table["frames"][0]
    assert export_array(bare.directory, tmp_path / "z", "rti").notes == ()


def test_folders_without_a_name_are_refused(array: Manifest, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.chdir(array.directory)
    for target in (Path("."), Path("..")):
        with pytest.raises(OutputError, match="expected the name of a folder to be made"):
            export_array(array.directory, target, "rti")


def test_no_points_and_one_camera_are_fine(array: Manifest, tmp_path: Path) -> None:
    result = export_array(array.directory, tmp_path / "a", "nerfstudio", points=0)
    assert (result.result.points, result.notes) == (0, ())
    result = export_array(array.directory, tmp_path / "b", "nerfstudio", cameras="2", points=200)
    assert 100 < result.result.points <= 200


@pytest.mark.parametrize(
    ("options", "message"),
    [
        ({"light": "3"}, "--light: expected one of 3 light positions"),
        ({"cameras": "9"}, "--cameras: expected one of 4 camera positions"),
        ({"at": ["lamps=0"]}, "--at: expected AXIS=PLACES"),
    ],
)
def test_places_outside_the_array_are_reported(array: Manifest, tmp_path: Path, options: dict, message: str) -> None:
    with pytest.raises(JobError, match=message):
        export_array(array.directory, tmp_path / "x", "colmap", **options)
    assert not (tmp_path / "x").exists()


def test_poses_that_are_no_motion_are_refused(tmp_path: Path) -> None:
    manifest = plain_manifest(tmp_path / "out")
    first, *others = manifest.cameras
    bad = replace(first, world_from_camera=matrix_rows(first.matrix * [2, 2, 2, 1]))
    broken = write_array(replace(manifest, cameras=(bad, *others)))
    for kind in EXPORT_KINDS:
        with pytest.raises(OutputError, match=r"cameras\[0\]\.world_from_camera: expected a rigid motion"):
            export_array(broken.directory, tmp_path / "x", kind)
