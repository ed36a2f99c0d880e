"""Environments as eyes see them."""

from pathlib import Path
from typing import Any

import numpy as np
import pytest
from support import tiny

from framearray_cli.array.images import ImageFormat, write_image
from framearray_cli.engine.frames.threads import TracePool
from framearray_cli.job.job import Job

RNG = np.random.default_rng(4)
TURNS = (0.0, 30.0, 220.0)


@pytest.fixture
def pixels() -> Any:
    return (RNG.random((32, 64, 3)) * (1.0, 2.0, 3.0)).astype(np.float32)


def job_with(file: Path, pixels: Any, **changes: Any) -> Job:
    write_image(file, pixels, ImageFormat(half="never"))
    keys = [{"frame": k, "rotation": turn, "intensity": [1.0, 0.5, 1.0 + k]} for k, turn in enumerate(TURNS)]
    sky = {"type": "environment", "file": str(file), "keys": keys}
    return tiny.job(light={"frames": len(TURNS), "sources": [sky]}, **changes)


def seen(pixels: Any, d: Any, turn_deg: float) -> Any:
    """The readable twin: radiance in unit directions (n, 3), y up, blended between four texels."""
    height, width, _ = pixels.shape
    azimuth = np.arctan2(d[:, 0], -d[:, 2]) - np.radians(turn_deg)
    u = (azimuth / (2 * np.pi) % 1 + 0.5) % 1 * width - 0.5
    v = (0.5 - np.arcsin(np.clip(d[:, 1], -1, 1)) / np.pi) * height - 0.5
    left, top = np.floor(u).astype(int), np.floor(v).astype(int)
    f, g = (u - left)[:, None], (v - top)[:, None]

    def at(i: int, j: int) -> Any:
        return pixels[np.clip(top + j, 0, height - 1), (left + i) % width].astype(np.float64)

    return (at(0, 0) * (1 - f) + at(1, 0) * f) * (1 - g) + (at(0, 1) * (1 - f) + at(1, 1) * f) * g


def ways(job: Job, scene: Any) -> Any:
    """Unit directions through the middles of all pixels of camera 0, (n, 3)."""
    eyes = tiny.prepared(job, scene).eyes
    (width, height), matrix = job.camera.resolution, eyes.world_from_camera[0, :3, :3]
    x, y = np.meshgrid(np.arange(width) + 0.5 - width / 2, height / 2 - np.arange(height) - 0.5)
    focal = height / 2 / np.tan(np.radians(eyes.lenses[0].fov) / 2)
    d = np.stack([x, y, np.full_like(x, -focal)], axis=-1).reshape(-1, 3) @ matrix.T
    return d / np.linalg.norm(d, axis=1, keepdims=True)


@pytest.mark.parametrize("up", [1.2, -0.7])
def test_eyes_see_the_map_turned_by_the_light_position(tmp_path: Path, pixels: Any, up: float) -> None:
    """Pixels hold means over their area, of a map that is smooth over a pixel."""
    smooth = np.repeat(np.repeat(pixels[::16, ::16], 16, 0), 16, 1)
    for _ in range(12):
        smooth = (smooth + np.roll(smooth, 1, 1) + np.roll(smooth, -1, 1)) / 3
        smooth[1:-1] = (smooth[1:-1] + smooth[2:] + smooth[:-2]) / 3
    scene = tiny.scene_of(tiny.box((0, 0, 8), (0.1, 0.1, 8.1)))
    keys = [{"frame": 0, "eye": [0.0, 0.0, 0.0], "target": [0.3, up, -1.0]}]
    job = job_with(
        tmp_path / "sky.exr", smooth.astype(np.float32), camera={"keys": keys, "fov": 40.0}, samples={"hits": 64}
    )
    images = tiny.render_frames(tiny.prepared(job, scene)).images[0].reshape(len(TURNS), -1, 3)
    for l, turn in enumerate(TURNS):
        wanted = seen(smooth, ways(job, scene), turn) * (1.0, 0.5, 1.0 + l)
        np.testing.assert_allclose(images[l], wanted, rtol=0.03)
        assert np.abs(images[l] / wanted - 1).mean() < 3e-3


def test_grey_maps_and_blocks_of_positions_show_the_same(tmp_path: Path, pixels: Any) -> None:
    """With one channel, and where only some positions are kept."""
    grey = np.repeat(pixels[..., :1], 3, axis=2)
    tinted = grey * (1.0, 1.0, 1.0 + 1e-6)
    tinted[0, 0, 0] *= 1.001  # three channels
    images = [
        tiny.render_frames(tiny.prepared(job_with(tmp_path / "sky.exr", sky.astype(np.float32)))).images
        for sky in (grey, tinted)
    ]
    np.testing.assert_allclose(*images, rtol=1e-3, atol=1e-5)


def test_with_alpha_eyes_do_not_see_the_map_and_surfaces_and_mirrors_do(tmp_path: Path) -> None:
    """Put over its colour, an image is that without alpha; it has none where only the map is seen."""
    colour = np.array([1.0, 2.0, 3.0], np.float32)
    table: dict[str, Any] = {"camera": tiny.WALK, "reuse": {"n_r": 1, "weights": "area"}}
    jobs = [
        job_with(tmp_path / "sky.exr", np.tile(colour, (4, 8, 1)), output={"alpha": alpha}, **table)
        for alpha in (False, True)
    ]
    plain, found = (tiny.render_frames(tiny.prepared(job)).composed[2] for job in jobs)
    assert found.alpha.min() == 0 and 0.5 < found.alpha.mean() < 0.99 and found.alpha.max() == 1
    assert not found.images[:, found.alpha == 0].any()
    for l in range(len(TURNS)):
        outside = (1 - found.alpha[..., None]) * colour * (1.0, 0.5, 1.0 + l)
        np.testing.assert_allclose(found.images[l] + outside, plain.images[l], rtol=1e-4, atol=1e-5)


def test_mirrors_show_the_map(tmp_path: Path) -> None:
    """A mirror of reflectivity (0.9, 0.8, 0.7) shows one colour as that times the tint."""
    floor = tiny.quad((-9, 0, 9), (9, 0, 9), (9, 0, -9), (-9, 0, -9))
    scene = tiny.scene_of(floor, tiny.MATERIALS[tiny.MIRROR])
    keys = [{"frame": 0, "eye": [0.0, 2.0, 0.0], "target": [0.0, 0.0, -1.0]}]
    camera = {"keys": keys, "fov": 30.0, "resolution": [4, 3]}
    job = job_with(tmp_path / "sky.exr", np.full((8, 16, 3), (1.0, 2.0, 4.0), np.float32), camera=camera)
    images = tiny.render_frames(tiny.prepared(job, scene)).images[0]
    for l in range(len(TURNS)):
        np.testing.assert_allclose(images[l], np.broadcast_to([0.9, 0.8, 0.7 * 4 * (1 + l)], (3, 4, 3)), rtol=1e-4)


def test_suns_are_seen_once(tmp_path: Path) -> None:
    """With a sun that is a source of its own."""
    pixels = np.full((32, 64, 3), 1.0, np.float32)
    pixels[4:6, 10:12] = 500.0
    scene = tiny.scene_of(tiny.box((0, 0, 8), (0.1, 0.1, 8.1)))
    keys = [{"frame": 0, "eye": [0.0, 0.0, 0.0], "target": [-0.9, 1.6, 0.5]}]
    job = job_with(tmp_path / "sky.exr", pixels, camera={"keys": keys, "fov": 100.0}, samples={"hits": 64})
    inputs = tiny.prepared(job, scene)
    assert len(inputs.lights.sources) == 2
    image = tiny.render_frames(inputs).images[0, 0].reshape(-1, 3)
    finer = job_with(tmp_path / "sky.exr", pixels, camera={"keys": keys, "fov": 100.0, "resolution": [240, 180]})
    wanted = seen(pixels, ways(finer, scene), 0.0) * (1.0, 0.5, 1.0)
    np.testing.assert_allclose(np.median(image, axis=0), [1.0, 0.5, 1.0], rtol=1e-4)
    np.testing.assert_allclose(image.mean(axis=0), wanted.mean(axis=0), rtol=0.05)
    assert wanted.mean() > 1.5  # 0.83 without the sun


def test_blocks_of_positions_show_the_same(tmp_path: Path, pixels: Any) -> None:
    """To the last bit, in a room with mirrors."""
    inputs = tiny.prepared(job_with(tmp_path / "sky.exr", pixels))
    with tiny.planned(inputs) as (setup, ambient):
        parts = []
        for block in (range(0, 3), range(0, 1), range(1, 3)):
            part = setup.for_block(block)
            with TracePool(part, 1) as pool:
                parts.append(tiny.frames_of(part, ambient.for_lights(block), pool)[0].images)
    np.testing.assert_array_equal(parts[0], np.concatenate(parts[1:]))
