"""Results -> docs/quality/speed.csv. Nothing is measured here: the files in out/bench are enough for the page."""

from pathlib import Path

from support.tables import publish

from bench.core import plots
from bench.core.cases import JOBS
from bench.core.results import Site, folder, limited, load, site_for

from . import parts as pages
from . import sweeps


def write(quick: bool) -> None:
    """Write the page and its plots from all results there are; quick results go beside themselves."""
    page = site_for(quick).pages / (f"speed-{limited()}.md" if limited() else "speed.md")
    text = render(folder(quick), site_for(quick))
    page = publish(page, text)
    print(page)


def render(results: Path, site: Site) -> str:
    """The whole page; parts without results are left out."""
    speed = {name: table for name in JOBS if (table := load(results, f"speed-{name}"))}
    mitsuba = {name: table for name in JOBS if (table := load(results, f"mitsuba-{name}"))}
    cycles = {name: table for name in JOBS if (table := load(results, f"cycles-{name}"))}
    memory, startup, scaling = (load(results, name) for name in ("memory", "startup", "scaling"))
    parts = [limited_head(limited()) if limited() else pages.HEAD]
    if speed:
        parts += pages.machine(
            next(iter(speed.values())), [share for table in speed.values() for share in table["busy"]]
        )
        parts += [*pages.summary(speed, mitsuba), *pages.cost(speed), *pages.stages(speed), *pages.writing(speed)]
    if mitsuba:
        parts += pages.peers(speed, mitsuba, cycles)
    if memory:
        parts += pages.memory(memory)
    if startup:
        parts += pages.startup(startup)
    if scaling:
        drawn = {name: site.link(file) for name, file in plots.draw(scaling, site.plots).items()}
        parts += sweeps.scaling(scaling, drawn)
    return "\n\n".join(part.strip("\n") for part in parts) + "\n"


def limited_head(isa: str) -> str:
    """The head of the page of a limited instruction set."""
    return f"""
# Speed with {isa.upper()}

[Speed](speed.md) on the same machine with no instructions beyond {isa.upper()}: Embree gets `isa={isa}` as its
configuration, and numba the name of a processor that has no more. `make bench BENCH=--{isa}` measures and writes this
page. Mitsuba cannot be limited in this way: it runs with all that the processor has.
"""
