"""A first job: the options, the choices, the tables of the job, and its text with a comment per key.

All positions are in the scene file's own coordinates. The text is formatted here rather than by a TOML library, since
half of it is comments, for users who read and edit it before any documentation; a test reads it back.
"""

import os
import shlex
import unicodedata
from collections.abc import Callable, Iterable, Sequence
from dataclasses import dataclass, replace
from datetime import date
from pathlib import Path
from typing import Any, Literal, NamedTuple

import numpy as np
from pydantic import ValidationError

from framearray_cli.base.arrays import Float64
from framearray_cli.base.errors import SceneError
from framearray_cli.base.forms.problems import problems_of
from framearray_cli.base.forms.toml import inline, inline_floats, quoted
from framearray_cli.base.units import counted
from framearray_cli.job.job import Job
from framearray_cli.scene.paths.panorama import norths

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
    """The sun over a place on Earth.

    Attributes:
        latitude, longitude: degrees north and east.
        dates: different days.
        north: direction of the scene, or degrees from the default, clockwise as seen from above.
        step: minutes from one position to the next, instead of a number of positions.
    """

    latitude: float
    longitude: float
    dates: tuple[date, ...]
    north: float | Vector | None = None
    step: float | None = None

    def with_axis(self, up: Up) -> "SunOption":
        """Turn degrees of north into a direction of a scene whose up axis is known."""
        if self.north is None or isinstance(self.north, tuple):
            return self
        return self._replace(north=round_vector(norths(up, np.array([self.north]))[0]))


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
        sun: the sun over a place instead of other lights; `lights` counts its positions on all days.
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
    def stepped(self) -> bool:
        """True if the step of a sun determines the number of light positions."""
        return any("step" in source.table for source in self.sources)

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


UNITS = {
    "intensity": "W/sr",
    "irradiance": "W/m2 of a surface that faces the light",
    "radiance": "W/(m2 sr) of the panel",
}
_LAMPS = '"point": a lamp; "spot": in a cone; "directional": the sun; "sun": by place and time'
_PANELS = '"rect", "disc": flat lamps; "point": a bulb; "directional": the sun'
# Comments of the keys of cameras and sources, by the key, or by the type of a source and the key.
COMMENTS = {
    "type": '"perspective", "orthographic" without perspective, or "panorama"',
    "resolution": "width and height, pixels",
    "fov": "vertical field of view, degrees",
    "height": "height of the view, scene units",
    "shift": "lens shift to the right and up, shares of the longer side",
    "frames": "camera positions along the path",
    **dict.fromkeys(("point.type", "spot.type", "directional.type"), _LAMPS),
    **dict.fromkeys(("rect.type", "disc.type"), _PANELS),
    "sun.type": "by place and time",
    "mesh.type": "emitting surfaces of the scene",
    "group": "stored separately, to change it afterwards",
    "material": "its name in the scene file",
    "two_sided": "true: the back emits, too",
    "mesh.keys": "factor of the emission in the file",
    "latitude": "degrees, north is positive",
    "longitude": "degrees, east is positive",
    "date": "year-month-day, or a list of days",
    "timezone": 'hours ahead of UTC, or a name: "Europe/Berlin"',
    "start": "local time of the first position",
    "stop": "local time of the last",
    "step": "minutes between positions, whose number follows",
    "north": "direction of the scene that points north",
    "irradiance": "of a surface that faces the sun: red, green, blue, W/m2",
    "sky.type": "the sky without the sun, by the height of the sun",
    "sky.irradiance": "of a level surface by the sky, W/m2",
    "angle": "angular diameter of the sun, degrees: shadows get soft edges",
}
MOST_STEPS_UP = 2  # largest number of leading ".." of a relative scene name; beyond, it is absolute
COLUMN = 42  # of comments behind keys
MOST_MATERIALS = 12  # between the scene and the camera; more are at the end


def to_text(start: Start, job_file: Path) -> str:
    """Write a job as text, which names the scene relative to the job's file."""
    few = len(start.materials) <= MOST_MATERIALS
    count = counted(len(start.materials), "material")
    surfaces = 'gloss, glass and bumps as in the file; "diffuse": without them, in less time'
    backs = 'cameras look through the backs of single-sided materials, as viewers do; "show": backs are seen'
    outside = (
        'light of rays that meet nothing so near; "background" where the sky matters'
        if start.inside
        else "rays that leave the scene bring the sky's light"
    )
    folders = [scene_name(folder, job_file) for folder in start.folders]
    lines = [
        f"# A first job for {_one_line(start.file.name)}, made by `framearray init`. Change it, then:",
        f"#   framearray render {_one_line(shlex.quote(job_file.name))}",
        *_comments(start.about),
        _line("name", quoted(start.name), "starts every file name"),
        _line("seed", "0", "of all random numbers"),
        "",
        "[scene]",
        _line("file", quoted(scene_name(start.file, job_file)), "relative to this file"),
        *([_line("folders", inline(folders), "more folders for its files")] if folders else []),
        _line("up", quoted(start.up), "the axis that points up"),
        _line("background", inline_floats(start.background), "radiance outside the scene: the sky"),
        *([_line("surfaces", '"file"', surfaces)] if start.as_file else []),
        *([_line("back_faces", '"hide"', backs)] if start.hide_backs else []),
        *(_materials(start.materials) if few else [f"# Its {count} are at the end of this file."]),
        "",
        *camera_lines(start.camera),
        "",
        "[light]",
        _positions(start),
        *(line for source in start.sources for line in _source(source, job_file)),
        "",
        "[samples]",
        _line("hits", "2", "samples per pixel and frame; more: less noise, more time"),
        _line("obscurance", "5", "rays per sample for its indirect light"),
        "",
        "[reuse]",
        _line("n_r", "3", "frames before and after that share their samples"),
        "",
        "[obscurance]",
        _line("outside", quoted(start.outside), outside),
        "",
        "[indirect]",
        _line("method", quoted(INDIRECT), 'all bounces of light; "obscurance": an approximation, in half the time'),
        "",
        "[output]",
        _line("directory", quoted(f"out/{start.name}"), "relative to this file"),
        _line("format", quoted(start.format), '"png" is small; "exr" keeps linear light, for work after the render'),
        _line("fps", f"{start.fps:g}", "frames per second of movies"),
        *_sun_hours(start),
        *([] if few else _materials(start.materials)),
        "",
    ]
    return "\n".join(lines)


def scene_name(file: Path, job_file: Path) -> str:
    """Return the name of a file in the job: relative if both files are close together."""
    file, folder = Path(os.path.abspath(file)), Path(os.path.abspath(job_file)).parent
    try:
        name = Path(os.path.relpath(file, folder))
    except ValueError:  # another drive
        return file.as_posix()
    return name.as_posix() if name.parts[: MOST_STEPS_UP + 1].count("..") <= MOST_STEPS_UP else file.as_posix()


def camera_lines(camera: NotedTable) -> list[str]:
    """Write `[camera]`."""
    keys = "camera positions at some frames; between them the camera moves smoothly"
    return [
        "[camera]",
        *_comments(camera.about),
        *(_line(key, inline(value), COMMENTS[key]) for key, value in camera.table.items() if key != "keys"),
        *_keys(camera.keys, keys),
    ]


def _positions(start: Start) -> str:
    """Write the number of light positions; a comment if it follows from a step."""
    about = "of the light; each gives one picture per camera position"
    if start.stepped:
        return f"# {counted(start.light_frames, 'position')} {about}"
    return _line("frames", str(start.light_frames), f"positions {about}")


def _source(source: NotedTable, job_file: Path) -> list[str]:
    table = plain(source.table, lambda file: scene_name(file, job_file))
    kind, keys = table["type"], table.pop("keys", None)
    lines = ["", "[[light.sources]]", *_comments(source.about)]
    for key, value in table.items():
        if key == "irradiance" and kind == "sun" and "step" not in table:
            lines.append(_line("# step", "15", "minutes between positions, instead of `frames` of [light]"))
        lines.append(_line(key, inline(value), COMMENTS.get(f"{kind}.{key}") or COMMENTS[key]))
    if f"{kind}.keys" in COMMENTS:
        return [*lines, _line("keys", f"[{inline(keys[0])}]", COMMENTS[f"{kind}.keys"])]
    if keys:
        strength = next(name for name in STRENGTHS if name in keys[0])
        lines += _keys(keys, f"{strength}: red, green, blue, {UNITS[strength]}")
    if keys and len(keys) == 1:
        more = "A second key, such as { frame = 11, ... }, and more `frames` above make it move."
        lines.append(f"# It stands still. {more}")
    return lines


def _keys(keys: Sequence[dict[str, Any]], comment: str) -> list[str]:
    return [f"{'keys = [':<{COLUMN - 1}} # {comment}", *(f"  {_key(key)}," for key in keys), "]"]


def _key(table: dict[str, Any]) -> str:
    return inline({key: list(map(float, value)) if isinstance(value, list) else value for key, value in table.items()})


def _sun_hours(start: Start) -> list[str]:
    """Write the key for hours of sun, commented out: a dozen positions without both ends of the day count too few."""
    if not any(source.table["type"] == "sun" for source in start.sources):
        return []
    steps = "# Let it go in steps of minutes, too: remove `frames` of [light] and the # before `step`."
    return [
        "# For hours of direct sun as a layer, let the sun go from its first rise to its last set: change `start` and",
        "# `stop`, and remove the # here.",
        *([] if start.stepped else [steps]),
        _line("# sun_hours", "true", "each position counts for the time to the next"),
    ]


def _materials(materials: Sequence[MaterialNote]) -> list[str]:
    """Write every material, commented out."""
    lines = [
        "",
        "# The materials as they were read. To change one, remove the # before its lines and edit the numbers:",
        "# reflectivity: diffuse, 0 is black and 1 white; specular: above 0 it is a mirror; their sum is at most 1.",
    ]
    if any(material.gloss for material in materials):
        lines.append(
            "# roughness: 0.1 is polished and 1 matt; metallic: 1 of metals, which have the reflectivity as colour."
        )
    for material in materials:
        more = f"  # {material.more}, which these numbers replace" if material.more else ""
        lines.append(f"# [scene.materials.{quoted(material.name)}]")
        lines.append(f"# reflectivity = {inline_floats(material.reflectivity)}{more}")
        if max(material.specular) > 0:
            lines.append(f"# specular = {inline_floats(material.specular)}")
        if material.gloss:
            lines += [f"# roughness = {material.gloss[0]}", f"# metallic = {material.gloss[1]}"]
    return lines


def _comments(lines: Iterable[str]) -> list[str]:
    return [f"# {_one_line(line)}" for line in lines]


def _one_line(text: str) -> str:
    """Replace control characters, which a comment must not contain."""
    return "".join(c if c.isprintable() else "?" for c in text)


def _line(key: str, value: str, comment: str) -> str:
    return f"{f'{key} = {value}':<{COLUMN - 1}} # {comment}"
