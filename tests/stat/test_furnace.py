"""The inside of a sphere: direct plus indirect light is known at every point, for any position of the light.

jobs/furnace-*.toml through the whole program, for independent seeds: the files are read back, the direct light of
every pixel is subtracted, and what is left must be the indirect light R / pi R E.
"""

from pathlib import Path

import numpy as np
import pytest
from numpy.typing import NDArray
from support import closed_forms as forms
from support.furnace import expected_direct, furnace_job
from support.stages import result_of
from support.ztests import Estimate, chi2_bounds, estimate

SEEDS = 6


def measured(reflectivity: float, method: str, out: Path) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
    """Indirect radiance of independent seeds, and the relative errors predicted for I_A, (seeds, n_l) each."""
    found, predicted = [], []
    for seed in range(SEEDS):
        result = result_of(furnace_job(reflectivity, out / str(seed), seed, method))
        rest = result.images.mean(axis=-1) - expected_direct(reflectivity)  # (n_c, n_l, h, w)
        found.append(rest.mean(axis=(0, 2, 3)))
        predicted.append(result.ambient.standard_error)
    return np.array(found), np.array(predicted)


# both methods in the brightest furnace, where light bounces most; the other two for one method each
SLOW = [(0.2, "fit"), (0.5, "eye")]


@pytest.mark.parametrize(
    ("reflectivity", "method"),
    [(r, m) for r in (0.2, 0.5, 0.8) for m in ("eye", "fit") if (r, m) not in SLOW]
    + [pytest.param(*case, marks=pytest.mark.slow) for case in SLOW],
)
def test_furnace(reflectivity: float, method: str, tmp_path: Path) -> None:
    by_light, predicted = measured(reflectivity, method, tmp_path)
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
