"""Files of rows: reading text, CSV and JSON, with the place of each row."""

import csv
import json
from collections.abc import Iterator, Sequence
from pathlib import Path
from typing import Any

from ..files import read_at_most, reason
from ..units import counted
from .words import shown

LARGEST_ROW_FILE = 64 * 1024 * 1024  # bytes; 100,000 rows of nine long numbers are 20 MB
LONGEST_HEADER = 200  # characters of column names that a message shows


class RowFileError(Exception):
    """An unusable file; the arguments are its problems, each with its row."""


def read_data(path: Path) -> bytes:
    """Read a whole file, up to the largest that is accepted."""
    try:
        data = read_at_most(path, LARGEST_ROW_FILE)
    except FileNotFoundError:
        raise RowFileError("no such file") from None
    except OSError as error:
        raise RowFileError(f"cannot be read: {reason(error)}") from error
    if data is None:
        raise RowFileError(f"expected at most {LARGEST_ROW_FILE >> 20} MB, got a bigger file")
    return data


def read_text(path: Path) -> str:
    """Read a whole UTF-8 file, up to the largest that is accepted."""
    try:
        return read_data(path).decode("utf-8-sig")
    except UnicodeDecodeError as error:
        raise RowFileError("expected UTF-8 text, got another encoding; save the file as UTF-8") from error


def csv_lines(text: str) -> tuple[list[str], Iterator[tuple[str, dict[str, Any]]]]:
    """Read a CSV file: the names of its columns, in small letters, and place and cells of each row by these names.

    Rows are checked as they are taken, so a caller that checks the names first reports wrong ones as such.
    """
    try:
        reader = csv.reader(text.splitlines(), strict=True)
        lines = [(f"row {reader.line_num}", line) for line in reader if line]
    except csv.Error as error:
        raise RowFileError(f"not valid CSV: {error}") from error
    header = [name.strip().lower() for name in lines[0][1]] if lines else []
    return header, _cells(header, lines[1:])


def _cells(header: Sequence[str], lines: Sequence[tuple[str, Sequence[str]]]) -> Iterator[tuple[str, dict[str, Any]]]:
    for place, line in lines:
        if len(line) != len(header):
            raise RowFileError(f"{place}: expected {counted(len(header), 'cell')}, got {len(line)}")
        yield place, dict(zip(header, map(cell_value, line), strict=True))


def columns_text(header: Sequence[str]) -> str:
    """Write the names of the columns of a file, shortened, for messages."""
    text = ", ".join(header)
    return shown(text) if not text.isprintable() or len(text) > LONGEST_HEADER else text or "none"


def cell_value(cell: str) -> float | str:
    """Read one cell: a number, or else its text."""
    try:
        return float(cell)
    except ValueError:
        return cell.strip()


def load_json(text: str) -> Any:
    """Read a JSON file."""
    try:
        return json.loads(text)
    except (ValueError, RecursionError) as error:
        raise RowFileError(f"not valid JSON: {error}") from error


def tables_of(value: object, problem: str) -> list[dict[str, Any]]:
    """Return a list of tables, or fail with the problem."""
    if not isinstance(value, list) or not all(isinstance(row, dict) for row in value):
        raise RowFileError(problem)
    return value
