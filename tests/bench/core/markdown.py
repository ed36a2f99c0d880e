"""Numbers and tables as Markdown."""

import math
from collections.abc import Iterable, Mapping, Sequence


def grid(head: Sequence[str], rows: Iterable[Sequence[str]]) -> str:
    """A Markdown table; all columns but the first are set to the right."""
    lines = [head, ["---", *["---:"] * (len(head) - 1)], *rows]
    return "\n".join("| " + " | ".join(cells) + " |" for cells in lines)


def number(value: float, digits: int = 3) -> str:
    """A number to some significant digits, whole ones at least; never in powers of ten."""
    if value == 0:
        return "0"
    places = digits - 1 - math.floor(math.log10(abs(value)))
    rounded = round(value, max(places, 0))
    return f"{rounded:,.{max(places, 0)}f}".rstrip("0").rstrip(".") if places > 0 else f"{rounded:,.0f}"


def percent(value: float, digits: int = 3) -> str:
    """A share as a percentage."""
    return f"{number(100 * value, digits)} %"


def times(value: float) -> str:
    """A ratio."""
    return f"{number(value)}x"


def total(table: Mapping[str, float]) -> float:
    """The sum of a table of numbers."""
    return sum(table.values())
