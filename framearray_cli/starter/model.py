"""A first job before it is text: what was chosen, and why. All positions are in the scene file's own coordinates."""

import unicodedata
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any, Literal

from pydantic import ValidationError

from framearray_cli.base.arrays import Float64
from framearray_cli.base.errors import SceneError
from framearray_cli.base.forms.problems import problems_of
from framearray_cli.base.units import counted
from framearray_cli.job.job import Job

MOST_PROBLEMS = 3  # of a job that one error reports; a light that is nowhere has one per key
Vector = tuple[float, float, float]
LensKeys = dict[str, Any]  # as a job has them
POWERS = {
    "point": ("position", "intensity"),
    "directional": ("direction", "irradiance"),
    "spot": ("position", "intensity"),
    "rect": ("position", "radiance"),
    "disc": ("position", "radiance"),
}
SUN_ANGLE = 0.53  # degrees; of the sun, seen from the Earth
WEIGHTS, INDIRECT = "area", "cells"  # see docs/decisions/settings.md
FPS = 24.0  # of a job, unless the file has its own; times of animations are seconds
DIGITS = 6  # significant digits of positions and directions; an error of a thousandth of a pixel
ROUNDING = 1e-12  # of its longest component: shorter ones are 0


@dataclass(frozen=True, slots=True, kw_only=True)
class EyeKey:
    """The camera at a frame; `up` is None for a level camera, `lens` holds the keys of a lens that changes."""

    frame: int
    eye: Vector
    target: Vector
    up: Vector | None = None
    lens: LensKeys = field(default_factory=dict)

    @property
    def table(self) -> dict[str, Any]:
        """As the job has it."""
        above = {"up": list(self.up)} if self.up else {}
        return {"frame": self.frame, "eye": list(self.eye), "target": list(self.target), **above, **self.lens}


@dataclass(frozen=True, slots=True, kw_only=True)
class Camera:
    """The camera's path.

    Attributes:
        lens: keys of `[camera]` for the lens of all frames: type, fov, height, shift.
        about: comment lines.
    """

    keys: tuple[EyeKey, ...]
    frames: int
    lens: LensKeys
    resolution: tuple[int, int]
    about: tuple[str, ...]


@dataclass(frozen=True, slots=True, kw_only=True)
class LightKeys:
    """A light's path: its frames, and its position or direction and its power at each.

    Attributes:
        aims: of a spot: the way the middle of its light goes.
        ies: of a measured lamp, a spot without cone: its file; and `ups` the direction of its horizontal angle 0, or of
            the height of a rectangle.
        shapes: further numbers of each key: radius, angle, width and height, and of a spot `inner` and `outer`; one
            for all of them where they stay as they are.
        name: for a group.
    """

    kind: Literal["point", "directional", "spot", "rect", "disc"]
    frames: tuple[int, ...]
    vectors: tuple[Vector, ...]
    powers: tuple[Vector, ...]
    about: tuple[str, ...]
    aims: tuple[Vector, ...] = ()
    ies: Path | None = None
    ups: tuple[Vector, ...] = ()
    shapes: tuple[dict[str, float], ...] = ({},)
    name: str = "lamp"
    group: str | None = None


@dataclass(frozen=True, slots=True, kw_only=True)
class SunDay:
    """The sun over a place on a day.

    Attributes:
        timezone: hours ahead of UTC.
        start, stop: local times.
        power: irradiance.
    """

    latitude: float
    longitude: float
    date: str
    timezone: float
    start: str
    stop: str
    power: Vector
    about: tuple[str, ...]
    name: str = "sun"
    group: str | None = None


@dataclass(frozen=True, slots=True, kw_only=True)
class MeshLight:
    """A material that shines.

    Attributes:
        intensity: multiplies the emission of the scene file.
        two_sided: whether the back shines, too.
    """

    material: str
    intensity: float
    two_sided: bool
    about: tuple[str, ...]
    name: str
    group: str | None = None


@dataclass(frozen=True, slots=True, kw_only=True)
class EnvironmentLight:
    """A panorama around the scene.

    Attributes:
        file: its EXR; `intensity`: factor of its radiance.
    """

    file: Path
    intensity: float
    about: tuple[str, ...]
    name: str
    group: str | None = None


LightSource = LightKeys | SunDay | MeshLight | EnvironmentLight


@dataclass(frozen=True, slots=True, kw_only=True)
class MaterialNote:
    """A material as read.

    Attributes:
        more: what its reflectivity is multiplied with, or empty.
        gloss: roughness and metal; None of what is not glossy.
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
        inside: whether the scene counts as a room.
        unit: of length, as it seems: "m", "cm", "mm", "in" or "ft"; "" where nothing tells.
        fps: frames per second of movies.
        format: of the images.
        as_file: whether surfaces follow the file; else they are diffuse or mirrors.
        about: comment lines at the top.
        notes: what of the scene was not understood or was approximated, one sentence each.
    """

    name: str
    file: Path
    up: Literal["y", "z"]
    background: Vector
    camera: Camera
    light_frames: int
    sources: tuple[LightSource, ...]
    range: float
    inside: bool
    about: tuple[str, ...]
    materials: tuple[MaterialNote, ...]
    unit: str = ""
    fps: float = FPS
    format: str = "png"
    as_file: bool = False
    notes: tuple[str, ...] = ()

    @property
    def outside(self) -> str:
        """The light of rays that meet nothing: average in a room, the sky for a thing under it."""
        return "average" if self.inside else "background"


def without_accents(name: str) -> str:
    """Return a name with plain letters in place of accented ones."""
    return "".join(c for c in unicodedata.normalize("NFKD", name) if not unicodedata.combining(c))


def round_vector(values: Any) -> Vector:
    """Round three numbers to few enough digits to read, and enough to mean the same."""
    least = ROUNDING * max(abs(float(value)) for value in values)  # what a turned axis leaves in place of 0
    x, y, z = (float(f"{float(value):.{DIGITS}g}") if abs(float(value)) > least else 0.0 for value in values)
    return x + 0.0, y + 0.0, z + 0.0  # no -0.0


def round_points(points: Float64, size: float) -> list[Vector]:
    """Round points (n, 3) in file coordinates to a ten-thousandth of the size of the scene."""
    step = 10.0 ** _floor_log10(size * 1e-4)
    return [tuple(float(f"{round(float(v) / step) * step:.12g}") + 0.0 for v in point) for point in points]  # type: ignore[misc]


def _floor_log10(value: float) -> int:
    return int(f"{value:e}".split("e")[1])


def table_of(start: Start) -> dict[str, Any]:
    """The tables of the job file of this job."""
    camera, surfaces = start.camera, {"surfaces": "file"} if start.as_file else {}
    return {
        "name": start.name,
        "scene": {"file": str(start.file), "up": start.up, "background": list(start.background), **surfaces},
        "camera": {
            "resolution": list(camera.resolution),
            **camera.lens,
            "frames": camera.frames,
            "keys": [key.table for key in camera.keys],
        },
        "light": {
            "frames": start.light_frames,
            "sources": [source_table(source) for source in start.sources],
        },
        "obscurance": {"range": start.range, "outside": start.outside},
        "indirect": {"method": INDIRECT},
        "output": {"format": start.format},
    }


def validate_job(table: dict[str, Any], file: Path) -> Job:
    """Make the job of some tables.

    Raises:
        SceneError: the cameras or lights of the scene file make no job, such as a light that is too far away.
    """
    try:
        return Job.model_validate(table)
    except ValidationError as error:
        problems = problems_of(error, Job)
        more = (
            f"; and {counted(len(problems) - MOST_PROBLEMS, 'more problem')}" if len(problems) > MOST_PROBLEMS else ""
        )
        listed = "; ".join(problems[:MOST_PROBLEMS]) + more
        raise SceneError(f"{file}: its cameras or lights do not make a job: {listed}") from error


def source_table(source: LightSource) -> dict[str, Any]:
    """The table of a source."""
    group = {"group": source.group} if source.group else {}
    if isinstance(source, LightKeys):
        ies = {"ies": str(source.ies)} if source.ies else {}
        return {"type": source.kind, **group, **ies, "keys": source_keys(source)}
    if isinstance(source, EnvironmentLight):
        keys = [{"frame": 0, "intensity": source.intensity}]
        return {"type": "environment", **group, "file": str(source.file), "keys": keys}
    if isinstance(source, MeshLight):
        own = {"material": source.material, "two_sided": source.two_sided}
        return {"type": "mesh", **group, **own, "keys": [{"frame": 0, "intensity": source.intensity}]}
    return {
        "type": "sun",
        **group,
        "latitude": source.latitude,
        "longitude": source.longitude,
        "date": source.date,
        "timezone": source.timezone,
        "start": source.start,
        "stop": source.stop,
        "irradiance": list(source.power),
        "angle": SUN_ANGLE,
    }


def source_keys(source: LightKeys) -> list[dict[str, Any]]:
    """The key frames of a source."""
    place, power = POWERS[source.kind]
    keys: list[dict[str, Any]] = [
        {"frame": frame, place: list(vector), power: list(strength)}
        for frame, vector, strength in zip(source.frames, source.vectors, source.powers, strict=True)
    ]
    for k, key in enumerate(keys):
        key |= {"direction": list(source.aims[k])} if source.aims else {}
        key |= {"up": list(source.ups[k])} if source.ups else {}
        key |= source.shapes[k if len(source.shapes) > 1 else 0]
    return keys
