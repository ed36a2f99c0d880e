"""`camera.file`: a file with one eye per frame -> camera keys.

CSV: the first row names the columns eye_x, eye_y, eye_z, target_x, target_y, target_z and, optionally, up_x, up_y,
up_z and those of the lens, in any order; one row per frame follows. JSON: a list with one `{"eye": [...], "target":
[...]}` per frame, optionally with `"up"` and the lens; or a `transforms.json`. COLMAP: an `images.txt`. A manifest.
"""

from collections.abc import Mapping
from pathlib import Path
from typing import Any

from .camera import CameraKey
from .colmapfile import IMAGES_FILE, read_colmap
from .keys import MOST_EYES
from .lens import LENS_KEYS
from .manifestfile import read_manifest_eyes
from .poses import EyeRows
from .rowfile import PlacedRow, RowFileError, columns_text, csv_lines, load_json, read_text, refuse_frames, row_problems
from .transforms import FRAMES, read_transforms

EYE_COLUMNS = ("eye_x", "eye_y", "eye_z")
TARGET_COLUMNS = ("target_x", "target_y", "target_z")
UP_COLUMNS = ("up_x", "up_y", "up_z")
SHIFT_COLUMNS = ("shift_x", "shift_y")
SINGLE_COLUMNS = ("fov", "height", "pixel_aspect")
FILES_OF_FOLDERS = (IMAGES_FILE, f"sparse/0/{IMAGES_FILE}", f"sparse/{IMAGES_FILE}", "transforms.json", "manifest.toml")
OPTIONAL = ("up", *LENS_KEYS)


def read_eyes(path: Path, resolution: tuple[int, int] | None = None) -> EyeRows:
    """Read a file of eyes as key tables for frames 0, 1, 2 and so on.

    Args:
        resolution: that the job gives, for files that say angles only.

    Raises:
        RowFileError: the file is missing, has another format, or has rows that are no eyes.
    """
    found = _read(path, resolution)
    if isinstance(found, EyeRows):
        _check_count(len(found.keys))
        placed = [(f"camera {c}", {k: v for k, v in key.items() if k != "frame"}) for c, key in enumerate(found.keys)]
        if problems := row_problems(placed, CameraKey, OPTIONAL, {}):
            raise RowFileError(*problems)
        return found
    _check_count(len(found))
    if problems := row_problems(found, CameraKey, OPTIONAL, {}):
        raise RowFileError(*problems)
    return EyeRows(keys=[{"frame": frame, **row} for frame, (_, row) in enumerate(found)])


def _read(path: Path, resolution: tuple[int, int] | None) -> EyeRows | list[PlacedRow]:
    """Read a file by its suffix."""
    if path.is_dir():
        raise RowFileError(f"expected a file, got a folder{_folder_remedy(path)}")
    if path.name == IMAGES_FILE:
        return read_colmap(path)
    match path.suffix.lower():
        case ".csv":
            return _csv_rows(read_text(path))
        case ".json":
            table = load_json(read_text(path))
            return read_transforms(table, resolution) if _is_transforms(table) else _json_rows(table)
        case ".toml":
            return read_manifest_eyes(read_text(path))
        case _:
            remedy = ""
            if path.suffix.lower() == ".bin":
                remedy = "; write COLMAP's model as text: colmap model_converter --output_type TXT"
            kinds = f".csv, .json or .toml, or an {IMAGES_FILE}"
            raise RowFileError(f'expected a file name that ends in {kinds}, got "{path.suffix}"{remedy}')


def _folder_remedy(folder: Path) -> str:
    """Name the file in a folder that was meant: of a COLMAP model, a data set of nerfstudio, or an array."""
    found = [name for name in FILES_OF_FOLDERS if (folder / name).is_file()]
    return f'; give the "{found[0]}" in it' if found else ""


def _check_count(n: int) -> None:
    if not 1 <= n <= MOST_EYES:
        raise RowFileError(f"expected 1 to {MOST_EYES} camera positions, got {n}")


def _is_transforms(table: object) -> bool:
    return isinstance(table, Mapping) and FRAMES in table


def _csv_rows(text: str) -> list[PlacedRow]:
    """Read the named columns of a CSV file; a cell that is no number stays text, which the check of its row reports."""
    header, lines = csv_lines(text)
    groups = {"up": UP_COLUMNS, "shift": SHIFT_COLUMNS}
    groups = {key: names for key, names in groups.items() if any(name in header for name in names)}
    single = [name for name in SINGLE_COLUMNS if name in header]
    vectors = {"eye": EYE_COLUMNS, "target": TARGET_COLUMNS, **groups}
    wanted = (*(name for names in vectors.values() for name in names), *single)
    if sorted(header) != sorted(wanted):
        raise RowFileError(f"row 1: expected the column names {', '.join(wanted)}, got {columns_text(header)}")
    rows = []
    for place, cells in lines:
        row: dict[str, Any] = {key: [cells[name] for name in names] for key, names in vectors.items()}
        rows.append((place, {**row, **{name: cells[name] for name in single}}))
    return rows


def _json_rows(rows: Any) -> list[PlacedRow]:
    """Take a list of tables."""
    if not isinstance(rows, list) or not all(isinstance(row, dict) for row in rows):
        raise RowFileError('expected a list of {"eye": [...], "target": [...]}, got something else')
    refuse_frames(rows)
    return [(f"entry {number}", row) for number, row in enumerate(rows, start=1)]
