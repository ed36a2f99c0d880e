"""`samples.error`: a pilot measures the noise of each block of pixels, and native hits are allotted to reach a target.

The pilot has random numbers of its own and is discarded, so that the number of hits of a pixel does not depend on their
values: means stay unbiased, and weights know the numbers. It depends only on the job, so that every run of a job allots
the same hits.

The pilot measures u(b), the variance of a pixel of block b with one hit from each frame of the window, mean
over light positions and channels. With n(b) hits from each frame, which count as m(b) independent ones, the variance is
u(b) / m(b), so the squared error of a frame's images is

    e^2 = mean over b of u(b) / m(b), m(b) = independent_hits(n(b)).

Of all n with the same e, the one with the fewest hits has n(b)^(1 + p) proportional to u(b), with p the power of
`independent_hits` [Neyman34].
"""

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np

from framearray_cli.base.arrays import Float32, Float64, Int32
from framearray_cli.engine.features.emission import AreaLights, own_light
from framearray_cli.engine.features.indirect import CellLight, gathered, irradiance_of
from framearray_cli.engine.frames.passes import Allotment, Blocks, blocks_of
from framearray_cli.engine.frames.pool import TracePool
from framearray_cli.engine.frames.records import HitRecords
from framearray_cli.engine.frames.setup import Batch, FrameSetup, Scratch
from framearray_cli.engine.frames.shading import record, shade
from framearray_cli.engine.hits.native import PixelSamples, native_hits
from framearray_cli.engine.hits.outer import outer_hits
from framearray_cli.engine.hits.row import INDIRECT, LIGHT_INDEPENDENT, OBSCURANCE, REFLECTIVITY
from framearray_cli.engine.kernels.simd import LANES
from framearray_cli.engine.terms.ambient.intensity import Ambient
from framearray_cli.engine.terms.obscurance import HITS_TOGETHER

from .automatic import EVENNESS, MOST_DENSE, evenly_spaced, independent_hits, with_lanes
from .prepare import Prepared

# The fewest hits per pixel: below, most pixels would depend on hits of distant frames.
FEWEST = 0.25
# Bisection steps for the logarithm of a frame's factor.
HALVINGS = 60
# Logarithm of the largest final correction of all hits, and bisection steps for it.
MOST_CHANGE, CHANGES = 2.0, 12
# Added to the job's seed for the pilot; no job's seed is as large.
PILOT_SEED = 1 << 40
# Share of the variance between places in a pixel that is left with weights by area (docs/decisions/reuse.md).
AREA_SHARE = 0.4
# Number of frames whose pilot hits judge the allotment, and of patches that show what the filter leaves.
JUDGED, PATCHES = 32, 16


def fewest_hits(u: Float64, wanted: float, most: float) -> Float64:
    """Return the fewest native hits per pixel with which no frame exceeds the wanted error, (n_frames, n_blocks).

    Args:
        u: (n_frames, n_blocks) variance of a pixel with one hit from each frame of the window.
        wanted: mean variance that a frame may have.
        most: limit of hits per pixel; where it binds, the wanted error may be missed.
    """
    share = u ** (1.0 / (1.0 + EVENNESS))
    largest = np.maximum(share.max(axis=1), 1e-300)
    # from the fewest hits everywhere to the most wherever there is noise
    low = np.log(FEWEST / largest)
    high = np.log(most / np.where(share > 0, share, largest[:, None]).min(axis=1))

    def with_factor(logs: Float64) -> Float64:
        hits: Float64 = np.clip(np.exp(logs)[:, None] * share, FEWEST, most)
        return hits

    for _ in range(HALVINGS):
        middle = (low + high) / 2
        enough = variances(u, with_factor(middle)) <= wanted
        low, high = np.where(enough, low, middle), np.where(enough, middle, high)
    return with_factor(high)


def variances(u: Float64, hits: Float64) -> Float64:
    """Return the mean variance of every frame, (n_frames,), for given native hits per pixel of each block."""
    means: Float64 = (u / independent_hits(hits)).mean(axis=1)
    return means


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class Witnesses:
    """Pairs of hits of one frame that judge the allotment: one pair per block and half of the pilot.

    Attributes:
        c: the frame.
        first_eye: of its window.
        variance: (2, n_blocks) of one hit, by half.
        block: (2, 2, n_blocks, n_eyes) by half and hit: the block in which each eye sees the hit.
        density: of the same shape: hits of that eye per hit of eye c there; 0 where it does not see the place.
    """

    c: int
    first_eye: int
    variance: Float64
    block: Int32
    density: Float64

    def variances(self, whole: Float64, by_half: Float64) -> float:
        """Return the mean variance of the frame.

        Args:
            whole: (n_frames, n_blocks) native hits per pixel, allotted by the whole pilot.
            by_half: (2, n_frames, n_blocks) the same by each half of the pilot. For their own frame, pairs count the
                hits that the other half allotted.
        """
        found = []
        for half in range(2):
            eyes = np.arange(self.block.shape[-1])
            hits = whole[self.first_eye + eyes, self.block[half]]
            own = self.c - self.first_eye
            hits[..., own] = by_half[1 - half][self.c, self.block[half][..., own]]
            arriving = (self.density[half] * independent_hits(hits)).sum(axis=-1)
            found.append((self.variance[half] * (1.0 / arriving).mean(axis=0)).mean())
        return float(np.mean(found))


def allot(
    u: Float64, blocks: Blocks, wanted: float, most: float, witnesses: Sequence[Witnesses]
) -> tuple[Float64, Float64]:
    """Return native hits of every block of every frame, and the expected mean variance of each witness's frame.

    A block whose variance the pilot underestimates by chance gets few hits, so a pilot judges its own allotment too
    well. But every place gets its hits from all frames of a window, whose pilots err independently. So pairs of hits
    that had no part in the allotment judge it, and one factor corrects all hits until the error is as wanted.

    Args:
        u: (2, n_frames, n_blocks) by each half of the pilot, see `fewest_hits`.
    """
    whole = fewest_hits(blocks.smooth(u.mean(axis=0)), wanted, most)
    halves = np.stack([fewest_hits(blocks.smooth(half), wanted, most) for half in u])

    def scale(hits: Float64, log: float) -> Float64:
        found: Float64 = np.clip(np.exp(log) * hits, FEWEST, most)
        return found

    def judge(log: float) -> Float64:
        hits, by_half = scale(whole, log), scale(halves, log)
        return np.array([witness.variances(hits, by_half) for witness in witnesses])

    low, high = -MOST_CHANGE, MOST_CHANGE
    for _ in range(CHANGES):
        middle = (low + high) / 2
        low, high = (low, middle) if judge(middle).mean() <= wanted else (middle, high)
    return scale(whole, high), judge(high)


@dataclass(frozen=True, slots=True, kw_only=True)
class Target:
    """The error that a job wants, and the native hits allotted for it.

    Attributes:
        error: wanted of every frame: root mean square over the pixels of all its images, relative to the mean radiance
            of the array.
        expected: error of the whole array; `worst`: of the worst frame.
        radiance: mean of the array, estimated by the pilot.
        hits: mean native hits per pixel; `frames`: least and greatest mean of a frame.
        capped: share of all blocks that have the most hits allowed.
        rays: traced by the pilot.
    """

    error: float
    expected: float
    worst: float
    radiance: float
    hits: float
    frames: tuple[float, float]
    capped: float
    rays: int

    def table(self) -> dict[str, object]:
        """Return the table for the manifest."""
        return {
            "error": self.error,
            "expected": round(self.expected, 5),
            "expected_worst": round(self.worst, 5),
            "radiance": self.radiance,
            "hits": round(self.hits, 3),
            "hits_by_frame": [round(self.frames[0], 3), round(self.frames[1], 3)],
            "capped": round(self.capped, 4),
            "pilot_rays": self.rays,
        }


def allot_hits(prepared: Prepared, setup: FrameSetup, ambient: Ambient) -> tuple[FrameSetup, Target | None]:
    """Allot native hits for `samples.error`; return the setup unchanged where the job has no target.

    Args:
        setup: for all light positions.
    """
    error = prepared.job.samples.error
    if error is None:
        return setup, None
    # for a camera at rest, one frame stands for the whole window
    most = float(prepared.job.samples.most_hits * (2 * prepared.job.n_r + 1 if prepared.still else 1))
    with TracePool(setup, prepared.threads) as pool:
        left = share_after_filter(replace(setup, seed=setup.seed + PILOT_SEED), pool)
        pilot = _Pilot(setup, ambient, blocks_of(setup.cams.width, setup.cams.height), left)
        means, variances_by_half, judges = zip(*pool.run(pilot.measure, range(setup.n_frames)), strict=True)
        rays = pool.rays().total()
    radiance = float(np.mean(means))
    wanted = (error * radiance) ** 2
    if wanted > 0:
        u = np.stack(variances_by_half, axis=1)
        hits, reached = allot(u, pilot.blocks, wanted, most, list(filter(None, judges)))
    else:  # all is black
        hits, reached = np.full((setup.n_frames, pilot.blocks.n), FEWEST), np.zeros(1)
    allotment = Allotment(blocks=pilot.blocks, hits=hits.astype(np.float32))
    per_pixel = allotment.mean()
    least = radiance if radiance > 0 else 1.0
    target = Target(
        error=error,
        expected=float(np.sqrt(reached.mean())) / least,
        worst=float(np.sqrt(reached.max())) / least,
        radiance=radiance,
        hits=float(per_pixel.mean()),
        frames=(float(per_pixel.min()), float(per_pixel.max())),
        capped=float((allotment.hits >= most).mean()),
        rays=rays,
    )
    return replace(setup, allotment=allotment, per_pixel=per_pixel), target


def share_after_filter(setup: FrameSetup, pool: TracePool) -> float:
    """Measure the share of the variance of indirect light that the filter leaves, over patches of some frames."""
    if not (isinstance(setup.indirect, CellLight) and setup.indirect.smooth):
        return 1.0
    patches = -(-setup.n_pixels // HITS_TOGETHER)

    def measure(c: int, scratch: Scratch) -> Float64:
        first = int(np.random.default_rng((setup.seed, c)).integers(patches)) * HITS_TOGETHER
        pixels = setup.order[first : first + HITS_TOGETHER]
        light = np.empty((2, 2, len(pixels), setup.lights.n_lights, 3), np.float32)
        for smooth in (False, True):
            for half in range(2):
                samples = PixelSamples(setup.seed + half, pixels, per_pixel=1, first=0, halves=False)
                _, records = pilot_batch(setup, c, samples, 0, len(pixels), scratch, smooth=smooth)
                reflectivity = records.row[:, None, REFLECTIVITY : REFLECTIVITY + 3]
                light[int(smooth), half] = reflectivity * gathered(records) * setup.lights.colour
        squares: Float64 = np.square(light[:, 0] - light[:, 1], dtype=np.float64).sum(axis=(1, 2, 3))
        return squares

    plain, smoothed = sum(pool.run(measure, evenly_spaced(setup.n_frames, PATCHES)))
    return float(smoothed / plain) if plain > 0 else 1.0


class _Pilot:
    """Two independent hits in each of two pixels per block: one pixel for each half of the pilot."""

    def __init__(self, setup: FrameSetup, ambient: Ambient, blocks: Blocks, left: float) -> None:
        self.setup = replace(setup, seed=setup.seed + PILOT_SEED)
        self.left, self.ambient, self.blocks = left, ambient, blocks
        self._judges = frozenset(evenly_spaced(setup.n_frames, JUDGED))

    def measure(self, c: int, scratch: Scratch) -> tuple[float, Float64, Witnesses | None]:
        """Measure the noise of frame c.

        Returns:
            Mean radiance over all its images; (2, n_blocks) variance by half of the pilot, see `allot`; for some frames
            witnesses.
        """
        eyes = self.setup.frames_around(c, self.setup.n_r)
        random = np.random.default_rng((self.setup.seed, c)).random((2, self.blocks.n, 2))
        pixels = np.concatenate([self.blocks.random_pixels(half) for half in random])
        n, batch = len(pixels), len(scratch.hits.pixel) // 2
        mean, variance = 0.0, np.empty(n)
        block, density = np.empty((2, n, len(eyes)), np.int32), np.empty((2, n, len(eyes)))
        for first in range(0, n, batch):
            span = slice(first, min(first + batch, n))
            pair = hit_pairs(span.stop - span.start)
            samples = PixelSamples(self.setup.seed, pixels[span], per_pixel=2, first=0, halves=True)
            _, records = pilot_batch(self.setup, c, samples, 0, 2 * len(pair[0]), scratch)
            scratch.rays["pilot"] += 2 * len(pair[0])
            radiance = _radiance(self.setup, self.ambient, records)[pair]
            mean += float(radiance.sum(dtype=np.float64)) / (2 * n * radiance[0, 0].size)
            variance[span] = self._variance(radiance[0] - radiance[1], records, pair)
            seen, arriving = self._views(c, eyes, 2 * len(pair[0]), scratch)
            block[:, span], density[:, span] = seen[pair], arriving[pair]
        # with one hit per pixel from each frame of the window: the variance, over the number of hits that arrive
        shared = (1.0 / density.sum(axis=-1)).mean(axis=0)
        by_half = (2, self.blocks.n)
        witnesses = None
        if c in self._judges:
            views = (2, *by_half, len(eyes))
            witnesses = Witnesses(
                c=c,
                first_eye=eyes.start,
                variance=variance.reshape(by_half),
                block=block.reshape(views).swapaxes(0, 1),
                density=density.reshape(views).swapaxes(0, 1),
            )
        return mean, (variance * shared).reshape(by_half), witnesses

    def _variance(self, difference: Float32, records: HitRecords, pair: Int32) -> Float64:
        """Return the variance of one hit, mean over light positions and channels, from the difference of two, (n,).

        Weights by area lower only what depends on the place in the pixel, not the noise of the obscurance rays; the
        filter lowers only the latter.

        Args:
            difference: (n, n_lights, 3) of the radiance of the hits `pair`.
        """
        if not self.setup.area and self.setup.indirect.ambient:
            single: Float64 = np.square(difference, dtype=np.float64).mean(axis=(1, 2)) / 2
            return single
        row = records.row[pair]
        reflectivity, obscurance = (row[..., at : at + 3] for at in (REFLECTIVITY, OBSCURANCE))
        if self.setup.indirect.ambient:
            noise = (obscurance[0] - obscurance[1])[:, None] * self.ambient.intensity
        else:
            light = gathered(records) * self.setup.lights.colour / np.float32(np.pi)
            noise = light[pair[0]] - light[pair[1]]
        noise = noise * reflectivity.mean(axis=0)[:, None]
        of_place = AREA_SHARE if self.setup.area else 1.0
        squares = of_place * np.square(difference - noise, dtype=np.float64)
        squares += self.left * np.square(noise, dtype=np.float64)
        weighed: Float64 = squares.mean(axis=(1, 2)) / 2
        return weighed

    def _views(self, c: int, eyes: range, n: int, scratch: Scratch) -> tuple[Int32, Float64]:
        """Return the block in which each eye sees each hit, and the eye's hits there per hit of eye c, (n, n_eyes)."""
        setup, own = self.setup, c - eyes.start
        if setup.n_r == 0:
            return self.blocks.of_pixel[scratch.hits.pixel[:n]][:, None], np.ones((n, 1))
        pixel, density = with_lanes(len(eyes), n)
        scratch.rays["pilot"] += outer_hits(
            setup.cams, c, eyes.start, scratch.hits, n, setup.world.eyes, scratch.test_rays, pixel, density, True
        )
        known = density[own, :n] > 0
        ratio = np.divide(density[:, :n], density[own, :n], out=np.zeros((len(eyes), n)), where=known)
        ratio[own] = 1.0
        pixel[own, :n] = scratch.hits.pixel[:n]
        return self.blocks.of_pixel[pixel[:, :n]].T, np.minimum(ratio, MOST_DENSE).T


def pilot_batch(
    setup: FrameSetup, c: int, samples: PixelSamples, first: int, n: int, scratch: Scratch, *, smooth: bool = False
) -> tuple[Batch, HitRecords]:
    """Find n hits of eye c, from the first one on, and estimate their terms; return them and their records."""
    packets, hits, records = scratch.hit_rays.packets, scratch.hits, setup.empty_records(n)
    native_hits(setup.cams, c, samples, first, n, setup.world, setup.depth > 0, packets, hits)
    batch = Batch(setup=setup, c=c, hits=hits, n=n, scratch=scratch, records=records, smooth=smooth, pilot=True)
    record(batch)
    shade(batch)
    return batch, records


def hit_pairs(n: int) -> Int32:
    """Return the places of the two hits of each of n pixels, (2, n): `native_hits` groups 16 pixels, then samples."""
    pixel = np.arange(n)
    group, members = pixel // LANES * LANES, np.minimum(n - pixel // LANES * LANES, LANES)
    places: Int32 = np.stack([2 * group + sample * members + pixel - group for sample in range(2)])
    return places


def _radiance(setup: FrameSetup, ambient: Ambient, records: HitRecords) -> Float32:
    """Return the radiance of each hit under every light, (n, n_lights, 3)."""
    rgb = {at: records.row[:, None, at : at + 3] for at in (LIGHT_INDEPENDENT, INDIRECT, REFLECTIVITY)}
    light = irradiance_of(records) * setup.lights.colour / np.float32(np.pi)
    radiance: Float32 = rgb[LIGHT_INDEPENDENT] + rgb[REFLECTIVITY] * light
    if AreaLights.name in records:
        radiance += own_light(records, setup.lights)
    if setup.indirect.ambient:
        radiance += ambient.intensity * rgb[INDIRECT]
    return radiance
