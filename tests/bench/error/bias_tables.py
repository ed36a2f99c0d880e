"""Results of bias.py -> docs/quality/bias.csv and docs/plots/bias.svg. Nothing is measured here.

Squared bias is in millionths of the squared mean, with its standard error; 2,500 is 5 % of the mean, root mean square.
"At most" is the upper bound of the squared bias of `balance` over that of `average`.
"""

import math
from collections.abc import Iterable, Mapping
from pathlib import Path

from support.tables import Section, number, percent, write_csv

from bench.core.cases import JOBS
from bench.core.plots import plotted
from bench.core.results import Table, folder, load_some, site_for

from .bias import OWN, RELATIVE, SHADOWS, USUAL, WEIGHTS, WHOLE
from .camera_paths import CAMERAS

ALLOWED = 3  # standard errors that a bound leaves to chance
PARTS = ("silhouettes", "textures", SHADOWS, "disocclusions")  # for weights by area
COLOURS = ("#2b6cb0", "#c53030", "#2f855a")
LINES = {"average": "--", "balance": "-"}


def write(quick: bool) -> None:
    """Write the tables and the plot of all results."""
    out, site = folder(quick), site_for(quick)
    found = {camera: load_some(out, {job: f"bias-{job}-{camera}" for job in JOBS}) for camera in CAMERAS}
    rows = {f"{job}, {camera}": table for camera, jobs in found.items() for job, table in jobs.items()}
    own, spent = (load_some(out, {job: f"bias-{job}-{part}" for job in JOBS}) for part in ("own-size", "time"))
    sections = [_summary(rows), _by_area(rows), *_by_part(rows), _by_hits(rows), _equal_time(own, spent)]
    write_csv(site.tables / "bias.csv", sections)
    _plot(found, site.plots / "bias.svg")


def _row(table: Table, weights: str, hits: int, part: str) -> Table | None:
    """One row of the results, if there is one."""
    wanted = (weights, hits, part)
    return next((r for r in table["found"] if (r["weights"], r["hits"], r["part"]) == wanted), None)


def _both(table: Table, part: str) -> tuple[Table, Table] | None:
    """The rows of `average` and `balance`, where both are there."""
    average, balance = (_row(table, weights, USUAL, part) for weights in LINES)
    return (average, balance) if average and balance else None


def _bound(row: Table) -> float:
    return max(float(row["bias"]), 0.0) + ALLOWED * float(row["error"])


def _millionths(row: Table) -> str:
    """A squared bias and its standard error."""
    return f"{1e6 * row['bias']:.0f} +- {number(1e6 * row['error'], 2)}"


def _at_most(average: Table, balance: Table) -> str:
    """The bound of `balance`, where the bias of `average` is more than chance."""
    seen = average["bias"] >= ALLOWED * average["error"]
    return percent(_bound(balance) / average["bias"], 2) if seen else ""


def _root(row: Table) -> str:
    """Root of a squared bias, or of its upper bound."""
    if row["bias"] < ALLOWED * row["error"]:
        return f"below {percent(math.sqrt(_bound(row)), 2)}"
    return percent(math.sqrt(row["bias"]), 2)


def _z(row: Table) -> str:
    return f"{row['bias'] / row['error']:.0f}"


def _summary(found: Mapping[str, Table]) -> Section:
    rows = []
    for name, table in found.items():
        if both := _both(table, WHOLE):
            average, balance = both
            size, lights = " x ".join(map(str, table["resolution"])), str(len(table["lights"]))
            first = [str(average["runs"]), _millionths(average), _z(average), _root(average)]
            second = [str(balance["runs"]), _millionths(balance), _root(balance), _at_most(average, balance)]
            rows.append([name, size, lights, *first, *second])
    head = ("", "pixels", "lights", "runs", "average", "z", "root", "runs", "balance", "root", "at most")
    return Section("Three jobs, three cameras", head, rows)


def _by_area(found: Mapping[str, Table]) -> Section:
    rows = []
    for name, table in found.items():
        for part in (WHOLE, *PARTS):
            weights = [row for one in WEIGHTS if (row := _row(table, one, USUAL, part))]
            if len(weights) == len(WEIGHTS):
                area = weights[-1]
                square = area["bias"] + area["variance"]
                cells = [percent(math.sqrt(square), 3), percent(max(area["bias"], 0.0) / square, 2)]
                first = name if part == WHOLE else part
                rows.append([first, str(area["runs"]), *(_millionths(row) for row in weights), *cells])
    return Section("Weights by area", ("", "runs", *WEIGHTS, "RMSE", "of it bias"), rows)


def _by_part(found: Mapping[str, Table]) -> Iterable[Section]:
    for name, table in found.items():
        rows = []
        for part in dict.fromkeys(r["part"] for r in table["found"] if r["part"] not in (WHOLE, RELATIVE)):
            if both := _both(table, part):
                average, balance = both
                share = percent(average["share"], 2)
                rows.append([part, share, _millionths(average), _z(average), _millionths(balance), _at_most(*both)])
        yield Section(name.capitalize(), ("", "share", "average", "z", "balance", "at most"), rows)


def _by_hits(found: Mapping[str, Table]) -> Section:
    hits = sorted({r["hits"] for table in found.values() for r in table["found"]})
    rows = []
    for name, table in found.items():
        for weights in LINES:
            cells = [_row(table, weights, n, WHOLE) for n in hits]
            rows.append([f"{name}, {weights}", *(_millionths(cell) if cell else "" for cell in cells)])
    return Section("By hits", ["", *map(str, hits)], rows)


def _equal_time(own: Mapping[str, Table], spent: Mapping[str, Table]) -> Section:
    """Processor ms per image, RMSE and relative RMSE; and the error of `average` after the time of `balance`."""
    rows = []
    for job in (job for job in own if job in spent):
        curve = {weights: _cost_curve(own[job], spent[job], weights) for weights in LINES}
        for i, hits in enumerate(OWN.hits):
            average, balance = curve["average"][i], curve["balance"][i]
            same = [at_time(curve["average"], balance[0], k) for k in (1, 2)]
            cells = [number(average[0]), *map(percent, average[1:]), number(balance[0]), *map(percent, balance[1:])]
            rows.append([f"{job}, hits {hits}", *cells, *map(percent, same)])
    head = ["", "average, ms", "RMSE", "relative", "balance, ms", "RMSE", "relative"]
    return Section("Error at equal time", [*head, "average at equal time, RMSE", "relative"], rows)


def _cost_curve(own: Table, spent: Table, weights: str) -> list[tuple[float, ...]]:
    """By hits: processor ms per image, RMSE and relative RMSE."""
    found = []
    for hits in OWN.hits:
        ms = next(r["cpu_ms"] for r in spent["found"] if (r["weights"], r["hits"]) == (weights, hits))
        rows = [row for part in (WHOLE, RELATIVE) if (row := _row(own, weights, hits, part))]
        found.append((ms, *(math.sqrt(max(r["bias"] + r["variance"], 0.0)) for r in rows)))
    return found


def at_time(curve: Iterable[tuple[float, ...]], ms: float, column: int) -> float:
    """An error between the points of a curve, by straight lines of logarithms; beyond its end, its last line."""
    points = sorted((point[0], point[column]) for point in curve)
    upper = next((i for i in range(1, len(points)) if points[i][0] >= ms), len(points) - 1)
    (t0, e0), (t1, e1) = points[upper - 1], points[upper]
    return math.exp(math.log(e0) + math.log(ms / t0) * math.log(e1 / e0) / math.log(t1 / t0))


def _plot(found: Mapping[str, Mapping[str, Table]], file: Path) -> None:
    """Squared bias against hits, a panel per camera; a triangle is an upper bound."""
    settings = {"xscale": "log", "yscale": "log", "xlabel": "hits per pixel and frame"}
    with plotted(file, len(found), (2.9 * len(found), 3.1), **settings) as panels:
        for axes, (camera, jobs) in zip(panels, found.items(), strict=True):
            axes.set_title(camera)
            for (job, table), colour in zip(jobs.items(), COLOURS, strict=False):
                for weights, line in LINES.items():
                    rows = [r for r in table["found"] if (r["weights"], r["part"]) == (weights, WHOLE)]
                    seen = sorted((r["hits"], r["bias"], r["error"]) for r in rows if r["bias"] > 2 * r["error"])
                    if seen:
                        style = {"color": colour, "linestyle": line, "marker": "o", "markersize": 3}
                        axes.errorbar(*zip(*seen, strict=True), **style, label=f"{job}, {weights}")
                    below = [
                        (r["hits"], max(r["bias"], 0) + 2 * r["error"]) for r in rows if r["bias"] <= 2 * r["error"]
                    ]
                    axes.plot([hits for hits, _ in below], [y for _, y in below], "v", color=colour, fillstyle="none")
        panels[0].set_ylabel("squared bias over the squared mean")
