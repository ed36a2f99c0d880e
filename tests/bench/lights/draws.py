"""The time of drawing points of sources: once per hit, or once per hit and light position."""

import time
from pathlib import Path

import numpy as np

from bench.core.results import Table
from bench.speed.speed import log
from framearray_cli.base.arrays import Float32, with_room
from framearray_cli.engine.inputs.lights import LightArrays
from framearray_cli.engine.inputs.shapes import source_point
from framearray_cli.engine.kernels.kernel import kernel
from framearray_cli.engine.kernels.simd import LANES, load, store
from framearray_cli.render.prepare import prepare

from .sources import DIRECT, job_at, job_with, sources_of

HITS, QUICK_HITS = 1 << 16, 1 << 10
TIMES = 64  # draws per hit that are timed
RUNS = 5


@kernel
def draw_points(lights: LightArrays, key: np.uint64, n: int, times: int, out: Float32) -> None:
    """Draw points of source 0 by the keys of n hits, `times` each, and add their coordinates up."""
    for i in range(0, n, LANES):
        word = load(key, i)
        total = load(out, i)
        for k in range(times):
            x, y, z = source_point(lights, word + np.uint64(k), 0)
            total = total + (x + y + z)
        store(out, i, total)


def measure(part: str, quick: bool, folder: Path) -> Table:
    """Nanoseconds of one thread per draw, by job and source."""
    found: Table = {}
    for job, source in (("cabin", "sphere"), ("cabin", "square"), ("kitchen", "sun")):
        prepared = prepare(job_with(job_at(job, (16, 12)), sources_of(job, folder / "lights")[source], DIRECT))
        found[source] = per_draw(prepared.light_arrays, QUICK_HITS if quick else HITS)
        log(f"{part}: {source}: {found[source]:.2f} ns")
    return found


def per_draw(lights: LightArrays, n: int) -> float:
    """Median nanoseconds per draw of one thread."""
    key = with_room((n,), np.uint64, fill=1)
    key[:] = np.random.default_rng(1).integers(0, 2**63, n).astype(np.uint64)
    out = with_room((n,), np.float32, fill=0)
    draw_points(lights, key, n, 1, out)  # compiles it
    spent = []
    for _ in range(RUNS):
        started = time.perf_counter()
        draw_points(lights, key, n, TIMES, out)
        spent.append(time.perf_counter() - started)
    return 1e9 * float(np.median(spent)) / (n * TIMES)
