"""Results -> docs/quality/speed.csv, sizes.csv and plots. Nothing is measured here.

The steady state of jobs of the paper's size: some cameras from the middle of the path, with the window filled before
the clock starts. *From scratch* renders each image separately, with as many hits per pixel as a pixel of the frame
array averages. *Floor* is the time that Embree needs only to trace the same rays. *Processor* is the time of all
threads together. *Serial* is the share of the time in which no thread traces or composes.
"""

from collections.abc import Callable, Mapping
from typing import Any

from support.tables import Section, number, percent, times, write_csv

from bench.core.cases import BY_AREA, FRAME_ARRAY, JOBS, SCRATCH, VARIANTS
from bench.core.machine import describe
from bench.core.plots import plotted
from bench.core.results import Site, Table, folder, limited, load, load_some, site_for

from .speed import FORMATS, WRITTEN

# Stages that trace rays; all other kinds of rays belong to mirrors.
STAGES = ("native", "obscurance", "shadow", "visibility", "mirror")
# A sweep: its name, title, columns that say how large the job was, their cells, and what its plot has along x.
SWEEPS: tuple[tuple[str, str, tuple[str, ...], Callable[[Table], list[str]], Callable[[Table], float] | None], ...] = (
    ("lights", "Light positions", ("N_l",), lambda r: [str(r["lights"])], lambda r: r["lights"]),
    ("n_r", "Frames that share hits", ("N_r", "hits per pixel"), lambda r: [str(r["n_r"]), f"{r['hits'][0]:.1f}"],
     lambda r: r["n_r"]),
    ("threads", "Threads", ("threads", "serial"), lambda r: [str(r["threads"]), f"{r['serial']:.1%}"],
     lambda r: r["threads"]),
    ("cameras", "Cameras", ("N_c",), lambda r: [str(r["cameras"])], None),
    ("triangles", "Triangles", ("triangles", "scene, s", "Embree, s"),
     lambda r: [str(r["triangles"]), f"{r['scene_s']:.2f}", f"{r['embree_s']:.2f}"], lambda r: r["triangles"]),
)  # fmt: skip
PLOTS = {"n_r": "reuse"}  # files that are not named like their sweep


def write(quick: bool) -> None:
    """Write the tables and plots of all results."""
    out, site = folder(quick), site_for(quick)
    speed, mitsuba = (load_some(out, {job: f"{part}-{job}" for job in JOBS}) for part in ("speed", "mitsuba"))
    sections = []
    if speed:
        machine = next(iter(speed.values()))["machine"]
        sections += [Section("Machine", ("", ""), list(machine.items())), *_summary(speed, mitsuba)]
        sections += [_cost(*item) for item in speed.items()] + [_stages(*item) for item in speed.items()]
        sections += [_writing(speed), _peers(speed, mitsuba)]
    if memory := load(out, "memory"):
        rows = [
            (f"{name}, {variant}", _gib(t["peak"]), _gib(t["before"]))
            for name in JOBS
            for variant, t in memory.get(name, {}).items()
        ]
        sections.append(Section("Memory", ("", "GiB at most", "of it before the first frame"), rows))
    if sizes := load(out, "sizes"):
        head = ("", "pixels", "ms per image", "ms per image and megapixel", "GiB at most")
        rows = [
            (name, f"{r['width']} x {r['height']}", *map(number, (r["ms"], r["ms_megapixel"])), _gib(r["peak"]))
            for name in JOBS
            for r in sizes.get(name, ())
        ]
        own = Section("Machine", ("", ""), list(describe().items()))
        write_csv(site.tables / "sizes.csv", [own, Section("Sizes", head, rows)])
    if startup := load(out, "startup"):
        names = {"ray": "from the start to the first ray", "plan": "to the first frame: ambient light is known",
                 "job": "framearray render jobs/smoke.toml, in all"}  # fmt: skip
        rows = [("framearray --help", "", f"{startup['help']:.2f}")]
        rows += [(text, f"{startup['cold'][k]:.1f}", f"{startup['warm'][k]:.2f}") for k, text in names.items()]
        sections.append(Section("Start-up", ("", "cold", "warm"), rows))
    if scaling := load(out, "scaling"):
        sections += _scaling(scaling, site)
    if sections:
        write_csv(site.tables / (f"speed-{limited()}.csv" if limited() else "speed.csv"), sections)


def _gib(n_bytes: int) -> str:
    return f"{n_bytes / 2**30:.2f}"


def _by_stage(table: Mapping[str, float]) -> list[str]:
    """Numbers by kind of ray -> numbers by stage."""
    found = dict.fromkeys(STAGES, 0.0)
    for kind, value in table.items():
        found[kind if kind in STAGES else "mirror"] += value
    return [number(value) for value in found.values()]


def _summary(speed: Mapping[str, Table], mitsuba: Mapping[str, Table]) -> list[Section]:
    rows, sizes = [], []
    for name, table in speed.items():
        array, area, scratch = (table["median"][v.name] for v in (FRAME_ARRAY, BY_AREA, SCRATCH))
        peer = mitsuba.get(name, {}).get("written_ms")
        written, by_area = (t["written"][WRITTEN]["ms"] for t in (array, area))
        row = [f"jobs/{name}.toml", number(array["ms"]), times(array["floor_ratio"]["ms"])]
        row += [times(scratch["ms"] / array["ms"]), number(written), times(scratch["written"][WRITTEN]["ms"] / written)]
        rows.append([*row, *(times(peer / own) if peer else "" for own in (written, by_area))])
        a = table["about"]
        counts = (a["triangles"], " x ".join(map(str, a["resolution"])), a["n_cameras"], a["n_lights"])
        sizes.append([name, *map(str, counts), "yes" if a["mirrors"] else "no"])
    head = ["job", "ms per image", "to the floor", "from scratch takes", "written, ms", "from scratch, written"]
    sizes_head = ("job", "triangles", "pixels", "cameras", "lights", "mirrors")
    areas = ["Mitsuba, written", "same, to weights area"]
    return [Section("Summary", [*head, *areas], rows), Section("Summary", sizes_head, sizes)]


def _timed(table: Table) -> dict[str, Table]:
    """Variant -> medians, in the order of all variants."""
    return {v.name: table["median"][v.name] for v in VARIANTS if v.name in table["median"]}


def _cost(name: str, table: Table) -> Section:
    rows, scratch = [], table["median"][SCRATCH.name]
    for variant, t in _timed(table).items():
        floor = [number(sum(t["floor"]["ms"].values())), *map(times, t["floor_ratio"].values())] if "floor" in t else []
        cells = [cell for clock in ("ms", "cpu_ms") for cell in (number(t[clock]), times(scratch[clock] / t[clock]))]
        hits = f"{t['hits'][0]:.1f} / {t['hits'][1]:.0f}"
        rows.append([variant, *cells, hits, number(sum(t["rays"].values())), *(floor or [""] * 3)])
    head = ["", "ms", "from scratch takes", "processor, ms", "from scratch, processor", "hits", "rays per pixel"]
    return Section(name, [*head, "floor, ms", "ratio", "ratio, processor"], rows)


def _stages(name: str, table: Table) -> Section:
    """Thread time by stage, next to the floor and the rays."""
    rows = []
    for variant in (FRAME_ARRAY.name, SCRATCH.name):
        t = table["median"][variant]
        spent = [number(t["stages"].get(stage, 0.0)) for stage in (*STAGES, "compose", "rest")]
        rows += [[variant, *spent], ["Embree only", *_by_stage(t["floor"]["cpu_ms"]), "", ""]]
        rows.append(["rays per pixel", *_by_stage(t["rays"]), "", ""])
    return Section(f"Stages: {name}", ["", *STAGES, "compose", "rest"], rows)


def _writing(speed: Mapping[str, Table]) -> Section:
    rows = []
    for name, table in speed.items():
        scratch = table["median"][SCRATCH.name]["written"][WRITTEN]["ms"]
        for variant in (v.name for v in VARIANTS if v.writes):
            t = table["median"][variant]
            cells = [f"{name}, {variant}", number(t["ms"])]
            for stored in FORMATS:
                one = t["written"].get(stored)
                own = one and (number(one["ms"]), times(one["ms"] / t["ms"]), number(one["stages"]["writing"]))
                cells += own or ("", "", "")
            rows.append([*cells, times(scratch / t["written"][WRITTEN]["ms"])])
    head = ["", "not written, ms"]
    for stored in FORMATS:
        head += [f"{stored}, ms", "longer by", "writing, processor ms"]
    return Section("Writing", [*head, f"from scratch, {WRITTEN}, takes"], rows)


def _peers(speed: Mapping[str, Table], mitsuba: Mapping[str, Table]) -> Section:
    """Mitsuba renders each image from scratch, without mirrors, alpha masks and texture filtering."""
    rows = []
    for name, t in mitsuba.items():
        if "skipped" not in t and name in speed:
            array = speed[name]["median"][FRAME_ARRAY.name]
            written, off = array["written"][WRITTEN]["ms"], abs(t["mean"] / t["our_mean"] - 1)
            cells = [number(t["ms"]), times(t["ms"] / array["ms"]), number(t["written_ms"])]
            rows.append([f"Mitsuba {t['version']}, {name}", *cells, times(t["written_ms"] / written), percent(off, 2)])
    head = ("", "ms", "to the frame array", "written, ms", "to the frame array, written", "means differ by")
    return Section("Other programs", head, rows)


def _scaling(found: Table, site: Site) -> list[Section]:
    sections = []
    for name, title, head, cells, size in SWEEPS:
        rows = [[*cells(row), number(row["ms"]), number(sum(row["rays"].values()))] for row in found[name]]
        sections.append(Section(title, [*head, "ms per image", "rays per pixel and image"], rows))
        if size and len(rows) > 1:
            _plot(found[name], size, site, name)
    return sections


def _plot(rows: list[Table], size: Callable[[Table], float], site: Site, name: str) -> None:
    settings: dict[str, Any] = {} if name == "n_r" else {"xscale": "log"}
    ms = [row["ms"] for row in rows]
    settings |= {"yscale": "log"} if settings and max(ms) > 10 * min(ms) else {"ylim": (0, 1.05 * max(ms))}
    file = site.plots / f"{PLOTS.get(name, name)}.svg"
    with plotted(file, xlabel=name, ylabel="ms per image", **settings) as (axes,):
        axes.plot([size(row) for row in rows], ms, "o-", color="#2b6cb0", markersize=4)
