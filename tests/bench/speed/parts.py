"""The parts of docs/quality/speed.csv: plain text and tables, each a list of paragraphs."""

import statistics
from collections.abc import Mapping, Sequence

from bench.core.cases import BY_AREA, FRAME_ARRAY, JOBS, SCRATCH, VARIANTS
from bench.core.markdown import grid, number, percent, times, total
from bench.core.results import Table

from .speed import FORMATS, WRITTEN

SCRATCH_HITS, SCRATCH_RAYS = SCRATCH.settings.hits, SCRATCH.settings.obscurance

HEAD = """
# Speed

The cost of an image, beside the time that Embree needs only to trace the same rays and beside rendering every image
from scratch. `make bench` and `make bench-scaling` measure and write this page; `tests/bench/` says how. Times are
those of one machine: compare the ratios. [Error](error.md) has the error of the images.
"""

# Kinds of rays, as the program counts them, by the stage that traces them.
STAGE_OF = {
    "native": "native",
    "obscurance": "obscurance",
    "shadow": "shadow",
    "visibility": "visibility",
    "mirror": "mirror",
    "mirror obscurance": "mirror",
    "mirror shadow": "mirror",
    "pilot": "mirror",
}
STAGES = ("native", "obscurance", "shadow", "visibility", "mirror")


def by_stage(table: Mapping[str, float]) -> dict[str, float]:
    """Numbers by kind of ray -> numbers by stage; kinds that are not known count as mirrors."""
    found = dict.fromkeys(STAGES, 0.0)
    for kind, value in table.items():
        found[STAGE_OF.get(kind, "mirror")] += value
    return found


def machine(speed: Table, shares: Sequence[float]) -> list[str]:
    """The machine, and how busy it was."""
    rows = [[name, value] for name, value in speed["machine"].items()]
    idle = f"Other programs took {percent(statistics.median(shares), 2)} of the cores while this was measured"
    worst = f"{percent(max(shares), 2)} at the worst"
    return ["## Machine", grid(["", ""], rows), f"{idle} (median; {worst})."]


def summary(speed: Mapping[str, Table], mitsuba: Mapping[str, Table]) -> list[str]:
    """How many times as fast as from scratch, by job."""
    rows = []
    for name, table in speed.items():
        found = table["median"]
        array, area, scratch = (found[v.name] for v in (FRAME_ARRAY, BY_AREA, SCRATCH))
        peer = mitsuba.get(name, {})
        written, by_area = (t["written"][WRITTEN]["ms"] for t in (array, area))
        rows.append(
            [
                f"`jobs/{name}.toml`",
                number(array["ms"]),
                times(array["floor_ratio"]["ms"]),
                times(scratch["ms"] / array["ms"]),
                number(written),
                times(scratch["written"][WRITTEN]["ms"] / written),
                *(times(peer["written_ms"] / own) if "written_ms" in peer else "" for own in (written, by_area)),
            ]
        )
    head = [
        "job", "ms per image", "to the floor", "from scratch takes",
        "written, ms", "from scratch, written", "Mitsuba, written",
        "same, to weights `area`",
    ]  # fmt: skip
    runs = min(len(tables) for table in speed.values() for tables in table["runs"].values())
    about = f"""
The three jobs of the size that the paper used, in the steady state: some cameras from the middle of the path, with the
window filled before the clock starts, so that reading, ambient light and path ends are left out. Weights are `average`,
unless a row says otherwise. Variants take turns, {runs} times, each
time at another place of the camera path; figures are medians.

- *From scratch*: every image separately, by the same kernels and packets, with as many native hits per pixel as a
  pixel of the frame array rests on: {SCRATCH_HITS}, with {SCRATCH_RAYS} obscurance rays each. Columns say how many
  times as long that takes.
- *Floor*: the rays of one frame, recorded and replayed through Embree packets on all cores; nothing but Embree's own
  calls is timed. Packets are those that the program makes, idle lanes and all.
- *Written*: as half EXR, not compressed, to a temporary folder.
"""
    return ["## Summary", about, grid(head, rows), _sizes(speed)]


def _sizes(speed: Mapping[str, Table]) -> str:
    rows = []
    for name, table in speed.items():
        a = table["about"]
        size = f"{a['resolution'][0]} x {a['resolution'][1]}"
        mirrors = "yes" if a["mirrors"] else "no"
        rows.append([name, f"{a['triangles']:,}", size, str(a["n_cameras"]), str(a["n_lights"]), mirrors])
    return grid(["job", "triangles", "pixels", "cameras", "lights", "mirrors"], rows)


def cost(speed: Mapping[str, Table]) -> list[str]:
    """Every variant that was timed, by job."""
    about = """
*Hits* are accepted hits per pixel: mean and 1st percentile. *Processor* is the time of all threads together: where
other programs share the machine, trust the ratios of processor time.
"""
    parts = ["## Cost of an image", about]
    for name, table in speed.items():
        found = table["median"]
        scratch = found[SCRATCH.name]
        rows = []
        for variant in (v.name for v in VARIANTS if v.name in found):
            t = found[variant]
            floor = total(t["floor"]["ms"]) if "floor" in t else None
            rows.append(
                [
                    variant,
                    number(t["ms"]),
                    times(scratch["ms"] / t["ms"]),
                    number(t["cpu_ms"]),
                    times(scratch["cpu_ms"] / t["cpu_ms"]),
                    f"{t['hits'][0]:.1f} / {t['hits'][1]:.0f}",
                    number(total(t["rays"])),
                    number(floor) if floor else "",
                    times(t["floor_ratio"]["ms"]) if floor else "",
                    times(t["floor_ratio"]["cpu_ms"]) if floor else "",
                ]
            )
        head = [
            "", "ms", "from scratch takes", "processor, ms", "from scratch, processor", "hits", "rays per pixel",
            "floor, ms", "ratio", "ratio, processor",
        ]  # fmt: skip
        parts += [f"### {name}", grid(head, rows)]
    return parts


def stages(speed: Mapping[str, Table]) -> list[str]:
    """Where the time goes: thread time by stage, beside the floor and the rays."""
    about = """
Thread time per image, ms; below it the time that Embree needs only to trace the rays of the stage, and their number
per pixel. *Mirror* includes everything behind mirrors, also obscurance and shadow rays. *Rest* is sorting, waiting and
all work that is not timed by stage.
"""
    parts = ["## Stages", about]
    head = ["", *STAGES, "compose", "rest"]
    for name, table in speed.items():
        rows = []
        for variant in (FRAME_ARRAY.name, SCRATCH.name):
            t = table["median"][variant]
            spent = t["stages"]
            floor, rays = by_stage(t["floor"]["cpu_ms"]), by_stage(t["rays"])
            other = [number(spent.get("compose", 0.0)), number(spent["rest"])]
            rows.append([variant, *[number(spent.get(stage, 0.0)) for stage in STAGES], *other])
            rows.append(["Embree only", *[number(floor[stage]) for stage in STAGES], "", ""])
            rows.append(["rays per pixel", *[number(rays[stage]) for stage in STAGES], "", ""])
        parts += [f"### Stages: {name}", grid(head, rows)]
    return parts


def writing(speed: Mapping[str, Table]) -> list[str]:
    """With and without writing."""
    rows = []
    for name, table in speed.items():
        for variant in (v.name for v in VARIANTS if v.writes):
            t, scratch = table["median"][variant], table["median"][SCRATCH.name]
            cells = [f"{name}, {variant}", number(t["ms"])]
            for stored in FORMATS:
                if stored not in t["written"]:
                    cells += [""] * 3
                    continue
                ms = t["written"][stored]["ms"]
                own = t["written"][stored]["stages"]["writing"]
                cells += [number(ms), times(ms / t["ms"]), number(own)]
            cells.append(times(scratch["written"][WRITTEN]["ms"] / t["written"][WRITTEN]["ms"]))
            rows.append(cells)
    head = ["", "not written, ms"]
    for stored in FORMATS:
        head += [f"`{stored}`, ms", "longer by", "writing, processor ms"]
    head.append(f"from scratch, `{WRITTEN}`, takes")
    return ["## Writing", "Half EXR to a temporary folder, beside the tracing.", grid(head, rows)]


def peers(speed: Mapping[str, Table], mitsuba: Mapping[str, Table], cycles: Mapping[str, Table]) -> list[str]:
    """Other programs."""
    rows, why = [], []
    for program, tables in (("Mitsuba", mitsuba), ("Cycles", cycles)):
        for name, t in tables.items():
            if "skipped" in t:
                why.append(f"- {program}, {name}: left out: {t['skipped']}.")
                continue
            found = speed[name]["median"] if name in speed else {}
            array = found.get(FRAME_ARRAY.name, {}).get("ms")
            written = found.get(FRAME_ARRAY.name, {}).get("written", {}).get(WRITTEN, {}).get("ms")
            rows.append(
                [
                    f"{program} {t['version']}, {name}",
                    number(t["ms"]),
                    times(t["ms"] / array) if array else "",
                    number(t["written_ms"]) if "written_ms" in t else "",
                    times(t["written_ms"] / written) if written and "written_ms" in t else "",
                    percent(abs(t["mean"] / t["our_mean"] - 1), 2) if "mean" in t else "",
                ]
            )
    head = ["", "ms", "to the frame array", "written, ms", "to the frame array, written", "means differ by"]
    about = f"""
- *Mitsuba*, LLVM backend: a small integrator of the same model on the same triangles, every image from scratch,
  {SCRATCH_HITS} x (1 eye ray + {SCRATCH_RAYS} obscurance rays + 1 shadow ray) per pixel. It is spared mirrors,
  alpha masks, interpolated normals and texture filtering. The last column compares the mean of one image with the
  program's own.
- *Cycles*, on the processor: path tracing with {SCRATCH_HITS} samples per pixel, not denoised; another model, so
  another picture. It takes materials and lights as they are, textures as their mean colour, and no mirrors.
"""
    return ["## Other programs", about, *([grid(head, rows)] if rows else []), "\n".join(why)]


def memory(found: Table) -> list[str]:
    """Peak memory."""
    rows = []
    for name in JOBS:
        for variant, t in found.get(name, {}).items():
            rows.append([f"{name}, {variant}", f"{t['peak'] / 2**30:.2f}", f"{t['before'] / 2**30:.2f}"])
    head = ["", "GiB at most", "of it before the first frame"]
    return ["## Memory", "Largest resident size of a process that runs the steady state.", grid(head, rows)]


def startup(found: Table) -> list[str]:
    """Start-up time."""
    rows = [["`framearray --help`", "", f"{found['help']:.2f}"]]
    for mark, text in (
        ("ray", "from the start to the first ray"),
        ("plan", "to the first frame: ambient light is known"),
        ("job", "`framearray render jobs/smoke.toml`, in all"),
    ):
        rows.append([text, f"{found['cold'][mark]:.1f}", f"{found['warm'][mark]:.2f}"])
    about = "Seconds, with `jobs/smoke.toml`. Cold: no kernel was ever compiled on the machine."
    return ["## Start-up", about, grid(["", "cold", "warm"], rows)]
