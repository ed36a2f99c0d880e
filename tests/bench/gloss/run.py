"""Compares glossy scenes with Mitsuba's pictures of them: `python -m bench gloss`, or some of the scenes by name."""

from collections.abc import Sequence

from bench.core.results import folder, save

from . import against, page


def run(names: Sequence[str], quick: bool) -> None:
    """Compare the scenes, and write the page from all results."""
    out = folder(quick)
    for scene in names or against.PLACES:
        save(out, f"gloss-{scene}", against.measure(scene, quick))
    page.write(quick)
