"""Files with one row per frame that replace key frames: reading them, and checking their rows.

`file` of a light source has one light position per row. CSV: the first row names the columns x, y, z, or the values of
a key: position_x ..., direction_x ...; optionally a strength and color, or these with _r, _g, _b, and other keys of
that type, such as target_x ... and radius. JSON: a list of `[x, y, z]`, or of the tables of keys. `.npy`: an array
(n, 3). x, y, z are the position of a lamp, and for a directional source the direction from the object to the light.
"""

import csv
import json
from collections.abc import Callable, Mapping, Sequence
from pathlib import Path
from typing import Any, TypeAlias

from pydantic import ValidationError

from framearray_cli.base.files import read_at_most, reason
from framearray_cli.base.forms.problems import append_count, problems_of
from framearray_cli.base.forms.schema import file_schema
from framearray_cli.base.forms.table import Table
from framearray_cli.base.forms.words import shown
from framearray_cli.base.units import counted

from .keys import MOST_EYES, LightKey
from .sources import ROW_KEYS

LARGEST_ROW_FILE = 64 * 1024 * 1024  # bytes; 100,000 rows of nine long numbers are 20 MB
LONGEST_HEADER = 200  # characters of column names that a message shows
MOST_ROW_PROBLEMS = 10  # a column that is wrong is wrong in every row

PlacedRow: TypeAlias = tuple[str, dict[str, Any]]  # "row 3" or "entry 3", and the table of a key without its frame


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
    try:
        reader = csv.reader(text.splitlines(), strict=True)
        lines = [(f"row {reader.line_num}", line) for line in reader if line]
    except csv.Error as error:
        raise RowFileError(f"not valid CSV: {error}") from error
    header = [name.strip().lower() for name in lines[0][1]] if lines else []
    found = {key: names for key, names in groups.items() if any(name in header for name in names)}
    alone = [key for key in single if key in header and key not in found]
    known = [name for names in found.values() for name in names] + alone
    if sorted(header) != sorted(known) or any(sum(key in found for key in keys) != 1 for keys in required):
        needed = ", ".join(" or ".join(", ".join(groups[key]) for key in keys) for keys in required)
        others = [f"{groups[key][0]}, ..." for key in groups if not any(key in keys for keys in required)]
        wanted = f"{needed}, and optionally {', '.join([*others, *single])}"
        raise RowFileError(f"row 1: expected the column names {wanted}, got {_columns_text(header)}")
    rows = []
    for place, line in lines[1:]:
        if len(line) != len(header):
            raise RowFileError(f"{place}: expected {counted(len(header), 'cell')}, got {len(line)}")
        cells = dict(zip(header, map(_cell_value, line), strict=True))
        vectors = {key: [cells[name] for name in names] for key, names in found.items()}
        rows.append((place, vectors | {key: cells[key] for key in alone}))
    return rows


def _columns_text(header: Sequence[str]) -> str:
    """Write the names of the columns of a file, shortened."""
    text = ", ".join(header)
    return shown(text) if not text.isprintable() or len(text) > LONGEST_HEADER else text or "none"


def _cell_value(cell: str) -> float | str:
    """Read one cell: a number, or else its text."""
    try:
        return float(cell)
    except ValueError:
        return cell.strip()


AXES = ("x", "y", "z")
_AIMS = {"direction", "target"}
AT = "at"  # where the light is, until its kind is known


def read_positions(path: Path, kind: str, common: Mapping[str, Any], *, strong: bool = False) -> list[dict[str, Any]]:
    """Read a file of light positions as key tables for frames 0, 1, 2 and so on.

    Args:
        kind: type of the source, one of `ROW_KEYS`.
        common: values of all positions, where the file gives none.
        strong: the strength may be missing, as another file has it.

    Raises:
        RowFileError: the file is missing, has another format, or has rows that are no light positions.
    """
    key = ROW_KEYS[kind]
    strengths = [name for name in _values_of(key, "anyOf") if name != "color"]
    readers: dict[str, Callable[[Path], list[PlacedRow]]] = {
        ".csv": lambda file: _csv_rows(read_text(file), key),
        ".json": lambda file: _json_rows(read_text(file), key.place),
        ".npy": lambda file: _npy_rows(read_data(file)),
    }
    reader = readers.get(path.suffix.lower())
    if reader is None:
        known = ", ".join(readers)
        raise RowFileError(f'expected a file name that ends in one of {known}, got "{path.suffix}"')
    rows = [(place, _as_key(row, key.place, kind)) for place, row in reader(path)]
    if not 1 <= len(rows) <= MOST_EYES:
        raise RowFileError(f"expected 1 to {MOST_EYES} light positions, got {len(rows)}")
    if not strong and not any(name in row for name in strengths for row in (common, *(row for _, row in rows))):
        wanted = " or ".join(strengths)
        raise RowFileError(f"the file has no {wanted}; give it next to `file`, as in {strengths[0]} = 10")
    if "target" in key.model_fields and not any(_AIMS & row.keys() for row in (common, *(row for _, row in rows))):
        raise RowFileError("the file has no direction or target; give one next to `file`, as in target = [0, 1, 0]")
    if problems := row_problems(rows, key, key.row_values(), common):
        raise RowFileError(*problems)
    return [{"frame": frame, **common, **row} for frame, (_, row) in enumerate(rows)]


def _as_key(row: dict[str, Any], vector: str, kind: str) -> dict[str, Any]:
    """Name where the light is as a key does; a direction runs from the light to the object."""
    if AT not in row:
        return row
    at = row[AT]
    if kind == "directional" and isinstance(at, list):
        at = [0.0 - value if type(value) in (int, float) else value for value in at]
    return {vector: at, **{key: value for key, value in row.items() if key != AT}}


def _values_of(key: type[LightKey], kind: str) -> list[str]:
    """List the values of a row by their kind in the schema: "anyOf" for one number or RGB, "array" or "number"."""
    schemas = file_schema(key)["properties"]
    return [name for name in key.row_values() if kind in (schemas[name].get("type"), *schemas[name])]


def _csv_rows(text: str, key: type[LightKey]) -> list[PlacedRow]:
    colours, vectors = _values_of(key, "anyOf"), [key.place, *_values_of(key, "array")]
    groups = {AT: AXES} | {name: tuple(f"{name}_{axis}" for axis in AXES) for name in vectors}
    groups |= {name: tuple(f"{name}_{channel}" for channel in "rgb") for name in colours}
    return csv_rows(text, groups, (*colours, *_values_of(key, "number")), [(AT, key.place)])


def _json_rows(text: str, vector: str) -> list[PlacedRow]:
    rows = load_json(text)
    if not isinstance(rows, list) or not all(isinstance(row, dict | list) for row in rows):
        raise RowFileError(f'expected a list of [x, y, z] or of {{"{vector}": [...]}}, got something else')
    refuse_frames([row for row in rows if isinstance(row, dict)])
    return [
        (f"entry {number}", row if isinstance(row, dict) else {AT: row}) for number, row in enumerate(rows, start=1)
    ]


def _npy_rows(data: bytes) -> list[PlacedRow]:
    """Read an array (n, 3) of numbers."""
    import io

    import numpy as np

    try:
        values = np.lib.format.read_array(io.BytesIO(data), allow_pickle=False)
    except Exception as error:  # broken files make numpy raise anything
        raise RowFileError("not a valid .npy file; expected one that numpy.save writes") from error
    if values.ndim != 2 or values.shape[1] != len(AXES) or values.dtype.kind not in "fiu":
        size = " x ".join(map(str, values.shape)) or "one value"
        raise RowFileError(f"expected an array of n x 3 numbers, got {size} of type {values.dtype}")
    with np.errstate(invalid="ignore"):  # a NaN that signals; its row is refused later
        rows = values.astype(np.float64).tolist()
    return [(f"row {number}", {AT: row}) for number, row in enumerate(rows, start=1)]
