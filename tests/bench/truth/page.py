"""Results -> docs/quality/truth.csv and its pictures. Nothing is measured here."""

from collections.abc import Mapping, Sequence
from pathlib import Path

import numpy as np
from PIL import Image as Pillow
from support.tables import publish

from bench.core.cases import JOBS
from bench.core.machine import named
from bench.core.markdown import grid, number, percent
from bench.core.results import Site, Table, folder, load, site_for
from framearray_cli.base.arrays import Float32, Image
from framearray_cli.base.colour import srgb8_from_linear

from .compare import BLOCK, means
from .places import Place

HEAD = f"""
# Against the true light

How far images of the jobs are from path-traced ones of the same scene: Mitsuba's `path` integrator, the same triangles,
textures, mirrors, sources and background, without an end to its paths but by chance. `make bench-truth` measures and
writes this page; `tests/bench/truth/` says how. Images are those that `framearray render` writes, with the job's own
samples; only the keys of indirect light differ.

*All light*: RMSE of means over {BLOCK} x {BLOCK} pixels, over their root mean square. *Indirect*: RMSE per pixel,
noise of ours included, over the mean indirect light. *Mean*: over that of the truth. Noise of the path-traced images is
no part of any figure: errors against two independent halves of them are multiplied.

Images after those of the kitchen, the stairs and the cabin are of
[scenes by other people](real-scenes.md), 200 x 150, with few positions of camera and light
(`tests/support/real_jobs.py`), so that an image takes longer and one of Mitsuba's less.
"""
TIMES = """
*ms per image*: of interior frames of the job, all light positions, with writing; of Mitsuba rendering only. *Error*:
all light, as above. The error of path tracing is its noise, which falls with the square root of its samples per pixel;
fewer than one may have the error of ours.
"""
METHODS = ("obscurance", "obscurance, fit", "cells")
SHOWN = ("obscurance", "cells")
WIDTH, GAP, QUALITY = 300, 4, 82  # of one picture and between two, pixels; of JPEG


def write(places: Sequence[Place], quick: bool) -> None:
    """Write the page from all results there are; quick results go beside themselves."""
    page = site_for(quick).pages / "truth.md"
    page = publish(page, render(places, folder(quick), site_for(quick)))
    print(page)


def render(places: Sequence[Place], results: Path, site: Site) -> str:
    """The whole page; images without results are left out."""
    found = {place: table for place in places if (table := load(results, f"truth-{place.name}"))}
    compared = {place: table for place, table in found.items() if "noise" in table}
    parts = [HEAD, "## Errors", _errors(compared), *_times(compared, results)]
    parts += _pictures(compared, results, site)
    skipped = {place.name: table["traced"]["skipped"] for place, table in found.items() if "skipped" in table["traced"]}
    if skipped:
        parts.append("Not path-traced: " + "; ".join(f"{name}: {why}" for name, why in skipped.items()) + ".")
    return "\n\n".join(part.strip("\n") for part in parts) + "\n"


def _errors(compared: Mapping[Place, Table]) -> str:
    rows = []
    for place, table in compared.items():
        for method in METHODS:
            one = table["methods"].get(method, {"skipped": ""})
            if "skipped" in one:
                continue
            numbers = [percent(one["all"]), _mean(one["mean"]), percent(one["indirect"]), _mean(one["indirect_mean"])]
            rows.append([f"{place.job}, c = {place.c}, l = {place.l}", f"`{method}`", *numbers])
        noise = table["noise"]
        rows.append(["", "noise of the truth", percent(noise["all"]), "", percent(noise["indirect"]), ""])
    return grid(("image", "method", "all light", "mean", "indirect", "mean"), rows)


def _mean(share: float) -> str:
    return f"{share:.3f}"


def _times(compared: Mapping[Place, Table], results: Path) -> list[str]:
    """Time per image, and that of path tracing for the same error."""
    rows, machines = [], set()
    for place, table in compared.items():
        traced, pace = table["traced"], load(results, f"truth-pace-{place.job}") or {}
        noise = table["noise"]["all"]
        for method in METHODS:
            one = table["methods"].get(method, {})
            if "all" not in one or method not in pace or "seconds" not in traced or one["all"] <= 0:
                continue
            if "machine" in pace:
                machines.add(named(pace["machine"]))
            needed = (noise / one["all"]) ** 2  # samples for the same error, over those that were traced
            ms = 1e3 * traced["seconds"] * needed
            rows.append(
                [
                    f"{place.job}, c = {place.c}, l = {place.l}", f"`{method}`", number(pace[method]),
                    percent(one["all"]), number(traced["samples"] * needed), number(ms),
                    f"{number(ms / pace[method])}x",
                ]
            )  # fmt: skip
    head = ("image", "method", "ms per image", "error", "Mitsuba: samples", "ms per image", "over ours")
    measured_on = [f"Measured on {' and '.join(sorted(machines))}."] if machines else []
    return ["## Time at equal error", TIMES, *measured_on, grid(head, rows)] if rows else []


def _pictures(compared: Mapping[Place, Table], results: Path, site: Site) -> list[str]:
    """A strip per job of the project: truth, each method, and the difference of the last from the truth."""
    parts = [
        "## Pictures",
        f"Truth, `{'`, `'.join(SHOWN)}`, and `{SHOWN[-1]}` minus truth: grey is none, white as much as the mean of the"
        " image.",
    ]
    for place in {place.job: place for place in compared if place.job in JOBS}.values():  # the last of each job
        shown = results / f"truth-shown-{place.name}.npz"
        if not shown.is_file():
            continue
        with np.load(shown) as kept:
            images = {name: kept[name] for name in kept.files}
        file = site.pictures / f"truth-{place.name}.jpg"
        if all(name in images for name in ("truth", *SHOWN)):
            _save(_strip(images), file)
            parts.append(f"![{place.job}: truth, {', '.join(SHOWN)}, difference]({site.link(file)})")
    return parts if len(parts) > 2 else []


def _strip(images: Mapping[str, Image]) -> list[Image]:
    """What stands side by side, display values from 0 to 255, (h, w, 3)."""
    row = [srgb8_from_linear(images[name]) for name in ("truth", *SHOWN)]
    error = means(images[SHOWN[-1]]) - means(images["truth"])
    grey = np.clip(0.5 + error / (2 * images["truth"].mean()), 0.0, 1.0)
    full = np.repeat(np.repeat(grey, BLOCK, axis=0), BLOCK, axis=1)
    return [*row, np.asarray(255 * full + 0.5, np.uint8)]


def _save(row: Sequence[Image], file: Path) -> None:
    height = round(WIDTH * row[0].shape[0] / row[0].shape[1])
    canvas = Pillow.new("RGB", (len(row) * (WIDTH + GAP) - GAP, height), "white")
    for i, image in enumerate(row):
        small = Pillow.fromarray(np.ascontiguousarray(image)).resize((WIDTH, height), Pillow.Resampling.LANCZOS)
        canvas.paste(small, (i * (WIDTH + GAP), 0))
    file.parent.mkdir(parents=True, exist_ok=True)
    canvas.save(file, quality=QUALITY)


def keep(images: Mapping[str, Float32], place: Place, results: Path) -> None:
    """Add images of a place to those that the page shows."""
    file = results / f"truth-shown-{place.name}.npz"
    known: dict[str, Float32] = {}
    if file.is_file():
        with np.load(file) as kept:
            known = {name: kept[name] for name in kept.files}
    np.savez(file, **{**known, **images})  # type: ignore[arg-type]  # numpy's stubs take no names from a dictionary
