"""Environment maps: light from infinitely far away, as a panorama that may turn along the light path.

A panorama has twice as many columns as rows (latitude and longitude): the top row is straight up, the middle column is
north, the right half east. North is -z in a scene with y up, and y in one with z up.
"""

from collections.abc import Sequence
from dataclasses import dataclass, field, replace
from pathlib import Path
from typing import Any

import numpy as np

from framearray_cli.base.arrays import Float32, Float64
from framearray_cli.base.colour import LUMINANCE
from framearray_cli.base.errors import OutputError
from framearray_cli.base.hashing import fingerprint
from framearray_cli.base.openimage import read_rgb
from framearray_cli.base.units import counted
from framearray_cli.job.values import MOST_EMISSION

LINEAR_MAPS = (".exr", ".hdr", ".tif", ".tiff")


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class Panorama:
    """Radiance from all directions.

    Attributes:
        file: name of its file.
        pixels: (h, 2 h, 3) radiance, finite and at least 0.
    """

    file: str
    pixels: Float32
    digest: str = field(init=False)

    def __post_init__(self) -> None:
        object.__setattr__(self, "digest", fingerprint(np.ascontiguousarray(self.pixels).data))

    @property
    def flux(self) -> float:
        """Luminance integrated over all directions."""
        rows = self.pixels.mean(axis=1, dtype=np.float64) @ LUMINANCE
        return float(2 * np.pi * -np.diff(np.sin(np.linspace(np.pi / 2, -np.pi / 2, len(rows) + 1))) @ rows)

    @property
    def is_grey(self) -> bool:
        """Whether all channels are equal."""
        return bool((self.pixels == self.pixels[..., :1]).all())


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class Environment:
    """A panorama around the scene, at n light positions.

    Attributes:
        rotation_deg: (n,) turn from north over east: clockwise, as seen from above.
        factor: (n, 3) of its radiance.
        up: (3,) unit, up in the scene.
    """

    panorama: Panorama
    rotation_deg: Float64
    factor: Float64
    up: Float64

    def table(self, l: int) -> dict[str, Any]:
        """Describe the environment at position l as the manifest does."""
        return {
            "type": "environment",
            "file": self.panorama.file,
            "rotation": float(self.rotation_deg[l]),
            "intensity": self.factor[l].tolist(),
        }

    def at(self, rows: Sequence[int]) -> "Environment":
        """Return the environment at some light positions."""
        some = list(rows)
        return replace(self, rotation_deg=self.rotation_deg[some], factor=self.factor[some])


def read_panorama(path: Path) -> Panorama:
    """Read an environment map.

    Raises:
        OutputError: it is missing or damaged, is no panorama, or holds values that are no radiance.
    """
    if path.suffix.lower() not in LINEAR_MAPS:
        raise OutputError(f"{path}: expected an environment map with linear light, {', '.join(LINEAR_MAPS)}")
    pixels = read_rgb(path)
    height, width, _ = pixels.shape
    if width != 2 * height:
        raise OutputError(f"{path}: expected a panorama, twice as wide as high, got {width} x {height} pixels")
    wrong = ~(np.isfinite(pixels) & (pixels >= 0) & (pixels <= MOST_EMISSION)).all(axis=-1)
    if wrong.any():
        y, x = (int(k) for k in np.argwhere(wrong)[0])
        values = ", ".join(f"{value:g}" for value in pixels[y, x].tolist())
        raise OutputError(
            f"{path}: expected radiance from 0 to {MOST_EMISSION:g}, got {values} at column {x}, row {y}, and "
            f"{counted(int(wrong.sum()), 'such pixel')} in all"
        )
    if not pixels.any():
        raise OutputError(f"{path}: expected an environment that shines, got radiance 0 everywhere")
    return Panorama(file=path.name, pixels=pixels)


def norths(up: str, rotation_deg: Float64) -> Float64:
    """Unit directions from the scene to the middle of a panorama that is turned, (n, 3).

    Args:
        up: the scene's up axis, "y" or "z".
    """
    turn, zero = np.radians(rotation_deg), np.zeros(len(rotation_deg))
    east, north = np.sin(turn), np.cos(turn)
    return np.stack([east, north, zero] if up == "z" else [east, zero, -north], axis=1)
