"""Frame arrays for COLMAP: read back by a small reader of the published text format, and by pycolmap."""

from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from support.boxarrays import HIGH, LOW, RESOLUTION, colour_at, look_at, plain_manifest, see, write_array
from support.making import export_array

from framearray_cli.array.images import write_layers
from framearray_cli.array.manifest import Manifest, layers_path, manifest_camera
from framearray_cli.base.colour import srgb8_from_linear
from framearray_cli.base.errors import OutputError
from framearray_cli.base.lens import Lens
from framearray_cli.tools.export.colmap import camera_from_world, quaternion
from framearray_cli.tools.export.points import smooth_pixels

FAR = (4e6, -2e5, 7e5)


@dataclass(frozen=True)
class Model:
    """cameras: id -> parameters; images: id -> (quaternion, translation, camera, name, points2d); points: id -> ..."""

    cameras: dict[int, list[str]]
    images: dict[int, tuple[np.ndarray, np.ndarray, int, str, np.ndarray]]
    points: dict[int, tuple[np.ndarray, np.ndarray, np.ndarray]]


def read(folder: Path) -> Model:
    """Read a text model by the published format, independently of the writer."""

    def lines(name: str) -> list[list[str]]:
        text = (folder / name).read_text(encoding="utf-8")
        return [line.split() for line in text.splitlines() if not line.startswith("#")]

    cameras = {int(line[0]): line[1:] for line in lines("cameras.txt")}
    images, rows = {}, lines("images.txt")
    for head, points in zip(rows[::2], rows[1::2], strict=True):
        values = np.array(head[1:8], float)
        triples = np.array(points, float).reshape(-1, 3)
        images[int(head[0])] = (values[:4], values[4:], int(head[8]), head[9], triples)
    points3d = {}
    for line in lines("points3D.txt"):
        track = np.array(line[8:], int).reshape(-1, 2)
        points3d[int(line[0])] = (np.array(line[1:4], float), np.array(line[4:7], int), track)
    return Model(cameras, images, points3d)


def turned(q: np.ndarray, points: np.ndarray) -> np.ndarray:
    """Rotate points by a quaternion (w, x, y, z)."""
    w, v = q[0], q[1:]
    return points + 2 * w * np.cross(v, points) + 2 * np.cross(v, np.cross(v, points))


def falls(model: Model, image: int, points: np.ndarray) -> np.ndarray:
    """Project points into an image by the model: x right, y down, z along the view."""
    q, shift, camera, _, _ = model.images[image]
    x, y, z = (turned(q, points) + shift).T
    fx, fy, cx, cy = np.array(model.cameras[camera][3:], float)
    return np.stack([fx * x / z + cx, fy * y / z + cy], -1)


def falls_by_manifest(manifest: Manifest, c: int, points: np.ndarray, flip: int | None = None) -> np.ndarray:
    """Project points by docs/reference/manifest.md only; `flip` reverses an axis of the camera."""
    matrix = manifest.cameras[c].matrix
    if flip is not None:
        matrix[:3, flip] *= -1
    x, y, z = np.linalg.inv(matrix)[:3] @ np.c_[points, np.ones(len(points))].T
    width, height = manifest.resolution
    half = np.tan(np.radians(manifest.cameras[c].fov) / 2)
    return np.stack([width / 2 + x / -z / half * height / 2, height / 2 - y / -z / half * height / 2], -1)


@pytest.fixture
def array(tmp_path: Path) -> Manifest:
    return write_array(plain_manifest(tmp_path / "out", fov=(60.0, 60.0, 45.0, 60.0)))


def known_points() -> np.ndarray:
    """Points inside the box, in front of all eyes."""
    return np.random.default_rng(2).uniform([-1.5, 0.3, -2.9], [1.5, 2.2, -1.0], (50, 3))


def test_world_points_fall_where_the_manifest_says(array: Manifest, tmp_path: Path) -> None:
    model = read(export_array(array.directory, tmp_path / "x", "colmap").target / "sparse/0")
    assert [image[3] for image in model.images.values()] == [f"c{c:04d}_l001.png" for c in range(4)]
    assert len(model.cameras) == 2
    for c in range(4):
        expected = falls_by_manifest(array, c, known_points())
        np.testing.assert_allclose(falls(model, c + 1, known_points()), expected, atol=1e-8)
        for flip in range(3):
            other = falls_by_manifest(array, c, known_points(), flip)
            assert np.abs(other - expected).max() > 5, "a flipped axis is seen"


def test_points_are_where_the_scene_is_and_tracks_agree_both_ways(array: Manifest, tmp_path: Path) -> None:
    result = export_array(array.directory, tmp_path / "x", "colmap", points=1200)
    model = read(result.target / "sparse/0")
    assert len(model.points) == result.result.points
    assert 600 < result.result.points <= 1200
    position = np.array([point[0] for point in model.points.values()])
    off = np.minimum(np.abs(position - LOW), np.abs(position - HIGH)).min(-1)
    assert off.max() < 1e-5
    codes = np.array([point[1] for point in model.points.values()])
    assert np.abs(codes - srgb8_from_linear(colour_at(position) * 0.8)).max() <= 1
    listed = {(int(triple[2]), image, k) for image, found in model.images.items() for k, triple in enumerate(found[4])}
    tracked = {(point, int(i), int(k)) for point, found in model.points.items() for i, k in found[2]}
    assert listed == tracked
    assert all(len({i for i, _ in found[2]}) == len(found[2]) >= 2 for found in model.points.values())
    for image, found in model.images.items():
        points = np.array([model.points[int(point)][0] for point in found[4][:, 2]])
        np.testing.assert_allclose(found[4][:, :2], falls(model, image, points), atol=1e-4)


def test_a_camera_sees_the_points_that_nothing_hides(tmp_path: Path) -> None:
    """A panel in front of one eye removes from the tracks of that eye what it hides, and nothing else."""
    array = write_array(plain_manifest(tmp_path / "out"))
    depth, _ = see(array, 0)
    panel = np.zeros(depth.shape, bool)
    panel[10:30, 20:40] = True
    write_layers(layers_path(array, 0), {"depth.Z": np.where(panel, 0.7, depth).astype(np.float32)})
    model = read(export_array(array.directory, tmp_path / "x", "colmap", points=4000).target / "sparse/0")
    position = np.array([point[0] for point in model.points.values()])
    off = np.minimum(np.abs(position - LOW), np.abs(position - HIGH)).min(-1)
    walls = off < 1e-4
    assert np.count_nonzero(walls) > 500
    where = falls(model, 1, position)
    inside = ((where > [22, 12]) & (where < [38, 28])).all(-1) & walls
    clear = ((where > [3, 3]) & (where < [17, 37])).all(-1) & walls
    sees = np.array([1 in point[2][:, 0] for point in model.points.values()])
    assert np.count_nonzero(inside) > 50 and not sees[inside].any()
    corners = smooth_pixels(depth.astype(np.float32))
    flat = corners[tuple(where[clear].astype(int).T[::-1])]
    assert np.count_nonzero(flat) > 50 and sees[clear][flat].mean() > 0.9


def test_pixels_that_mix_surfaces_are_not_smooth() -> None:
    y, x = np.mgrid[:20, :30]
    plane = (1 / (0.2 + 0.004 * x + 0.002 * y)).astype(np.float32)
    assert smooth_pixels(plane)[1:-1, 1:-1].all() and not smooth_pixels(plane)[0].any()
    cut = np.where(x < 12, plane, 1.2 * plane).astype(np.float32)
    assert np.flatnonzero(~smooth_pixels(cut)[1:-1].all(0)).tolist() == [0, 11, 12, 29]
    hole = plane.copy()
    hole[5, 7] = 0
    assert not smooth_pixels(hole)[5, 6:9].any() and not smooth_pixels(hole)[4:7, 7].any() and smooth_pixels(hole)[4, 6]


def test_the_same_export_gives_the_same_files(array: Manifest, tmp_path: Path) -> None:
    folders = [export_array(array.directory, tmp_path / name, "colmap", points=300).target for name in ("a", "b")]
    for name in ("cameras", "images", "points3D"):
        texts = [(folder / f"sparse/0/{name}.txt").read_bytes() for folder in folders]
        assert texts[0] == texts[1]


def test_every_light_position_of_a_pose_is_an_image(array: Manifest, tmp_path: Path) -> None:
    target = export_array(array.directory, tmp_path / "x", "colmap", light="0,2", cameras="0,3").target
    model = read(target / "sparse/0")
    assert [image[3] for image in model.images.values()] == [f"c{c:04d}_l{l:03d}.png" for c in (0, 3) for l in (0, 2)]
    for point in model.points.values():
        images = set(point[2][:, 0].tolist())
        assert (1 in images) == (2 in images) and (3 in images) == (4 in images)


def test_an_array_without_layers_gives_only_cameras(tmp_path: Path) -> None:
    array = write_array(plain_manifest(tmp_path / "out", layers=False))
    result = export_array(array.directory, tmp_path / "x", "colmap")
    assert result.notes == ("no points and no depth: the array was rendered without layers (output.layers)",)
    model = read(result.target / "sparse/0")
    assert (len(model.images), len(model.points)) == (4, 0)


turns = st.lists(st.floats(-1, 1), min_size=4, max_size=4).map(np.array).filter(lambda q: np.linalg.norm(q) > 0.1)


@settings(max_examples=200)
@given(turns)
def test_quaternions_turn_as_their_matrices_do(q: np.ndarray) -> None:
    q = q / np.linalg.norm(q)
    matrix = turned(q, np.eye(3)).T
    found = quaternion(matrix)
    assert found[0] >= 0 and np.linalg.norm(found) == pytest.approx(1, abs=1e-14)
    np.testing.assert_allclose(turned(found, np.eye(3)).T, matrix, atol=1e-14)


def test_a_camera_that_looks_along_z_of_colmap() -> None:
    """By hand: an eye at (1, 2, 3) that looks along -z sees (1, 2, 0) three ahead, and (1, 3, 0) above it."""
    matrix = look_at([1, 2, 3], [1, 2, 0])
    turn, shift = camera_from_world(matrix)
    np.testing.assert_allclose(turn @ [1, 2, 0] + shift, [0, 0, 3], atol=1e-15)
    np.testing.assert_allclose(turn @ [1, 3, 0] + shift, [0, -1, 3], atol=1e-15)


# pycolmap


def reconstruction(folder: Path) -> Any:
    pycolmap = pytest.importorskip("pycolmap", reason="pycolmap is not installed")
    return pycolmap.Reconstruction(folder / "sparse/0")


def errors_of(model: Any) -> np.ndarray:
    """Distance between each listed point of a track and its projection by pycolmap, pixels."""
    found = []
    for point in model.points3D.values():
        for element in point.track.elements:
            image = model.images[element.image_id]
            found.append(image.project_point(point.xyz) - image.points2D[element.point2D_idx].xy)
    return np.linalg.norm(np.array(found), axis=-1)


@pytest.mark.parametrize("at", [(0.0, 0.0, 0.0), FAR])
def test_pycolmap_finds_the_points_in_their_images(tmp_path: Path, at: tuple[float, ...]) -> None:
    array = write_array(plain_manifest(tmp_path / "out", fov=(60.0, 60.0, 45.0, 60.0), at=at), at)
    result = export_array(array.directory, tmp_path / "x", "colmap", points=1000)
    model = reconstruction(result.target)
    assert (model.num_images(), model.num_points3D(), model.num_cameras()) == (4, result.result.points, 2)
    assert model.compute_mean_track_length() > 2
    assert errors_of(model).max() < 1e-3
    for c in range(4):
        image = model.images[c + 1]
        assert image.name == f"c{c:04d}_l001.png"
        points = known_points() + at
        theirs = np.array([image.project_point(point) for point in points])
        np.testing.assert_allclose(theirs, falls_by_manifest(array, c, points), atol=1e-4)
        pose = np.vstack([image.cam_from_world().matrix(), [0, 0, 0, 1]])
        np.testing.assert_allclose(np.linalg.inv(pose), array.cameras[c].matrix * [1, -1, -1, 1], atol=1e-8)


@pytest.mark.parametrize("flip", [0, 1, 2])
def test_pycolmap_sees_a_flipped_axis(tmp_path: Path, flip: int) -> None:
    """Points and images of one array with cameras that have one axis reversed."""
    folder = write_array(plain_manifest(tmp_path / "out")).directory
    target = export_array(folder, tmp_path / "x", "colmap", points=300).target / "sparse/0"
    lines = (target / "images.txt").read_text(encoding="utf-8").splitlines()
    for k, line in enumerate(lines):
        if line.endswith(".png"):
            parts = line.split()
            values = np.array(parts[1:8], float)
            rows = turned(values[:4], np.eye(3)).T
            rows[[flip, (flip + 1) % 3]] *= -1  # two rows: reversing one would give no rotation
            shift = values[4:] * np.where(np.isin(np.arange(3), [flip, (flip + 1) % 3]), -1, 1)
            parts[1:8] = [repr(float(value)) for value in (*quaternion(rows), *shift)]
            lines[k] = " ".join(parts)
    (target / "images.txt").write_text("\n".join(lines) + "\n", encoding="utf-8")
    model = reconstruction(target.parents[1])
    found = []
    for point in list(model.points3D.values())[:50]:
        element = point.track.elements[0]
        image = model.images[element.image_id]
        there = image.project_point(point.xyz)
        found.append(RESOLUTION[0] if there is None else np.linalg.norm(there - image.points2D[element.point2D_idx].xy))
    assert np.median(found) > 0.5


# Other lenses


def with_lens(manifest: Manifest, lens: Lens) -> Manifest:
    return replace(manifest, cameras=tuple(manifest_camera(c.world_from_camera, lens) for c in manifest.cameras))


def test_pycolmap_sees_shifted_lenses_and_wide_pixels(tmp_path: Path) -> None:
    lens = Lens(fov=60.0, shift=(0.1, -0.2), pixel_aspect=1.3)
    write_array(with_lens(plain_manifest(tmp_path / "out"), lens))
    export_array(tmp_path / "out", tmp_path / "colmap", "colmap")
    model = reconstruction(tmp_path / "colmap")
    assert len(model.points3D) > 100 and errors_of(model).max() < 1e-3


def test_cameras_that_colmap_has_not_are_refused(tmp_path: Path) -> None:
    write_array(with_lens(plain_manifest(tmp_path / "out"), Lens(type="orthographic", height=2.0)))
    with pytest.raises(OutputError, match=r'cameras\[0\].type: expected "perspective", the only one that COLMAP has'):
        export_array(tmp_path / "out", tmp_path / "colmap", "colmap")
    assert not (tmp_path / "colmap").exists()
