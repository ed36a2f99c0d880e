"""Results -> docs/speed.md. Nothing is measured here: the page can be written again from the files in out/bench."""

from pathlib import Path

from . import pages, plots
from .cases import JOBS
from .results import ROOT, folder, load


def write(quick: bool) -> None:
    """Write the page and its plots from whatever was measured; quick results go beside themselves."""
    results = folder(quick)
    page = results / "speed.md" if quick else ROOT / "docs" / "speed.md"
    plots_at = page.parent / "plots"
    text = render(results, plots_at)
    page.write_text(text, encoding="utf-8")
    print(page)


def render(results: Path, plots_at: Path) -> str:
    """The whole page; parts without results are left out."""
    speed = {name: table for name in JOBS if (table := load(results, f"speed-{name}"))}
    error = {name: table for name in JOBS if (table := load(results, f"error-{name}"))}
    mitsuba = {name: table for name in JOBS if (table := load(results, f"mitsuba-{name}"))}
    cycles = {name: table for name in JOBS if (table := load(results, f"cycles-{name}"))}
    memory, startup, scaling = (load(results, name) for name in ("memory", "startup", "scaling"))
    parts = [pages.HEAD]
    if speed:
        parts += pages.machine(
            next(iter(speed.values())), [share for table in speed.values() for share in table["busy"]]
        )
        parts += [*pages.summary(speed, mitsuba), *pages.cost(speed), *pages.stages(speed), *pages.writing(speed)]
    if mitsuba:
        parts += pages.peers(speed, mitsuba, cycles)
    if error:
        parts += [*pages.errors(error, speed), *pages.containers(error)]
    if memory:
        parts += pages.memory(memory)
    if startup:
        parts += pages.startup(startup)
    if scaling:
        parts += pages.scaling(scaling, plots.draw(scaling, plots_at))
    return "\n\n".join(part.strip("\n") for part in parts) + "\n"
