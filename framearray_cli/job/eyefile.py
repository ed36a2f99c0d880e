"""`camera.file`: a CSV or JSON file with one eye per frame -> camera keys.

CSV: the first row names the columns eye_x, eye_y, eye_z, target_x, target_y, target_z and, optionally, up_x, up_y,
up_z, in any order; one row per frame follows. JSON: a list with one `{"eye": [...], "target": [...]}` per frame,
optionally with `"up"`.
"""

from pathlib import Path
from typing import Any

from .camera import CameraKey
from .keys import MOST_EYES
from .rowfile import PlacedRow, RowFileError, columns_text, csv_lines, load_json, read_text, refuse_frames, row_problems

EYE_COLUMNS = ("eye_x", "eye_y", "eye_z")
TARGET_COLUMNS = ("target_x", "target_y", "target_z")
UP_COLUMNS = ("up_x", "up_y", "up_z")


def read_eyes(path: Path) -> list[dict[str, Any]]:
    """Read a file of eyes as key tables for frames 0, 1, 2 and so on.

    Raises:
        RowFileError: the file is missing, is neither CSV nor JSON, or has rows that are no eyes.
    """
    text = read_text(path)
    match path.suffix.lower():
        case ".csv":
            rows = _csv_rows(text)
        case ".json":
            rows = _json_rows(text)
        case _:
            raise RowFileError(f'expected a file name that ends in .csv or .json, got "{path.suffix}"')
    if not 1 <= len(rows) <= MOST_EYES:
        raise RowFileError(f"expected 1 to {MOST_EYES} camera positions, got {len(rows)}")
    if problems := row_problems(rows, CameraKey, ("up",), {}):
        raise RowFileError(*problems)
    return [{"frame": frame, **row} for frame, (_, row) in enumerate(rows)]


def _csv_rows(text: str) -> list[PlacedRow]:
    """Read the named columns of a CSV file; a cell that is no number stays text, which the check of its row reports."""
    header, lines = csv_lines(text)
    with_up = any(name in header for name in UP_COLUMNS)
    wanted = EYE_COLUMNS + TARGET_COLUMNS + (UP_COLUMNS if with_up else ())
    if sorted(header) != sorted(wanted):
        raise RowFileError(f"row 1: expected the column names {', '.join(wanted)}, got {columns_text(header)}")
    rows = []
    for place, cells in lines:
        row = {"eye": [cells[name] for name in EYE_COLUMNS], "target": [cells[name] for name in TARGET_COLUMNS]}
        rows.append((place, {**row, "up": [cells[name] for name in UP_COLUMNS]} if with_up else row))
    return rows


def _json_rows(text: str) -> list[PlacedRow]:
    """Read a list of tables from a JSON file."""
    rows = load_json(text)
    if not isinstance(rows, list) or not all(isinstance(row, dict) for row in rows):
        raise RowFileError('expected a list of {"eye": [...], "target": [...]}, got something else')
    refuse_frames(rows)
    return [(f"entry {number}", row) for number, row in enumerate(rows, start=1)]
