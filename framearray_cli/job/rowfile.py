"""Files with one row per frame, which stand in for key frames: reading them, and checking their rows."""

import csv
import json
from collections.abc import Iterator, Mapping, Sequence
from pathlib import Path
from typing import Any, TypeAlias

from pydantic import ValidationError

from framearray_cli.base.files import read_at_most
from framearray_cli.base.forms.problems import append_count, problems_of
from framearray_cli.base.forms.table import Table
from framearray_cli.base.forms.words import shown
from framearray_cli.base.units import counted

LARGEST_ROW_FILE = 64 * 1024 * 1024  # bytes; MOST_EYES rows of nine long numbers are 20 MB
LONGEST_HEADER = 200  # characters of column names that a message shows
MOST_ROW_PROBLEMS = 10  # a column that is wrong is wrong in every row

PlacedRow: TypeAlias = tuple[str, dict[str, Any]]  # "row 3" or "entry 3", and the table of a key without its frame


class RowFileError(Exception):
    """An unusable file; the arguments are its problems, each with its row."""


def read_data(path: Path, largest: int = LARGEST_ROW_FILE) -> bytes:
    """Read a whole file of at most `largest` bytes."""
    try:
        data = read_at_most(path, largest)
    except FileNotFoundError:
        raise RowFileError("no such file") from None
    except OSError as error:
        raise RowFileError(f"cannot be read: {error.strerror}") from error
    if data is None:
        raise RowFileError(f"expected at most {largest >> 20} MB, got a bigger file")
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


def refuse_frames(rows: Sequence[Mapping[str, Any]]) -> None:
    """Refuse frame numbers in rows, which are numbered by their order."""
    for number, row in enumerate(rows, start=1):
        if "frame" in row:
            raise RowFileError(
                f'entry {number}: unknown key "frame"; the first entry is frame 0, the next 1, and so on'
            )


def row_problems(
    rows: Sequence[PlacedRow], key: type[Table], optional: Sequence[str], common: Mapping[str, Any]
) -> list[str]:
    """Check each row as a key frame, and that all or none of them give each optional value.

    Args:
        common: values of all rows that they do not give themselves.
    """
    problems: list[str] = []
    n = 0
    for frame, (place, row) in enumerate(rows):
        for name in optional:
            if (name in row) != (name in rows[0][1]):
                problems.append(f"{place}: {name}: expected in every row or in none")
                n += 1
        try:
            key.model_validate({"frame": frame, **common, **row})
        except ValidationError as error:
            n += error.error_count()
            if len(problems) < MOST_ROW_PROBLEMS:
                problems += [f"{place}: {problem}" for problem in problems_of(error, key)]
    return append_count(problems[:MOST_ROW_PROBLEMS], n)


def csv_rows(
    text: str, groups: Mapping[str, Sequence[str]], single: Sequence[str], required: Sequence[Sequence[str]]
) -> list[PlacedRow]:
    """Read the named columns of a CSV file as rows; a cell that is no number stays text, for the check of its row.

    Args:
        groups: columns of each key with several values, such as eye_x, eye_y, eye_z.
        single: keys with one value, in a column of the same name, unless their group is there.
        required: alternatives, of which exactly one key is in the file.
    """
    header, lines = csv_lines(text)
    found = {key: names for key, names in groups.items() if any(name in header for name in names)}
    alone = [key for key in single if key in header and key not in found]
    known = [name for names in found.values() for name in names] + alone
    if sorted(header) != sorted(known) or any(sum(key in found for key in keys) != 1 for keys in required):
        needed = ", ".join(" or ".join(", ".join(groups[key]) for key in keys) for keys in required)
        others = [f"{groups[key][0]}, ..." for key in groups if not any(key in keys for keys in required)]
        wanted = f"{needed}, and optionally {', '.join([*others, *single])}"
        raise RowFileError(f"row 1: expected the column names {wanted}, got {columns_text(header)}")
    return [
        (
            place,
            {key: [cells[name] for name in names] for key, names in found.items()} | {key: cells[key] for key in alone},
        )
        for place, cells in lines
    ]
