"""Weights of light positions from a CSV file: a column `weight`, or `r`, `g` and `b`; one row per light position.

With a column `light` rows may be in any order, and positions without a row have the weight 0.
"""

import csv
import math
from pathlib import Path

import numpy as np

from framearray_cli.base.arrays import Float64
from framearray_cli.base.errors import JobError
from framearray_cli.base.files import read_at_most
from framearray_cli.base.forms.problems import append_count
from framearray_cli.base.forms.words import shown
from framearray_cli.base.units import counted

LARGEST_FILE = 2**24  # bytes
MOST_WEIGHT = 1e6
MOST_PROBLEMS = 10  # a column that is wrong is wrong in every row
_COLUMNS = (["weight"], ["r", "g", "b"])


def read_weights(file: Path, n: int) -> Float64:
    """Read the weights of n light positions, (n, 3).

    Raises:
        JobError: the file cannot be read, or has wrong rows; the error names the rows.
    """
    header, rows = _read_rows(file)
    columns = [name for name in header if name != "light"]
    if sorted(columns) not in [sorted(names) for names in _COLUMNS] or len(set(header)) != len(header):
        names = ", ".join(header)[:200] or "none"
        raise JobError(file, [f"row 1: expected the column names weight, or r, g, b; and light if wanted, got {names}"])
    if "light" not in header and len(rows) != n:
        raise JobError(file, [f"expected {counted(n, 'row')}, one per light position, got {len(rows)}"])
    weights, seen, problems = np.zeros((n, 3)), set[int](), list[str]()
    for k, (number, cells) in enumerate(rows):
        if len(cells) != len(header):
            problems.append(f"row {number}: expected {counted(len(header), 'cell')}, got {len(cells)}")
            continue
        row = dict(zip(header, cells, strict=True))
        values = [_number(row[name]) for name in (_COLUMNS[1] if "r" in row else _COLUMNS[0])]
        l = _index(row["light"], n) if "light" in row else k
        if None in values:
            bad = next(cell for cell in cells if _number(cell) is None)
            problems.append(f"row {number}: expected numbers from {-MOST_WEIGHT:.0f} to {MOST_WEIGHT:.0f}, got {bad!r}")
        elif l is None or l in seen:
            wanted = "each light position once" if l in seen else f"a light position from 0 to {n - 1}"
            problems.append(f"row {number}: light: expected {wanted}, got {shown(row['light'])}")
        else:
            seen.add(l)
            weights[l] = values  # one number fills three
    if problems:
        raise JobError(file, append_count(problems[:MOST_PROBLEMS], len(problems)))
    return weights


def _read_rows(file: Path) -> tuple[list[str], list[tuple[int, list[str]]]]:
    """Return the names of the columns, and number and cells of each row."""
    try:
        data = read_at_most(file, LARGEST_FILE)
        text = (data or b"").decode("utf-8-sig")
    except FileNotFoundError:
        raise JobError(file, ["no such file"]) from None
    except OSError as error:
        raise JobError(file, [f"cannot be read: {error.strerror}"]) from error
    except UnicodeDecodeError as error:
        raise JobError(file, ["expected UTF-8 text, got another encoding; save the file as UTF-8"]) from error
    if data is None:
        raise JobError(file, [f"expected at most {LARGEST_FILE >> 20} MB, got a bigger file"])
    try:
        reader = csv.reader(text.splitlines(), strict=True)
        lines = [(reader.line_num, [cell.strip() for cell in line]) for line in reader if line]
    except csv.Error as error:
        raise JobError(file, [f"not valid CSV: {error}"]) from error
    header = [name.lower() for name in lines[0][1]] if lines else []
    return header, lines[1:]


def _number(cell: str) -> float | None:
    try:
        value = float(cell)
    except ValueError:
        return None
    return value if math.isfinite(value) and abs(value) <= MOST_WEIGHT else None


def _index(cell: str, n: int) -> int | None:
    return int(cell) if cell.isascii() and cell.isdigit() and len(cell) < 10 and int(cell) < n else None
