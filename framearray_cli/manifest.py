"""Manifest: what a folder of images holds, so that a program which never saw the renderer can use it.

`manifest.toml` is read by people first: short keys on top, then the job, then one block a camera and a light.
"""

import math
import tomllib
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any, TypeAlias

import numpy as np

from .arrays import Float64
from .errors import OutputError
from .filepatterns import check_pattern
from .files import reason, write_bytes

FILE_NAME = "manifest.toml"
FORMAT = 1  # of the manifest itself; a program that knows format 1 may not understand 2

Vector: TypeAlias = tuple[float, float, float]
Row: TypeAlias = tuple[float, float, float, float]
Matrix: TypeAlias = tuple[Row, Row, Row, Row]


@dataclass(frozen=True, slots=True, kw_only=True)
class ManifestCamera:
    """One eye.

    Attributes:
        world_from_camera: 4x4, row after row, acts on columns; the camera looks along -z, y up; the world is the
            scene file's own coordinates.
        fov: vertical field of view, degrees.
    """

    world_from_camera: Matrix
    fov: float

    def __post_init__(self) -> None:
        rows = self.world_from_camera
        square = isinstance(rows, tuple) and len(rows) == 4 and all(_is_vector(row, 4) for row in rows)
        _check(square, "world_from_camera: expected 4 rows of 4 finite numbers")
        _check(_is_number(self.fov) and 0 < self.fov < 180, f"fov: expected degrees in (0, 180), got {self.fov!r}")

    @property
    def matrix(self) -> Float64:
        """`world_from_camera` as a (4, 4) array."""
        return np.array(self.world_from_camera, dtype=np.float64)


@dataclass(frozen=True, slots=True, kw_only=True)
class ManifestLight:
    """One light index: all its sources shine together.

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
        _check(_is_vector(self.ambient, 3), f"ambient: expected 3 finite numbers, got {self.ambient!r}")
        _check(
            _is_vector(self.ambient_error, 3), f"ambient_error: expected 3 finite numbers, got {self.ambient_error!r}"
        )
        typed = all(isinstance(source, dict) and isinstance(source.get("type"), str) for source in self.sources)
        _check(typed, "sources: expected tables with a type")


@dataclass(frozen=True, slots=True, kw_only=True)
class Manifest:
    """What an output folder holds.

    Attributes:
        version: of the program that rendered it.
        name: of the job.
        fingerprint: of job and scene, see fingerprint.py.
        images: file pattern with {camera} and {light}, relative to the folder, "/" between folders.
        layers: file pattern with {camera}, or "" where no layers were written.
        resolution: width, height, pixels.
        fps: frames per second.
        cameras: N_c eyes.
        lights: N_l light indices.
        job: the job as resolved, a plain table.
        scene: what the scene file held, a plain table.
        summary: how the run went, a plain table.
        directory: the folder; known after reading, not written.
    """

    version: str
    name: str
    fingerprint: str
    images: str
    layers: str = ""
    resolution: tuple[int, int]
    fps: float
    cameras: tuple[ManifestCamera, ...]
    lights: tuple[ManifestLight, ...]
    job: dict[str, Any] = field(default_factory=dict)
    scene: dict[str, Any] = field(default_factory=dict)
    summary: dict[str, Any] = field(default_factory=dict)
    directory: Path = field(default_factory=Path, compare=False)

    def __post_init__(self) -> None:
        for key in ("version", "name", "fingerprint", "images", "layers"):
            _check(isinstance(getattr(self, key), str), f"{key}: expected text, got {getattr(self, key)!r}")
        for key in ("job", "scene", "summary"):
            _check(isinstance(getattr(self, key), dict), f"{key}: expected a table, got {getattr(self, key)!r}")
        sizes = self.resolution
        whole = (
            isinstance(sizes, tuple) and len(sizes) == 2 and all(isinstance(size, int) and size > 0 for size in sizes)
        )
        _check(whole, f"resolution: expected 2 positive whole numbers, got {sizes!r}")
        _check(_is_number(self.fps) and self.fps > 0, f"fps: expected a positive number, got {self.fps!r}")
        _check(bool(self.cameras), "cameras: expected at least one")
        _check(bool(self.lights), "lights: expected at least one")
        check_pattern("images", self.images, {"camera": self.n_cameras > 1, "light": self.n_lights > 1})
        if self.layers:
            check_pattern("layers", self.layers, {"camera": self.n_cameras > 1})

    @property
    def n_cameras(self) -> int:
        """N_c."""
        return len(self.cameras)

    @property
    def n_lights(self) -> int:
        """N_l."""
        return len(self.lights)


def matrix_rows(matrix: Float64) -> Matrix:
    """Turn a (4, 4) array into the form that `ManifestCamera` holds."""
    a, b, c, d = (tuple(float(value) for value in row) for row in matrix)
    return a, b, c, d  # type: ignore[return-value]  # lengths are checked by ManifestCamera


def image_path(manifest: Manifest, c: int, l: int) -> Path:
    """Find the file of image [c, l].

    Raises:
        OutputError: the array has no such image.
    """
    _check_index(manifest, "camera", c, manifest.n_cameras)
    _check_index(manifest, "light", l, manifest.n_lights)
    return manifest.directory / manifest.images.format(camera=c, light=l)


def layers_path(manifest: Manifest, c: int) -> Path:
    """Find the layers of camera c.

    Raises:
        OutputError: the array has no such camera, or no layers.
    """
    _check_index(manifest, "camera", c, manifest.n_cameras)
    if not manifest.layers:
        raise OutputError(f"{manifest.directory}: this frame array was written without layers")
    return manifest.directory / manifest.layers.format(camera=c)


def write_manifest(directory: Path, manifest: Manifest) -> Path:
    """Write `manifest.toml` into a folder, whole or not at all.

    Returns:
        The file.

    Raises:
        OutputError: the file cannot be written.
    """
    target = directory / FILE_NAME
    write_bytes(target, to_toml(manifest).encode())
    return target


def read_manifest(place: Path) -> Manifest:
    """Read the manifest of an output folder, given the folder or the file.

    Raises:
        OutputError: it is missing, broken, made by a newer program, or leads out of its folder.
    """
    path = place / FILE_NAME if place.is_dir() else place
    try:
        table = tomllib.loads(path.read_bytes().decode())
    except FileNotFoundError as error:
        raise OutputError(f"{path}: no such file; expected the output folder of `framearray render`") from error
    except OSError as error:
        raise OutputError(f"{path}: cannot be read: {reason(error)}") from error
    except (UnicodeDecodeError, tomllib.TOMLDecodeError, RecursionError) as error:
        raise OutputError(f"{path}: not valid TOML: {error}; render again, or restore the file") from error
    found = table.get("format")
    if found != FORMAT:
        advice = "; use a newer framearray" if isinstance(found, int) and found > FORMAT else ""
        raise OutputError(f"{path}: format: expected {FORMAT}, got {found!r}{advice}")
    try:
        return _from_table(table, path.parent)
    except (ValueError, TypeError) as error:
        raise OutputError(f"{path}: {error}") from error


def to_toml(manifest: Manifest) -> str:
    """Write a manifest as TOML text."""
    import tomli_w

    head = {
        "format": FORMAT,
        "version": manifest.version,
        "name": manifest.name,
        "fingerprint": manifest.fingerprint,
        "images": manifest.images,
        "layers": manifest.layers,
        "resolution": list(manifest.resolution),
        "fps": manifest.fps,
        "n_cameras": manifest.n_cameras,
        "n_lights": manifest.n_lights,
    }
    tables = {"summary": manifest.summary, "scene": manifest.scene, "job": manifest.job}
    text = ["# A frame array; docs/manifest.md explains the keys.\n", tomli_w.dumps(_plain(head | tables))]
    # Written by hand, because a matrix on one line is easier to read than on the 22 lines of tomli_w.
    for c, camera in enumerate(manifest.cameras):
        rows = ", ".join(_numbers(row) for row in camera.world_from_camera)
        text.append(f"\n[[cameras]]  # {c}\nworld_from_camera = [{rows}]\nfov = {float(camera.fov)!r}\n")
    for l, light in enumerate(manifest.lights):
        text.append(f"\n[[lights]]  # {l}\nambient = {_numbers(light.ambient)}\n")
        text.append(f"ambient_error = {_numbers(light.ambient_error)}\nsources = [\n")
        text.extend(f"    {_inline(_plain(source))},\n" for source in light.sources)
        text.append("]\n")
    return "".join(text)


def _from_table(table: Mapping[str, Any], directory: Path) -> Manifest:
    """Build a manifest from what the file says; keys of no concern here are left alone."""
    cameras = tuple(
        _built(f"cameras[{c}]", ManifestCamera, camera, ("world_from_camera", "fov"))
        for c, camera in enumerate(_tables(table, "cameras"))
    )
    lights = tuple(
        _built(f"lights[{l}]", ManifestLight, light, ("ambient", "ambient_error", "sources"))
        for l, light in enumerate(_tables(table, "lights"))
    )
    needed = ("version", "name", "fingerprint", "images", "resolution", "fps")
    rest = {key: table[key] for key in ("layers", "job", "scene", "summary") if key in table}
    missing = [key for key in needed if key not in table]
    _check(not missing, f"expected the keys {', '.join(missing)}, found none")
    rest |= {key: _frozen(table[key]) for key in needed}
    manifest = Manifest(cameras=cameras, lights=lights, directory=directory, **rest)
    for key, count in (("n_cameras", manifest.n_cameras), ("n_lights", manifest.n_lights)):
        _check(table.get(key, count) == count, f"{key}: says {table.get(key)!r}, but {count} are listed")
    return manifest


def _built(place: str, kind: type[Any], table: Mapping[str, Any], keys: Sequence[str]) -> Any:
    """Make one camera or light; a ValueError starts with its place in the file."""
    try:
        missing = [key for key in keys if key not in table]
        _check(not missing, f"expected the keys {', '.join(missing)}, found none")
        return kind(**{key: _frozen(table[key]) for key in keys})
    except (ValueError, TypeError) as error:
        raise ValueError(f"{place}: {error}") from error


def _tables(table: Mapping[str, Any], key: str) -> list[dict[str, Any]]:
    found = table.get(key, [])
    _check(isinstance(found, list) and all(isinstance(item, dict) for item in found), f"{key}: expected tables")
    return list(found)


def _check_index(manifest: Manifest, axis: str, index: int, count: int) -> None:
    if not 0 <= index < count:
        raise OutputError(f"{manifest.directory}: no {axis} {index}; the frame array has 0 to {count - 1}")


def _check(good: bool, problem: str) -> None:
    if not good:
        raise ValueError(problem)


def _is_number(value: object) -> bool:
    return isinstance(value, int | float) and not isinstance(value, bool) and math.isfinite(value)


def _is_vector(value: object, length: int) -> bool:
    return isinstance(value, tuple) and len(value) == length and all(_is_number(item) for item in value)


def _frozen(value: Any) -> Any:
    """Turn lists into tuples, all the way down; tables stay."""
    return tuple(_frozen(item) for item in value) if isinstance(value, list) else value


def _plain(value: Any) -> Any:
    """Turn a value into what TOML can hold: numpy values, tuples and paths become plain, None is left out."""
    if isinstance(value, Mapping):
        return {str(key): _plain(item) for key, item in value.items() if item is not None}
    if isinstance(value, np.ndarray | np.generic):
        return _plain(value.tolist())
    if isinstance(value, list | tuple):
        return [_plain(item) for item in value if item is not None]
    return str(value) if isinstance(value, Path) else value


def _numbers(values: Sequence[float]) -> str:
    """Write numbers on one line; `repr` gives the shortest text that reads back as the same float."""
    return f"[{', '.join(repr(float(value)) for value in values)}]"


def _inline(value: Any) -> str:
    """Write a plain value on one line."""
    import tomli_w

    if isinstance(value, dict):
        return f"{{ {', '.join(f'{key} = {_inline(item)}' for key, item in value.items())} }}"
    if isinstance(value, list):
        return f"[{', '.join(_inline(item) for item in value)}]"
    return tomli_w.dumps({"x": value}).removeprefix("x = ").rstrip("\n")
