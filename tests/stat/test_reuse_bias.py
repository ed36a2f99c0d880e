"""Reuse keeps the mean with the weights `balance`, and does not with `average`: squared bias of images."""

from dataclasses import dataclass
from pathlib import Path

import numpy as np
import pytest
from numpy.typing import NDArray
from support import tiny
from support.stages import point, stage_job, sun, write_stage
from support.ztests import differing

from framearray_cli.engine.frames.passes import Allotment, blocks_of
from framearray_cli.job.job import Job
from framearray_cli.render.prepare import prepare

# Runs x_i and parts r_m are vectors of n values; x and r are their limits. The mean of (x - r)^2 over the values
# is estimated by products of only different runs and parts, so that it contains no noise:
#
#     mean of x_i . x_j (i != j) - 2 mean of x_i . r_m + mean of r_m . r_n (m != n),    . the mean of products
#
# which is mean((mean of runs - mean of parts)^2) - variance / runs - variance of the reference. Noise may make it
# negative. Its standard error is that of the jackknife: each run, and each part, is left out once. Where there is no
# bias, it is too large by a factor of up to sqrt 2, never too small.
Array = NDArray[np.float64]


@dataclass(frozen=True, slots=True, kw_only=True)
class Squares:
    """The error of runs, per value.

    Attributes:
        bias, error: squared bias and its standard error.
        variance: of one run.
    """

    bias: float
    error: float
    variance: float

    @property
    def mean_square(self) -> float:
        """Mean squared error of one run."""
        return self.bias + self.variance


def products(runs: NDArray[np.floating], parts: NDArray[np.floating]) -> tuple[Array, int]:
    """Products of all runs (k, n) and parts (m, n) with each other, (k + m, k + m), summed over n values; and n.

    The mean of the parts is subtracted first, which changes no difference and keeps digits. Sums of several pictures
    add up.
    """
    together = np.concatenate([runs, parts]).astype(np.float64)
    together -= together[len(runs) :].mean(axis=0)
    return together @ together.T, together.shape[1]


def squares(gram: Array, n: int, k: int) -> Squares:
    """Squared bias of k runs.

    Args:
        gram: (k + m, k + m) from `products`, k and m at least 3.
        n: values that were summed.
    """
    gram = gram / n
    xx, xr, rr = gram[:k, :k], gram[:k, k:], gram[k:, k:]
    m = len(rr)
    own_x, own_r = np.diag(xx), np.diag(rr)
    sum_x, sum_r = xx.sum() - own_x.sum(), rr.sum() - own_r.sum()
    pairs_x, pairs_r, cross = sum_x / (k * (k - 1)), sum_r / (m * (m - 1)), xr.mean()
    # with one run left out, and with one part
    less_x = (sum_x - 2 * (xx.sum(axis=1) - own_x)) / ((k - 1) * (k - 2))
    less_r = (sum_r - 2 * (rr.sum(axis=1) - own_r)) / ((m - 1) * (m - 2))
    cross_x = (xr.sum() - xr.sum(axis=1)) / ((k - 1) * m)
    cross_r = (xr.sum() - xr.sum(axis=0)) / (k * (m - 1))
    without_run, without_part = less_x - 2 * cross_x, less_r - 2 * cross_r
    spread = (k - 1) * without_run.var() + (m - 1) * without_part.var()
    return Squares(
        bias=float(pairs_x - 2 * cross + pairs_r),
        error=float(np.sqrt(spread)),
        variance=float(own_x.mean() - pairs_x),
    )


K, M, N = 6, 9, 400
SPREAD, PART_SPREAD = 2.0, 0.7


def found(rng: np.random.Generator, bias: np.ndarray) -> tuple[float, float, float]:
    right = rng.normal(5, 1, N)
    runs = right + bias + rng.normal(0, SPREAD, (K, N))
    parts = right + rng.normal(0, PART_SPREAD, (M, N))
    one = squares(*products(runs.astype(np.float32), parts.astype(np.float32)), K)
    return one.bias, one.error, one.variance


@pytest.mark.parametrize("size", [0.0, 0.2, 3.0])
def test_the_mean_is_right_and_the_standard_error_not_too_small(size: float):
    rng = np.random.default_rng(3)
    bias = size * rng.normal(0, 1, N)
    right, trials = float((bias**2).mean()), 1000
    values, errors, variances = np.array([found(rng, bias) for _ in range(trials)]).T
    spread = values.std(ddof=1)
    assert abs(values.mean() - right) < 4 * spread / trials**0.5
    # the jackknife is right where the bias stands out, and without bias too large by at most sqrt 2
    typical = np.sqrt((errors**2).mean())
    assert 0.9 < typical / spread < 1.6
    assert abs(variances.mean() - SPREAD**2) < 4 * variances.std() / trials**0.5


def test_it_is_the_square_of_means_less_both_variances():
    rng = np.random.default_rng(4)
    runs, parts = rng.normal(1, 1, (K, N)), rng.normal(0, 1, (M, N))
    one = squares(*products(runs, parts), K)
    naive = ((runs.mean(axis=0) - parts.mean(axis=0)) ** 2).mean()
    noise = (runs.var(axis=0, ddof=1) / K + parts.var(axis=0, ddof=1) / M).mean()
    assert one.bias == pytest.approx(naive - noise)
    assert one.variance == pytest.approx(runs.var(axis=0, ddof=1).mean())
    assert one.mean_square == pytest.approx(one.bias + one.variance)


def test_pictures_add_up():
    rng = np.random.default_rng(5)
    runs, parts = rng.normal(1, 1, (K, N)), rng.normal(0, 1, (M, N))
    halves = [products(runs[:, some], parts[:, some]) for some in (slice(0, 100), slice(100, N))]
    together = squares(halves[0][0] + halves[1][0], halves[0][1] + halves[1][1], K)
    whole = squares(*products(runs, parts), K)
    assert together.bias == pytest.approx(whole.bias)
    assert together.error == pytest.approx(whole.error)


# A small scene with silhouettes, a texture, the sky and a mirror; the middle frame of a short path, rendered with and
# without reuse for independent seeds, compared pixel by pixel.
N_R, MIDDLE = 3, 3
FRAMES = 2 * N_R + 1


@pytest.fixture(scope="module")
def scene(tmp_path_factory: pytest.TempPathFactory) -> Path:
    return write_stage(tmp_path_factory.mktemp("reuse"))


SLOW, FAST = 0.12, 1.0  # how far the eye goes to either side; its middle frame is the same


def job_of(scene: Path, out: Path, hits: float, n_r: int, weights: str, way: float = SLOW) -> Job:
    return stage_job(
        scene, out, FRAMES, (24, 16), way=way, background=[0.3, 0.5, 0.9],
        lights=[point([0.6, 1.6, 0.3], [1.2, 1.0, 0.8]), sun([-0.5, -1.0, -0.4], 0.8)],
        samples={"hits": hits, "obscurance": 2}, obscurance={"range": 0.6, "outside": "background"},
        reuse={"n_r": n_r, "weights": weights}, specular={"hits": 24},
    )  # fmt: skip


def middle_frames(job: Job, seeds: range, allotment: Allotment | None = None) -> Array:
    """The middle frame for each seed, (seeds, values), by the program's own frame loop without files."""
    frames = list(tiny.frames_of_seeds(prepare(job), MIDDLE, seeds, allotment=allotment))
    assert not any(frame.bad for frame in frames)
    return np.array([frame.images.ravel() for frame in frames], float)


SEEDS = 60


def without_reuse(scene: Path, out: Path) -> Array:
    """Only a pixel's own hits, the same number as with reuse, for other seeds."""
    return middle_frames(job_of(scene, out, 24, 0, "balance"), range(1000, 1000 + SEEDS))


@pytest.fixture(scope="module")
def right(scene: Path, tmp_path_factory: pytest.TempPathFactory) -> Array:
    return without_reuse(scene, tmp_path_factory.mktemp("out"))


@pytest.mark.parametrize("hits", [4, 0.5])  # 28 hits per pixel, and 3 or 4
def test_balance_leaves_the_mean_alone(hits: float, scene: Path, right: Array, tmp_path: Path) -> None:
    found = middle_frames(job_of(scene, tmp_path, hits, N_R, "balance"), range(SEEDS))
    assert differing(found, right).max() < 1


def test_balance_leaves_the_mean_alone_where_hits_differ_from_place_to_place(
    scene: Path, right: Array, tmp_path: Path
) -> None:
    """From a quarter of a hit to eight, in small blocks, others in every frame: edges run through everything."""
    blocks = blocks_of(24, 16, edge=3)
    hits = np.random.default_rng(8).choice([0.25, 1.0, 1.5, 3.0, 8.0], (FRAMES, blocks.n)).astype(np.float32)
    job = job_of(scene, tmp_path, 4, N_R, "balance")
    found = middle_frames(job, range(SEEDS), Allotment(blocks=blocks, hits=hits))
    assert differing(found, right).max() < 1


def test_average_is_biased_at_silhouettes_and_texture_edges(scene: Path, right: Array, tmp_path: Path) -> None:
    """The published weights fail the same comparison: it can fail."""
    found = middle_frames(job_of(scene, tmp_path, 4, N_R, "average"), range(SEEDS))
    off = differing(found, right).reshape(16, 24, 3).max(axis=-1)
    assert off.max() > 1.5
    assert 0.02 < (off > 1).mean() < 0.5  # some pixels, at edges; not the image as a whole


def test_no_reuse_twice_is_the_same(scene: Path, right: Array, tmp_path: Path) -> None:
    """The comparison finds nothing between two halves of one thing."""
    assert differing(right[::2], right[1::2]).max() < 1


def off_by(found: Array, right: Array) -> Squares:
    """Squared bias of the pictures of many seeds."""
    return squares(*products(found, right), len(found))


def fast(scene: Path, right: Array, out: Path, weights: str, hits: int, seeds: int = SEEDS) -> Squares:
    """What pictures of a camera that moves fast are off by."""
    return off_by(middle_frames(job_of(scene, out, hits, N_R, weights, FAST), range(seeds)), right)


def test_with_a_fast_camera_average_is_off_and_balance_at_most_a_tenth_of_it(
    scene: Path, right: Array, tmp_path: Path
) -> None:
    average, balance = (fast(scene, right, tmp_path, weights, 4) for weights in ("average", "balance"))
    assert average.bias > 10 * average.error
    assert balance.bias + 3 * balance.error < average.bias / 10


def falls(few: Squares, many: Squares, times: float) -> float:
    """By how many standard errors a squared bias lies above what 1 / n, n being `times` as large, leaves of it."""
    share = times**-2.0
    return (many.bias - share * few.bias) / float(np.hypot(many.error, share * few.error))


@pytest.mark.slow
def test_what_balance_is_off_by_falls_with_hits_as_one_over_n(scene: Path, right: Array, tmp_path: Path) -> None:
    few, many = (fast(scene, right, tmp_path, "balance", hits, 240 // hits) for hits in (1, 4))
    assert few.bias > 4 * few.error  # a ratio is biased where there are few hits
    assert falls(few, many, 4) < 3
    # what average is off by stays
    few, many = (fast(scene, right, tmp_path, "average", hits) for hits in (1, 4))
    assert falls(few, many, 4) > 10


def test_squared_bias_of_no_reuse_is_none(right: Array) -> None:
    """Neither bound holds of what has no bias, and a bias that is added is found."""
    none = off_by(right[::2], right[1::2])
    assert abs(none.bias) < 4 * none.error
    added = off_by(right[::2] * 1.05, right[1::2])
    assert abs(added.bias - np.mean((0.05 * right.mean(axis=0)) ** 2)) < 4 * added.error
    assert added.bias > 10 * added.error
