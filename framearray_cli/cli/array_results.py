"""Results of the commands that make something out of an array, as typed data, for `--json`."""

from dataclasses import dataclass


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


@dataclass(frozen=True, slots=True, kw_only=True)
class SheetResult:
    """The picture that `sheet` drew; `cameras`: of the columns; `lights`: of the rows; `size`: pixels."""

    file: str
    cameras: tuple[int, ...]
    lights: tuple[int, ...]
    size: tuple[int, int]


@dataclass(frozen=True, slots=True, kw_only=True)
class AssembleResult:
    """The movie or sequence that `assemble` cut.

    Attributes:
        images: the number of different places in the array.
        otio: the file that describes a sequence for editing programs, if it was asked for.
    """

    path: str
    frames: int
    images: int
    fps: float
    otio: str | None = None


@dataclass(frozen=True, slots=True, kw_only=True)
class PageResult:
    """The page that `view --export` wrote; `pictures`: prepared; `damaged`: images that could not be read."""

    directory: str
    size_bytes: int
    pictures: int
    damaged: int


@dataclass(frozen=True, slots=True, kw_only=True)
class ServerResult:
    """The address of the page that `view` shows; the document is printed when it opens, and the command goes on."""

    url: str
    pictures: int
