"""Manifest: the contents of a folder of images, for programs that know nothing of the renderer.

Notation: a place is a tuple of indices, one per light axis, in the order of `Manifest.axes`. File names are patterns
for `str.format` with {camera} and {light}.
"""

import re
import string
from collections.abc import Iterable, Iterator, Mapping
from dataclasses import dataclass, field
from datetime import datetime
from pathlib import Path, PurePosixPath
from typing import Any, TypeAlias

import numpy as np

from framearray_cli.base.arrays import Float64, is_number, is_vector
from framearray_cli.base.errors import OutputError
from framearray_cli.base.forms.words import shown
from framearray_cli.base.lens import ORTHOGRAPHIC, PERSPECTIVE, Lens, lens_problem
from framearray_cli.base.sundays import moment_text
from framearray_cli.base.units import LEAST_FPS, MOST_FPS, counted

FILE_NAME = "manifest.toml"
SENSORS = "sensors.csv"  # illuminance at points
BACKGROUND = "background"  # next to the groups: light from outside the scene
MAIN_AXIS = "light"  # the axis of all sources, or of those that name none; as in the job
LARGEST = 65535  # pixels of a side; a job has at most 16384

Vector: TypeAlias = tuple[float, float, float]
Row: TypeAlias = tuple[float, float, float, float]
Matrix: TypeAlias = tuple[Row, Row, Row, Row]
_FIELD = re.compile(r"\{[^{}]*\}")  # one field with its format, whose colon is not part of a name


@dataclass(frozen=True, slots=True, kw_only=True)
class ManifestCamera:
    """One eye.

    Attributes:
        world_from_camera: 4x4, by rows, acts on columns; the camera looks along -z, y up; the world is the
            scene file's own coordinates.
        fov: vertical field of view of a perspective, degrees.
        type: "orthographic" or "panorama" of one that is no perspective.
        height: of what an orthographic camera sees, scene units.
        shift: of the picture to the right and up, as a share of its longer side.
        pixel_aspect: width of a pixel over its height.
    """

    world_from_camera: Matrix
    fov: float | None = None
    type: str = PERSPECTIVE
    height: float | None = None
    shift: tuple[float, float] = (0.0, 0.0)
    pixel_aspect: float = 1.0

    def __post_init__(self) -> None:
        rows = self.world_from_camera
        square = isinstance(rows, tuple) and len(rows) == 4 and all(is_vector(row, 4) for row in rows)
        expect(square, "world_from_camera: expected 4 rows of 4 finite numbers")
        problem = lens_problem(self.type, self.fov, self.height, self.shift, self.pixel_aspect)
        expect(not problem, problem)

    @property
    def lens(self) -> Lens:
        """The lens."""
        sizes: dict[str, Any] = {key: value for key in ("fov", "height") if (value := getattr(self, key)) is not None}
        return Lens(type=self.type, shift=self.shift, pixel_aspect=self.pixel_aspect, **sizes)

    @property
    def matrix(self) -> Float64:
        """`world_from_camera` as a (4, 4) array."""
        return np.array(self.world_from_camera, dtype=np.float64)


@dataclass(frozen=True, slots=True, kw_only=True)
class ManifestLight:
    """One light position: all its sources shine together.

    Attributes:
        ambient: I_A, radiance, RGB.
        ambient_error: standard error of I_A, RGB.
        sources: tables with "type", and "position" and "intensity" (W/sr) of a point, "direction" and "irradiance"
            (W/m2) of a directional source; in the scene file's own coordinates.
    """

    ambient: Vector
    ambient_error: Vector
    sources: tuple[dict[str, Any], ...]

    def __post_init__(self) -> None:
        for name, value in (("ambient", self.ambient), ("ambient_error", self.ambient_error)):
            expect(is_vector(value, 3), f"{name}: expected 3 finite numbers, got {shown(value)}")
        typed = all(isinstance(source, dict) and isinstance(source.get("type"), str) for source in self.sources)
        expect(typed, "sources: expected tables with a type")


@dataclass(frozen=True, slots=True, kw_only=True)
class ManifestGroup:
    """Sources whose light is stored separately, so that it can be changed after rendering.

    Attributes:
        name: of the group.
        axis: light axis that the group's images are numbered along; groups of one axis move together.
        images: file pattern with {camera} and {light}: only the direct light of this group.
        lights: positions along the axis; `ambient` is the contribution of this group to I_A.
    """

    name: str
    axis: str
    images: str
    lights: tuple[ManifestLight, ...]

    def __post_init__(self) -> None:
        for key in ("name", "axis", "images"):
            value = getattr(self, key)
            expect(isinstance(value, str) and bool(value), f"{key}: expected text, got {shown(value)}")
        expect(bool(self.lights), "lights: expected at least one")


@dataclass(frozen=True, slots=True, kw_only=True)
class Manifest:
    """The contents of an output folder.

    Attributes:
        version: of the program that rendered it.
        name: of the job.
        fingerprint: of job and scene, see render/identity.py.
        images: file pattern with {camera} and {light}, relative to the folder, "/" between folders; "" in an array
            with groups.
        layers: file pattern with {camera}, or "" if no layers were written.
        resolution: width, height, pixels.
        fps: frames per second.
        cameras: N_c eyes.
        lights: N_l light positions; none in an array with groups.
        groups: stored instead of `images` if the job has groups of sources.
        ambient_images: file pattern with {camera}: R W, which I_A multiplies; "" without groups.
        background_images: file pattern with {camera}: the light of the background; "" if it is black.
        background_ambient: contribution of the background to I_A, RGB.
        job: the job as resolved, a plain table.
        scene: contents of the scene file, a plain table.
        summary: result and cost of all runs, a plain table.
        directory: the folder; set when read, not written.
    """

    version: str
    name: str
    fingerprint: str
    images: str = ""
    layers: str = ""
    resolution: tuple[int, int]
    fps: float
    cameras: tuple[ManifestCamera, ...]
    lights: tuple[ManifestLight, ...] = ()
    groups: tuple[ManifestGroup, ...] = ()
    ambient_images: str = ""
    background_images: str = ""
    background_ambient: Vector = (0.0, 0.0, 0.0)
    job: dict[str, Any] = field(default_factory=dict)
    scene: dict[str, Any] = field(default_factory=dict)
    summary: dict[str, Any] = field(default_factory=dict)
    directory: Path = field(default_factory=Path, compare=False)

    def __post_init__(self) -> None:
        for key in ("version", "name", "fingerprint", "images", "layers", "ambient_images", "background_images"):
            expect(isinstance(getattr(self, key), str), f"{key}: expected text, got {shown(getattr(self, key))}")
        for key in ("job", "scene", "summary"):
            expect(isinstance(getattr(self, key), dict), f"{key}: expected a table, got {shown(getattr(self, key))}")
        sizes = self.resolution
        whole = is_vector(sizes, 2) and all(isinstance(size, int) and 0 < size <= LARGEST for size in sizes)
        expect(whole, f"resolution: expected 2 whole numbers from 1 to {LARGEST}, got {shown(sizes)}")
        good = is_number(self.fps) and LEAST_FPS <= self.fps <= MOST_FPS
        expect(good, f"fps: expected a number from {LEAST_FPS:g} to {MOST_FPS:g}, got {shown(self.fps)}")
        expect(bool(self.cameras), "cameras: expected at least one")
        ambient = self.background_ambient
        expect(is_vector(ambient, 3), f"background_ambient: expected 3 finite numbers, got {shown(ambient)}")
        moves = self.n_cameras > 1
        if self.groups:
            self._check_groups()
        else:
            expect(bool(self.lights), "lights: expected at least one")
            check_pattern("images", self.images, {"camera": moves, "light": len(self.lights) > 1})
        for key in ("layers", "ambient_images", "background_images"):
            if pattern := getattr(self, key):
                check_pattern(key, pattern, {"camera": moves})

    def _check_groups(self) -> None:
        expect(not self.images and not self.lights, "groups: expected no images and lights next to them")
        expect(bool(self.ambient_images), "ambient_images: expected file names, as there are groups")
        names = [group.name for group in self.groups]
        expect(len(set(names)) == len(names), f"groups: expected different names, got {', '.join(names)}")
        axes = self.axes
        for k, group in enumerate(self.groups):
            n = len(group.lights)
            wanted = counted(axes[group.axis], "light position")
            expect(n == axes[group.axis], f"groups[{k}]: expected {wanted}, as others of its axis")
            check_pattern(f"groups[{k}].images", group.images, {"camera": self.n_cameras > 1, "light": n > 1})

    @property
    def n_cameras(self) -> int:
        """N_c."""
        return len(self.cameras)

    @property
    def parts(self) -> tuple[ManifestGroup, ...]:
        """The groups, or in an array without groups one part with all light."""
        return self.groups or (ManifestGroup(name="all", axis=MAIN_AXIS, images=self.images, lights=self.lights),)

    @property
    def axes(self) -> dict[str, int]:
        """Number of light positions along each axis, by name; the main axis first, if any group uses it."""
        found = {part.axis: len(part.lights) for part in reversed(self.parts)}
        return {axis: found[axis] for axis in sorted(found, key=lambda axis: (axis != MAIN_AXIS, axis))}

    @property
    def group_names(self) -> tuple[str, ...]:
        """Names of all that can be relit: the groups, and BACKGROUND if there is one."""
        return (*(group.name for group in self.groups), *((BACKGROUND,) if self.background_images else ()))

    @property
    def uses_ambient(self) -> bool:
        """True if indirect light is I_A R W; else images contain it for their own sources, and I_A is 0."""
        return self._in_job("indirect", "method") != "cells"

    @property
    def has_sun_hours(self) -> bool:
        """True if the layers contain hours of direct sun."""
        return bool(self.layers) and self._in_job("output", "sun_hours") is True

    @property
    def has_alpha(self) -> bool:
        """True if images have an alpha channel."""
        return self._in_job("output", "alpha") is True

    def _in_job(self, table: str, key: str) -> object:
        found = self.job.get(table)
        return found.get(key) if isinstance(found, dict) else None

    @property
    def n_lights(self) -> int:
        """N_l: light positions along the first axis."""
        return next(iter(self.axes.values()))


def manifest_camera(rows: Matrix, lens: Lens) -> ManifestCamera:
    """Return a camera with the keys of its lens."""
    own: dict[str, Any] = {"type": lens.type, "shift": lens.shift, "pixel_aspect": lens.pixel_aspect}
    own |= {PERSPECTIVE: {"fov": lens.fov}, ORTHOGRAPHIC: {"height": lens.height}}.get(lens.type, {})
    return ManifestCamera(world_from_camera=rows, **own)


def matrix_rows(matrix: Float64) -> Matrix:
    """Convert a (4, 4) array to the rows that `ManifestCamera` holds."""
    a, b, c, d = (tuple(float(value) for value in row) for row in matrix)
    return a, b, c, d  # type: ignore[return-value]  # lengths are checked by ManifestCamera


def image_path(manifest: Manifest, c: int, l: int, group: ManifestGroup | None = None) -> Path:
    """Return the file of image [c, l], or of the image of a group.

    Raises:
        OutputError: the array has groups, and none is given.
    """
    if group is None and manifest.groups:
        names = ", ".join(known.name for known in manifest.groups)
        raise OutputError(f"{manifest.directory}: images are stored by group of sources; expected one of {names}")
    return manifest.directory / file_name(group.images if group else manifest.images, c, l)


def array_files(manifest: Manifest) -> Iterator[Path]:
    """Yield all files of the array except the manifest, whether they exist or not."""
    for c in range(manifest.n_cameras):
        for name in camera_files(manifest, c):
            yield manifest.directory / name


def camera_files(manifest: Manifest, c: int) -> Iterator[str]:
    """Yield the names of all files of camera c, relative to the folder."""
    for pattern in (manifest.layers, manifest.ambient_images, manifest.background_images):
        if pattern:
            yield file_name(pattern, c)
    for part in manifest.parts:
        for l in range(len(part.lights)):
            yield file_name(part.images, c, l)


def layers_path(manifest: Manifest, c: int) -> Path:
    """Return the file of the layers of camera c.

    Raises:
        OutputError: the array has no layers.
    """
    if not manifest.layers:
        raise OutputError(f"{manifest.directory}: this frame array was written without layers")
    return manifest.directory / file_name(manifest.layers, c)


def moment_at(manifest: Manifest, axis: str, l: int) -> datetime | None:
    """Return the local date and time of light position l along an axis; None without a sun."""
    return moment_of(_sources(manifest, axis, l))


def moment_of(sources: Iterable[Mapping[str, Any]]) -> datetime | None:
    """Return the local date and time at which the sources of a light position shine; None without a sun among them."""
    for source in sources:
        try:
            return datetime.fromisoformat(source["time"])
        except (KeyError, ValueError, TypeError):
            continue
    return None


def _sources(manifest: Manifest, axis: str, l: int) -> list[dict[str, Any]]:
    return [source for part in manifest.parts if part.axis == axis for source in part.lights[l].sources]


def sun_angles(manifest: Manifest, axis: str, l: int) -> tuple[float, float] | None:
    """Return azimuth, clockwise from north, and height of the sun at a light position, degrees; None without a sun."""
    sources = (source for source in _sources(manifest, axis, l) if {"azimuth", "elevation"} <= source.keys())
    return next(((source["azimuth"], source["elevation"]) for source in sources), None)


def position_name(manifest: Manifest, axis: str, l: int) -> str:
    """Name a light position: "light 12", under a sun "light 12  2026-06-21 14:30"."""
    moment = moment_at(manifest, axis, l)
    return f"{axis} {l}" + (f"  {moment_text(moment)}" if moment else "")


def axis_moments(manifest: Manifest) -> dict[str, tuple[datetime, ...]]:
    """Return local date and time of all positions of each axis with a sun, by its name."""
    found = {axis: [moment_at(manifest, axis, l) for l in range(n)] for axis, n in manifest.axes.items()}
    return {axis: tuple(m for m in moments if m) for axis, moments in found.items() if all(moments)}


def expect(good: bool, problem: str) -> None:
    """Raise a ValueError with a problem of a manifest, unless a condition is true."""
    if not good:
        raise ValueError(problem)


def file_patterns(name: str, n_cameras: int, n_lights: int, extension: str) -> tuple[str, str]:
    """Return the patterns of images and of layers, chosen so that names sort; both go into one folder.

    A `glob` of "name.c0007.*" finds only the images of camera 7, "name.layers.*" all layers.
    """
    l_digits = max(3, len(str(n_lights - 1)))
    images = f"{_safe(name)}.{_camera_field(n_cameras)}.l{{light:0{l_digits}d}}.{extension}"
    return images, camera_pattern(name, "layers", n_cameras, "exr")


def camera_pattern(name: str, what: str, n_cameras: int, extension: str) -> str:
    """Return the pattern of files of which there is one per camera."""
    return f"{_safe(name)}.{what}.{_camera_field(n_cameras)}.{extension}"


def file_name(pattern: str, c: int, l: int = 0) -> str:
    """Return the file name for camera c and light position l; a pattern without {light} ignores l."""
    return pattern.format(camera=c, light=l)


def _safe(name: str) -> str:
    return name.replace("{", "{{").replace("}", "}}")


def _camera_field(n_cameras: int) -> str:
    return f"c{{camera:0{max(4, len(str(n_cameras - 1)))}d}}"


def check_pattern(key: str, pattern: str, fields: Mapping[str, bool]) -> None:
    """Refuse a file pattern that leads out of its folder, or does more than number files.

    Args:
        key: name of the pattern in messages.
        pattern: for `str.format`.
        fields: name -> whether the pattern must have it.

    Raises:
        ValueError: the pattern is refused.
    """
    path = PurePosixPath(pattern)
    leads_out = path.is_absolute() or ".." in path.parts or not path.name
    # Backslash and colon lead out of a folder on Windows; a reader there must not follow them.
    if leads_out or re.search(r"[\\:\x00-\x1f]", _FIELD.sub("", pattern)):
        raise ValueError(f"{key}: expected file names inside the folder, got {shown(pattern)}")
    try:
        parts = [(name, spec, conversion) for _, name, spec, conversion in string.Formatter().parse(pattern)]
    except ValueError as error:
        raise ValueError(f"{key}: broken pattern {shown(pattern)}: {error}") from error
    names = [name for name, _, _ in parts if name is not None]
    for name, spec, conversion in parts:
        # Anything else, such as {camera.__class__}, would let a manifest inspect this program.
        if name is not None and (name not in fields or conversion or not re.fullmatch(r"(0?[1-9]d)?", spec or "")):
            allowed = " and ".join(f"{{{known}:04d}}" for known in fields)
            raise ValueError(f"{key}: expected no other fields than {allowed}, got {shown(pattern)}")
    for name, must in fields.items():
        if must and name not in names:
            raise ValueError(f"{key}: expected {{{name}}} in {shown(pattern)}")
