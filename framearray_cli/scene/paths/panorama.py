"""Environment maps: light from infinitely far away, as a panorama that may turn along the light path.

A panorama has twice as many columns as rows (latitude and longitude): the top row is straight up, the middle column is
north, the right half east. North is -z in a scene with y up, and y in one with z up.
"""

from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

import numpy as np

from framearray_cli.base.arrays import Flags, Float32, Float64
from framearray_cli.base.colour import LUMINANCE
from framearray_cli.base.files import fingerprint
from framearray_cli.base.openimage import read_environment

MOST_ROWS = 1024  # of texels: a fifth of a degree; finer maps are averaged
TOGETHER = 64  # rows that are averaged together, which takes less memory
FEWEST_ROWS = 8  # so that angles within a texel are small
WHOLE, REST, SUNS = "whole", "rest", "suns"  # parts of a map
# Texels are suns if they are BRIGHT times as bright as the mean of the map, and hold a share of its light within these
# bounds: with less they are not worth a shadow ray, with more nothing else is left.
BRIGHT, LEAST_SUNS, MOST_SUNS = 100.0, 0.05, 0.999


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class Panorama:
    """Radiance from all directions.

    Attributes:
        file: name of its file.
        pixels: (h, 2 h, 3) radiance, finite and at least 0.
        texels: (rows, 2 rows, 3) by which it shines; `is_sun`: those that may be a source of their own.
        note: on texels that were no radiance, or "".
    """

    file: str
    pixels: Float32
    note: str = ""
    digest: str = field(init=False)
    texels: Float32 = field(init=False)
    is_sun: Flags = field(init=False)

    def __post_init__(self) -> None:
        texels = lit_texels(self.pixels)
        luminance, powers = texels @ LUMINANCE, texel_powers(texels)
        is_sun = luminance > BRIGHT * powers.sum() / (4 * np.pi)
        object.__setattr__(self, "digest", fingerprint(np.ascontiguousarray(self.pixels).data))
        object.__setattr__(self, "texels", texels)
        object.__setattr__(self, "is_sun", is_sun)

    @property
    def flux(self) -> float:
        """Luminance integrated over all directions."""
        return float(texel_powers(self.texels).sum())

    @property
    def has_suns(self) -> bool:
        """True if a few texels hold much of the light, and not all of it."""
        powers = texel_powers(self.texels)
        return LEAST_SUNS < float(powers[self.is_sun].sum() / powers.sum()) < MOST_SUNS

    def part(self, name: str) -> Float32:
        """The texels of the suns or of the rest, black elsewhere; or all."""
        if name == WHOLE:
            return self.texels
        return np.where(self.is_sun[..., None] == (name == SUNS), self.texels, np.float32(0.0))

    @property
    def is_grey(self) -> bool:
        """True if all channels are equal."""
        return bool((self.pixels == self.pixels[..., :1]).all())


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class Environment:
    """A panorama around the scene, at n light positions.

    Attributes:
        rotation_deg: (n,) turn from north over east: clockwise, as seen from above.
        factor: (n, 3) of its radiance.
        up: (3,) unit, up in the scene.
        part: of its texels that shine: WHOLE, SUNS or the REST.
        maps: (n, h, 2 h, 3) radiance at each position, of a sky; hits then draw directions from the panorama. None: the
            panorama's, at all positions.
        level: (n, 3) irradiance of a level surface by a sky.
    """

    panorama: Panorama
    rotation_deg: Float64
    factor: Float64
    up: Float64
    part: str = WHOLE
    maps: Float32 | None = None
    level: Float64 | None = None

    @property
    def is_grey(self) -> bool:
        """True if all channels are equal."""
        return self.panorama.is_grey if self.maps is None else bool((self.maps == self.maps[..., :1]).all())

    @property
    def flux(self) -> float:
        """Luminance of the part, integrated over all directions."""
        return float(texel_powers(self.panorama.part(self.part)).sum())

    @property
    def horizontal(self) -> Float64:
        """(n,) irradiance of an unobstructed horizontal surface, luminance."""
        if self.level is not None:
            return np.asarray(self.level @ LUMINANCE)
        texels = self.panorama.part(self.part)
        squares = np.maximum(np.sin(np.linspace(np.pi / 2, -np.pi / 2, len(texels) + 1)), 0) ** 2
        by_row = (squares[:-1] - squares[1:]) * np.pi  # the integral of sin(elevation) over the directions of a row
        return np.asarray(self.factor @ (by_row @ texels.mean(axis=1) * LUMINANCE))

    def table(self, l: int) -> dict[str, Any]:
        """Describe the environment at position l as the manifest does."""
        if self.level is not None:
            return {"type": "sky", "irradiance": self.level[l].tolist()}
        return {
            "type": "environment",
            "file": self.panorama.file,
            "rotation": float(self.rotation_deg[l]),
            "intensity": self.factor[l].tolist(),
        }


def read_panorama(path: Path) -> Panorama:
    """Read an environment map.

    Raises:
        OutputError: it is missing or damaged, is no panorama, or nothing in it shines.
    """
    pixels, note = read_environment(path)
    return Panorama(file=path.name, pixels=pixels, note=note)


def norths(up: str, rotation_deg: Float64) -> Float64:
    """Unit directions from the scene to the middle of a panorama that is turned, (n, 3).

    Args:
        up: the scene's up axis, "y" or "z".
    """
    turn, zero = np.radians(rotation_deg), np.zeros(len(rotation_deg))
    east, north = np.sin(turn), np.cos(turn)
    return np.stack([east, north, zero] if up == "z" else [east, zero, -north], axis=1)


def lit_texels(pixels: Float32) -> Float32:
    """The texels by which a map shines, (rows, 2 rows, 3): the file's, means of them, or repetitions."""
    if len(pixels) > MOST_ROWS:
        columns = np.arange(pixels.shape[1] + 1.0)
        wanted = np.linspace(0, columns[-1], 2 * MOST_ROWS + 1)
        parts = (pixels[k : k + TOGETHER].swapaxes(0, 1).astype(np.float64) for k in range(0, len(pixels), TOGETHER))
        found = np.concatenate([_means(part, columns, wanted).swapaxes(0, 1) for part in parts])
        edges = np.sin(np.linspace(np.pi / 2, -np.pi / 2, len(found) + 1))
        found = _means(found, -edges, -np.sin(np.linspace(np.pi / 2, -np.pi / 2, MOST_ROWS + 1)))
    else:
        found = pixels.astype(np.float64)
    times = -(-FEWEST_ROWS // len(found))
    return np.ascontiguousarray(found.repeat(times, axis=0).repeat(times, axis=1), np.float32)


def _means(rows: Float64, edges: Float64, wanted: Float64) -> Float64:
    """Means of rows that lie between rising edges over wider spans."""
    width = np.diff(edges).reshape(-1, 1, 1)
    sums = np.concatenate([np.zeros_like(rows[:1]), np.cumsum(rows * width, axis=0)])
    at = np.clip(np.searchsorted(edges, wanted, side="right") - 1, 0, len(rows) - 1)
    reached = sums[at] + (wanted - edges[at]).reshape(-1, 1, 1) * rows[at]
    return np.asarray(np.maximum(np.diff(reached, axis=0), 0.0) / np.diff(wanted).reshape(-1, 1, 1))


def texel_powers(texels: Float32) -> Float64:
    """Luminance times solid angle of each texel, (rows, columns)."""
    height, width, _ = texels.shape
    sines = np.sin(np.linspace(np.pi / 2, -np.pi / 2, height + 1))
    return np.asarray((texels @ LUMINANCE) * (sines[:-1] - sines[1:])[:, None] * (2 * np.pi / width))
