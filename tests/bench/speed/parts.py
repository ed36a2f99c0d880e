"""The parts of docs/measured/speed.md: plain text and tables, each a list of paragraphs."""

import statistics
from collections.abc import Mapping, Sequence

from bench.core.cases import FRAME_ARRAY, JOBS, REDUCED, SCRATCH, VARIANTS
from bench.core.markdown import grid, number, percent, times, total
from bench.core.results import Table

from .speed import FORMATS, WRITTEN

SCRATCH_HITS, SCRATCH_RAYS = SCRATCH.settings.hits, SCRATCH.settings.obscurance

HEAD = """
# Speed

The cost of an image, beside the time that Embree needs only to trace the same rays and beside rendering every image
from scratch, and the error of the images. `make bench` and `make bench-scaling` measure and write this page;
`tests/bench/` says how. Times are those of one machine: compare the ratios.
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
        array, reduced, scratch = (found[v.name] for v in (FRAME_ARRAY, REDUCED, SCRATCH))
        peer = mitsuba.get(name, {})
        written = array["written"][WRITTEN]["ms"]
        rows.append(
            [
                f"`jobs/{name}.toml`",
                number(array["ms"]),
                times(array["floor_ratio"]["ms"]),
                times(scratch["ms"] / array["ms"]),
                times(scratch["ms"] / reduced["ms"]),
                number(written),
                times(scratch["written"][WRITTEN]["ms"] / written),
                times(peer["written_ms"] / written) if "written_ms" in peer else "",
            ]
        )
    head = [
        "job", "ms per image", "to the floor", "from scratch takes", "same, to `shadow_step` 4",
        "written, ms", "from scratch, written", "Mitsuba, written",
    ]  # fmt: skip
    runs = min(len(tables) for table in speed.values() for tables in table["runs"].values())
    about = f"""
The three jobs of the size that the paper used, in the steady state: some cameras from the middle of the path, with the
window filled before the clock starts, so that reading, ambient light and path ends are left out. Weights are `average`,
and shadows are tested at every light position, unless a row says otherwise. Variants take turns, {runs} times, each
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
                ms = t["written"][stored]["ms"]
                own = t["written"][stored]["stages"]["writing"]
                cells += [number(ms), times(ms / t["ms"]), number(own), times(scratch["written"][stored]["ms"] / ms)]
            rows.append(cells)
    head = ["", "not written, ms"]
    for stored in FORMATS:
        head += [f"`{stored}`, ms", "longer by", "writing, processor ms", "from scratch takes"]
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


def errors(error: Mapping[str, Table], speed: Mapping[str, Table]) -> list[str]:
    """Error beside time, by job."""
    first = next(iter(error.values()))
    about = f"""
Against references with reuse off, other seeds and {first["hits"]} native hits per pixel, made in two halves. Ambient
light is the same for all. Errors are relative to the mean of the reference, averaged over
{len(first["lights"])} light positions:

- *RMSE*; *relMSE*: mean of (I - R)^2 / (R^2 + {first["epsilon"]}); *mean error*: mean of I - R.
- *At shadow edges*: RMSE and largest error where irradiance jumps, but neither normal nor depth.
- *Bias*: root of the squared bias, from two runs and the two halves, whose noise is independent: it contains no
  noise. Where the squared bias is less than twice its standard error, "below" that.
- *Added*: RMSE of the difference to exact shadows with the same random numbers.
- *Flicker*: RMSE of the change of the error from one frame of the camera path to the next, over sqrt 2: equal to
  *RMSE* where the errors of two frames are independent.
"""
    head = ["", "ms", "RMSE", "relMSE", "mean error", "edges, RMSE", "edges, most", "bias", "added", "flicker"]
    parts = ["## Error beside time", about]
    for name, table in error.items():
        rows = []
        for variant, t in table["variants"].items():
            timed = speed.get(name, {}).get("median", {}).get(variant, {})  # only if timed with the same cameras
            rows.append(
                [
                    variant,
                    number(timed["ms"]) if "ms" in timed else "",
                    percent(t["rmse"]),
                    number(t["relmse"]),
                    percent(t["bias"], 2),
                    percent(t["edge_rmse"]),
                    percent(t["edge_max"]),
                    _bias(t),
                    percent(t["added"]) if t["added"] else "",
                    percent(t["flicker"]),
                ]
            )
        known = f"The reference's own RMSE is {percent(table['noise'], 2)}."
        parts += [f"### Error: {name}", f"Camera {', '.join(map(str, table['cameras']))}. {known}", grid(head, rows)]
    return parts


def _bias(t: Table) -> str:
    square, spread = t["squared_bias"], t["squared_bias_error"]
    if square < 2 * spread:
        return f"below {percent((max(square, 0) + 2 * spread) ** 0.5, 2)}"
    return percent(square**0.5, 2)


def containers(error: Mapping[str, Table]) -> list[str]:
    """Ways to store an image."""
    name, table = next(iter(error.items()))
    rows = [
        [
            stored,
            number(t["cpu_ms"]),
            number(t["wall_ms"]),
            number(t["bytes"] / 1024),
            percent(t["rmse"], 2) if "rmse" in t else "",
        ]
        for stored, t in table["formats"].items()
    ]
    head = ["", "one thread, processor ms", "all threads, ms per image", "KiB", "RMSE added"]
    return ["## Containers", f"An image of {name}, with no other work.", grid(head, rows)]


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
