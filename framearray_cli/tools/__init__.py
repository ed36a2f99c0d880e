"""Tools for an array: movie, sheet, export, view."""

from collections.abc import Callable
from dataclasses import dataclass
from typing import TypeAlias

Progress: TypeAlias = Callable[[int, int], None]  # pictures done, pictures in all


@dataclass(frozen=True, slots=True, kw_only=True)
class SheetResult:
    """The picture that `sheet` drew; `cameras`: of the columns; `lights`: of the rows; `size`: pixels."""

    file: str
    cameras: tuple[int, ...]
    lights: tuple[int, ...]
    size: tuple[int, int]


@dataclass(frozen=True, slots=True, kw_only=True)
class AssembleResult:
    """The movie, sequence or still that was cut; `images`: number of different places in the array; `size`: pixels."""

    path: str
    frames: int
    images: int
    fps: float
    size: tuple[int, int]


@dataclass(frozen=True, slots=True, kw_only=True)
class ExportResult:
    """The folder that `export` wrote; `sets`: pictures of each set, with `--split`."""

    directory: str
    format: str
    cameras: int
    lights: int
    points: int
    pictures: int
    sets: dict[str, int]
