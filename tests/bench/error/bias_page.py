"""Results of bias.py -> docs/quality/bias.csv and docs/plots/bias.svg. Nothing is measured here."""

import math
import statistics
from collections.abc import Iterable, Mapping
from pathlib import Path

from support.tables import publish

from bench.core.cases import JOBS
from bench.core.markdown import grid, number, percent
from bench.core.plots import draw_bias
from bench.core.results import Site, Table, folder, load, site_for

from .bias import EPSILON, LIGHTS, OWN, RELATIVE, SHADOWS, USUAL, WEIGHTS, WHOLE
from .camera_paths import CAMERAS, CLOSE, N_R, NEARER, SPEED

ALLOWED = 3  # standard errors that a bound leaves to chance

HEAD = f"""
# Bias of reuse

Written by `make bench-bias`. Which error of a frame remains in the mean of any number of runs? Weights `average` and
`balance` ([note](../decisions/weights.md)) with N_r = {N_R}, against references without reuse and with other seeds.

- *Squared bias*: mean((mean of runs - reference)^2) - variance / runs - variance of the reference, over all pixels,
  channels and pictures of a row, each picture over its own mean; in millionths. 2,500 is 5 % of the mean, root mean
  square. Noise may make it negative.
- *+-*: its standard error, by leaving out each run and each part of the reference in turn. Where there is no bias, it
  is up to sqrt 2 too large (`tests/bench/error/squares.py`).
- *At most*: how large `balance` may be beside `average`: (its squared bias, or 0, + {ALLOWED} standard errors) over
  that of `average`.
- Cameras. *slow*: as the job has it. *fast*: every {SPEED}th of its frames, so that the window shears; the picture in
  the middle is the same. *close*: an eye that approaches the surface in the middle of that picture, {CLOSE:g} m away
  from it and {1 - NEARER:.0%} nearer with each frame; the eyes of its window are {CLOSE / NEARER**N_R:.2f} to
  {CLOSE * NEARER**N_R:.2f} m away.

Ambient light, average reflectivity and light positions are the same in runs and references: they differ only in reuse.
"""

BY_AREA = f"""
Weights `area` ([note](../decisions/area-weights.md)) beside the others, in the whole picture and in four of its parts
(see below); {USUAL} hits per pixel and frame. *RMSE*: of one run of `area`; *of it bias*: the share of its square that
is bias.
"""
AREA_BLURS = """
So with few hits `area` has a bias that `balance` has not. Hits beyond the border of a pixel stand for cells along it,
which blurs edges, of surfaces and of shadows, and textures by a fraction of the distance between hits. It is a few
hundredths of the squared error of one run.
"""
BESIDE = ("silhouettes", "textures", SHADOWS, "disocclusions")

BY_PART = f"""
With {USUAL} hits. *Silhouettes*: inverse depth bends by 5 % or normals part by 18 degrees between neighbours.
*Textures*: reflectivity steps by 0.03. *Grazing angles*: more than 75.5 degrees from the normal. *Frame edges*: where
the picture of another eye of the window ends. These three exclude silhouettes. *Disocclusions*: pixels that rest on
fewer than 70 % of the hits that they would have if every eye of the window saw them; they may be silhouettes. *Shadow
edges*: under each light position the pixels where light jumps, but neither normal nor depth does; they may also be in
any other part. *Share*: of the pixels.
"""

BY_HITS = """
The whole picture. `balance` is the ratio sum(w L) / sum(w), whose bias is O(1 / n): its squared bias falls to a
quarter where hits double, until it is not measurable. That of `average` stays.
"""

TIME = f"""
At the jobs' own size, one camera, {len(LIGHTS)} light positions. *RMSE* is of one run, without the noise of
the reference; *relative*: root of mean((I - R)^2 / (R^2 + {EPSILON})), which a few bright pixels do not dominate. Time
is that of all threads together in the steady state, under all 48 light positions, not written. *At equal time*: the
error of `average` after the time that `balance` takes, interpolated between the rows of `average`.
"""


def write(quick: bool) -> None:
    """Write the page and its plot from all results there are; quick results go beside themselves."""
    page = site_for(quick).pages / "bias.md"
    page = publish(page, render(folder(quick), site_for(quick)))
    print(page)


def render(results: Path, site: Site) -> str:
    """The whole page; parts without results are left out."""
    found = {
        (job, camera): table for camera in CAMERAS for job in JOBS if (table := load(results, f"bias-{job}-{camera}"))
    }
    own = {job: table for job in JOBS if (table := load(results, f"bias-{job}-own-size"))}
    spent = {job: table for job in JOBS if (table := load(results, f"bias-{job}-time"))}
    parts = [HEAD]
    if found:
        parts += [*_summary(found), *_by_area(found), *_by_part(found), *_by_hits(found)]
        curves = {key: {w: _curve(table, w) for w in ("average", "balance")} for key, table in found.items()}
        if drawn := draw_bias(curves, site.plots):
            parts.append(f"![Squared bias by hits]({site.link(drawn)})")
    if own and spent:
        parts += _equal_time(own, spent)
    return "\n\n".join(part.strip("\n") for part in parts) + "\n"


def row_of(table: Table, weights: str, hits: int, part: str) -> Table | None:
    """One row of the results, if there is one."""
    wanted = (weights, hits, part)
    return next((r for r in table["found"] if (r["weights"], r["hits"], r["part"]) == wanted), None)


def at_most(balance: Table, average: Table) -> float:
    """How large the squared bias of `balance` may be beside that of `average`."""
    return (max(balance["bias"], 0.0) + ALLOWED * balance["error"]) / average["bias"]


def _millionths(row: Table) -> str:
    """A squared bias and its standard error."""
    return f"{1e6 * row['bias']:,.0f} +- {number(1e6 * row['error'], 2)}"


def _beside(balance: Table, average: Table) -> str:
    """`at_most`, where the bias of `average` is more than chance."""
    if average["bias"] < ALLOWED * average["error"]:
        return ""
    return percent(at_most(balance, average), 2)


def _root(row: Table) -> str:
    """Root of a squared bias, or of its upper bound."""
    if row["bias"] < ALLOWED * row["error"]:
        return f"below {percent(math.sqrt(max(row['bias'], 0.0) + ALLOWED * row['error']), 2)}"
    return percent(math.sqrt(row["bias"]), 2)


def _summary(found: Mapping[tuple[str, str], Table]) -> list[str]:
    """Both weights, by job and camera."""
    rows = []
    for (job, camera), table in found.items():
        average, balance = (row_of(table, weights, USUAL, WHOLE) for weights in ("average", "balance"))
        assert average and balance
        z = average["bias"] / average["error"]
        size, lights = " x ".join(map(str, table["resolution"])), str(len(table["lights"]))
        cells = [size, lights, str(average["runs"]), _millionths(average), f"{z:.0f}", _root(average)]
        cells += [str(balance["runs"]), _millionths(balance), _root(balance)]
        rows.append([f"{job}, {camera}", *cells, _beside(balance, average)])
    first = next(iter(found.values()))
    about = f"""
Two frames of each path; {USUAL} hits per pixel and frame; references of {first["reference"]:,} hits per pixel.
"""
    head = ["", "pixels", "lights", "runs", "`average`", "z", "root", "runs", "`balance`", "root", "at most"]
    return ["## Three jobs, three cameras", about, grid(head, rows)]


def _by_area(found: Mapping[tuple[str, str], Table]) -> list[str]:
    """Weights by area beside the others, in the parts of the picture that all jobs have."""
    rows = []
    for (job, camera), table in found.items():
        for part in (WHOLE, *BESIDE):
            found_rows = [row for weights in WEIGHTS if (row := row_of(table, weights, USUAL, part))]
            if len(found_rows) < len(WEIGHTS):  # results of the time before weights by area
                continue
            area, name = found_rows[-1], f"{job}, {camera}" if part == WHOLE else part
            square = area["bias"] + area["variance"]
            cells = [percent(math.sqrt(square), 3), percent(max(area["bias"], 0.0) / square, 2)]
            rows.append([name, str(area["runs"]), *(_millionths(row) for row in found_rows), *cells])
    head = ["", "runs", "`average`", "`balance`", "`area`", "RMSE", "of it bias"]
    return ["## Weights by area", BY_AREA, grid(head, rows), AREA_BLURS] if rows else []


def _by_part(found: Mapping[tuple[str, str], Table]) -> list[str]:
    """Both weights, by part of the picture."""
    text = ["## By part of the picture", BY_PART]
    for (job, camera), table in found.items():
        rows = []
        for part in _parts(table["found"]):
            average, balance = (row_of(table, weights, USUAL, part) for weights in ("average", "balance"))
            if average and balance:
                share, both = percent(average["share"], 2), (_millionths(average), _millionths(balance))
                z = f"{average['bias'] / average['error']:.0f}"
                rows.append([part, share, both[0], z, both[1], _beside(balance, average)])
        head = ["", "share", "`average`", "z", "`balance`", "at most"]
        text += [f"### {job.capitalize()}, {camera}", grid(head, rows)]
    return text


def _parts(rows: Iterable[Table]) -> list[str]:
    return [part for part in dict.fromkeys(r["part"] for r in rows) if part not in (WHOLE, RELATIVE)]


def _curve(table: Table, weights: str) -> list[tuple[int, float, float]]:
    """(hits, squared bias, standard error), by rising hits."""
    rows = [r for r in table["found"] if r["weights"] == weights and r["part"] == WHOLE]
    return sorted((r["hits"], r["bias"], r["error"]) for r in rows)


def _by_hits(found: Mapping[tuple[str, str], Table]) -> list[str]:
    """Both weights, by hits."""
    hits = sorted({r["hits"] for table in found.values() for r in table["found"]})
    rows = []
    for (job, camera), table in found.items():
        for weights in ("average", "balance"):
            cells = [row_of(table, weights, n, WHOLE) for n in hits]
            rows.append([f"{job}, {camera}, `{weights}`", *(_millionths(cell) if cell else "" for cell in cells)])
    return ["## By hits", BY_HITS, grid(["", *(f"{n} hits" if n > 1 else "1 hit" for n in hits)], rows)]


def _equal_time(own: Mapping[str, Table], spent: Mapping[str, Table]) -> list[str]:
    """Error of both weights beside their time."""
    rows = []
    for job in (job for job in JOBS if job in own and job in spent):
        curve = {weights: _cost_curve(own[job], spent[job], weights) for weights in ("average", "balance")}
        for hits in OWN.hits:
            average, balance = curve["average"][hits], curve["balance"][hits]
            cells = [f"{job}, {hits} hits" if hits > 1 else f"{job}, 1 hit"]
            cells += [number(average[0]), percent(average[1]), percent(average[2])]
            cells += [number(balance[0]), percent(balance[1]), percent(balance[2])]
            same = [at_time(curve["average"].values(), balance[0], k) for k in (1, 2)]
            rows.append([*cells, *(percent(value) for value in same)])
    shares = [share for table in spent.values() for share in table["busy"]]
    head = [
        "", "`average`, ms", "RMSE", "relative", "`balance`, ms", "RMSE", "relative", "`average` at equal time, RMSE",
        "relative",
    ]  # fmt: skip
    busy = f"Other programs took {percent(statistics.median(shares), 2)} of the cores (median) while time was measured."
    return ["## Error at equal time", TIME + busy, grid(head, rows)]


def _cost_curve(own: Table, spent: Table, weights: str) -> dict[int, tuple[float, float, float]]:
    """By hits: processor ms per image, RMSE and relative RMSE."""
    found = {}
    for hits in OWN.hits:
        ms = next(r["cpu_ms"] for r in spent["found"] if (r["weights"], r["hits"]) == (weights, hits))
        rows = [row_of(own, weights, hits, part) for part in (WHOLE, RELATIVE)]
        errors = [math.sqrt(max(r["bias"] + r["variance"], 0.0)) for r in rows if r]
        found[hits] = (ms, errors[0], errors[1])
    return found


def at_time(curve: Iterable[tuple[float, ...]], ms: float, column: int) -> float:
    """An error between the points of a curve, by straight lines of logarithms; beyond its end, its last line."""
    points = sorted((point[0], point[column]) for point in curve)
    upper = next((i for i in range(1, len(points)) if points[i][0] >= ms), len(points) - 1)
    (t0, e0), (t1, e1) = points[upper - 1], points[upper]
    return math.exp(math.log(e0) + math.log(ms / t0) * math.log(e1 / e0) / math.log(t1 / t0))
