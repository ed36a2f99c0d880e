"""Path-traced pictures of a job's images, from Mitsuba 3, kept on the disk."""

from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np

from bench.core.results import Table
from bench.speed.processes import asked_of_mitsuba
from bench.speed.speed import log
from framearray_cli.base.arrays import Float32
from framearray_cli.render.prepare import prepare

from . import mitsuba
from .places import Place, job_of

SAMPLES, QUICK_SAMPLES = 128, 32  # per pixel, in all


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class Truth:
    """A path-traced image in two independent halves: all light, and that without light from sources, (2, h, w, 3)."""

    total: Float32
    indirect: Float32


def trace(place: Place, quick: bool) -> Table:
    """Trace an image in a process of its own; {"skipped": why} where that is impossible."""
    table = asked_of_mitsuba("trace-place", place.job, str(place.c), str(place.l), quick=quick)
    log(f"{place.name}: traced")
    return table


def trace_here(place: Place, quick: bool, folder: Path) -> Table:
    """Trace an image into `folder` in this process."""
    mi, why = mitsuba.find_mitsuba()
    if why:
        return {"skipped": why}
    prepared = prepare(job_of(place.job, quick))
    if why := mitsuba.unknown(prepared.scene):
        return {"skipped": why}
    samples = QUICK_SAMPLES if quick else SAMPLES
    traced = mitsuba.pictures(mi, prepared, place, samples)
    folder.mkdir(parents=True, exist_ok=True)
    file = folder / f"truth-{place.name}.npz"
    traced.save(file)
    return {"file": file.name, "version": mi.__version__, "samples": samples, "seconds": traced.seconds}


def read(file: Path) -> Truth:
    """Read a traced image."""
    with np.load(file) as kept:
        total: Any = kept["total"]
        return Truth(total=total, indirect=total - kept["light"])
