"""Light from cells in closed rooms of one reflectivity, where the sum of all bounces is known."""

from pathlib import Path
from typing import Any

import numpy as np
import pytest
from scipy.stats import t
from support import closed_forms as forms
from support import tiny
from support.furnace import expected_direct, furnace_job
from support.stages import result_of
from support.ztests import CHANCE, estimate, sidak

from framearray_cli.job.job import Job
from framearray_cli.job.method import IndirectTable

SEEDS = 6
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
