"""`camera.file`: a CSV or JSON file with one eye per frame -> camera keys.

CSV: the first row names the columns eye_x, eye_y, eye_z, target_x, target_y, target_z and, optionally, up_x, up_y,
up_z, in any order; one row per frame follows. JSON: a list with one `{"eye": [...], "target": [...]}` per frame,
optionally with `"up"`.
"""

import csv
import json
from pathlib import Path
from typing import Any, TypeAlias

from pydantic import ValidationError

from framearray_cli.base.files import read_at_most
from framearray_cli.base.forms.problems import append_count, problems_of
from framearray_cli.base.units import counted

from .camera import CameraKey
from .keys import MOST_EYES

LARGEST_EYE_FILE = 64 * 1024 * 1024  # bytes; MOST_EYES rows of nine long numbers are 20 MB
MOST_ROW_PROBLEMS = 10  # a column that is wrong is wrong in every row

EYE_COLUMNS = ("eye_x", "eye_y", "eye_z")
TARGET_COLUMNS = ("target_x", "target_y", "target_z")
UP_COLUMNS = ("up_x", "up_y", "up_z")


PlacedRow: TypeAlias = tuple[str, dict[str, Any]]  # "row 3" or "entry 3", and a camera key's table


class EyeFileError(Exception):
    """An unusable file of eyes; the arguments are its problems, each with its row."""


def read_eyes(path: Path) -> list[dict[str, Any]]:
    """Read a file of eyes as key tables for frames 0, 1, 2 and so on.

    Raises:
        EyeFileError: the file is missing, is neither CSV nor JSON, or has rows that are no eyes.
    """
    text = _read_text(path)
    match path.suffix.lower():
        case ".csv":
            rows = _csv_rows(text)
        case ".json":
            rows = _json_rows(text)
        case _:
            raise EyeFileError(f'expected a file name that ends in .csv or .json, got "{path.suffix}"')
    if not 1 <= len(rows) <= MOST_EYES:
        raise EyeFileError(f"expected 1 to {MOST_EYES} camera positions, got {len(rows)}")
    if problems := _row_problems(rows):
        raise EyeFileError(*problems)
    return [{"frame": frame, **row} for frame, (_, row) in enumerate(rows)]


def _row_problems(rows: list[PlacedRow]) -> list[str]:
    """Check each row, and that either all of them give `up` or none."""
    problems: list[str] = []
    n = 0
    for frame, (place, row) in enumerate(rows):
        if ("up" in row) != ("up" in rows[0][1]):
            problems.append(f"{place}: up: expected in every row or in none")
            n += 1
        try:
            CameraKey.model_validate({"frame": frame, **row})
        except ValidationError as error:
            n += error.error_count()
            if len(problems) < MOST_ROW_PROBLEMS:
                problems += [f"{place}: {problem}" for problem in problems_of(error, CameraKey)]
    return append_count(problems[:MOST_ROW_PROBLEMS], n)


def _read_text(path: Path) -> str:
    """Read a whole UTF-8 file, up to the largest that is accepted."""
    try:
        data = read_at_most(path, LARGEST_EYE_FILE)
    except FileNotFoundError:
        raise EyeFileError("no such file") from None
    except OSError as error:
        raise EyeFileError(f"cannot be read: {error.strerror}") from error
    if data is None:
        raise EyeFileError(f"expected at most {LARGEST_EYE_FILE >> 20} MB, got a bigger file")
    try:
        return data.decode("utf-8-sig")
    except UnicodeDecodeError as error:
        raise EyeFileError("expected UTF-8 text, got another encoding; save the file as UTF-8") from error


def _csv_rows(text: str) -> list[PlacedRow]:
    """Read the named columns of a CSV file; a cell that is no number stays text, which the check of its row reports."""
    try:
        reader = csv.reader(text.splitlines(), strict=True)
        lines = [(f"row {reader.line_num}", line) for line in reader if line]
    except csv.Error as error:
        raise EyeFileError(f"not valid CSV: {error}") from error
    header = [name.strip().lower() for name in lines[0][1]] if lines else []
    with_up = any(name in header for name in UP_COLUMNS)
    wanted = EYE_COLUMNS + TARGET_COLUMNS + (UP_COLUMNS if with_up else ())
    if sorted(header) != sorted(wanted):
        raise EyeFileError(
            f"row 1: expected the column names {', '.join(wanted)}, got {', '.join(header)[:200] or 'none'}"
        )
    rows = []
    for place, line in lines[1:]:
        if len(line) != len(header):
            raise EyeFileError(f"{place}: expected {counted(len(header), 'cell')}, got {len(line)}")
        cells = dict(zip(header, map(_cell_value, line), strict=True))
        row = {"eye": [cells[name] for name in EYE_COLUMNS], "target": [cells[name] for name in TARGET_COLUMNS]}
        rows.append((place, {**row, "up": [cells[name] for name in UP_COLUMNS]} if with_up else row))
    return rows


def _cell_value(cell: str) -> float | str:
    """Read one cell: a number, or else its text."""
    try:
        return float(cell)
    except ValueError:
        return cell.strip()


def _json_rows(text: str) -> list[PlacedRow]:
    """Read a list of tables from a JSON file."""
    try:
        rows = json.loads(text)
    except (ValueError, RecursionError) as error:
        raise EyeFileError(f"not valid JSON: {error}") from error
    if not isinstance(rows, list) or not all(isinstance(row, dict) for row in rows):
        raise EyeFileError('expected a list of {"eye": [...], "target": [...]}, got something else')
    for number, row in enumerate(rows, start=1):
        if "frame" in row:
            raise EyeFileError(
                f'entry {number}: unknown key "frame"; the first entry is frame 0, the next 1, and so on'
            )
    return [(f"entry {number}", row) for number, row in enumerate(rows, start=1)]
