"""Closed rooms of one reflectivity and bowls: the sum of all bounces is known, with obscurances and from cells."""

from functools import cache
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from numpy.typing import NDArray
from scipy.stats import t
from support import ROOT, tiny
from support import closed_forms as forms
from support.stages import result_of
from support.ztests import CHANCE, Estimate, chi2_bounds, estimate, sidak

from framearray_cli.job.job import Job
from framearray_cli.job.method import IndirectTable
from framearray_cli.job.read import read_job
from framearray_cli.scene.paths.paths import eyes, lights

JOBS = ROOT / "jobs"
FINE = 8  # places along each edge of a pixel that its expected direct light is averaged over


def furnace_job(reflectivity: float, out: Path, seed: int = 0) -> Job:
    """A job of jobs/ with another seed, and files that hold float."""
    job = read_job(JOBS / f"furnace-{round(100 * reflectivity)}.toml")
    output = {"directory": out, "half": "never", "compression": "none", "layers": False}
    tables = {
        "seed": seed,
        "output": job.output.model_copy(update=output),
    }
    return job.model_copy(update=tables)


@cache
def expected_direct(reflectivity: float) -> NDArray[np.float64]:
    """Mean direct radiance of every pixel of the furnace job, (n_c, n_l, h, w): eye rays met with the unit sphere."""
    job = read_job(JOBS / f"furnace-{round(100 * reflectivity)}.toml")
    width, height = job.camera.resolution
    focal = 0.5 * height / np.tan(np.radians(job.camera.fov) / 2)
    x = (np.arange(width * FINE) + 0.5) / FINE - 0.5 * width
    y = 0.5 * height - (np.arange(height * FINE) + 0.5) / FINE
    image = np.stack([*np.meshgrid(x / focal, y / focal), np.full((height * FINE, width * FINE), -1.0)], axis=-1)
    frames = []
    for matrix in eyes(job).world_from_camera:
        way = image.reshape(-1, 3) @ matrix[:3, :3].T
        way /= np.linalg.norm(way, axis=1, keepdims=True)
        eye = matrix[:3, 3]
        along = way @ eye
        points = eye + (np.sqrt(along**2 - eye @ eye + 1) - along)[:, None] * way
        per_light = [forms.point_irradiance(points, -points, place, 1.0) for place in lights(job).sources[0].vector]
        fine = np.array(per_light).reshape(-1, height, FINE, width, FINE)
        frames.append(reflectivity / np.pi * fine.mean(axis=(2, 4)))
    return np.array(frames)


# jobs/furnace-*.toml through the whole program, for independent seeds: the files are read back, the direct light of
# every pixel is subtracted, and what is left must be the indirect light R / pi R E.
SEEDS = 6


def measured(reflectivity: float, out: Path) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
    """Indirect radiance of independent seeds, and the relative errors predicted for I_A, (seeds, n_l) each."""
    found, predicted = [], []
    for seed in range(SEEDS):
        result = result_of(furnace_job(reflectivity, out / str(seed), seed))
        rest = result.images.mean(axis=-1) - expected_direct(reflectivity)  # (n_c, n_l, h, w)
        found.append(rest.mean(axis=(0, 2, 3)))
        predicted.append(result.ambient.standard_error)
    return np.array(found), np.array(predicted)


@pytest.mark.parametrize("reflectivity", [0.2, 0.5, 0.8])
def test_furnace(reflectivity: float, tmp_path: Path) -> None:
    by_light, predicted = measured(reflectivity, tmp_path)
    right = forms.furnace_indirect(reflectivity)
    whole = expected_direct(reflectivity).mean(axis=(0, 2, 3)) + right
    for l in range(by_light.shape[1]):  # the same random numbers serve all lights, so each is tested separately
        got = estimate(by_light[:, l])
        # six seeds estimate their spread badly; the error that the program reports is checked below, and serves here
        said = Estimate(mean=got.mean, error=right * float(predicted[:, l].mean()) / SEEDS**0.5)
        assert abs(said.z(right)) < 3
        assert abs(got.mean - right) < 0.01 * whole[l]
        assert got.error < 0.01 * right
        # the spread over seeds is what the program said its error would be, or less where walks are well spread
        spread = ((by_light[:, l] - got.mean) ** 2).sum() / (right * predicted[:, l].mean()) ** 2
        assert spread < chi2_bounds(SEEDS - 1)[1]
        assert abs(said.z(1.05 * right)) > 3  # the test can fail


def test_every_pixel_of_the_furnace(tmp_path: Path) -> None:
    """With the light in the middle every pixel is the same, but for the flatness of the triangles.

    Of equilateral triangles of circumradius rho on the unit sphere, the middles are nearer to the light than the
    corners by the sag rho^2 / 2, so that irradiance cos / d^2 varies by 3 rho^2 / 2. Neighbours are tilted against
    each other by the angle rho. Only rays below that meet a neighbour within the range of 0.01: a share of rho^2 of
    all; and a pixel has 14 * 5 rays.
    """
    result = result_of(furnace_job(0.5, tmp_path))
    image = result.images[0, 0].mean(axis=-1)
    square = 1.5 * 4 / (3 * 3**0.5) * 4 * np.pi / 81920  # rho^2; the largest triangles are 1.5 times the mean area
    off = np.abs(image / np.median(image) - 1)
    assert (off < 1.5 * square).mean() > 1 - 70 * square
    assert (np.abs(image / (1.01 * np.median(image)) - 1) < 1.5 * square).mean() < 0.01  # the test can fail


def test_sunlit_sphere_has_a_mean_too() -> None:
    """The expected direct light itself: the light's power over the sphere, seen from its middle."""
    assert expected_direct(0.5)[:, 0].mean() == pytest.approx(0.5 / np.pi, rel=0.005)  # light at the centre: E = 1


BRIGHT = [0.5, pytest.param(0.2, marks=pytest.mark.slow), pytest.param(0.8, marks=pytest.mark.slow)]
BLOCK = (12, 16)  # pixels that are tested together, down and across
LAMPS = [[0.3, -0.6, 0.2], [0.0, 0.0, 0.0], [-0.8, 0.8, 0.1]]  # in a box from -1 to 1
SIDES = [[1, 0, 0], [-1, 0, 0], [0, 1, 0], [0, -1, 0], [0, 0, 1], [0, 0, -1]]


def with_cells(job: Job) -> Any:
    """(n_c, n_l, h, w)."""
    job = job.model_copy(update={"indirect": IndirectTable(method="cells", samples=2**17)})
    return result_of(job).images.mean(axis=-1)


@pytest.mark.parametrize("reflectivity", BRIGHT)
def test_the_mean_over_a_sphere(reflectivity: float, tmp_path: Path) -> None:
    found = []
    for seed in range(SEEDS):
        rest = with_cells(furnace_job(reflectivity, tmp_path / str(seed), seed)) - expected_direct(reflectivity)
        found.append(rest.mean(axis=(0, 2, 3)))
    right = forms.furnace_indirect(reflectivity)
    whole = expected_direct(reflectivity).mean(axis=(0, 2, 3)) + right
    by_light = np.array(found)
    most = float(t.ppf(1 - sidak(by_light.shape[1]) / 2, SEEDS - 1))
    for l in range(by_light.shape[1]):  # the same random numbers serve all lights, so each is tested separately
        got = estimate(by_light[:, l])
        error = got.error * SEEDS**0.5  # of one render
        flat = 1e-4 * whole[l]  # triangles of the sphere have about this share less area
        assert abs(got.mean - right) < most * error + flat
        assert abs(got.mean - right) < 0.01 * whole[l]
        assert abs(got.mean - 1.05 * right) > most * error + flat  # the test can fail


@pytest.mark.slow
@pytest.mark.parametrize("reflectivity", [0.2, 0.5, 0.8])
def test_every_place_of_a_sphere_gets_the_same(reflectivity: float, tmp_path: Path) -> None:
    """The pattern over places, whose mean square over independent seeds has no noise; direct light of the same hits.

    Cells and the triangles of the sphere leave a pattern of about 0.04 % of the light; 1 % is too much.
    """
    found = []
    for seed in range(SEEDS):
        job = furnace_job(reflectivity, tmp_path / str(seed), seed)
        dark = job.ambient.model_copy(update={"intensity": (0.0, 0.0, 0.0)})
        direct = job.model_copy(
            update={
                "ambient": dark,
                "output": job.output.model_copy(update={"directory": tmp_path / f"direct-{seed}"}),
            }
        )
        found.append(mean_of_blocks(with_cells(job) - result_of(direct).images.mean(axis=-1)))
    blocks = np.array(found)  # (seeds, n_l, blocks)
    whole = expected_direct(reflectivity).mean(axis=(0, 2, 3)) + forms.furnace_indirect(reflectivity)
    for l in range(blocks.shape[1]):
        pattern = blocks[:, l] - blocks[:, l].mean(axis=1, keepdims=True)
        square, error = mean_square(pattern)
        assert square + 3 * error < (0.01 * whole[l]) ** 2
        tilted = pattern + 0.03 * whole[l] * np.linspace(-1, 1, blocks.shape[2])
        wrong, error = mean_square(tilted)
        assert wrong - 3 * error > (0.01 * whole[l]) ** 2  # the test can fail


def mean_of_blocks(images: Any) -> Any:
    """(n_c, n_l, h, w) -> (n_l, blocks)."""
    n_c, n_l, h, w = images.shape
    rows = images.reshape(n_c, n_l, h // BLOCK[0], BLOCK[0], w // BLOCK[1], BLOCK[1]).mean(axis=(3, 5))
    return rows.swapaxes(0, 1).reshape(n_l, -1)


def mean_square(patterns: Any) -> tuple[float, float]:
    """Mean square of what patterns (seeds, blocks) have in common, and its standard error: product of two halves."""
    products = patterns[::2].mean(axis=0) * patterns[1::2].mean(axis=0)
    got = estimate(products)
    return got.mean, got.error


def box_job(seed: int) -> Any:
    """An eye in the middle of a box sees one side per frame, each pixel as much of its area as any other."""
    looks = [
        {"frame": k, "eye": [0.0, 0.0, 0.0], "target": side, "up": [0, 0, 1] if side[1] else [0, 1, 0]}
        for k, side in enumerate(SIDES)
    ]
    lamp = {"type": "point", "keys": [{"frame": l, "position": at, "intensity": 1.0} for l, at in enumerate(LAMPS)]}
    return tiny.job(
        seed=seed,
        camera={"resolution": [24, 24], "fov": 90.0, "frames": len(SIDES), "keys": looks},
        light={"frames": len(LAMPS), "sources": [lamp]},
        indirect={"method": "cells", "samples": 2**17},
    )


@pytest.mark.parametrize("reflectivity", BRIGHT)
def test_the_mean_over_the_area_of_a_box(reflectivity: float) -> None:
    scene = tiny.scene_of(
        tiny.box((-1, -1, -1), (1, 1, 1)), tiny.Material(name="Grey", reflectivity=(reflectivity,) * 3)
    )
    found = np.array(
        [tiny.render_frames(tiny.prepared(box_job(seed), scene), 2).images.mean(axis=(0, 2, 3, 4)) for seed in range(8)]
    )
    right = reflectivity / np.pi * forms.furnace_irradiance(reflectivity, area=24.0)
    most = float(t.ppf(1 - CHANCE / 2 / len(LAMPS), len(found) - 1))
    for l in range(len(LAMPS)):
        got = estimate(found[:, l])
        assert abs(got.mean - right) < most * got.error
        assert abs(got.mean - right) < 0.01 * right
        assert got.error < 0.003 * right  # so that the bounds above would show an error of 2 %


# Each point of a sphere gives every other point the same irradiance. So a sphere of which the share f is open has the
# same light at each point: E = pi f L + R (1 - f) E.
BOWL_SEEDS = 16
OPEN, REFLECTIVITY, SKY = 0.9, 0.8, np.array([1.0, 1.0, 2.0])
STEPS = 48  # along a meridian of the bowl
DARK = {"type": "point", "keys": [{"frame": 0, "position": [0.0, 9.0, 0.0], "intensity": 0.0}]}
ABOVE = {"frame": 0, "eye": [0.0, 0.0, 0.0], "target": [0.0, -1.0, 0.0], "up": [0.0, 0.0, 1.0]}
# Triangles of the bowl have about this share less light from each other.
FLAT = 5e-4


def bowl() -> Any:
    """The lowest part of a sphere of radius 1: corners, (triangles, 3, 3)."""
    down = np.linspace(0, np.arccos(2 * OPEN - 1), STEPS + 1)[:, None]
    around = np.linspace(0, 2 * np.pi, 4 * STEPS + 1)[None]
    at = np.stack(
        np.broadcast_arrays(np.sin(down) * np.cos(around), -np.cos(down), np.sin(down) * np.sin(around)), axis=-1
    )
    return np.concatenate(
        [
            tiny.quad(at[j, i], at[j + 1, i], at[j + 1, i + 1], at[j, i + 1])[0 if j else 1 :]
            for j in range(STEPS)
            for i in range(4 * STEPS)
        ]
    )


def light_over_sky(seed: int) -> float:
    """The mean radiance of the bowl over that of the sky."""
    job = tiny.job(
        seed=seed,
        scene={"background": SKY.tolist()},
        camera={"resolution": [16, 16], "fov": 40.0, "frames": 1, "keys": [ABOVE]},
        light={"frames": 1, "sources": [DARK]},
        samples={"hits": 16},
        obscurance={"range": 0.001, "outside": "average"},
        indirect={"method": "cells", "samples": 2**15},
    )
    scene = tiny.scene_of(bowl(), tiny.Material(name="Grey", reflectivity=(REFLECTIVITY,) * 3))
    return float((tiny.render_frames(tiny.prepared(job, scene), threads=2).images / SKY).mean())


@pytest.mark.slow
def test_a_bowl_has_the_light_of_an_open_sphere() -> None:
    got = estimate(np.array([light_over_sky(seed) for seed in range(BOWL_SEEDS)]))
    right = REFLECTIVITY * OPEN / (1 - REFLECTIVITY * (1 - OPEN))
    most = float(t.ppf(1 - CHANCE / 2, BOWL_SEEDS - 1))
    assert abs(got.mean - right) < most * got.error + FLAT * right
    assert abs(got.mean - right) < 0.01 * right
    assert got.error < 0.002 * right  # so that only the light of the sky, 8 % less, would fail
