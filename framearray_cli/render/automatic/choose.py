"""`reuse.n_r = "auto"` and `samples.hits = "auto"`: the settings that reach a wanted error in the least time.

The wanted error is that of the default, n_r = 3 and hits = 2, on an ordinary walk; where the job gives `samples.hits`,
that of n_r = 3 with these hits.
"""

from collections.abc import Callable, Iterator
from dataclasses import dataclass, replace

import numpy as np

from framearray_cli.base.forms.table import changed
from framearray_cli.engine.embree.embreescene import EmbreeScene
from framearray_cli.job.job import Job
from framearray_cli.job.method import DEFAULT_HITS, DEFAULT_N_R
from framearray_cli.job.values import MOST_HITS, SHARES

from ..memory import light_blocks, require_memory
from ..prepare import Prepared
from .cost import Model, Reuse, independent_hits
from .probe import probe

# Longest windows tried. With `average`, distant views of a place bring an error that no number of hits removes.
LONGEST = {"area": 16, "balance": 16, "average": DEFAULT_N_R}
# Numbers of hits tried, in rising order.
HITS = (*sorted(SHARES), *map(float, range(1, 17)))
# Memory in bytes assumed for choosing, on any machine; what exceeds it counts as rendered in blocks of light positions.
ROOM = 4 * 2**30
# Share of the hits of the default window that count on an ordinary walk: 0.91 to 0.93 in the three jobs of the paper.
ORDINARY = 0.9
DEFAULT = Reuse(n_r=DEFAULT_N_R, hits=DEFAULT_HITS)
# Frame distances for which the share of hits seen is reported.
SEEN_AT = (1, 2, 4, 8, 16)


@dataclass(frozen=True, slots=True, kw_only=True)
class AutoSettings:
    """The settings chosen where the job says "auto", and the reasons.

    Attributes:
        reuse: the settings, including those that the job gives.
        keys: of the job file that say "auto".
        enough: whether the settings reach the wanted error; if not, no candidate does.
        error: expected error over the wanted one.
        time: expected time over that of the default.
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
    chosen = choose(model, enough, rows, lambda reuse: _blocks(prepared, reuse))
    result = apply_reuse(prepared, chosen)
    require_memory(result)
    return result, AutoSettings(
        reuse=chosen,
        keys=keys,
        enough=enough(chosen),
        error=(model.variance(chosen) / wanted) ** 0.5,
        time=model.time(chosen, _blocks(prepared, chosen)) / model.time(DEFAULT, _blocks(prepared, DEFAULT)),
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
    """Return the variance of a pixel with the default window on an ordinary walk, in units of that of one hit."""
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
    blocks: Callable[[Reuse], int] = lambda _: 1,
) -> Reuse:
    """Return the fastest settings that pass the test; the shorter window of two that are equally fast.

    If none pass, return those with the least product of time and variance: with fewer hits time falls and variance
    grows, so the product shows which window uses its time best.

    Args:
        rows: lists of settings, in each of which hits, time and accuracy rise.
        blocks: number of blocks of light positions that settings are rendered in.
    """
    reached, rest = [], []
    for row in rows:
        good = next(filter(enough, row), None)
        if good is not None:
            reached.append(good)
        rest += row
    if reached:
        return min(reached, key=lambda reuse: model.time(reuse, blocks(reuse)))
    return min(rest, key=lambda reuse: model.time(reuse, blocks(reuse)) * model.variance(reuse))


def _blocks(prepared: Prepared, reuse: Reuse) -> int:
    return len(light_blocks(apply_reuse(prepared, reuse), 0.0, ROOM))
