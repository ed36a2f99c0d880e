"""Measures the ambient estimate, and writes docs/quality/ambient.md: `python -m bench ambient`."""

from collections.abc import Sequence

from bench.core.cases import JOBS
from bench.core.results import folder, save

from . import levels as ambient_levels
from . import page as ambient_page
from . import pathtraced
from . import pictures as ambient_pictures
from .scenes import FURNACE, SMALLER, probes

# All of it, or one part; the parts keep their results, so that each can be made again separately.
PARTS = ("ambient", "ambient-levels", "ambient-traced", "ambient-pictures", "ambient-along", "ambient-page")


def run(what: str, names: Sequence[str], quick: bool) -> None:
    """Measure a part of it, or all, in some of the scenes, or all; then write the page from all results there are."""
    out = folder(quick)
    for probe in probes():
        if names and probe.name not in names:
            continue
        if what in ("ambient", "ambient-levels") and probe.name not in SMALLER:
            save(out, f"ambient-levels-{probe.name}", ambient_levels.measure(probe, quick))
        if probe.name == FURNACE:  # known without path tracing
            continue
        if what in ("ambient", "ambient-traced") and probe.traced == probe.name:
            save(out, f"traced-{probe.name}", pathtraced.measure("trace", probe.name, quick))
        if what in ("ambient", "ambient-pictures") and probe.traced == probe.name:
            save(out, f"ambient-pictures-{probe.name}", ambient_pictures.measure(probe, quick, out))
        if what in ("ambient", "ambient-along") and probe.name in JOBS:
            means = pathtraced.measure("trace-means", probe.name, quick)
            save(out, f"ambient-along-{probe.name}", ambient_pictures.along(probe, means, quick, out))
    ambient_page.write(quick)
