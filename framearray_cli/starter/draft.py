"""A first job before it is text: the options, the choices, and the tables of the job.

All positions are in the scene file's own coordinates.
"""

import unicodedata
from collections.abc import Callable
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any, Literal, NamedTuple

from pydantic import ValidationError

from framearray_cli.base.arrays import Float64
from framearray_cli.base.errors import SceneError
from framearray_cli.base.forms.problems import problems_of
from framearray_cli.job.job import Job

MOST_PROBLEMS = 3  # of a job that one error reports; a light that is nowhere has one per key
Vector = tuple[float, float, float]
Format = Literal["exr", "png", "tif", "jpg"]
Up = Literal["y", "z"]
INDIRECT = "cells"  # see docs/decisions/reuse.md
FPS = 24.0  # of a job, unless the file has its own; times of animations are seconds
DIGITS = 6  # significant digits of positions and directions; an error of a thousandth of a pixel
ROUNDING = 1e-12  # of the longest component: shorter ones are 0
STRENGTHS = ("intensity", "irradiance", "radiance")


class SunOption(NamedTuple):
    """A place on Earth, degrees north and east, a day, year-month-day, and the direction of the scene that is north."""

    latitude: float
    longitude: float
    date: str
    north: Vector | None = None


@dataclass(frozen=True, slots=True, kw_only=True)
class StartOptions:
    """Options of `init`; None: the starter chooses.

    Attributes:
        camera: name of a camera of the file.
        frames, lights: numbers of frames of the camera and of positions of the light.
        inside: True if the scene is a room.
        room: name of a room or storey of the file to stand in.
        up: the axis that points up.
        resolution: width and height, pixels.
        format: of the images; None: PNG, or EXR with groups.
        groups: make every source a group of its own, which only EXR and TIFF can hold.
        sun: the sun over a place instead of other lights.
        folders: from which the scene may read files, besides its own.
    """

    camera: str | None = None
    frames: int | None = None
    lights: int | None = None
    inside: bool | None = None
    room: str | None = None
    up: Up | None = None
    resolution: tuple[int, int] | None = None
    format: Format | None = None
    groups: bool = False
    sun: SunOption | None = None
    folders: tuple[Path, ...] = ()

    @property
    def image_format(self) -> Format:
        """The format of the images."""
        return self.format or ("exr" if self.groups else "png")


@dataclass(frozen=True, slots=True, kw_only=True)
class NotedTable:
    """A table of the job, for the camera or a light source.

    Attributes:
        table: keys and values of the job; a `Path` for a file name.
        about: comment lines.
        name: for a group.
    """

    table: dict[str, Any]
    about: tuple[str, ...]
    name: str = ""

    @property
    def keys(self) -> list[dict[str, Any]]:
        """The key frames."""
        keys: list[dict[str, Any]] = self.table["keys"]
        return keys

    def scaled(self, factor: float) -> "NotedTable":
        """Multiply all strengths of a light source by a factor, and round them to three digits."""

        def changed(value: Any, key: str = "") -> Any:
            if isinstance(value, dict):
                return {name: changed(each, name) for name, each in value.items()}
            if isinstance(value, list):
                return [changed(each, key) for each in value]
            return float(f"{value * factor:.3g}") if key in STRENGTHS else value

        return replace(self, table=changed(self.table))


class MaterialNote(NamedTuple):
    """A material as read.

    Attributes:
        more: factor of its reflectivity in the scene, in words, or empty.
        gloss: roughness and metal; None of a material that is not glossy.
    """

    name: str
    reflectivity: Vector
    specular: Vector
    more: str
    gloss: tuple[float, float] | None = None


@dataclass(frozen=True, slots=True, kw_only=True)
class Start:
    """A whole first job.

    Attributes:
        inside: True if the scene counts as a room.
        fps: frames per second of movies.
        format: of the images.
        as_file: surfaces follow the file; otherwise they are diffuse or mirrors.
        hide_backs: eyes look through the backs of materials that are one-sided by the file.
        about: comment lines at the top.
        notes: parts of the scene that were not understood or were approximated, one sentence each.
        folders: from which the scene may read files, besides its own.
    """

    name: str
    file: Path
    up: Up
    background: Vector
    camera: NotedTable
    light_frames: int
    sources: tuple[NotedTable, ...]
    inside: bool
    about: tuple[str, ...]
    materials: tuple[MaterialNote, ...]
    fps: float = FPS
    format: str = "png"
    as_file: bool = False
    hide_backs: bool = False
    notes: tuple[str, ...] = ()
    folders: tuple[Path, ...] = ()

    @property
    def frames(self) -> int:
        """Number of camera positions."""
        return int(self.camera.table["frames"])

    @property
    def outside(self) -> str:
        """The light of rays that meet nothing: average in a room, the sky for a thing under it."""
        return "average" if self.inside else "background"

    def noted(self, *lines: str) -> "Start":
        """Add comment lines."""
        return replace(self, about=(*self.about, *lines))


def without_accents(name: str) -> str:
    """Return a name with plain letters instead of accented ones."""
    return "".join(c for c in unicodedata.normalize("NFKD", name) if not unicodedata.combining(c))


def round_vector(values: Any) -> Vector:
    """Round three numbers to few enough digits to read, and enough to mean the same."""
    least = ROUNDING * max(abs(float(value)) for value in values)  # left by a turned axis instead of 0
    x, y, z = (float(f"{float(value):.{DIGITS}g}") if abs(float(value)) > least else 0.0 for value in values)
    return x + 0.0, y + 0.0, z + 0.0  # no -0.0


def round_points(points: Float64, size: float) -> list[Vector]:
    """Round points (n, 3) in file coordinates to a ten-thousandth of the size of the scene."""
    step = 10.0 ** int(f"{size * 1e-4:e}".split("e")[1])
    return [tuple(float(f"{round(float(v) / step) * step:.12g}") + 0.0 for v in point) for point in points]  # type: ignore[misc]


def table_of(start: Start) -> dict[str, Any]:
    """Return the tables of the job file."""
    return {
        "name": start.name,
        "scene": {
            "file": str(start.file),
            "up": start.up,
            "background": list(start.background),
            **({"surfaces": "file"} if start.as_file else {}),
            **({"back_faces": "hide"} if start.hide_backs else {}),
            "folders": [str(folder) for folder in start.folders],
        },
        "camera": dict(start.camera.table),
        "light": {"frames": start.light_frames, "sources": [plain(source.table, str) for source in start.sources]},
        "obscurance": {"outside": start.outside},
        "indirect": {"method": INDIRECT},
        "output": {"format": start.format},
    }


def plain(table: dict[str, Any], write: Callable[[Path], str]) -> dict[str, Any]:
    """Write the file names of a table as text."""
    return {key: write(value) if isinstance(value, Path) else value for key, value in table.items()}


def validate_job(table: dict[str, Any], file: Path) -> Job:
    """Make the job of some tables.

    Raises:
        SceneError: the cameras or lights of the scene file make no job, such as a light that is too far away.
    """
    try:
        return Job.model_validate(table)
    except ValidationError as error:
        listed = "; ".join(problems_of(error, Job, MOST_PROBLEMS))
        raise SceneError(f"{file}: its cameras or lights do not make a job: {listed}") from error
