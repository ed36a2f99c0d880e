"""Variables of stores and labelled arrays next to pictures: poses and lenses of cameras, and the lights of every axis.

Names are as in the manifest, behind the name of the light axis: `light_position` has the dimensions light,
light_source and xyz. What a source does not have is NaN, or empty text.
"""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from typing import Any, TypeAlias

import numpy as np
from numpy.typing import NDArray

from framearray_cli.array.manifest import ManifestGroup
from framearray_cli.array.pictures import WHITE
from framearray_cli.base.arrays import is_number, is_vector
from framearray_cli.base.lens import ORTHOGRAPHIC, PANORAMA

from .stored import StoredArray

Source: TypeAlias = Mapping[str, Any]

RADIANCE = "radiance"  # the name of the pictures
STRENGTHS = ("intensity", "irradiance", "radiance")
TEXTS = ("type", "group")
# (key of a source, units); vectors are in the coordinates of the scene file
VECTORS = {"position": "scene unit", "direction": "the way the light travels", "across": "unit vector"}
NUMBERS = {
    "radius": "scene unit", "angle": "degree", "inner": "degree", "outer": "degree", "width": "scene unit",
    "height": "scene unit", "rotation": "degree", "azimuth": "degree", "elevation": "degree",
}  # fmt: skip
ALWAYS = ("position", "direction", "strength", *TEXTS)
EPOCH = np.datetime64("1970-01-01T00:00:00", "s")


@dataclass(frozen=True, slots=True)
class Variable:
    """An array with names of its dimensions, and what is to be known of its values."""

    dims: tuple[str, ...]
    values: NDArray[Any]
    notes: Mapping[str, Any] = field(default_factory=dict)


def variables(array: StoredArray) -> dict[str, Variable]:
    """Return all variables of an array but its pictures, by name."""
    found = camera_variables(array)
    for axis, n in array.axes.items():
        found[axis] = Variable((axis,), np.arange(n))
        if len(array.lights_along(axis)) == n:  # else they are summed
            found |= light_variables(array, axis)
    return found


def camera_variables(array: StoredArray) -> dict[str, Variable]:
    """Return poses and lenses."""
    cameras, one = array.cameras, ("camera",)
    lenses = cameras.lenses
    heights = [lens.height if lens.type == ORTHOGRAPHIC else np.nan for lens in lenses]
    shifts = [(np.nan,) * 2 if lens.type == PANORAMA else lens.shift for lens in lenses]
    return {
        "camera": Variable(one, np.arange(len(cameras))),
        "world_from_camera": Variable(("camera", "row", "column"), cameras.world_from_camera),
        "intrinsics": Variable(("camera", "image", "axis"), cameras.intrinsics, {"units": "pixel"}),
        "fov": Variable(one, cameras.fov, {"units": "degree", "long_name": "vertical field of view"}),
        "projection": Variable(one, np.array([lens.type for lens in lenses])),
        "view_height": Variable(one, np.array(heights), {"long_name": "height of what an orthographic camera sees"}),
        "shift": Variable(
            ("camera", "xy"), np.array(shifts, float), {"long_name": "right and up, of the picture's longer side"}
        ),
        "pixel_aspect": Variable(one, np.array([lens.pixel_aspect for lens in lenses])),
    }


def light_variables(array: StoredArray, axis: str) -> dict[str, Variable]:
    """Return the sources of each position along a light axis, their ambient light, and the time under a sun."""
    manifest, relight = array.manifest, array.lighting.relight
    parts = [part for part in manifest.parts if part.axis == axis]
    padded = [_padded(part, {"group": part.name} if manifest.groups else {}) for part in parts]
    rows = [tuple(source for row in at for source in row) for at in zip(*padded, strict=True)]
    factors = [relight.groups.get(part.name, WHITE) for part in parts]
    of_source = [factor for factor, part in zip(factors, padded, strict=True) for _ in part[0]]
    ambient = [
        np.array([light.ambient for light in part.lights]) * factor * relight.ambient
        for part, factor in zip(parts, factors, strict=True)
    ]
    about_ambient = Variable((axis, "channel"), sum(ambient, np.zeros((len(rows), 3))), {"units": "W/(m2 sr)"})
    if not of_source:
        return {f"{axis}_ambient": about_ambient}
    dims, name = (axis, f"{axis}_source"), f"{axis}_{{}}".format
    found = {name(key): Variable(dims, _texts(rows, key)) for key in TEXTS}
    found[name("strength")] = Variable(
        (*dims, "channel"),
        _vectors(rows, STRENGTHS) * np.array(of_source, float),
        {"units": "W/sr; directional: W/m2; mesh: W/(m2 sr); environment: factor"},
    )
    found |= {name(key): Variable((*dims, "xyz"), _vectors(rows, (key,)), {"units": u}) for key, u in VECTORS.items()}
    found |= {name(key): Variable(dims, _numbers(rows, key), {"units": unit}) for key, unit in NUMBERS.items()}
    always = {name(key) for key in ALWAYS}
    kept = {key: one for key, one in found.items() if key in always or not np.isnan(one.values).all()}
    return kept | {name("ambient"): about_ambient}


def seconds(times: NDArray[np.datetime64]) -> tuple[NDArray[np.int64], dict[str, str]]:
    """Return times as stores hold them, which xarray decodes."""
    values = (times.astype("datetime64[s]") - EPOCH).astype(np.int64)
    return values, {"units": "seconds since 1970-01-01", "calendar": "proleptic_gregorian"}


def local_times(array: StoredArray) -> dict[str, Variable]:
    """Return the times of the positions of each light axis with a sun that is not summed, by name."""
    found = {}
    for k, (axis, n) in enumerate(array.axes.items()):
        times = array.lights_along(axis).times
        if times is not None and len(times) == n:
            values = np.array([time.replace(tzinfo=None) for time in times], "datetime64[ns]")
            found[f"time_{axis}" if k else "time"] = Variable((axis,), values)
    return found


def _padded(part: ManifestGroup, more: Source) -> list[tuple[Source, ...]]:
    """Return the sources of a part at each position, each with more keys; empty tables where others have more sources,
    so that columns agree.
    """
    most = max(len(light.sources) for light in part.lights)
    rows = [tuple({**source, **more} for source in light.sources) for light in part.lights]
    return [(*row, *({},) * (most - len(row))) for row in rows]


def _texts(rows: Sequence[Sequence[Source]], key: str) -> NDArray[np.str_]:
    return np.array([[str(source.get(key, "")) for source in row] for row in rows], str)


def _numbers(rows: Sequence[Sequence[Source]], key: str) -> NDArray[np.float64]:
    values = [[source.get(key) for source in row] for row in rows]
    return np.array([[v if is_number(v) else np.nan for v in row] for row in values], float)


def _vectors(rows: Sequence[Sequence[Source]], keys: Sequence[str]) -> NDArray[np.float64]:
    """Return the first of the keys that each source has, (positions, sources, 3)."""
    found = [[next((source[key] for key in keys if key in source), None) for source in row] for row in rows]
    return np.array([[_vector(value) for value in row] for row in found], float)


def _vector(value: object) -> tuple[float, ...]:
    found = tuple(value) if isinstance(value, list | tuple) else ()
    return found if is_vector(found, 3) else (np.nan,) * 3
