"""Standard error that images report, and their true error: docs/quality/standard-error.csv.

*Reported* is the root mean square of the standard error over a picture, *true* the RMSE from a reference without the
reference's own error; both relative to the mean of the reference.
"""

from collections.abc import Sequence
from dataclasses import replace
from pathlib import Path

import numpy as np
from support.tables import Section, number, percent, write_csv

from bench.core.cases import (
    Case,
    Variant,
    choose_images,
    job_named,
    make_variant,
    open_case,
    with_lights,
    with_resolution,
    with_settings,
)
from bench.core.frames import frame
from bench.core.plots import plotted
from bench.core.results import DOCS, Table
from bench.speed.speed import log
from framearray_cli.engine.frames.passes import frames_per_turn
from framearray_cli.engine.hits.row import BY_SAMPLE
from framearray_cli.engine.images.standard_error import square_mean, standard_error
from framearray_cli.render.plan import FEWEST_SPLIT
from framearray_cli.report.reference import PASSES, Reference, make_reference, rmse

RESOLUTION = (160, 120)
PLACES = (0.25, 0.6)  # of the camera path
SEED = 303
TRIED = tuple(
    make_variant(f"{weights}, n_r {n_r}, hits {hits:g}", n_r=n_r, hits=hits, weights=weights)
    for n_r, weights, counts in (
        (0, "average", (2, 8, 32, 224)),
        (3, "average", (0.5, 1, 2, 8, 32)),
        (3, "balance", (0.5, 1, 2, 8, 32)),
        (0, "area", (2, 8, 32)),
        (3, "area", (0.5, 1, 2, 8, 32)),
    )
    for hits in counts
)


def measure(name: str, folder: Path) -> list[Table]:
    """For each setting, camera and light position: the reported error, and the true one."""
    rows: list[Table] = []
    with open_case(with_resolution(job_named(name, False), RESOLUTION)) as whole:
        l = [*choose_images(whole.setup.lights.n_lights, ())]
        case = with_lights(whole, l)
        for place in PLACES:
            c = round(place * case.setup.n_frames)
            wanted = make_reference(whole, c, l, folder, PASSES)
            for variant in TRIED:
                rows += [{"job": name, "variant": variant.name, **row} for row in compare(case, variant, c, wanted)]
                last = rows[-1]
                log(f"{name}, camera {c}, {variant.name}: reported {last['reported']:.2%}, true {last['true']:.2%}")
    return rows


def compare(case: Case, variant: Variant, c: int, wanted: Reference) -> list[Table]:
    """Each image of frame c made by a variant: the error that it reports, and how far it is from the reference."""
    setup = with_settings(case, variant.settings).setup
    native, n_r = variant.settings.hits, variant.settings.n_r
    halves = BY_SAMPLE if native >= FEWEST_SPLIT or n_r == 0 else frames_per_turn(native)
    made = frame(replace(case, setup=replace(setup, halves=halves)), c, SEED)
    assert made.differences is not None
    hits = made.hits.reshape(made.images.shape[1:3])
    rows = []
    for k, image in enumerate(made.images):
        ambient = case.ambient.intensity[k]
        right = wanted.image(k, ambient)
        mean = float(right.mean(dtype=np.float64))
        apart = rmse(wanted.half(0, k, ambient), wanted.half(1, k, ambient)) / 2  # of the reference itself
        true = max(rmse(image, right) ** 2 - apart**2, 0.0) ** 0.5
        found = square_mean(standard_error(made.differences[k], hits)) ** 0.5
        relative = {"reported": found / mean, "true": true / mean, "reference": apart / mean}
        rows.append({"camera": c, "light": k, **relative})
    return rows


def write(rows: Sequence[Table]) -> None:
    """Write the table and its plot."""
    jobs = dict.fromkeys(row["job"] for row in rows)
    table = []
    for variant in TRIED:
        cells = [variant.name]
        for job in jobs:
            some = [row for row in rows if (row["job"], row["variant"]) == (job, variant.name)]
            found, true = (float(np.sqrt(np.mean([row[key] ** 2 for row in some]))) for key in ("reported", "true"))
            cells += [percent(found), percent(true), number(found / true)]
        table.append(cells)
    head = ["setting", *(cell for job in jobs for cell in (f"{job}, reported", "true", "ratio"))]
    write_csv(DOCS.tables / "standard-error.csv", [Section("The error that images report", head, table)])
    _plot(rows, DOCS.plots / "standard-error.svg")


def _plot(rows: Sequence[Table], file: Path) -> None:
    """Reported against true, one point per image."""
    labels = {"xlabel": "RMSE from the reference / mean", "ylabel": "reported / mean"}
    with plotted(file, size=(4.6, 4.2), xscale="log", yscale="log", **labels) as (axes,):
        for weights, colour in (("average", "#c05621"), ("balance", "#2b6cb0"), ("area", "#2f855a")):
            for reuse, marker in (("n_r 3", "o"), ("n_r 0", "x")):
                some = [row for row in rows if row["variant"].startswith(weights) and reuse in row["variant"]]
                style = {"color": colour, "markersize": 3.5, "alpha": 0.7, "label": f"{weights}, {reuse}"}
                axes.plot([r["true"] for r in some], [r["reported"] for r in some], marker, **style)
        ends = np.array([min(row["true"] for row in rows), max(row["true"] for row in rows)])
        axes.plot(ends, ends, "-", color="#444", linewidth=0.8)
        axes.fill_between(ends, 0.8 * ends, 1.2 * ends, color="#888", alpha=0.2, linewidth=0, label="within 20 %")
