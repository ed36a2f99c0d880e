"""Eye rays and their inverse."""

from typing import Any

import numpy as np
import pytest
from support import oracle_lens, tiny

from framearray_cli.base.lens import Lens, fov_of_focal, shift_of_centre
from framearray_cli.engine.inputs.cameras import (
    OUTSIDE,
    Cameras,
    angle_of,
    cameras,
    eye_ray,
    lens_density,
    lens_position,
    lens_ray,
    picture_rays,
    project_to_pixel,
    resized,
    sine_and_cosine,
)
from framearray_cli.engine.kernels.kernel import kernel
from framearray_cli.scene.paths.paths import Eyes, eyes


@kernel
def there_and_back(cams: Cameras, c: int, jitter: Any, length: float, pixels: Any, depths: Any) -> None:
    """Project a point on the eye ray through each pixel, at a depth."""
    for p in range(cams.width * cams.height):
        x, y, z = eye_ray(cams, c, p % cams.width + jitter[p, 0], p // cams.width + jitter[p, 1])
        pixels[p], depths[p] = project_to_pixel(
            cams, c, np.float32(x * length), np.float32(y * length), np.float32(z * length)
        )


@kernel
def project_all(cams: Cameras, c: int, vectors: Any, pixels: Any) -> None:
    for i in range(vectors.shape[0]):
        pixels[i], _ = project_to_pixel(cams, c, vectors[i, 0], vectors[i, 1], vectors[i, 2])


def some_cameras(resolution: tuple[int, int] = (400, 300), fov: float = 60.0) -> Cameras:
    """Three eyes: along an axis, askew, and upside down."""
    keys = [
        {"frame": 0, "eye": [0, 0, 0], "target": [0, 0, -1], "up": [0, 1, 0]},
        {"frame": 1, "eye": [3, 1, 2], "target": [-1, 0.3, 0.7], "up": [0.3, 1, 0.1]},
        {"frame": 2, "eye": [-2, 5, 1], "target": [0, 0, 0], "up": [0.4, -1, 0.5]},
    ]
    job = tiny.job(camera={"resolution": list(resolution), "fov": fov, "frames": 3, "keys": keys})
    return cameras(eyes(job), resolution, np.zeros(3))


def vectors_of(cams: Cameras, c: int, combinations: Any) -> Any:
    """Vectors from right, up and forward parts, (n, 3)."""
    return np.asarray(combinations, np.float32) @ np.stack([cams.right[c], cams.up[c], cams.forward[c]])


@pytest.mark.parametrize("resolution", [(400, 300), (64, 48), (1, 1), (7, 31)])
@pytest.mark.parametrize("fov", [5.0, 60.0, 150.0])
def test_the_eye_ray_of_a_pixel_projects_into_that_pixel(resolution: tuple[int, int], fov: float) -> None:
    cams = some_cameras(resolution, fov)
    n = resolution[0] * resolution[1]
    pixels, depths = np.empty(n, np.int32), np.empty(n, np.float64)
    rng = np.random.default_rng(1)
    for c in range(3):
        for length in (1e-3, 1.0, 1e5):
            # a pixel's border itself may round to its neighbour: positions carry 2^-24 of some hundred pixels
            for jitter in (np.full((n, 2), 0.5), rng.uniform(0.001, 0.999, (n, 2))):
                there_and_back(cams, c, jitter.astype(np.float32), length, pixels, depths)
                np.testing.assert_array_equal(pixels, np.arange(n))
                np.testing.assert_allclose(depths, length, rtol=3e-6)


def test_what_is_behind_or_beside_the_image_is_outside() -> None:
    cams = some_cameras((40, 30), 90.0)  # 45 degrees up and down, 4:3 wide
    combinations = [
        [0, 0, -1], [0, 0, 0], [0.1, 0.2, -1], [1.34, 0, 1], [-1.34, 0, 1], [0, 1.01, 1], [0, -1.01, 1], [1, 0, 0],
    ]  # fmt: skip
    inside = [[0, 0, 1], [1.33, 0, 1], [-1.33, 0.99, 1], [0, -0.99, 1]]
    pixels = np.empty(len(combinations), np.int32)
    for c in range(3):
        project_all(cams, c, vectors_of(cams, c, combinations), pixels)
        assert (pixels == OUTSIDE).all()
        found = np.empty(len(inside), np.int32)
        project_all(cams, c, vectors_of(cams, c, inside), found)
        assert (found >= 0).all()
        assert found[2] == 0, "up and left is the first pixel"


def test_what_is_not_a_number_is_outside() -> None:
    cams, pixels = some_cameras(), np.empty(3, np.int32)
    vectors = np.float32([[np.nan, 0, -1], [0, 0, np.nan], [np.inf, 0, -1]])
    project_all(cams, 0, vectors, pixels)
    assert (pixels == OUTSIDE).all()


def test_the_field_of_view_is_vertical() -> None:
    cams = some_cameras((40, 30), 60.0)
    assert cams.focal == pytest.approx(15 / np.tan(np.radians(30)))


def test_eyes_are_centred_before_they_become_float32() -> None:
    matrix = np.tile(np.eye(4), (2, 1, 1))
    centre = np.array([5e6, -3e6, 1e7])
    matrix[:, :3, 3] = np.array([[0.001, 0.002, 0.003], [-1, 2, 0.25]]) + centre
    both = Eyes(position=matrix[:, :3, 3], world_from_camera=matrix, lenses=(Lens(fov=50.0),) * 2)
    position = cameras(both, (4, 3), centre).position
    np.testing.assert_allclose(position, [[0.001, 0.002, 0.003], [-1, 2, 0.25]], rtol=0, atol=2e-9)


def test_axes_are_unit_and_right_handed() -> None:
    cams = some_cameras()
    np.testing.assert_allclose(np.cross(cams.right, cams.up), -cams.forward, atol=1e-6)
    np.testing.assert_allclose(np.linalg.norm(cams.forward, axis=1), 1, atol=1e-6)


SIZE = (64, 32)
LENSES = {
    "shifted": Lens(fov=70.0, shift=(0.2, -0.1)),
    "wide pixels": Lens(fov=40.0, pixel_aspect=1.4),
    "orthographic": Lens(type="orthographic", height=3.0, shift=(0.1, 0.05), pixel_aspect=0.8),
    "panorama": Lens(type="panorama"),
}


@kernel
def look(cams: Cameras, c: int, xy: Any, depth: float, found: Any) -> None:
    """Origin and direction of rays, and where a point on each, at a depth, is seen, with its depth and density."""
    for i in range(xy.shape[0]):
        (ox, oy, oz), (dx, dy, dz) = lens_ray(cams, c, xy[i, 0], xy[i, 1])
        for k, value in enumerate((ox, oy, oz, dx, dy, dz)):
            found[i, k] = value
        o = cams.position
        x, y, z = ox - o[c, 0] + depth * dx, oy - o[c, 1] + depth * dy, oz - o[c, 2] + depth * dz
        column, row, away = lens_position(cams, c, x, y, z)
        found[i, 6], found[i, 7], found[i, 8] = column, row, away
        found[i, 9] = lens_density(cams, c, 1.0, row, away)
        found[i, 10], found[i, 11] = sine_and_cosine(2.0 * xy[i, 0] / cams.width - 1.0)
        found[i, 12] = angle_of(xy[i, 0] - 0.5 * cams.width, xy[i, 1] - 0.3 * cams.height)


def axes_of(c: int) -> Any:
    """World from camera of an eye that looks somewhere."""
    turn = np.linalg.qr(np.random.default_rng(c).normal(size=(3, 3)))[0]
    matrix = np.eye(4)
    matrix[:3, :3] = turn * np.linalg.det(turn)
    matrix[:3, 3] = [0.3 * c, -0.7, 1.1]
    return matrix


def eyes_with(lens: Lens) -> Eyes:
    matrices = np.stack([axes_of(c) for c in range(2)])
    return Eyes(position=matrices[:, :3, 3], world_from_camera=matrices, lenses=(lens, lens))


def twin_axes(matrix: Any) -> Any:
    return matrix[:3, 3], matrix[:3, 0], matrix[:3, 1], -matrix[:3, 2]


def positions(n: int = 400) -> Any:
    """Image positions away from the border and the poles, where float32 decides."""
    return np.random.default_rng(1).uniform(0.02, 0.98, (n, 2)) * SIZE


@pytest.mark.parametrize("name", LENSES)
def test_rays_positions_and_densities_are_those_of_the_twin(name: str) -> None:
    lens, xy = LENSES[name], positions()
    found, cams = np.empty((len(xy), 13)), cameras(eyes_with(lens), SIZE, np.zeros(3))
    for c, depth in ((0, 2.0), (1, 0.5)):
        look(cams, c, xy, depth, found)
        axes = twin_axes(axes_of(c))
        origin, way = oracle_lens.rays(lens, SIZE, axes, xy)
        np.testing.assert_allclose(found[:, :3], origin, atol=1e-6)
        np.testing.assert_allclose(found[:, 3:6], way, atol=1e-6)
        np.testing.assert_allclose(found[:, 6:8], xy, atol=1e-4)
        np.testing.assert_allclose(found[:, 8], depth, rtol=1e-6)
        # the density of samples on a surface that faces the ray is the area that its unit area has in the picture
        point, step = origin + depth * way - axes[0], 1e-5
        u = np.cross(way, [0.3, -0.5, 0.8])
        u /= np.linalg.norm(u, axis=1, keepdims=True)
        v = np.cross(way, u)
        v /= np.linalg.norm(v, axis=1, keepdims=True)
        moved = [
            (np.stack(oracle_lens.places(lens, SIZE, axes, point + step * side))
             - np.stack(oracle_lens.places(lens, SIZE, axes, point - step * side))) / (2 * step)
            for side in (u, v)
        ]  # fmt: skip
        area = np.abs(moved[0][0] * moved[1][1] - moved[0][1] * moved[1][0])
        facing = 1.0 if lens.type == "orthographic" else np.linalg.norm(point, axis=1)
        np.testing.assert_allclose(found[:, 9] * facing, area, rtol=1e-4)


def test_sines_and_angles_are_those_of_numpy() -> None:
    xy = np.concatenate([positions(2000), [[0, 0], [64, 32], [32, 0], [32, 9.6], [0, 9.6], [64, 9.6], [48, 25.6]]])
    found = np.empty((len(xy), 13))
    look(cameras(eyes_with(LENSES["panorama"]), SIZE, np.zeros(3)), 0, xy, 1.0, found)
    z = np.pi * (2 * xy[:, 0] / SIZE[0] - 1)
    np.testing.assert_allclose(found[:, 10:12], np.stack([np.sin(z), np.cos(z)], 1), atol=1e-13)
    angle = np.arctan2(xy[:, 0] - 32, xy[:, 1] - 0.3 * 32) / np.pi
    np.testing.assert_allclose(found[:, 12], angle, atol=1e-13)


@pytest.mark.parametrize("name", LENSES)
def test_other_programs_see_the_same_camera(name: str) -> None:
    """`Lens`, which exports and pilots use, and the rays that choose the pixels of lamps."""
    lens, xy = LENSES[name], positions()
    camera_axes = twin_axes(np.eye(4))
    origin, way = lens.rays(SIZE, xy)
    for ours, twin in zip((origin, way), oracle_lens.rays(lens, SIZE, camera_axes, xy), strict=True):
        np.testing.assert_allclose(ours, twin, atol=1e-13)
    place, depth = lens.project(SIZE, origin + 1.7 * way)
    np.testing.assert_allclose(place, xy, atol=1e-10)
    np.testing.assert_allclose(depth, 1.7, rtol=1e-12)
    cams = resized(cameras(eyes_with(lens), (640, 320), np.zeros(3)), *SIZE)
    middles = np.stack(np.meshgrid(np.arange(64) + 0.5, np.arange(32) + 0.5), -1).reshape(-1, 2)
    start, to = oracle_lens.rays(lens, SIZE, twin_axes(axes_of(1)), middles)
    found_start, found_to = picture_rays(cams, 1)
    np.testing.assert_allclose(np.broadcast_to(found_start, start.shape), start, atol=1e-6)
    np.testing.assert_allclose(found_to, to / np.linalg.norm(to, axis=1, keepdims=True), atol=1e-6)


def test_focal_lengths_and_centres_come_back() -> None:
    lens = Lens(fov=37.0, shift=(0.3, -0.2))
    (_, f_y), centre = lens.focal(SIZE), lens.centre(SIZE)
    assert fov_of_focal(f_y, SIZE[1]) == pytest.approx(37.0, rel=1e-14)
    assert shift_of_centre(centre, SIZE) == pytest.approx((0.3, -0.2), abs=1e-15)
    with pytest.raises(ValueError, match="no focal length"):
        LENSES["panorama"].focal(SIZE)


def test_a_plain_perspective_needs_no_rows() -> None:
    assert cameras(eyes_with(Lens()), SIZE, np.zeros(3)).lens.shape == (0, 5)
    zoom = Eyes(**{name: getattr(eyes_with(Lens()), name) for name in ("position", "world_from_camera")},
                lenses=(Lens(fov=50.0), Lens(fov=51.0)))  # fmt: skip
    assert cameras(zoom, SIZE, np.zeros(3)).lens.shape == (2, 5)
    assert not zoom.at_rest and not zoom.at([0, 0, 1]).at_rest
