"""Measured tables: their numbers as text, and the CSV files of docs/quality/ that contain them."""

import csv
import math
from collections.abc import Iterable, Sequence
from pathlib import Path
from typing import NamedTuple


class Section(NamedTuple):
    """One table of a file; `title` goes into a comment before it."""

    title: str
    head: Sequence[str]
    rows: Sequence[Sequence[str]]


def write_csv(file: Path, sections: Iterable[Section]) -> None:
    """Write all tables that have rows, with an empty line between them, and print the name of the file."""
    file.parent.mkdir(parents=True, exist_ok=True)
    with file.open("w", encoding="utf-8", newline="") as out:
        for title, head, rows in sections:
            if rows:
                out.write(f"{chr(10) if out.tell() else ''}# {title}\n")
                csv.writer(out, lineterminator="\n").writerows([head, *rows])
    print(file)


def number(value: float, digits: int = 3) -> str:
    """Return a number to some significant digits, whole ones at least; never in powers of ten."""
    if value == 0:
        return "0"
    places = max(digits - 1 - math.floor(math.log10(abs(value))), 0)
    text = f"{round(value, places):.{places}f}"
    return text.rstrip("0").rstrip(".") if places else text


def percent(value: float, digits: int = 3) -> str:
    """Return a share as a percentage."""
    return f"{number(100 * value, digits)} %"


def times(value: float) -> str:
    """Return a ratio."""
    return f"{number(value)}x"
