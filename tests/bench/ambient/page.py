"""Results -> docs/quality/ambient.md, its plots and its pictures. Nothing is measured here."""

from collections.abc import Mapping
from pathlib import Path

import numpy as np
from scipy.stats import chi2, norm

from bench.core.cases import JOBS
from bench.core.markdown import grid, number, percent
from bench.core.results import Site, Table, folder, load, site_for

from .levels import METHODS
from .pictures import OWN_LEVEL
from .plots import draw, strips
from .scenes import SMALLER, probes

HEAD = """
# Ambient light, measured

How I_A depends on the number of walks, whether its reported error is right, and how far pictures are from
path-traced ones: because of the model, and because of sampling. `make bench-ambient` measures and writes this page;
`tests/bench/` says how. The [decision](../decisions/ambient.md) has the conclusions.
"""
# Chance that any ratio of a page is marked although all reported errors are right: that of 3 standard errors.
CHANCE = 2 * norm.sf(3.0)


def write(quick: bool) -> None:
    """Write the page from all results there are; quick results go beside themselves."""
    page = site_for(quick).pages / "ambient.md"
    page.write_text(render(folder(quick), site_for(quick)), encoding="utf-8")
    print(page)


def render(results: Path, site: Site) -> str:
    """The whole page; parts without results are left out."""
    names = [probe.name for probe in probes()]
    levels = {name: table for name in names if (table := load(results, f"ambient-levels-{name}"))}
    compared = {name: table for name in names if (table := load(results, f"ambient-pictures-{name}"))}
    pictures = {name: table for name, table in compared.items() if "skipped" not in table}
    along = {name: table for name in names if (table := load(results, f"ambient-along-{name}")) and "cameras" in table}
    left_out = {name: table["skipped"] for name, table in compared.items() if "skipped" in table}
    drawn = {plot: site.link(file) for plot, file in draw(levels, pictures, site.plots).items()}
    parts = [HEAD]
    if levels:
        parts += [*walks(levels, drawn), *honesty(levels)]
    if pictures:
        parts += level(pictures, drawn)
    if along:
        parts += paths(along)
    if pictures:
        shown = strips(pictures, results, site.pictures)
        parts += errors(pictures, {name: site.link(file) for name, file in shown.items()})
        parts += same_light(pictures)
    if left_out:
        parts.append("Not path-traced: " + "; ".join(f"{name}: {why}" for name, why in left_out.items()) + ".")
    return "\n\n".join(part.strip("\n") for part in parts) + "\n"


def walks(levels: Mapping[str, Table], drawn: Mapping[str, str]) -> list[str]:
    """I_A and its error against the number of walks."""
    seeds = next(iter(levels.values()))["methods"][METHODS[0]]["rows"][0]["freedom"] + 1
    about = f"""
One light position of each scene: the middle of the light path. I_A is the mean of its channels, over {seeds}
independent seeds; *spread* is the standard deviation of one estimate over its mean, *reported* the standard error that
the program reports with it, *ms* the processor time per estimate. The last row is a separate estimate. The right value
of the furnace is known.
"""
    parts = ["## Walks and error", about]
    if "walks" in drawn:
        parts.append(f"![Spread of I_A against walks]({drawn['walks']})")
        parts.append("*Spread (lines) and reported standard error (dots) of I_A, over its mean.*")
    for name, table in levels.items():
        rows = []
        for i in range(len(table["methods"][METHODS[0]]["rows"])):
            found = [table["methods"][method]["rows"][i] for method in METHODS]
            cells = [f"{found[0]['paths']:,}"]
            for row in found:
                cells += [number(row["mean"], 4), percent(row["spread"] / row["mean"], 2)]
                cells += [percent(row["reported"] / row["mean"], 2), number(1e3 * row["cpu_s"], 2)]
            rows.append(cells)
        rows.append(_many(table))
        head = ["walks"]
        for method in METHODS:
            head += [f"`{method}`", "spread", "reported", "ms"]
        right = f" Right: {number(table['right'], 6)}." if "right" in table else ""
        parts += [f"### {name}", f"{_capital(table['words'])}, l = {table['light']}.{right}", grid(head, rows)]
    return parts


def _many(table: Table) -> list[str]:
    cells = ["many"]
    for method in METHODS:
        found = table["methods"][method]["many"]
        cells += [number(found["mean"], 4), "", percent(found["error"] / found["mean"], 2), ""]
    return cells


def _capital(words: str) -> str:
    return words[0].upper() + words[1:]


def honest_range(freedom: int, chance: float) -> tuple[float, float]:
    """The range of ratios of spread to reported error that right errors leave only by a given chance."""
    low, high = np.sqrt(chi2.ppf([chance / 2, 1 - chance / 2], freedom) / freedom)
    return float(low), float(high)


def honesty(levels: Mapping[str, Table]) -> list[str]:
    """Spread over reported error, all numbers of walks together."""
    each = 1 - (1 - CHANCE) ** (1 / (len(levels) * len(METHODS)))
    rows, marked = [], False
    for name, table in levels.items():
        cells = [name]
        for method in METHODS:
            found = table["methods"][method]["rows"]
            freedom = sum(row["freedom"] for row in found)
            ratio = float(np.sqrt(sum(row["squares"] for row in found) / freedom))
            low, high = honest_range(freedom, each)
            marked |= not low < ratio < high
            cells += [number(ratio) + ("" if low < ratio < high else " *")]
            cells.append(", ".join(number(np.sqrt(row["squares"] / row["freedom"]), 2) for row in found))
        rows.append(cells)
    head = [""]
    for method in METHODS:
        head += [f"`{method}`", "by number of walks"]
    about = f"""
Spread over reported standard error, from all rows of a table above together, and from each. Right errors give
{low:.2f} to {high:.2f} in all of them at once, except by the chance of 3 standard errors. Above 1 an error is larger
than reported; below 1 it is smaller, because walks are spread more evenly than independent ones would be.
"""
    parts = ["## Reported errors", about, grid(head, rows)]
    return [*parts, r"\* outside of that."] if marked else parts


def level(pictures: Mapping[str, Table], drawn: Mapping[str, str]) -> list[str]:
    """Mean of the indirect light of each method over the path-traced one."""
    traced = next(iter(pictures.values()))["traced"]
    about = f"""
One picture of each scene (of the jobs at 0.4 of the camera path and the middle of the light path), path-traced by
Mitsuba {traced["version"]}'s `path` integrator with {traced["samples"]:,} samples per pixel: the same triangles,
normals, textures, mirrors, lights and background; paths end only by chance. Indirect light is all light except that
which comes from a source or the background directly or only by mirrors. The table has the mean indirect light over the
path-traced mean, channels and pixels together. I_A comes from many walks, so that its own error is small. The jobs' I_A
is for all their cameras, so one picture may be wrong where the mean over the cameras is right. The generated scenes
have only one camera: there "fit" must be 1 within the standard errors of both; the last columns have these, and z.
"""
    rows = []
    for name, table in pictures.items():
        cells = [name, percent(table["share"], 2)]
        for method in METHODS:
            found = table["model"][method]
            cells.append(number(found["indirect"]["ratio"]))
        fit = table["model"]["fit"]
        off = fit["indirect"]["ratio"] - 1
        error = float(np.hypot(fit["error"], fit["indirect"]["ratio_error"]))
        cells += [f"{error:.3f}", "" if name in (*JOBS, *SMALLER) else f"{off / error:+.1f}"]
        rows.append(cells)
    head = ["", "indirect light, share", *(f"`{method}`" for method in METHODS), "standard error", "z of `fit`"]
    parts = ["## The level of indirect light", about]
    if "levels" in drawn:
        parts.append(f"![Mean indirect light over the path-traced one]({drawn['levels']})")
    return [*parts, grid(head, rows)]


def paths(along: Mapping[str, Table]) -> list[str]:
    """Mean indirect light along the camera path."""
    n = len(next(iter(along.values()))["cameras"])
    about = f"""
There is one I_A for all cameras of a light position. Mean indirect light at {n} cameras spread over the path, over the
path-traced mean: of all of them together, and of single ones.
"""
    rows = []
    for name, table in along.items():
        cells = [name]
        for method in METHODS:
            found = table["methods"][method]
            ratios = np.array(found["ratios"])
            cells += [number(found["ratio"]), f"{ratios.min():.2f} to {ratios.max():.2f}"]
        rows.append([*cells, percent(float(np.hypot.reduce(table["error"]) / np.sum(table["indirect"])), 2)])
    head = [""]
    for method in METHODS:
        head += [f"`{method}`", "single cameras"]
    return ["## Along the camera path", about, grid([*head, "standard error, path traced"], rows)]


def errors(pictures: Mapping[str, Table], shown: Mapping[str, str]) -> list[str]:
    """Distances from the path-traced pictures, by scene."""
    epsilon = next(iter(pictures.values()))["epsilon"]
    about = f"""
*Model*: with little noise, so that the error of obscurances remains. *{_capital(OWN_LEVEL)}*: with the I_A
that makes this one picture's indirect light right on average, which no method can know; the remaining error is in
single places. *Own settings*: the picture from the job's own numbers of hits, rays and walks: error of model and
sampling. RMSE and *mean error* (mean of I - R) are relative to the mean of their path-traced part; relMSE is the
mean of (I - R)^2 / (R^2 + {epsilon}), with R below the line the mean of the 24 pixels around. None of them contains
the noise of the path-traced picture: errors against two independent halves are multiplied.
"""
    parts = ["## Whole pictures", about]
    head = [
        "", "I_A", "standard error", "indirect: mean error", "RMSE", "relMSE", "all light: mean error", "RMSE",
        "relMSE",
    ]  # fmt: skip
    for name, table in pictures.items():
        rows = [_row(f"model, {method}", row) for method, row in table["model"].items()]
        rows += [_row(f"own settings, {method}", row) for method, row in table["own"].items()]
        noise = table["noise"]
        where = f"Camera {table['camera']}, l = {table['light']}. RMSE of the path-traced picture itself: "
        where += f"{percent(noise['whole'], 2)}, of its indirect light {percent(noise['indirect'], 2)}."
        parts += [f"### Picture: {name}", f"{_capital(table['words'])}. {where}"]
        if name in shown:
            parts.append(f"![{name}: eye, fit, path traced, and the errors]({shown[name]})")
            parts.append(
                "*`eye`, `fit`, path traced; then `eye` and `fit` minus path traced: red is too bright, blue too dark, "
                "full colour is an error of the mean of the picture.*"
            )
        parts.append(grid(head, rows))
    return parts


def _row(name: str, row: Table) -> list[str]:
    cells = [name, number(float(np.mean(row["level"])), 3), percent(row["error"], 2) if "error" in row else ""]
    for part in ("indirect", "whole"):
        found = row[part]
        cells += [f"{100 * (found['ratio'] - 1):+.1f} %", percent(found["rmse"], 2), number(found["relmse"], 2)]
    return cells


def same_light(pictures: Mapping[str, Table]) -> list[str]:
    """Both programs see the same scene."""
    about = """
Light directly from the sources and the background, mirrors included, does not involve obscurances: both programs must
agree. The table has the mean of ours over Mitsuba's, its standard error from Mitsuba's noise, and the RMSE without
Mitsuba's noise; it contains our own noise, at shadow edges. On the stairs Mitsuba's rays start 1 mm and more above a
surface, so that some light gets below the edges of steps.
"""
    rows = []
    for name, table in pictures.items():
        found = table["direct"]
        cells = [f"{found['ratio']:.4f}", f"{found['ratio_error']:.4f}", percent(found["rmse"], 2)]
        rows.append([name, *cells])
    return ["## The same light", about, grid(["", "mean", "standard error", "RMSE"], rows)]
