"""Noise of direct light, and how much of it changes along the light path: hard sources and soft ones."""

import time
from collections.abc import Sequence
from pathlib import Path

import numpy as np

from bench.core.cases import with_tables
from bench.core.frames import frames
from bench.core.results import Table
from bench.speed.speed import log
from bench.truth.flicker import change
from framearray_cli.base.arrays import Flags, Float64
from framearray_cli.job.job import Job
from framearray_cli.render.prepare import prepare, prepared_from
from framearray_cli.report.case import plan_case

from .sources import DIRECT, Source, job_at, job_with, sources_of

RESOLUTION, QUICK_RESOLUTION = (80, 60), (24, 18)
FINER = 4  # times as many light positions as the job has, as a movie would show
POSITIONS, QUICK_POSITIONS = 24, 3  # of them, in the middle of the path
SEEDS, QUICK_SEEDS = 8, 2
MORE_HITS = 10  # of the pictures that show where half-shadows are
HALF_SHADOW = 0.02  # of the mean of the picture: by how much pictures of the same hits differ, in any channel
# By part: the job, the place on its camera path, and its sources with a size, each with the same source without.
PARTS: dict[str, tuple[str, float, dict[str, str]]] = {
    "noise-cabin": ("cabin", 0.4, {"sphere": "point", "square": "speck", "square of 40 cm": "speck"}),
    "noise-kitchen": ("kitchen", 0.85, {"sun": "direction"}),  # where the sun shines on what is seen
}


def measure(part: str, quick: bool, folder: Path) -> Table:
    """Measure a part: source -> noise and flicker of its direct light, and of the same source without a size."""
    name, place, pairs = PARTS[part]
    job = job_at(name, QUICK_RESOLUTION if quick else RESOLUTION)
    steps, count = FINER * (job.light.frames - 1) + 1, QUICK_POSITIONS if quick else POSITIONS
    positions, c = range((steps - count) // 2, (steps + count) // 2), int(place * job.camera.frames)
    known, seeds = sources_of(name, folder / "lights"), range(1, 1 + (QUICK_SEEDS if quick else SEEDS))
    found: Table = {}
    for source, without in pairs.items():
        soft, hard = (job_with(job, finer(known[one]), DIRECT, steps) for one in (source, without))
        sharp, smooth = (pictures(better(one), c, positions, seeds[:1]) for one in (hard, soft))
        half = (np.abs(smooth - sharp)[0] > HALF_SHADOW * sharp.mean()).any(axis=-1)  # (n_l, h, w)
        found[source] = {
            "share": float(half.mean()),
            "without": without,
            "hard": figures(pictures(hard, c, positions, seeds), half),
            "soft": figures(pictures(soft, c, positions, seeds), half),
        }
        log(f"{part}: {source}: {found[source]}")
    return {"job": name, "seeds": len(seeds), "positions": len(positions), "sources": found}


def finer(sources: Sequence[Source]) -> list[Source]:
    """The sources with FINER steps in place of each."""
    return [
        {**source, "keys": [{**key, "frame": FINER * key["frame"]} for key in source["keys"]]} for source in sources
    ]


def figures(images: Float64, half: Flags) -> Table:
    """Noise and its change along the light path, over the mean light; everywhere, and in half-shadows.

    Args:
        images: (n_seeds, n_l, h, w, 3).
        half: (n_l, h, w).
    Returns:
        noise: standard deviation of an image; change: of the difference of two neighbours; true: RMS difference of the
        means of neighbours; half_noise, half_change: the same where at least one of the two is in half-shadow.
    """
    level = float(images.mean())
    spread, steps = images.var(axis=0, ddof=1), np.diff(images, axis=1)
    moved = steps.var(axis=0, ddof=1)
    means = images.mean(axis=0)
    edges = half[1:] | half[:-1]
    square = change(means, 0) ** 2 - float(moved.mean()) / len(images)
    return {
        "noise": float(spread.mean()) ** 0.5 / level,
        "change": float(moved.mean()) ** 0.5 / level,
        "true": max(square, 0.0) ** 0.5 / level,
        "half_noise": _root(spread[half]) / level,
        "half_change": _root(moved[edges]) / level,
    }


def _root(squares: Float64) -> float:
    return float(squares.mean()) ** 0.5 if squares.size else 0.0


def better(job: Job) -> Job:
    """The job with MORE_HITS times the hits."""
    assert isinstance(job.samples.hits, int | float)
    return with_tables(job, {"samples": {"hits": MORE_HITS * job.samples.hits}})


def pictures(job: Job, c: int, positions: Sequence[int], seeds: Sequence[int]) -> Float64:
    """Direct light of frame c, with its window, by seed, (n_seeds, n_l, h, w, 3)."""
    started, prepared = time.perf_counter(), prepare(job)
    prepared = prepared_from(job, prepared.scene, prepared.eyes, prepared.lights.at(positions))
    with plan_case(prepared) as case:
        made = frames(case, c, seeds)
    log(f"  {job.name}: {len(seeds)} pictures in {time.perf_counter() - started:.1f} s")
    return np.stack([composed.images.astype(np.float64) for composed in made])
