"""Measured tables as CSV files, made from the pages that measurements write."""

import csv
import io
import re
from pathlib import Path

TABLE = re.compile(r"(?:^\|.*\n)+", re.MULTILINE)
MARKS = re.compile(r"\[([^\]]*)\]\([^)]*\)|\*\*|[*`]")


def cells(line: str) -> list[str]:
    """Split a row of a Markdown table, without emphasis, links and thousands separators."""
    plain = [MARKS.sub(lambda mark: mark[1] or "", cell).strip() for cell in line.strip().strip("|").split("|")]
    return [re.sub(r"(?<=\d),(?=\d{3}\b)", "", cell) for cell in plain]


def tables_of(text: str) -> list[tuple[str, list[list[str]]]]:
    """Return each table of a page below the title of its section; the first row is the head."""
    found, place = [], 0
    for table in TABLE.finditer(text):
        titles = re.findall(r"^#+ (.*)$", text[: table.start()], re.MULTILINE)
        caption = text[place : table.start()].strip().rpartition("\n\n")[2]
        place = table.end()
        title = MARKS.sub(lambda mark: mark[1] or "", titles[-1] if titles else "")
        short = " ".join(caption.split()) if caption.endswith(":") and not caption.startswith("#") else ""
        lines = table[0].splitlines()
        found.append(
            (f"{title}: {short.rstrip(':')}" if short else title, [cells(line) for line in [lines[0], *lines[2:]]])
        )
    return found


def csv_of(text: str) -> str:
    """Write all tables of a page as CSV: a comment with the title before each, an empty line between them."""
    out = io.StringIO()
    for title, rows in tables_of(text):
        out.write(f"{'' if out.tell() == 0 else chr(10)}# {title}\n")
        csv.writer(out, lineterminator="\n").writerows(rows)
    return out.getvalue()


def publish(file: Path, text: str) -> Path:
    """Write the tables of a page into a CSV file of its name, and return that file."""
    table = file.with_suffix(".csv")
    table.write_text(csv_of(text), encoding="utf-8")
    return table
