"""Environments: the radiance that eyes see, and gather rays with less noise behind a window."""

from pathlib import Path
from typing import Any

import numpy as np
import pytest
from support import oracle_random, tiny
from support.hits import points
from support.irradiance import FAR, UP, N, P, arrays, check_mean, irradiances
from support.lit_rooms import roofless
from support.panoramas import TURNS as MAP_TURNS
from support.panoramas import environment, irradiance

from framearray_cli.array.images import ImageFormat, write_image
from framearray_cli.engine.embree.embreescene import EmbreeScene
from framearray_cli.engine.frames.pool import TracePool
from framearray_cli.engine.hits.hits import Hits
from framearray_cli.engine.hits.rays import room_for_tests
from framearray_cli.engine.inputs.lights import LightArrays
from framearray_cli.engine.inputs.panes import Sight
from framearray_cli.engine.inputs.random import AROUND
from framearray_cli.engine.terms.direct import direct
from framearray_cli.engine.terms.environments import GATHER_RAYS, gather_environments, with_gathering
from framearray_cli.job.job import Job
from framearray_cli.scene.paths.placing import cut_suns

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
                parts.append(tiny.frames_of(part, ambient.at(block), pool)[0].images)
    np.testing.assert_array_equal(parts[0], np.concatenate(parts[1:]))


GATHER_RNG = np.random.default_rng(3)
TILTED = np.array([0.48, 0.6, -0.64])


def gathered(
    hits: Hits, lights: LightArrays, triangles: Any = FAR, *, drawn: bool = True, neighbours: bool = True
) -> Any:
    """Irradiance (n, channels, n_lights) by looks, and by drawn directions if wanted."""
    n, looked = len(hits.kind), with_gathering(lights)
    out = np.zeros((n, lights.channels, lights.n_lights), np.float32)
    with EmbreeScene(tiny.scene_of(triangles)) as embree:
        rays = room_for_tests(4096, lights.n_lights)
        if drawn:
            direct(hits, n, looked, Sight(embree.tracer), rays, out, neighbours)
        gather_environments(hits, n, looked, embree.tracer, rays, out)
    return out.astype(np.float64)


@pytest.mark.parametrize("neighbours", [True, False])
@pytest.mark.parametrize("normal", [UP, TILTED])
def test_both_kinds_of_rays_together_have_the_mean_that_quadrature_has(normal: Any, neighbours: bool) -> None:
    pixels = GATHER_RNG.random((6, 12, 3)) ** 6 * (1.0, 2.0, 4.0)
    found = gathered(
        points(4 * N, P, normal), arrays(environment(pixels, factor=(2.0, 1.0, 0.5))), neighbours=neighbours
    )
    wanted = np.stack([irradiance(pixels, normal, turn) for turn in MAP_TURNS], axis=1) * [[2.0], [1.0], [0.5]]
    check_mean(found, wanted, 0.01, rounding=0)


def test_what_looks_add_is_what_the_readable_twin_adds() -> None:
    """Per hit, sum of L cos / (p + n cos / pi) over its looks, in float64."""
    pixels = GATHER_RNG.random((8, 16, 3)) ** 2
    lights, hits = arrays(environment(pixels)), points(300, P, TILTED)
    found, expected = gathered(hits, lights, drawn=False), np.zeros((300, 3, len(MAP_TURNS)))
    edges = np.sin(np.linspace(np.pi / 2, -np.pi / 2, 9))
    luminance = pixels.astype(np.float32).astype(np.float64) @ (0.2126, 0.7152, 0.0722)
    flux = (luminance * (edges[:-1] - edges[1:])[:, None]).sum() * 2 * np.pi / 16
    for i in range(300):
        (word,) = oracle_random.bits([int(hits.key[i])], AROUND)
        places = oracle_random.points([word] * GATHER_RAYS, range(GATHER_RAYS), oracle_random.sequence())
        for d in oracle_random.hemisphere(np.tile(TILTED, (GATHER_RAYS, 1)), places):
            cosine = d @ TILTED
            for l, turn in enumerate(np.radians(MAP_TURNS)):
                column = int(((np.arctan2(d[0], -d[2]) - turn) / (2 * np.pi) + 0.5) % 1 * 16)
                row = int(np.searchsorted(-edges, -d[1]) - 1)
                p = luminance[row, column] / flux
                expected[i, :, l] += pixels[row, column] * cosine / (p + GATHER_RAYS * cosine / np.pi)
    close = np.isclose(found, expected, rtol=2e-4).all(axis=(1, 2))
    assert close.mean() > 0.99, "but for directions at the edge of a texel"


def test_behind_a_window_the_noise_is_less_and_the_mean_is_the_same() -> None:
    """The middle of a room with a hole in a ceiling of 4 x 4, under a sky of one colour."""
    lights, room = arrays(environment(np.ones((8, 16, 3)))), np.concatenate(roofless((0.5, 1.3, -0.4, 0.4)))
    hits = points(8 * N, P, UP)
    plain, both = irradiances(hits, lights, tiny.scene_of(room)), gathered(hits, lights, room)
    for found in (plain, both):
        assert 0 < found.mean() < 0.3 * np.pi
    error = np.sqrt((plain.var(axis=0) + both.var(axis=0)) / len(plain))
    assert (np.abs(plain.mean(axis=0) - both.mean(axis=0)) <= 3.5 * error).all()
    assert both.var() < 0.25 * plain.var()


def test_suns_of_a_map_need_no_looks() -> None:
    pixels = np.full((32, 64, 3), 0.1)
    pixels[8, 20] = 3000.0
    lights = with_gathering(arrays(*cut_suns(environment(pixels), 0)))
    assert sorted((lights.maps.gathering > 0).tolist()) == [False, True]
