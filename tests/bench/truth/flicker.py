"""Measures how much errors change from one image to the next: `python -m bench flicker`.

An error that stays where it is looks like texture, one that changes flickers. The reference is the same method with a
hundred times the samples: ten times the hits, each with ten times the rays, and cells of four times the samples.
"""

from collections.abc import Sequence
from typing import Any

import numpy as np
from support.tables import Section, percent, write_csv

from bench.core.cases import JOBS, job_named, with_resolution, with_tables
from bench.core.results import Table, folder, load_some, save, site_for
from bench.speed.speed import log
from framearray_cli.base.arrays import Float64
from framearray_cli.engine.frames.pool import TracePool
from framearray_cli.engine.images.window import Window
from framearray_cli.engine.loop import ready_frames
from framearray_cli.job.job import Job
from framearray_cli.render.plan import image_ambient, plan_work
from framearray_cli.render.prepare import open_embree, prepare

RESOLUTION, QUICK_RESOLUTION = (80, 60), (40, 30)
CAMERAS, FIRST = 3, 0.4  # consecutive positions, from this share of the path on
MORE_HITS, MORE_RAYS, CELL_SAMPLES = 10, 10, 2**22
# Nothing but direct light, of the same hits.
DARK: dict[str, Any] = {
    "ambient": {"intensity": (0.0, 0.0, 0.0)},
    "indirect": {"method": "obscurance"},
    "samples": {"obscurance": 1},
}
CELLS = {"indirect": {"method": "cells"}}


def run(names: Sequence[str], quick: bool) -> None:
    """Measure the jobs, and write the table."""
    out = folder(quick)
    for name in names or JOBS:
        table = measure(name, quick)
        log(f"{name}: {table}")
        save(out, f"flicker-{name}", table)
    write(load_some(out, {name: f"flicker-{name}" for name in JOBS}), quick)


def measure(name: str, quick: bool) -> Table:
    """The change of errors of direct and of indirect light, over the mean light, along l and along c."""
    job = with_resolution(job_named(name, quick), QUICK_RESOLUTION if quick else RESOLUTION)
    first = int(FIRST * job.camera.frames)
    cameras = range(first, first + CAMERAS)
    dark, cells = with_tables(job, DARK), with_tables(job, CELLS)
    direct, right_direct, whole, right = (images_of(one, cameras) for one in (dark, better(dark), cells, better(cells)))
    level = float(right.mean())
    parts = {
        "direct": (direct, right_direct),
        "indirect": (whole - direct, right - right_direct),
        "all": (whole, right),
    }
    table: Table = {}
    for part, (found, reference) in parts.items():
        for axis, way in ((1, "l"), (0, "c")):
            table[f"{part}_{way}"] = change(found - reference, axis) / level
            table[f"{part}_true_{way}"] = change(reference, axis) / level
    return table


def change(values: Float64, axis: int) -> float:
    """Root mean square difference of neighbours along an axis."""
    return float((np.diff(values, axis=axis) ** 2).mean()) ** 0.5


def better(job: Job) -> Job:
    """The job with a hundred times the samples, and another seed."""
    assert isinstance(job.samples.hits, int | float)
    more: dict[str, Any] = {"samples": {"hits": MORE_HITS * job.samples.hits}}
    if job.indirect.method == "cells":
        more["samples"]["obscurance"] = MORE_RAYS * job.samples.obscurance
        more["indirect"] = {"samples": CELL_SAMPLES}
    return with_tables(job, more).model_copy(update={"seed": job.seed + 1})


def images_of(job: Job, cameras: range) -> Float64:
    """Images of some camera positions under every light, (n_c, n_l, h, w, 3)."""
    prepared = prepare(job)
    with open_embree(prepared) as embree:
        setup, ambient = plan_work(prepared, embree)
        with TracePool(setup, prepared.threads) as pool:
            window = Window(setup, image_ambient(ambient, prepared.lights), pool)
            shape = (prepared.n_lights, setup.cams.height, setup.cams.width, 3)
            found = [
                window.compose(j, np.empty(shape, np.float32)).images.astype(np.float64)
                for j in ready_frames(window, setup, cameras, pool)
            ]
    return np.array(found)


def write(tables: dict[str, Table], quick: bool) -> None:
    """Write the table of all results."""
    rows = []
    for name, table in tables.items():
        for way, words in (("l", "light"), ("c", "camera")):
            keys = (f"direct_{way}", f"indirect_{way}", f"indirect_true_{way}", f"all_{way}", f"all_true_{way}")
            rows.append([name, words, *(percent(table[key]) for key in keys)])
    head = ("job", "along", "direct", "indirect", "true change, indirect", "all light", "true change, all light")
    write_csv(site_for(quick).tables / "flicker.csv", [Section("Flicker", head, rows)])
