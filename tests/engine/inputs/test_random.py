"""Random streams and the maps from them to pixels, discs and hemispheres."""

from typing import Any

import numpy as np
import pytest
from scipy.stats import chi2, norm
from support import oracle_random as twin

from framearray_cli.engine.inputs.random import above, cosine_direction, disc, lattice_steps, r2, random_word, stream
from framearray_cli.engine.kernels.kernel import kernel

# Chance that a right generator fails one test; with some hundred tests here, 1e-6 makes it 1e-4 for all of them.
# Seeds are fixed, so a test that passes once passes always.
ALPHA = 1e-6
N = 200_000


@kernel
def fill_keys(seed: int, c: int, n_pixels: int, n_samples: int, out: Any) -> None:
    for pixel in range(n_pixels):
        for sample in range(n_samples):
            out[pixel * n_samples + sample] = stream(seed, c, pixel, sample)


@kernel
def fill_points(keys: Any, dimension: int, i: int, out: Any) -> None:
    """Point i of a dimension of each key."""
    for k in range(keys.shape[0]):
        out[k, 0], out[k, 1] = r2(random_word(keys[k], dimension), i)


@kernel
def fill_sequence(key: Any, first: int, out: Any) -> None:
    for i in range(out.shape[0]):
        out[i, 0], out[i, 1] = r2(key[0], first + i)


@kernel
def fill_discs(points: Any, out: Any) -> None:
    for i in range(points.shape[0]):
        out[i, 0], out[i, 1] = disc(points[i, 0], points[i, 1])


@kernel
def fill_directions(normal: Any, points: Any, out: Any) -> None:
    for i in range(points.shape[0]):
        out[i, 0], out[i, 1], out[i, 2] = cosine_direction(normal[0], normal[1], normal[2], points[i, 0], points[i, 1])


@kernel
def lift(dirs: Any, g: Any) -> None:
    for i in range(dirs.shape[0]):
        dirs[i, 0], dirs[i, 1], dirs[i, 2] = above(dirs[i, 0], dirs[i, 1], dirs[i, 2], g[0], g[1], g[2])


def keys(seed: int = 1, c: int = 0, n_pixels: int = N, n_samples: int = 1) -> Any:
    out = np.empty(n_pixels * n_samples, np.uint64)
    fill_keys(seed, c, n_pixels, n_samples, out)
    return out


def points(dimension: int = 1, i: int = 0, n: int = N) -> Any:
    out = np.empty((n, 2), np.float32)
    fill_points(keys(n_pixels=n), dimension, i, out)
    return out


def directions(normal: Any, uv: Any) -> Any:
    out = np.empty((len(uv), 3), np.float32)
    fill_directions(np.asarray(normal, np.float32), uv, out)
    return out


def assert_uniform(x: Any, y: Any, cells: tuple[int, int]) -> None:
    """Chi-squared test of points of the unit square."""
    table, _, _ = np.histogram2d(x, y, bins=cells, range=((0, 1), (0, 1)))
    assert table.sum() == len(x), "points outside the unit square"
    expected = len(x) / table.size
    assert ((table - expected) ** 2 / expected).sum() < chi2.isf(ALPHA, table.size - 1)


def assert_mean(values: Any, mean: float, variance: float) -> None:
    """Z-test of a mean."""
    z = (np.mean(values, dtype=np.float64) - mean) / np.sqrt(variance / len(values))
    assert abs(z) < norm.isf(ALPHA / 2)


def test_every_place_has_its_own_key() -> None:
    parts = [keys(seed, c, 4_000, 8) for seed in (0, 1, 2**32 - 1) for c in (0, 1, 2, (1 << 20) - 1)]
    together = np.concatenate(parts)
    assert len(np.unique(together)) == len(together)


def test_the_end_of_every_range_of_the_key_is_free() -> None:
    """The last sample, pixel and camera do not run into the next one's numbers."""
    places = [
        (c, pixel, sample)
        for c in (0, 1, (1 << 20) - 1)
        for pixel in (0, 1, (1 << 28) - 1)
        for sample in (0, 1, (1 << 16) - 1)
    ]
    found = {twin.keys(3, c, [pixel], [sample])[0] for c, pixel, sample in places}
    assert len(found) == len(places)
    for c, pixel, sample in places[:6]:
        assert stream(3, c, pixel, sample) == twin.keys(3, c, [pixel], [sample])[0]


@pytest.mark.parametrize("step", ["pixel", "sample", "camera", "seed"])
def test_neighbours_in_any_direction_share_half_their_bits(step: str) -> None:
    """Keys of neighbours look independent: every bit differs in half of all pairs."""
    n = 20_000
    other = {
        "pixel": lambda: keys(n_pixels=n + 1)[1:],
        "sample": lambda: keys(n_pixels=n, n_samples=2)[1::2],
        "camera": lambda: keys(c=1, n_pixels=n),
        "seed": lambda: keys(seed=2, n_pixels=n),
    }[step]()
    bits = np.unpackbits((keys(n_pixels=n) ^ other).view(np.uint8).reshape(n, 8), axis=1)
    z = (bits.mean(axis=0) - 0.5) / np.sqrt(0.25 / n)
    assert abs(z).max() < norm.isf(ALPHA / 2 / 64)


@pytest.mark.parametrize("dimension", [0, 1, 2])
@pytest.mark.parametrize("i", [0, 1, 7, 65_535])
def test_points_are_uniform(dimension: int, i: int) -> None:
    uv = points(dimension, i)
    assert_uniform(uv[:, 0], uv[:, 1], (32, 32))


def test_dimensions_are_independent() -> None:
    one, two = points(0), points(1)
    for a in range(2):
        for b in range(2):
            assert_uniform(one[:, a], two[:, b], (16, 16))


@pytest.mark.parametrize("first", [0, 65_500, 2**31 - 20, 2**32 - 20])
def test_the_sequence_is_exact_however_long(first: int) -> None:
    key, out = np.array([0xFEDCBA9876543210], np.uint64), np.empty((64, 2), np.float32)
    fill_sequence(key, first, out)
    np.testing.assert_array_equal(out, twin.points([int(key[0])] * 64, range(first, first + 64), twin.sequence()))
    assert (out >= 0).all() and (out < 1).all()


@pytest.mark.parametrize("n", [1, 2, 3, 5, 7, 8, 16, 70, 1000])
def test_the_lattice_is_that_of_the_twin_and_has_one_point_per_row_and_column(n: int) -> None:
    steps = lattice_steps(n)
    assert steps == tuple(step % 2**32 for step in twin.lattice(n))
    points = np.arange(n)[:, None] * np.array(steps, np.uint64) % 2**32 / 2**32
    for axis in range(2):
        cells = np.sort(np.round(points[:, axis] * n).astype(int) % n)
        np.testing.assert_array_equal(cells, np.arange(n))


@pytest.mark.parametrize("n", [3, 5, 8])
def test_the_lattice_is_better_spread_than_the_sequence(n: int) -> None:
    """Variances of the mean of x y over n points, over 2,000 shifts; their own error is 3 %."""
    shifts = np.random.default_rng(4).random((2_000, 1, 2))
    variances = []
    for steps in (twin.lattice(n), twin.sequence()):
        points = (shifts + np.arange(n)[:, None] * (np.array(steps) / 2**32)) % 1
        variances.append(points.prod(axis=2).mean(axis=1).var())
    assert variances[0] < 0.8 * variances[1]


@pytest.mark.parametrize("n", [4, 5, 10, 70])
def test_points_of_one_sample_are_better_spread_than_random_ones(n: int) -> None:
    """The variance of the mean of x y over n points; 7/144/n if they were independent."""
    means = []
    for key in keys(n_pixels=2_000):
        out = np.empty((n, 2), np.float32)
        fill_sequence(np.array([key], np.uint64), 0, out)
        means.append((out[:, 0] * out[:, 1]).mean())
    assert np.mean(means) == pytest.approx(0.25, abs=5 * np.sqrt(7 / 144 / n / len(means)))
    assert np.var(means) < 0.6 * 7 / 144 / n


def test_disc_is_uniform() -> None:
    out = np.empty((N, 2), np.float32)
    fill_discs(points(), out)
    square = (out.astype(np.float64) ** 2).sum(axis=1)
    assert square.max() <= 1 + 4e-7
    assert_uniform(np.minimum(square, 1), np.arctan2(out[:, 1], out[:, 0]) / (2 * np.pi) + 0.5, (16, 32))


def test_disc_series_are_those_of_cosine_and_sine() -> None:
    uv = np.concatenate([points(n=5_000), np.float32([[0.5, 0.5], [0, 0], [1, 1], [0, 1], [1, 0], [0.5, 0], [0, 0.5]])])
    out = np.empty((len(uv), 2), np.float32)
    fill_discs(uv, out)
    # the first term left out of the sine is (pi/4)^9 / 9! = 3e-7; rounding adds as much
    np.testing.assert_allclose(out, twin.disc(uv.astype(np.float64)), rtol=0, atol=6e-7)


NORMALS = [
    (0, 0, 1), (0, 0, -1), (1, 0, 0), (0, -1, 0), (0.6, 0, -0.8), (0.48, 0.64, 0.6), (-0.001, 0.001, -0.999999),
]  # fmt: skip


@pytest.mark.parametrize("normal", NORMALS)
def test_directions_have_the_density_of_the_cosine(normal: Any) -> None:
    """cos^2 and the azimuth are uniform where the density is cos / pi; moments of every order follow."""
    dirs = directions(normal, points()).astype(np.float64)
    n = np.float32(normal).astype(np.float64)
    np.testing.assert_allclose(np.linalg.norm(dirs, axis=1), 1, atol=1e-6)
    cosine = dirs @ n
    assert cosine.min() > -1e-6
    assert_mean(cosine, 2 / 3, 1 / 18)
    assert_mean(cosine**3, 2 / 5, 2 / 8 - 4 / 25)
    helper = np.eye(3)[abs(n).argmin()]
    x = np.cross(n, helper) / np.linalg.norm(np.cross(n, helper))
    y = np.cross(n, x)
    assert_mean(dirs @ x, 0, 1 / 4)
    assert_mean(dirs @ y, 0, 1 / 4)
    azimuth = np.arctan2(dirs @ y, dirs @ x) / (2 * np.pi) + 0.5
    assert_uniform(np.clip(cosine, 0, 1) ** 2, azimuth, (16, 16))


def test_a_wrong_density_would_be_seen() -> None:
    """The tests above can fail: uniform instead of cosine-distributed directions do."""
    z = points()[:, 0]
    with pytest.raises(AssertionError):
        assert_mean(z, 2 / 3, 1 / 18)
    with pytest.raises(AssertionError):
        assert_uniform(z.astype(np.float64) ** 2, points()[:, 1], (16, 16))


@pytest.mark.parametrize("normal", NORMALS)
def test_directions_are_those_of_the_twin(normal: Any) -> None:
    uv = points(n=2_000)
    n = np.float32(normal).astype(np.float64)
    expected = twin.hemisphere(np.tile(n, (len(uv), 1)), uv.astype(np.float64))
    # the height is a square root: 2^-23 under it is 3.5e-4 at the horizon, and 3e-6 at a height of 0.02
    high = expected @ n > 0.02
    np.testing.assert_allclose(directions(normal, uv)[high], expected[high], rtol=0, atol=1e-5)
    assert high.mean() > 0.99


def test_what_points_into_the_surface_is_mirrored_out_of_it() -> None:
    g = np.float32([0.6, 0, 0.8])
    dirs = directions((0, 0, 1), points(n=20_000))
    before = dirs.copy()
    lift(dirs, g)
    height = before @ g
    assert 0.01 < (height < 0).mean() < 0.5
    np.testing.assert_array_equal(dirs[height >= 0], before[height >= 0])
    np.testing.assert_allclose(dirs @ g, abs(height), atol=1e-6)
    np.testing.assert_allclose(np.linalg.norm(dirs, axis=1), 1, atol=1e-6)
