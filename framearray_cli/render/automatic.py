"""Automatic settings of reuse: `reuse.n_r = "auto"` and `samples.hits = "auto"`.

The chosen settings reach a target error in the least time. The target is the error of the default, n_r = 3 and hits =
2, on an ordinary walk; if the job sets `samples.hits`, the error of n_r = 3 with these hits.

A probe of the camera path finds how densely neighbouring eyes sample each other's hits. Expected error and time follow
from the probe. Both are computed only from counts, never from a clock or free memory: the same job gives the same
numbers on any machine. `docs/decisions/reuse.md` says where the constants come from, and how far off they are.
"""

import math
from collections.abc import Callable, Iterator
from dataclasses import dataclass, replace
from itertools import chain, islice

import numpy as np

from framearray_cli.base.arrays import Float64, Int32, with_room
from framearray_cli.base.forms.table import changed
from framearray_cli.engine.embree.embreescene import EmbreeScene
from framearray_cli.engine.frames.passes import repeated
from framearray_cli.engine.hits.hits import SURFACE, empty_hits
from framearray_cli.engine.hits.native import TILE, PixelSamples, native_hits, pixel_order
from framearray_cli.engine.hits.outer import outer_hits
from framearray_cli.engine.hits.rays import room_for_hits, room_for_tests
from framearray_cli.engine.kernels.simd import LANES
from framearray_cli.engine.terms.direct import direct
from framearray_cli.job.job import Job
from framearray_cli.job.method import DEFAULT_HITS, DEFAULT_N_R
from framearray_cli.job.values import MOST_HITS, SHARES

from .memory import require_memory, window_memory
from .plan import eye_cameras
from .prepare import Prepared

# Number of frames probed, native hits per frame, and light positions for which shadow rays are counted.
PROBE_FRAMES, PROBE_HITS, PROBE_LIGHTS = 16, 512, 32
# Limit of a neighbour's hits per hit of the eye itself, for surfaces that the eye sees nearly edge-on.
MOST_DENSE = 1000.0
# The variance of a pixel falls with this power of the hits of one eye in it, because they are evenly spread.
EVENNESS = 1.3
# Nanoseconds of processor time. Per ray of each kind, with all work that belongs to it.
EYE_RAY, OBSCURANCE_RAY, SHADOW_RAY, VISIBILITY_RAY = 115.0, 190.0, 48.0, 40.0
# Per hit: weighing it by the density of one eye in one frame, and sorting it into one frame.
WEIGH, SORT = 0.5, 5.0
# Per pixel: looking up the hits of one eye; per light position, adding a hit and storing the sum.
LOOK_UP, ADD, STORE = 18.0, 0.3, 3.2
# Per hit in a pixel: weighing it by area.
AREA = 40.0
# Longest windows tried. With `average`, distant views of a place bring an error that no number of hits removes.
LONGEST = {"area": 16, "balance": 16, "average": DEFAULT_N_R}
# Numbers of hits tried, in rising order.
HITS = (*sorted(SHARES), *map(float, range(1, 17)))
# Memory in bytes assumed for choosing, on any machine; larger renders count as rendered in strips of rows.
ROOM = 4 * 2**30
# Share of the hits of the default window that count on an ordinary walk: 0.91 to 0.93 in the three jobs of the paper.
ORDINARY = 0.9
# Frame distances for which the share of hits seen is reported.
SEEN_AT = (1, 2, 4, 8, 16)


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class Acceptance:
    """Some hits of some frames, and how densely the neighbour eyes would sample the same places.

    Only hits that reflect diffusely are kept, as the others have no noise; if none does, all are kept.

    Attributes:
        n_frames: of the path; 1 for a camera at rest.
        frame: (n,) frame of the eye that found each hit.
        density: (n, 2 reach + 1) relative density p_k / p_c of eye frame + k, k from -reach to reach: hits that it adds
            to a pixel of the frame per native hit per pixel; 0 where it does not see the place, or is off the path.
        reflecting: share of all hits that reflect diffusely.
        shadow_rays: per hit for all light positions.
    """

    n_frames: int
    frame: Int32
    density: Float64
    reflecting: float
    shadow_rays: float

    @property
    def reach(self) -> int:
        """Distance of the farthest neighbour probed, frames."""
        return int(self.density.shape[1]) // 2

    def seen(self, k: int) -> float:
        """Return the share of hits that the eyes k frames before and after see; beyond the reach, as at its end."""
        k, shares = min(k, self.reach), []
        for offset in (-k, k):
            there = (self.frame + offset >= 0) & (self.frame + offset < self.n_frames)
            shares.append(self.density[there, self.reach + offset] > 0)
        both = np.concatenate(shares)
        return float(both.mean()) if len(both) else 0.0


def probe(prepared: Prepared, embree: EmbreeScene, reach: int) -> Acceptance:
    """Test a few hundred native hits of some frames from all eyes at most `reach` frames away.

    The hits are among those that a render finds, so the same job gives the same result on any machine.
    """
    job, n_c = prepared.job, 1 if prepared.still else prepared.n_cameras
    cams = eye_cameras(prepared)
    lights = prepared.light_arrays.at(evenly_spaced(prepared.n_lights, PROBE_LIGHTS))
    order = pixel_order(cams.width, cams.height)
    pixels = order[evenly_spaced(len(order), PROBE_HITS)]
    n, samples = len(pixels), PixelSamples(job.seed, pixels, per_pixel=1, first=0)
    world = prepared.world(embree)
    hits, hit_rays = empty_hits(PROBE_HITS), room_for_hits(PROBE_HITS)
    test_rays = room_for_tests(PROBE_HITS, lights.n_lights)
    irradiance = with_room((PROBE_HITS, lights.channels, lights.n_lights), np.float32)
    frames, densities, diffuse, shadow = [], [], [], 0
    for c in evenly_spaced(n_c, PROBE_FRAMES):
        native_hits(cams, c, samples, 0, n, world, False, hit_rays.packets, hits)
        shadow += direct(hits, n, lights, world.sight, test_rays, irradiance, True)
        eyes = range(max(c - reach, 0), min(c + reach, n_c - 1) + 1)
        seen, of_eye = with_lanes(len(eyes), n)
        outer_hits(cams, c, eyes.start, hits, n, world.eyes, test_rays, seen, of_eye, True)
        density, first = np.zeros((n, 2 * reach + 1)), eyes.start - c + reach
        relative = of_eye[:, :n] / of_eye[c - eyes.start, :n]
        density[:, first : first + len(eyes)] = np.minimum(relative, MOST_DENSE).T
        diffuse.append((hits.kind[:n] == SURFACE) & (hits.reflectivity[:n] > 0).any(axis=1))
        densities.append(density)
        frames.append(np.full(n, c, np.int32))
    reflects = np.concatenate(diffuse)
    kept = reflects if reflects.any() else slice(None)
    return Acceptance(
        n_frames=n_c,
        frame=np.concatenate(frames)[kept],
        density=np.concatenate(densities)[kept],
        reflecting=float(reflects.mean()),
        shadow_rays=shadow / len(reflects) * prepared.n_lights / lights.n_lights,
    )


def evenly_spaced(n: int, most: int) -> list[int]:
    """Return at most `most` of the numbers 0 to n - 1, evenly spaced, each in the middle of its interval."""
    count = min(n, most)
    return [(2 * i + 1) * n // (2 * count) for i in range(count)]


def evenly_from_end_to_end(n: int, most: int) -> list[int]:
    """Return at most `most` of the numbers 0 to n - 1, evenly spaced from the first to the last."""
    return sorted({round(float(k)) for k in np.linspace(0, n - 1, min(n, most))})


def with_lanes(n_eyes: int, n: int) -> tuple[Int32, Float64]:
    """Return memory for the pixels and densities that `outer_hits` finds, (n_eyes, n or a few more)."""
    shape = n_eyes, -(-n // LANES) * LANES
    return np.empty(shape, np.int32), np.empty(shape)


@dataclass(frozen=True, slots=True, kw_only=True)
class Reuse:
    """Settings of reuse: N_r, and native hits per pixel and frame."""

    n_r: int
    hits: float


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class Model:
    """Quantities that error and time depend on, next to `Reuse`; see `Acceptance` and the job file."""

    found: Acceptance
    n_lights: int
    obscurance: int
    balance: bool = True
    area: bool = False

    def counts(self, reuse: Reuse) -> Float64:
        """Return the expected hits, native and outer, in the pixel of each probed hit, (n,).

        They are the native hits of a pixel times the relative density, summed over the eyes of the window.
        """
        found, n_r = self.found, reuse.n_r
        frame = np.array([repeated(eye, found.n_frames) for eye in range(-n_r, found.n_frames + n_r)])
        offset = frame[found.frame[:, None] + np.arange(2 * n_r + 1)] - found.frame[:, None]
        sums: Float64 = reuse.hits * np.take_along_axis(found.density, offset + found.reach, axis=1).sum(axis=1)
        return sums

    def least(self, reuse: Reuse) -> float:
        """Return the number of hits that 99 % of the pixels are expected to exceed."""
        return float(np.percentile(self.counts(reuse), 1))

    def variance(self, reuse: Reuse) -> float:
        """Return the expected variance of a pixel, mean over pixels, in units of the variance of one hit.

        It is 1 over the number of hits, where `independent_hits` counts the hits of one eye; a pixel without hits gets
        one.
        """
        sums = self.counts(replace(reuse, hits=float(independent_hits(np.array(reuse.hits)))))
        return float((1.0 / np.maximum(sums, 1.0)).mean())

    def time(self, reuse: Reuse, more: float = 1.0) -> float:
        """Return the expected processor time per pixel and frame for all light positions, ns; mirrors left out.

        Args:
            more: hits that strips find, over the hits of whole frames.
        """
        found, n_r = self.found, min(reuse.n_r, self.found.n_frames - 1)
        native = reuse.hits * (found.n_frames + 2 * reuse.n_r) / found.n_frames
        eyes = range(1, min((2 if self.balance else 1) * n_r, found.n_frames - 1) + 1)
        place = SORT * (2 * n_r + 1) + sum(2 * VISIBILITY_RAY * found.seen(k) for k in eyes)
        if self.balance and n_r:
            place += WEIGH * (2 * n_r + 1) ** 2
        find = EYE_RAY + OBSCURANCE_RAY * self.obscurance * found.reflecting + place
        light = SHADOW_RAY * found.shadow_rays
        used = native * (1 + 2 * sum(found.seen(k) for k in range(1, n_r + 1)))
        pixel = LOOK_UP * (2 * n_r + 1) + (ADD * used + STORE) * self.n_lights
        if self.area:
            pixel += AREA * used
        return native * more * (find + light) + pixel


def independent_hits(hits: Float64) -> Float64:
    """Return the number of independent hits with the same variance as the hits of one eye; see `EVENNESS`."""
    value: Float64 = np.where(hits >= 1.0, hits**EVENNESS, hits)
    return value


DEFAULT = Reuse(n_r=DEFAULT_N_R, hits=DEFAULT_HITS)


@dataclass(frozen=True, slots=True, kw_only=True)
class AutoSettings:
    """The settings chosen where the job says "auto", and the reasons.

    Attributes:
        reuse: the settings, including those that the job gives.
        keys: of the job file that say "auto".
        enough: True if the settings reach the target error; if not, no candidate does.
        error: expected error over the wanted one.
        time: expected time over the time of the default.
        hits: expected hits per pixel, native and outer: mean and 1st percentile.
        seen: share of hits that eyes k frames away see, by k.
    """

    reuse: Reuse
    keys: tuple[str, ...]
    enough: bool
    error: float
    time: float
    hits: tuple[float, float]
    seen: dict[int, float]

    def table(self) -> dict[str, object]:
        """Return the table for the manifest."""
        return {
            "keys": list(self.keys),
            "n_r": self.reuse.n_r,
            "hits": self.reuse.hits,
            "enough": self.enough,
            "error_to_wanted": round(self.error, 4),
            "time_to_default": round(self.time, 4),
            "hits_per_pixel": round(self.hits[0], 3),
            "hits_1st_percentile": round(self.hits[1], 3),
            "seen": {str(k): round(share, 4) for k, share in self.seen.items()},
        }


def resolve_auto(prepared: Prepared, embree: EmbreeScene) -> tuple[Prepared, AutoSettings | None]:
    """Replace each "auto" of a job by a number; return the reasons too, or None if the job has no "auto".

    Raises:
        JobError: with the chosen settings the job does not fit into memory.
    """
    job = prepared.job
    keys = auto_keys(job)
    if not keys:
        return prepared, None
    longest = LONGEST[job.reuse.weights] if job.reuse.n_r == "auto" else job.reuse.n_r
    model = Model(
        found=probe(prepared, embree, max(longest, DEFAULT.n_r)),
        n_lights=prepared.n_lights,
        obscurance=job.samples.obscurance,
        balance=job.reuse.weights != "average",
        area=job.reuse.weights == "area",
    )
    wanted = wanted_variance(job)
    enough, rows = accuracy_test(model, job), candidates(job, model.found.n_frames)
    chosen = choose(model, enough, rows, lambda reuse: _more_hits(prepared, reuse))
    result = apply_reuse(prepared, chosen)
    require_memory(result)
    return result, AutoSettings(
        reuse=chosen,
        keys=keys,
        enough=enough(chosen),
        error=(model.variance(chosen) / wanted) ** 0.5,
        time=model.time(chosen, _more_hits(prepared, chosen)) / model.time(DEFAULT, _more_hits(prepared, DEFAULT)),
        hits=(float(model.counts(chosen).mean()), model.least(chosen)),
        seen={k: model.found.seen(k) for k in SEEN_AT if k <= min(model.found.reach, model.found.n_frames - 1)},
    )


def require_least_memory(prepared: Prepared) -> None:
    """Refuse a job that fits into memory with no choice of settings; see `require_memory`.

    Raises:
        JobError: it does not.
    """
    n_r, hits = prepared.job.reuse.n_r, prepared.job.samples.hits
    if hits == "auto" or prepared.job.samples.error is not None:
        hits = HITS[0]
    least = Reuse(n_r=0 if n_r == "auto" else n_r, hits=hits)
    require_memory(apply_reuse(prepared, least))


def auto_keys(job: Job) -> tuple[str, ...]:
    """Return the keys of a job that say "auto"."""
    values = {"reuse.n_r": job.reuse.n_r, "samples.hits": job.samples.hits}
    return tuple(key for key, value in values.items() if value == "auto")


def apply_reuse(prepared: Prepared, reuse: Reuse) -> Prepared:
    """Return the same job with these settings."""
    job = prepared.job
    new = changed(job, reuse=changed(job.reuse, n_r=reuse.n_r), samples=changed(job.samples, hits=reuse.hits))
    return replace(prepared, job=new)


def wanted_variance(job: Job) -> float:
    """Return the variance of a pixel with the default window on an ordinary walk, in variances of one hit."""
    hits = DEFAULT.hits if job.samples.hits == "auto" else job.samples.hits
    return 1.0 / (ORDINARY * (2 * DEFAULT.n_r + 1) * float(independent_hits(np.array(hits))))


def accuracy_test(model: Model, job: Job) -> Callable[[Reuse], bool]:
    """Return the test for settings: the wanted error, and no fewer hits than by default on places just revealed."""
    wanted = wanted_variance(job)
    least = model.least(replace(DEFAULT, hits=DEFAULT.hits if job.samples.hits == "auto" else job.samples.hits))
    return lambda reuse: model.variance(reuse) <= wanted and model.least(reuse) >= least


def candidates(job: Job, n_frames: int) -> Iterator[list[Reuse]]:
    """Yield the settings that a job leaves open, one list per window, hits rising; no window exceeds the path."""
    n_r, hits = job.reuse.n_r, job.samples.hits
    longest = min(LONGEST[job.reuse.weights], n_frames - 1)
    for window in range(longest + 1) if n_r == "auto" else [n_r]:
        each = [Reuse(n_r=window, hits=h) for h in (HITS if hits == "auto" else [hits])]
        yield [one for one in each if (2 * window + 1) * one.hits <= MOST_HITS]


def choose(
    model: Model,
    enough: Callable[[Reuse], bool],
    rows: Iterator[list[Reuse]],
    more: Callable[[Reuse], float] = lambda _: 1.0,
) -> Reuse:
    """Return the fastest settings that pass the test; the shorter window of two that are equally fast.

    If none pass, return those with the least product of time and variance: with fewer hits time falls and variance
    grows, so the product shows which window uses its time best.

    Args:
        rows: lists of settings, in each of which hits, time and accuracy rise.
        more: hits that the strips of settings find, over the hits of whole frames.
    """
    tried = list(rows)
    if reached := [reuse for row in tried for reuse in islice(filter(enough, row), 1)]:
        return min(reached, key=lambda reuse: model.time(reuse, more(reuse)))
    return min(chain(*tried), key=lambda reuse: model.time(reuse, more(reuse)) * model.variance(reuse))


def _more_hits(prepared: Prepared, reuse: Reuse) -> float:
    """Estimate the hits that strips find, over the hits of whole frames: of rows of tiles around them, too."""
    job = changed(prepared.job, render=changed(prepared.job.render, threads=1))  # the same on any machine
    strips = math.ceil(window_memory(apply_reuse(replace(prepared, job=job), reuse), prepared.n_lights) / ROOM)
    return 1 + (strips - 1) * min(2 * TILE / prepared.job.camera.resolution[1], 1.0)
