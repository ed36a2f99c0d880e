"""Measure how far images are from path-traced ones: `python -m bench truth` -> docs/quality/truth.csv and pictures.

All light: RMSE of means over 4 x 4 pixels, over their root mean square. Indirect: RMSE per pixel, noise of ours
included, over the mean indirect light. Mean: over the mean of the truth. Time at equal error: the error of path tracing
is its noise, which falls with the square root of its samples per pixel.
"""

from collections.abc import Mapping, Sequence
from pathlib import Path

import numpy as np
from PIL import Image as Pillow
from support.tables import Section, number, percent, times, write_csv

from bench.core.cases import JOBS
from bench.core.machine import describe
from bench.core.results import Table, folder, load, load_some, save, site_for
from bench.speed.processes import asked
from bench.speed.speed import log
from framearray_cli.base.arrays import Float32, Image
from framearray_cli.base.colour import srgb8_from_linear

from . import compare, rendered, traced
from .places import Place, known_jobs, places_of

SHOWN = ("obscurance", "cells")
WIDTH, GAP, QUALITY = 300, 4, 82  # of one picture and between two, pixels; of JPEG


def run(names: Sequence[str], quick: bool, methods: Sequence[str]) -> None:
    """Trace what is not traced, render by each method, compare, and write the tables of all results."""
    out, jobs = folder(quick), names or known_jobs()
    for place in (place for name in jobs for place in places_of(name, quick)):
        _measure(place, out, quick, methods or [*rendered.METHODS])
    options = ["--quick"] if quick else []
    for name in jobs:
        table = load(out, f"truth-pace-{name}") or {}
        for method in methods or rendered.METHODS:
            table[method] = asked("pace", name, "--method", method, *options)["ms"]
            log(f"{name}: {method}: {table[method]:.3g} ms per image")
        save(out, f"truth-pace-{name}", {**table, "machine": describe()})
    names_of = {place: f"truth-{place.name}" for name in known_jobs() for place in places_of(name, quick)}
    found = {place: table for place, table in load_some(out, names_of).items() if "noise" in table}
    write_csv(site_for(quick).tables / "truth.csv", [_errors(found), times_at_equal_error(found, out)])
    for place in {place.job: place for place in found if place.job in JOBS}.values():  # the last of each job
        _save_strip(_kept(out, place), site_for(quick).pictures / f"truth-{place.name}.jpg")


def _measure(place: Place, out: Path, quick: bool, methods: Sequence[str]) -> None:
    table = load(out, f"truth-{place.name}") or {"traced": traced.trace(place, quick), "methods": {}}
    save(out, f"truth-{place.name}", table)
    if "skipped" in table["traced"]:
        log(f"{place.name}: {table['traced']['skipped']}")
        return
    truth = traced.read(out / table["traced"]["file"])
    table["noise"] = compare.noise(truth)
    shown = {**_kept(out, place), "truth": truth.total.mean(axis=0)}
    direct = rendered.render(place, rendered.DIRECT, quick, out)
    for method in methods:
        image = rendered.render(place, rendered.METHODS[method], quick, out)
        if isinstance(image, str) or isinstance(direct, str):
            table["methods"][method] = {"skipped": image if isinstance(image, str) else direct}
        else:
            table["methods"][method] = compare.distance(image, direct, truth)
            shown[method] = image
        log(f"{place.name}: {method}: {table['methods'][method]}")
    save(out, f"truth-{place.name}", table)
    np.savez(out / f"truth-shown-{place.name}.npz", **shown)  # type: ignore[arg-type]  # numpy's stubs take no names


def _kept(out: Path, place: Place) -> dict[str, Float32]:
    """The images of a place that were compared."""
    file = out / f"truth-shown-{place.name}.npz"
    if not file.is_file():
        return {}
    with np.load(file) as kept:
        return {name: kept[name] for name in kept.files}


def _name(place: Place) -> str:
    return f"{place.job}, c = {place.c}, l = {place.l}"


def _errors(compared: Mapping[Place, Table]) -> Section:
    rows = []
    for place, table in compared.items():
        for method in rendered.METHODS:
            one = table["methods"].get(method, {})
            if "all" in one:
                means = [f"{one[key]:.3f}" for key in ("mean", "indirect_mean")]
                rows.append([_name(place), method, percent(one["all"]), means[0], percent(one["indirect"]), means[1]])
        noise = table["noise"]
        rows.append(["", "noise of the truth", percent(noise["all"]), "", percent(noise["indirect"]), ""])
    return Section("Errors", ("image", "method", "all light", "mean", "indirect", "mean"), rows)


def times_at_equal_error(compared: Mapping[Place, Table], results: Path) -> Section:
    """Time per image, and the time of path tracing for the same error."""
    rows = []
    for place, table in compared.items():
        traced_here, pace = table["traced"], load(results, f"truth-pace-{place.job}") or {}
        for method in rendered.METHODS:
            error = table["methods"].get(method, {}).get("all", 0.0)
            if error > 0 and method in pace and "seconds" in traced_here:
                needed = (table["noise"]["all"] / error) ** 2  # samples for the same error, over those that were traced
                ms = 1e3 * traced_here["seconds"] * needed
                cells = [percent(error), number(traced_here["samples"] * needed), number(ms), times(ms / pace[method])]
                rows.append([_name(place), method, number(pace[method]), *cells])
    head = ("image", "method", "ms per image", "error", "Mitsuba: samples", "ms per image", "over ours")
    return Section("Time at equal error", head, rows)


def _save_strip(images: Mapping[str, Image], file: Path) -> None:
    """Show truth, each method, and the difference of the last from the truth, where grey is none."""
    row = [srgb8_from_linear(images[name]) for name in ("truth", *SHOWN)]
    error = compare.means(images[SHOWN[-1]]) - compare.means(images["truth"])
    grey = np.clip(0.5 + error / (2 * images["truth"].mean()), 0.0, 1.0)
    row.append(np.asarray(255 * np.repeat(np.repeat(grey, compare.BLOCK, 0), compare.BLOCK, 1) + 0.5, np.uint8))
    height = round(WIDTH * row[0].shape[0] / row[0].shape[1])
    canvas = Pillow.new("RGB", (len(row) * (WIDTH + GAP) - GAP, height), "white")
    for i, image in enumerate(row):
        small = Pillow.fromarray(np.ascontiguousarray(image)).resize((WIDTH, height), Pillow.Resampling.LANCZOS)
        canvas.paste(small, (i * (WIDTH + GAP), 0))
    canvas.save(file, quality=QUALITY)
