"""Pictures of a frame array at any light position, from its files alone: read, blended along the light, lit anew.

    picture = sum over groups of factor_g (direct_g + a I_A,g R W), the background b a group among them

Rendering is linear in each source: `direct_g` and `R W` are files, I_A,g is in the manifest, a is the ambient light's
factor.
Notation: a position is an index along a light axis that need not be whole; there is one for each of `Manifest.axes`.
"""

from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import dataclass, field
from functools import lru_cache
from math import floor
from pathlib import Path
from typing import TypeAlias

import numpy as np

from framearray_cli.base.arrays import Image
from framearray_cli.base.errors import OutputError

from .images.images import read_image
from .manifest import BACKGROUND, Manifest, ManifestGroup, ManifestLight, Vector, image_path
from .names import file_name

Positions: TypeAlias = Sequence[float]

WHITE: Vector = (1.0, 1.0, 1.0)
# Files that stay in memory: what the next picture of a movie needs again.
KEPT_FILES = 16


@dataclass(frozen=True, slots=True, kw_only=True)
class Relight:
    """What the light of an array is multiplied with.

    Attributes:
        groups: RGB factor by name of a group, or of BACKGROUND; of those that are not named it is 1.
        ambient: RGB factor of I_A.
    """

    groups: Mapping[str, Vector] = field(default_factory=dict)
    ambient: Vector = WHITE

    @property
    def changes_nothing(self) -> bool:
        return self.ambient == WHITE and all(factor == WHITE for factor in self.groups.values())


AS_RENDERED = Relight()


class Pictures:
    """Reads an array's files, keeps the last of them, and puts them together."""

    def __init__(self, manifest: Manifest, *, read: Callable[[Path], Image] = read_image) -> None:
        """Open nothing yet.

        Args:
            read: a file -> (h, w, 3) linear radiance.
        """
        self.manifest = manifest
        self._read = lru_cache(KEPT_FILES)(read)

    def picture(self, c: int, positions: Positions, relight: Relight = AS_RENDERED) -> Image:
        """Picture of camera c, (h, w, 3) linear radiance; not to be written to.

        Between two light positions both pictures are blended.

        Raises:
            OutputError: a file is missing or damaged, the array has no such place, or no groups to light anew.
        """
        manifest = self.manifest
        self._check_relight(relight)
        if not manifest.groups:
            return self._blended(c, positions[0], None)
        axes = list(manifest.axes)
        of_background = np.asarray(relight.groups.get(BACKGROUND, WHITE), np.float64)
        weight = of_background * np.asarray(manifest.background_ambient, np.float64)
        total = np.zeros((*manifest.resolution[::-1], 3), np.float32)
        for group in manifest.groups:
            position = positions[axes.index(group.axis)]
            factor = np.asarray(relight.groups.get(group.name, WHITE), np.float64)
            weight = weight + factor * ambient_at(group.lights, position)
            if factor.any():
                total += self._blended(c, position, group) * factor.astype(np.float32)
        weight = weight * np.asarray(relight.ambient, np.float64)
        if weight.any():
            total += self._steady(manifest.ambient_images, c) * weight.astype(np.float32)
        if manifest.background_images and of_background.any():
            total += self._steady(manifest.background_images, c) * of_background.astype(np.float32)
        return total

    def files(self, c: int, positions: Positions) -> Iterator[Path]:
        """The files that a picture is made of."""
        manifest = self.manifest
        axes = list(manifest.axes)
        for group in manifest.groups or (None,):
            for l, _ in between(positions[axes.index(group.axis) if group else 0]):
                yield image_path(manifest, c, l, group)
        for pattern in (manifest.ambient_images, manifest.background_images):
            if pattern:
                yield manifest.directory / file_name(pattern, c)

    def whole_file(self, c: int, positions: Positions, relight: Relight = AS_RENDERED) -> Path | None:
        """The one file that holds this very picture, if there is one."""
        if self.manifest.groups or not relight.changes_nothing or positions[0] != floor(positions[0]):
            return None
        return image_path(self.manifest, c, int(positions[0]))

    def _check_relight(self, relight: Relight) -> None:
        if relight.changes_nothing:
            return
        folder, known = self.manifest.directory, self.manifest.group_names
        if not known:
            raise OutputError(
                f"{folder}: the light cannot be changed, as this array stores it all together; render again with "
                'group = "..." in [[light.sources]]'
            )
        unknown = [name for name in relight.groups if name not in known]
        if unknown:
            raise OutputError(f"{folder}: no group {unknown[0]!r}; the array has {', '.join(known)}")

    def _blended(self, c: int, position: float, group: ManifestGroup | None) -> Image:
        """Image at a position of its own axis."""
        (l, near), *other = between(position)
        image = self._checked(image_path(self.manifest, c, l, group))
        if not other:
            return image
        (next_l, far) = other[0]
        return image * np.float32(near) + self._checked(image_path(self.manifest, c, next_l, group)) * np.float32(far)

    def _steady(self, pattern: str, c: int) -> Image:
        return self._checked(self.manifest.directory / file_name(pattern, c))

    def _checked(self, path: Path) -> Image:
        image = self._read(path)
        width, height = self.manifest.resolution
        if image.shape != (height, width, 3):
            raise OutputError(f"{path}: expected {width} x {height} pixels, got {image.shape[1]} x {image.shape[0]}")
        return image


def between(position: float) -> list[tuple[int, float]]:
    """The indices around a position with their shares; one where it is whole."""
    index = floor(position)
    share = position - index
    return [(index, 1 - share), (index + 1, share)] if share else [(index, 1.0)]


def ambient_at(lights: Sequence[ManifestLight], position: float) -> np.ndarray[tuple[int], np.dtype[np.float64]]:
    """I_A at a position, (3,)."""
    parts = [np.asarray(lights[l].ambient, np.float64) * share for l, share in between(position)]
    return np.asarray(sum(parts))
