"""Values of options: parsers with messages of our own, whichever version of typer reads the command line."""

from collections.abc import Callable
from typing import Any

import typer

from framearray_cli.base.forms.words import bound_text, range_text, shown

THREADS_VARIABLE = "FRAMEARRAY_THREADS"  # in the environment; an option stands above it, a job below


def whole(least: int, most: int | None = None) -> Callable[[object], int]:
    """Return a parser of whole numbers within bounds."""
    expected = f"a whole number {_bounds(least, most)}"

    def parse(value: object) -> int:
        try:
            number = int(str(value))
        except ValueError:
            raise refusal(expected, value) from None
        if number < least or (most is not None and number > most):
            raise refusal(expected, number)
        return number

    return parse


def number(least: float, most: float | None = None) -> Callable[[object], float]:
    """Return a parser of numbers within bounds."""
    expected = f"a number {_bounds(least, most)}"

    def parse(value: object) -> float:
        try:
            number = float(str(value))
        except ValueError:
            raise refusal(expected, value) from None
        if not number >= least or (most is not None and not number <= most) or number == float("inf"):
            raise refusal(expected, int(number) if number.is_integer() else number)
        return number

    return parse


def choice(*names: str) -> dict[str, Any]:
    """Return what `typer.Option` needs for one of some words: parser, metavar and completion."""

    def parse(value: object) -> str:
        if value not in names:
            raise refusal(f"{', '.join(names[:-1])} or {names[-1]}", value)
        return str(value)

    def complete(incomplete: str) -> list[str]:
        return [name for name in names if name.startswith(incomplete)]

    return {"parser": parse, "metavar": "|".join(names), "autocompletion": complete}


def refusal(expected: str, value: object) -> typer.BadParameter:
    """Make the error of a value that does not fit."""
    return typer.BadParameter(f"expected {expected}, got {shown(value)}")


def _bounds(least: float, most: float | None) -> str:
    """Word bounds: "from 1 to 1024", "of at least 1"."""
    return f"of at least {bound_text(least)}" if most is None else range_text(least, most)
