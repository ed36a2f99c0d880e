"""`reuse.n_r = "auto"` and `samples.hits = "auto"`: the settings that take the least time for an error that is wanted.

The error that is wanted is that which the default, n_r = 3 and hits = 2, has on an ordinary walk; where the job says
`samples.hits`, that which n_r = 3 has with so many.
"""

from collections.abc import Callable, Iterator
from dataclasses import dataclass, replace

import numpy as np

from framearray_cli.base.forms.table import changed
from framearray_cli.engine.embree import EmbreeScene
from framearray_cli.job.job import Job
from framearray_cli.job.method import DEFAULT_HITS, DEFAULT_N_R
from framearray_cli.job.values import MOST_HITS, SHARES

from ..memory import light_blocks, require_memory
from ..prepare import Prepared
from .cost import Model, Reuse, independent_hits
from .probe import probe

# Longest windows that are tried. With `average` old views of a place bring an error that no number of hits removes.
LONGEST = {"balance": 16, "average": DEFAULT_N_R}
# Numbers of hits that are tried, rising.
HITS = (*sorted(SHARES), *map(float, range(1, 17)))
# What does not fit into so many bytes is thought to be rendered in blocks of light positions, whatever a machine has.
ROOM = 4 * 2**30
# Of the hits of the default window, how many count on an ordinary walk: 0.91 to 0.93 in the three jobs of the paper.
ORDINARY = 0.9
DEFAULT = Reuse(n_r=DEFAULT_N_R, hits=float(DEFAULT_HITS))
# Numbers of frames that the share of hits seen is told for.
SEEN_AT = (1, 2, 4, 8, 16)


@dataclass(frozen=True, slots=True, kw_only=True)
class AutoSettings:
    """What was chosen where the job says "auto", and why.

    Attributes:
        reuse: the settings; those that the job says itself are among them.
        keys: of the job file that say "auto".
        enough: whether it is as exact as wanted; else nothing that was tried is.
        error: expected, over that which is wanted.
        time: expected, over that of the default.
        hits: expected hits of a pixel, native and outer: mean and 1st percentile.
        seen: share of hits that eyes some frames away see, by that number of frames.
    """

    reuse: Reuse
    keys: tuple[str, ...]
    enough: bool
    error: float
    time: float
    hits: tuple[float, float]
    seen: dict[int, float]

    def table(self) -> dict[str, object]:
        """For the manifest."""
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
    """The same job with a number for each "auto", and why; no choice where the job says all numbers.

    Raises:
        JobError: it does not fit into memory with what was chosen.
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
        shadow_step=job.samples.shadow_step,
        balance=job.reuse.weights == "balance",
    )
    wanted = wanted_variance(job)
    enough, trying = accuracy_test(model, job), candidates(job, model.found.n_frames)
    chosen = choose(model, enough, trying, lambda reuse: _blocks(prepared, reuse))
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
    """Refuse a job that does not fit into memory whatever is chosen; see `require_memory`.

    Raises:
        JobError: it does not.
    """
    n_r, hits = prepared.job.reuse.n_r, prepared.job.samples.hits
    if hits == "auto" or prepared.job.samples.error is not None:
        hits = HITS[0]
    least = Reuse(n_r=0 if n_r == "auto" else n_r, hits=hits)
    require_memory(apply_reuse(prepared, least))


def auto_keys(job: Job) -> tuple[str, ...]:
    """The keys of a job that say "auto"."""
    values = {"reuse.n_r": job.reuse.n_r, "samples.hits": job.samples.hits}
    return tuple(key for key, value in values.items() if value == "auto")


def apply_reuse(prepared: Prepared, reuse: Reuse) -> Prepared:
    """The same job with these settings."""
    job = prepared.job
    new = changed(job, reuse=changed(job.reuse, n_r=reuse.n_r), samples=changed(job.samples, hits=reuse.hits))
    return replace(prepared, job=new)


def wanted_variance(job: Job) -> float:
    """Variance of a pixel of the default window on an ordinary walk, in units of that of one hit."""
    hits = DEFAULT.hits if job.samples.hits == "auto" else job.samples.hits
    return 1.0 / (ORDINARY * (2 * DEFAULT.n_r + 1) * float(independent_hits(np.array(hits))))


def accuracy_test(model: Model, job: Job) -> Callable[[Reuse], bool]:
    """What settings must be: as exact as wanted, and places that were just revealed no worse than by default."""
    wanted = wanted_variance(job)
    least = model.least(replace(DEFAULT, hits=DEFAULT.hits if job.samples.hits == "auto" else job.samples.hits))
    return lambda reuse: model.variance(reuse) <= wanted and model.least(reuse) >= least


def candidates(job: Job, n_frames: int) -> Iterator[list[Reuse]]:
    """The settings that a job leaves open, a list a window with hits rising; no window is longer than the path."""
    n_r, hits = job.reuse.n_r, job.samples.hits
    longest = min(LONGEST[job.reuse.weights], n_frames - 1)
    for window in range(longest + 1) if n_r == "auto" else [n_r]:
        each = [Reuse(n_r=window, hits=h) for h in (HITS if hits == "auto" else [hits])]
        yield [one for one in each if (2 * window + 1) * one.hits <= MOST_HITS]


def choose(
    model: Model,
    enough: Callable[[Reuse], bool],
    trying: Iterator[list[Reuse]],
    blocks: Callable[[Reuse], int] = lambda _: 1,
) -> Reuse:
    """The settings of least time that are exact enough; the shorter window if two are alike.

    Where none are, those of the least time for the error they give: time falls and variance grows as hits
    become fewer, so that their product tells which window makes the most of its time.

    Args:
        trying: lists of settings, in each of which hits, time and accuracy rise.
        blocks: of light positions that settings are rendered in.
    """
    reached, rest = [], []
    for row in trying:
        good = next(filter(enough, row), None)
        if good is not None:
            reached.append(good)
        rest += row
    if reached:
        return min(reached, key=lambda reuse: model.time(reuse, blocks(reuse)))
    return min(rest, key=lambda reuse: model.time(reuse, blocks(reuse)) * model.variance(reuse))


def _blocks(prepared: Prepared, reuse: Reuse) -> int:
    return len(light_blocks(apply_reuse(prepared, reuse), 0.0, ROOM))
