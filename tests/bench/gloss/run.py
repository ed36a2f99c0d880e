"""Measures glossy scenes: `python -m bench gloss`, or some of its parts by name: costs, and scenes against Mitsuba."""

from collections.abc import Sequence

from bench.core.results import folder, save

from . import against, cost, page

PARTS = (*cost.PARTS, *against.PLACES)


def run(names: Sequence[str], quick: bool) -> None:
    """Measure all parts, or some by name, and write the page from all results."""
    out = folder(quick)
    out.mkdir(parents=True, exist_ok=True)
    for part in [name for name in names if name != "page"] if names else PARTS:
        measured = cost.measure(part, quick, out) if part in cost.PARTS else against.measure(part, quick)
        save(out, f"gloss-{part}", measured)
    page.write(quick)
