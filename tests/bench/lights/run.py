"""Measures lights with a size, a cone, a profile or a map: `python -m bench lights`, or parts of it by name."""

from collections.abc import Callable, Sequence
from pathlib import Path

from bench.core.results import Table, folder, save

from . import against, cost, draws, noise, page

# Parts keep their results, so that each can be measured again by itself.
PARTS: dict[str, Callable[[str, bool, Path], Table]] = {
    **dict.fromkeys(cost.PARTS, cost.measure),
    "draws": draws.measure,
    **dict.fromkeys(noise.PARTS, noise.measure),
    **dict.fromkeys(against.PARTS, against.measure),
}


def run(names: Sequence[str], quick: bool) -> None:
    """Measure all parts, or those whose names begin with one of `names`; then write the page from all results."""
    out = folder(quick)
    out.mkdir(parents=True, exist_ok=True)
    for part in parts_named(names):
        save(out, f"lights-{part}", PARTS[part](part, quick, out))
    page.write(quick)


def parts_named(names: Sequence[str]) -> list[str]:
    """The parts whose names begin with one of `names`; all without names.

    Raises:
        ValueError: a name is none, and begins none; `page` only writes the page.
    """
    for name in names:
        if name != "page" and not any(part.startswith(name) for part in PARTS):
            raise ValueError(f"no part of `lights` begins with {name}; there are page, {', '.join(PARTS)}")
    return [part for part in PARTS if not names or part.startswith(tuple(names))]
