"""Eye rays and their inverse."""

from typing import Any

import numpy as np
import pytest
from support import tiny

from framearray_cli.base.lens import Lens
from framearray_cli.engine.inputs.cameras import OUTSIDE, Cameras, cameras, eye_ray, project_to_pixel
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
