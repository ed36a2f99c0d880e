"""Results -> docs/quality/lights.csv. Nothing is measured here."""

from pathlib import Path

from support.tables import publish

from bench.core.machine import named
from bench.core.markdown import grid, number, percent, times
from bench.core.results import Table, folder, load, site_for
from framearray_cli.base.units import counted

from . import against, cost, noise

HEAD = """
# Lights with a size, a cone, a profile or a map

What they cost beside lights without size, how much their noise changes along the light path, and how their light
compares with Mitsuba's. `make bench-lights` measures and writes this page.
[Soft lights](../decisions/soft-lights.md) and [environments](../decisions/environments.md) say how they work.
"""
COST = """
## Cost

Interior frames of a job under all of its light positions: hits of one eye are found and one frame is composed,
nothing is written. Sources take turns, one frame each, with the same cameras; medians over frames. *Over the first*: of
the ratios of frames with the same camera. *Shadow rays*: per pixel and image, those that look for windows included.
"""
NOISE = """
## Noise and flicker

Direct light of one frame with its window, by several seeds, and how it changes from one light position to the next.
*Noise*: standard deviation of a pixel. *Change of noise*: standard deviation of the difference of two neighbours along
the light path. Both over the mean light. *Flicker*: the latter over sqrt(2) times the former; it is 1 where noise
starts anew at each position. *In half-shadows*: where the soft source differs from the hard one by more than 2 % of the
mean.

A *speck* is a square of 0.1 mm. *Own points*: a hit draws a point of its own for every light position; its place and
all else stay the same.
"""
TIME = """
## Error at equal time

One point per hit, under all light positions, beside one point per hit and light position. Both trace the same rays, so
the time of the latter is that of the former, measured above, and the time to draw the other points, measured apart:
*ns per draw* of one thread. *Error at equal time*: noise of an image with own points over that with shared points,
times the root of the ratio of times.
"""
AGAINST = """
## Against Mitsuba

Direct light of one source in a real scene, one eye, native hits only, against Mitsuba's samples of its own emitters.
Eyes see no lamps; blocks of {block} x {block} pixels that show a surface that shines, or a place out of the scene, are
left out. *Mean*: of all other pixels, ours minus Mitsuba's, with the standard error of both. *Blocks*: RMS difference
of their means over what the spread of independent passes of each program explains; 1 where noise is all.
"""


def write(quick: bool) -> None:
    """Write the page from all results there are; quick results go beside themselves."""
    page = site_for(quick).pages / "lights.md"
    page.parent.mkdir(parents=True, exist_ok=True)
    page = publish(page, render(folder(quick)))
    print(page)


def render(results: Path) -> str:
    """The whole page; parts without results are left out."""
    parts = [HEAD, *_costs(results), *_noise(results), *_equal_time(results), *_against(results)]
    return "\n\n".join(part.strip("\n") for part in parts) + "\n"


def _costs(results: Path) -> list[str]:
    parts = []
    for part in cost.PARTS:
        if (found := load(results, f"lights-{part}")) is None:
            continue
        width, height = found["resolution"]
        frames = len(next(iter(found["sources"].values()))["frames"])
        parts.append(
            f"The {found['job']}, {width} x {height}, {counted(frames, 'frame')} of each; {named(found['machine'])}:"
        )
        rows = [
            [source, number(table["ms"]), times(table["ratio"]), number(table["rays"]["shadow"])]
            for source, table in found["sources"].items()
        ]
        parts.append(grid(("sources", "ms per image", "over the first", "shadow rays"), rows))
    return [COST, *parts] if parts else []


def _noise(results: Path) -> list[str]:
    rows = []
    for part in noise.PARTS:
        if (found := load(results, f"lights-{part}")) is None:
            continue
        for source, table in found["sources"].items():
            about = f"{found['job']}, {source}"
            for words, kind in ((table["without"], "hard"), ("shared points", "shared"), ("own points", "own")):
                one = table[kind]
                rows.append(
                    [
                        f"{about}: {words}",
                        percent(one["noise"]), percent(one["change"]), number(flicker(one, "")),
                        percent(one["half_noise"]), percent(one["half_change"]), number(flicker(one, "half_")),
                    ]
                )  # fmt: skip
            rows.append([f"half-shadows: {percent(table['share'])} of all pixels", "", "", "", "", "", ""])
    if not rows:
        return []
    head = ("source", "noise", "change of noise", "flicker", "in half-shadows: noise", "change", "flicker")
    return [NOISE, " ".join(_taken(results)), grid(head, rows)]


def _taken(results: Path) -> list[str]:
    """What the figures of noise are of, by job."""
    said = []
    for part in noise.PARTS:
        if found := load(results, f"lights-{part}"):
            step = next(iter(found["sources"].values()))["hard"]["true"]
            said.append(
                f"The {found['job']}: {found['positions']} light positions in a row, of {noise.FINER} times as many as "
                f"the job has, {found['seeds']} seeds; the light itself changes by {percent(step)} per step."
            )
    return said


def flicker(table: Table, where: str) -> float:
    """Change of noise over that of noise that starts anew at each position; 0 without noise."""
    spread = float(table[f"{where}noise"])
    return float(table[f"{where}change"]) / (2**0.5 * spread) if spread else 0.0


def _equal_time(results: Path) -> list[str]:
    draws, rows = load(results, "lights-draws"), []
    for timed, measured, source in (
        ("cost-lamps", "noise-cabin", "sphere"),
        ("cost-panels", "noise-cabin", "square"),
        ("cost-sun", "noise-kitchen", "sun"),
    ):
        cost_of, noise_of = load(results, f"lights-{timed}"), load(results, f"lights-{measured}")
        if draws is None or cost_of is None or noise_of is None:
            continue
        shared = cost_of["sources"][source]["ms"]
        own = shared + drawn(cost_of, draws[source])
        table = noise_of["sources"][source]
        ratio = table["own"]["noise"] / table["shared"]["noise"]
        rows.append(
            [
                f"{cost_of['job']}, {source}",
                number(draws[source]), number(shared), number(own), number(ratio),
                number(ratio * (own / shared) ** 0.5),
                number(table["own"]["change"] / table["shared"]["change"]),
            ]
        )  # fmt: skip
    head = ("source", "ns per draw", "shared: ms per image", "own: ms", "noise, own over shared", "error at equal time",
            "change of noise, own over shared")  # fmt: skip
    return [TIME, grid(head, rows)] if rows else []


def drawn(cost_of: Table, ns: float) -> float:
    """Milliseconds per image that one more draw per hit takes, on all cores."""
    width, height = cost_of["resolution"]
    return float(cost_of["hits"] * width * height * ns * 1e-6 / int(cost_of["machine"]["cores"]))


def _against(results: Path) -> list[str]:
    rows, skipped = [], []
    version = ""
    for part, (scene, kind) in against.PARTS.items():
        if (table := load(results, f"lights-{part}")) is None:
            continue
        if "skipped" in table:
            skipped.append(f"{scene}, {kind}: {table['skipped']}")
            continue
        width, height = table["resolution"]
        version = f"Mitsuba {table['version']}, {width} x {height}."
        sign = "+" if table["mean"] >= 0 else "-"
        mean = f"{sign}{percent(abs(table['mean']), 2)} +- {percent(table['error'], 2)}"
        rows.append([f"{scene}, {kind}", mean, number(table["chi"]), percent(table["rms"], 2), percent(table["share"]),
                     number(table["hits"]), number(table["samples"])])  # fmt: skip
    if not rows and not skipped:
        return []
    about = AGAINST.format(block=against.BLOCK)
    head = ("source", "mean", "blocks", "RMS difference of blocks", "blocks compared", "hits per pixel",
            "Mitsuba: samples")  # fmt: skip
    parts = [about, version, grid(head, rows)] if rows else [about]
    return [*parts, "Not compared: " + "; ".join(skipped) + "."] if skipped else parts
