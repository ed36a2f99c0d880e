"""The light of an environment map as weights of light positions.

A map is a panorama of twice as many columns as rows (latitude and longitude): the top row is straight up, the middle
column is north, the right half east. North is -z in a scene with y up, and y in one with z up. Each position stands for
the directions that are nearer to it than to any other: its cell of the spherical Voronoi diagram. Its weight is the
irradiance that comes from there, E = integral of L over the cell, divided by the irradiance of its source.
"""

from dataclasses import dataclass
from pathlib import Path

import numpy as np

from framearray_cli.array.images import area_mean
from framearray_cli.array.manifest import Manifest, ManifestLight
from framearray_cli.array.mixtures import constant_sources, is_constant
from framearray_cli.base.arrays import Float64, Image
from framearray_cli.base.errors import OutputError
from framearray_cli.base.openimage import mend_panorama, read_environment
from framearray_cli.base.units import counted

ROWS = 128  # of the map that is summed: cells of 1.4 degrees, where domes have positions every 10 or 20
# Points whose distances to the middle of the fitted sphere differ by more than this share lie on none.
ROUNDNESS = 0.05
# Why light of a type stands for no direction; other types shine one way.
_MISFITS = {"environment": "comes from all sides", "mesh": "comes from surfaces of the scene"}


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class LightField:
    """The direction and irradiance of each light position.

    Attributes:
        to_light: (n, 3) unit directions in the scene.
        irradiance: (n, 3) of a surface that faces it, at the middle, RGB.
        up: the scene's up axis, "y" or "z".
    """

    to_light: Float64
    irradiance: Float64
    up: str


def read_map(file: Path) -> tuple[Image, str]:
    """Read an environment map, and shrink it to at most ROWS rows; also return a note on texels that are no radiance.

    Raises:
        OutputError: it is missing or damaged, is no panorama, or nothing in it shines.
    """
    image, note = read_environment(file)
    return _shrunk(image), note


def prepare_map(image: Image, name: str) -> tuple[Image, str]:
    """Check an environment map, and shrink it as `read_map` does; also return a note on texels that are no radiance.

    Args:
        name: of the map, for messages.

    Raises:
        OutputError: it is no panorama, or nothing in it shines.
    """
    if image.ndim != 3 or image.shape[1:] != (2 * image.shape[0], 3):
        raise OutputError(f"{name}: expected a panorama of shape (h, 2 h, 3), got {image.shape}")
    mended, note = mend_panorama(name, image)
    return _shrunk(mended), note


def _shrunk(image: Image) -> Image:
    return area_mean(image, 2 * ROWS, ROWS) if len(image) > ROWS else image


def environment_weights(field: LightField, panorama: Image, rotate_deg: float) -> tuple[Float64, float]:
    """Return the weights of all light positions, (n, 3), and the share of the map's light that they stand for.

    Light that comes from farther away than positions are from each other belongs to none of them: below a hemisphere,
    next to the path of a sun.

    Args:
        panorama: (h, 2 h, 3) radiance.
        rotate_deg: clockwise, as seen from above.
    """
    from scipy.spatial import cKDTree

    to_sky, power = _sky(panorama, rotate_deg, field.up)
    distance, nearest = cKDTree(field.to_light).query(to_sky)
    covered = distance <= _reach(field.to_light)
    energy = np.stack([np.bincount(nearest, power[:, k] * covered, len(field.to_light)) for k in range(3)], axis=-1)
    lit = field.irradiance > 0
    weights = np.divide(energy, field.irradiance, out=np.zeros_like(energy), where=lit)
    total = float(power.sum())
    return weights, float((energy * lit).sum()) / total if total else 1.0


def _sky(panorama: Image, rotate_deg: float, up: str) -> tuple[Float64, Float64]:
    """Return the direction to each pixel of a map, (h w, 3), and its radiance times its solid angle, (h w, 3)."""
    height, width, _ = panorama.shape
    edges = np.linspace(np.pi / 2, -np.pi / 2, height + 1)
    elevation = (edges[:-1] + edges[1:]) / 2
    azimuth = ((np.arange(width) + 0.5) / width - 0.5) * 2 * np.pi + np.radians(rotate_deg)
    east, north = np.sin(azimuth), np.cos(azimuth)
    level, high = np.cos(elevation)[:, None], np.broadcast_to(np.sin(elevation)[:, None], (height, width))
    parts = [level * east, level * north, high] if up == "z" else [level * east, high, -level * north]
    solid_angle = (np.sin(edges[:-1]) - np.sin(edges[1:])) * (2 * np.pi / width)
    power = panorama.astype(np.float64) * solid_angle[:, None, None]
    return np.stack(parts, axis=-1).reshape(-1, 3), power.reshape(-1, 3)


def _reach(to_light: Float64) -> float:
    """Return the largest distance from a position to its nearest other; without others, the whole sphere."""
    different = np.unique(to_light.round(9), axis=0)
    if len(different) < 2:
        return 2.0
    from scipy.spatial import cKDTree

    distance = np.asarray(cKDTree(different).query(different, k=2)[0])
    return float(distance[:, 1].max())


def light_field(manifest: Manifest, axis: str | None = None, what: str = "an environment") -> LightField:
    """Find where the one moving source along a light axis is.

    Args:
        axis: None: the first.
        what: needs it, for messages.

    Raises:
        OutputError: there are several such sources, or none, or points that lie on no sphere.
    """
    first = next(iter(manifest.axes))
    axis, need = axis or first, f"{manifest.directory}: {what} needs"
    every = _axis_lights(manifest, axis)
    sources = [_moving(lights) for lights in every]
    n = sum(len(each) for each in sources)
    if n != 1:
        which = "first light axis" if axis == first else f"light axis {axis}"
        raise OutputError(f"{need} one source that moves along the {which}, got {n}")
    lights, k = next((lights, each[0]) for lights, each in zip(every, sources, strict=True) if each)
    tables = [light.sources[k] for light in lights]
    if shaped := {table["type"] for table in tables} - {"point", "directional"}:
        raise OutputError(
            f"{need} light from points or directions, got type {min(shaped)!r}, "
            f"which {_MISFITS.get(min(shaped), 'does not shine to all sides')}"
        )
    up = str(manifest.job.get("scene", {}).get("up", "y"))
    if all("direction" in table for table in tables):
        to_light = -np.array([table["direction"] for table in tables], np.float64)
        irradiance = np.array([table["irradiance"] for table in tables], np.float64)
    else:
        position = np.array([table["position"] for table in tables], np.float64)
        vector = position - _middle(position, need)
        intensity = np.array([table["intensity"] for table in tables], np.float64)
        to_light, irradiance = vector, intensity / (vector**2).sum(axis=1, keepdims=True)
    to_light = to_light / np.linalg.norm(to_light, axis=1, keepdims=True)
    return LightField(to_light=to_light, irradiance=irradiance, up=up)


def _axis_lights(manifest: Manifest, axis: str) -> list[tuple[ManifestLight, ...]]:
    """Return the lights of the groups on an axis that move, or of all sources."""
    if not manifest.groups:
        return [manifest.lights]
    return [group.lights for group in manifest.groups if group.axis == axis and not is_constant(group.lights)]


def _moving(lights: tuple[ManifestLight, ...]) -> list[int]:
    stays = constant_sources(lights)
    return [k for k in range(len(lights[0].sources)) if k not in stays]


def _middle(position: Float64, need: str) -> Float64:
    """Return the middle of the sphere that points lie on, (3,), by least squares.

    Args:
        need: the beginning of messages.

    Raises:
        OutputError: they lie on none.
    """
    problem = f"{need} light from a dome or from directions"
    if len(position) < 4:
        raise OutputError(f"{problem}; got {counted(len(position), 'point')}")
    shift = position.mean(axis=0)
    moved = position - shift
    rows = np.concatenate([2 * moved, np.ones((len(moved), 1))], axis=1)  # |p|^2 = 2 p . m + (r^2 - |m|^2)
    found, _, rank, _ = np.linalg.lstsq(rows, (moved**2).sum(axis=1), rcond=1e-6)
    distance = np.linalg.norm(moved - found[:3], axis=1)
    if rank < 4 or np.ptp(distance) > ROUNDNESS * distance.mean():
        raise OutputError(f"{problem}; got points that lie on no sphere")
    return np.asarray(found[:3] + shift)
