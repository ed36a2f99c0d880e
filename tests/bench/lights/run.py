"""Measure lights with a size, a cone, a profile or a map: `python -m bench lights`, or parts of it by name.

Cost: frames of one eye in turns with the first source, nothing written. Noise: standard deviation of a pixel; change of
noise: standard deviation of the difference of neighbours along the light path; both over the mean light. Flicker: the
latter over sqrt(2) times the former, 1 where noise starts anew at each position. Against Mitsuba: mean of pixels, ours
minus Mitsuba's, with the standard error of both; blocks: RMS difference of their means over what the spread of
independent passes of each program explains.
"""

from collections.abc import Callable, Sequence
from pathlib import Path

from support.tables import Section, number, percent, times, write_csv

from bench.core.machine import named
from bench.core.results import Table, folder, load, load_some, save, site_for
from framearray_cli.base.units import counted

from . import against, cost, noise

# Parts keep their results, so that each can be measured again by itself.
PARTS: dict[str, Callable[[str, bool, Path], Table]] = {
    **dict.fromkeys(cost.PARTS, cost.measure),
    **dict.fromkeys(noise.PARTS, noise.measure),
    **dict.fromkeys(against.PARTS, against.measure),
}


def run(names: Sequence[str], quick: bool) -> None:
    """Measure all parts, or those whose names begin with one of `names`; then write the tables of all results."""
    out = folder(quick)
    out.mkdir(parents=True, exist_ok=True)
    for part in parts_named(names):
        save(out, f"lights-{part}", PARTS[part](part, quick, out))
    sections = [*_costs(out), _noise(out), _against(out)]
    write_csv(site_for(quick).tables / "lights.csv", sections)


def parts_named(names: Sequence[str]) -> list[str]:
    """The parts whose names begin with one of `names`; all without names.

    Raises:
        ValueError: a name is none, and begins none; `page` only writes the tables.
    """
    for name in names:
        if name != "page" and not any(part.startswith(name) for part in PARTS):
            raise ValueError(f"no part of `lights` begins with {name}; there are page, {', '.join(PARTS)}")
    return [part for part in PARTS if not names or part.startswith(tuple(names))]


def _costs(results: Path) -> list[Section]:
    sections = []
    for found in load_some(results, {part: f"lights-{part}" for part in cost.PARTS}).values():
        width, height = found["resolution"]
        frames = counted(len(next(iter(found["sources"].values()))["frames"]), "frame")
        title = f"Cost: The {found['job']}, {width} x {height}, {frames} of each; {named(found['machine'])}"
        rows = [
            (source, number(table["ms"]), times(table["ratio"]), number(table["rays"]["shadow"]))
            for source, table in found["sources"].items()
        ]
        sections.append(Section(title, ("sources", "ms per image", "over the first", "shadow rays"), rows))
    return sections


def _noise(results: Path) -> Section:
    rows = []
    for found in load_some(results, {part: f"lights-{part}" for part in noise.PARTS}).values():
        for source, table in found["sources"].items():
            for words, kind in ((table["without"], "hard"), ("with a size", "soft")):
                row = [f"{found['job']}, {source}: {words}"]
                for where in ("", "half_"):
                    spread, change = table[kind][f"{where}noise"], table[kind][f"{where}change"]
                    row += [percent(spread), percent(change), number(flicker(spread, change))]
                rows.append(row)
            rows.append([f"half-shadows: {percent(table['share'])} of all pixels", *[""] * 6])
    head = ("source", "noise", "change of noise", "flicker", "in half-shadows: noise", "change", "flicker")
    return Section("Noise and flicker", head, rows)


def flicker(spread: float, change: float) -> float:
    """Change of noise over the change of noise that starts anew at each position; 0 without noise."""
    return change / (2**0.5 * spread) if spread else 0.0


def _against(results: Path) -> Section:
    rows = []
    for part, (scene, kind) in against.PARTS.items():
        table = load(results, f"lights-{part}") or {"skipped": ""}
        if "skipped" not in table:
            mean = (
                f"{'+' if table['mean'] >= 0 else '-'}{percent(abs(table['mean']), 2)} +- {percent(table['error'], 2)}"
            )
            cells = [number(table["chi"]), percent(table["rms"], 2), percent(table["share"])]
            rows.append([f"{scene}, {kind}", mean, *cells, number(table["hits"]), number(table["samples"])])
    head = ("source", "mean", "blocks", "RMS difference of blocks", "blocks compared", "hits per pixel",
            "Mitsuba: samples")  # fmt: skip
    return Section("Against Mitsuba", head, rows)
