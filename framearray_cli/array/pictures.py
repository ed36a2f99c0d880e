"""Pictures of a frame array at any light position, from its files only: read, blended along the light, relit.

    picture = sum over groups g of factor_g (direct_g + a I_A,g R W), where the background counts as a group

Rendering is linear in each source: `direct_g` and `R W` are files, I_A,g is in the manifest, a is the factor of the
ambient light.
Notation: a position is an index along a light axis, not necessarily whole, or a `Mixture` of light positions; there is
one per axis of `Manifest.axes`.
"""

from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import dataclass, field
from fractions import Fraction
from functools import lru_cache, partial
from math import floor
from pathlib import Path
from typing import TypeAlias

import numpy as np

from framearray_cli.base.arrays import Float32, Float64, Image

from .exr import Attribute, frame_attributes
from .images import read_alpha, read_channels, read_image, require_size
from .manifest import BACKGROUND, Manifest, ManifestGroup, ManifestLight, Vector, file_name, image_path
from .mixtures import Mixture, Position, is_constant

Positions: TypeAlias = Sequence[Position]

AMBIENT = "ambient"  # in parts of a picture
DIFFERENCE = "difference"  # layer of images with halves
WHITE: Vector = (1.0, 1.0, 1.0)
# Number of files kept in memory: the next picture of a movie needs most of them again.
KEPT_FILES = 16
MOST_KEPT = 2**28  # bytes of more files than these


@dataclass(frozen=True, slots=True, kw_only=True)
class Relight:
    """Factors for the light of an array.

    Attributes:
        groups: RGB factor per name of a group, or BACKGROUND; 1 for all others.
        ambient: RGB factor of I_A.
    """

    groups: Mapping[str, Vector] = field(default_factory=dict)
    ambient: Vector = WHITE

    @property
    def changes_nothing(self) -> bool:
        return self.ambient == WHITE and all(factor == WHITE for factor in self.groups.values())


AS_RENDERED = Relight()


class Pictures:
    """Reads the files of an array, caches the last of them, and combines them into pictures."""

    def __init__(
        self,
        manifest: Manifest,
        *,
        read: Callable[[Path], Image] = read_image,
        mix: Callable[[Positions], Positions] | None = None,
    ) -> None:
        """Read no file yet.

        Args:
            read: a file -> (h, w, 3) linear radiance.
            mix: replaces the requested light positions by sums.
        """
        self.manifest = manifest
        self._of_differences: Pictures | None = None
        self._mix = mix or (lambda positions: positions)
        n_bytes = 12 * manifest.resolution[0] * manifest.resolution[1]
        kept = min(max(manifest.axes.values()) + 2, MOST_KEPT // n_bytes)  # a sum reads a whole axis for each picture
        self._cached_read = lru_cache(max(kept, KEPT_FILES))(read)
        self._cached_alpha = lru_cache(2)(read_alpha)

    def picture(self, c: int, positions: Positions, relight: Relight = AS_RENDERED) -> Image:
        """Return the picture of camera c, (h, w, 3) linear radiance, not to be modified.

        Between two light positions their pictures are blended.

        Raises:
            OutputError: a file is missing or damaged.
        """
        manifest, positions = self.manifest, self._mix(positions)
        if not manifest.groups:
            return self._blend(c, positions[0], *manifest.parts)
        total = np.zeros((*manifest.resolution[::-1], 3), np.float32)
        for _, factor, read in self._parts(c, positions, relight):
            if factor.any():
                total += read() * factor.astype(np.float32)
        return total

    def parts(self, c: int, positions: Positions, relight: Relight = AS_RENDERED) -> dict[str, Image]:
        """Return what a picture is the sum of, by group, with AMBIENT and BACKGROUND; nothing without groups.

        Raises:
            OutputError: as `picture`.
        """
        if not self.manifest.groups:
            return {}
        found = self._parts(c, self._mix(positions), relight)
        return {name: read() * factor.astype(np.float32) for name, factor, read in found}

    def alpha(self, c: int) -> Float32 | None:
        """Return the share of each pixel of camera c that the scene covers, (h, w), not to be modified; None without.

        Raises:
            OutputError: the file is missing or damaged, or lacks it.
        """
        manifest = self.manifest
        return self._cached_alpha(image_path(manifest, c, 0, manifest.parts[0])) if manifest.has_alpha else None

    def _parts(
        self, c: int, positions: Positions, relight: Relight
    ) -> Iterator[tuple[str, Float64, Callable[[], Image]]]:
        """Yield name, RGB factor and image of all that a picture of an array with groups is the sum of."""
        manifest = self.manifest
        axes = list(manifest.axes)
        of_background = np.asarray(relight.groups.get(BACKGROUND, WHITE), np.float64)
        weight = of_background * np.asarray(manifest.background_ambient, np.float64)
        for group in manifest.groups:
            position = _once(positions[axes.index(group.axis)], group)
            factor = np.asarray(relight.groups.get(group.name, WHITE), np.float64)
            weight = weight + factor * ambient_at(group.lights, position)
            yield group.name, factor, partial(self._blend, c, position, group)
        weight = weight * np.asarray(relight.ambient, np.float64)
        if manifest.uses_ambient:
            yield AMBIENT, weight, partial(self._read_unlit, manifest.ambient_images, c)
        if manifest.background_images:
            yield BACKGROUND, of_background, partial(self._read_unlit, manifest.background_images, c)

    def differences(self, c: int, positions: Positions, relight: Relight = AS_RENDERED) -> dict[str, Image]:
        """Return the signed difference of the halves of a sum of light positions, as the layer of an image.

        Its root mean square over a neighbourhood is the standard error of the sum, as differences add up like images.

        Returns:
            No layer if the array has no halves, or the picture is no sum.
        """
        halves = self.manifest.job.get("samples", {}).get("halves") is True
        if not halves or not any(isinstance(position, Mixture) for position in self._mix(positions)):
            return {}
        if self._of_differences is None:
            names = [f"{DIFFERENCE}.{letter}" for letter in "RGB"]
            read = partial(read_channels, names=names, resolution=self.manifest.resolution)
            self._of_differences = Pictures(self.manifest, read=read, mix=self._mix)
        return {DIFFERENCE: self._of_differences.picture(c, positions, relight)}

    def files(self, c: int, positions: Positions) -> Iterator[Path]:
        """Yield the files that a picture is made of."""
        manifest, positions = self.manifest, self._mix(positions)
        axes = list(manifest.axes)
        for part in manifest.parts:
            position = positions[axes.index(part.axis)]
            for l, _ in _blend_weights(_once(position, part) if manifest.groups else position):
                yield image_path(manifest, c, l, part)
        for pattern in (manifest.ambient_images, manifest.background_images):
            if pattern:
                yield manifest.directory / file_name(pattern, c)

    def whole_file(self, c: int, positions: Positions, relight: Relight = AS_RENDERED) -> Path | None:
        """Return the file that holds exactly this picture, if there is one."""
        manifest, position = self.manifest, self._mix(positions)[0]
        adds_up = len(manifest.groups) > 1 or (manifest.groups and manifest.uses_ambient) or manifest.background_images
        if adds_up or not relight.changes_nothing or isinstance(position, Mixture):
            return None
        return image_path(manifest, c, int(position), *manifest.parts) if position == floor(position) else None

    def _blend(self, c: int, position: Position, group: ManifestGroup) -> Image:
        """Return the image of a group at a position on its axis."""
        weights = _blend_weights(position)
        if not isinstance(position, Mixture) and len(weights) == 1:
            return self._read(image_path(self.manifest, c, weights[0][0], group))
        total = np.zeros((*self.manifest.resolution[::-1], 3), np.float32)
        for l, weight in weights:
            total += self._read(image_path(self.manifest, c, l, group)) * np.asarray(weight, np.float32)
        return total

    def _read_unlit(self, pattern: str, c: int) -> Image:
        return self._read(self.manifest.directory / file_name(pattern, c))

    def _read(self, path: Path) -> Image:
        image = self._cached_read(path)
        require_size(path, image.shape, self.manifest.resolution)
        return image


def picture_attributes(
    manifest: Manifest, c: int, l: int | None, fps: float | Fraction | None = None
) -> dict[str, Attribute]:
    """Return the attributes of the file of a picture; see `frame_attributes`.

    Args:
        l: light position; None: several.
        fps: frames per second; None: from the array.
    """
    camera = manifest.cameras[c]
    return frame_attributes(
        world_from_camera=camera.matrix, lens=camera.lens, resolution=manifest.resolution,
        fps=manifest.fps if fps is None else fps, c=c, l=l, software=f"framearray {manifest.version}",
    )  # fmt: skip


def _once(position: Position, group: ManifestGroup) -> Position:
    """Return where a group is seen: one that does not change along its axis is added once, not by weights."""
    return 0.0 if isinstance(position, Mixture) and is_constant(group.lights) else position


def _blend_weights(position: Position) -> list[tuple[int, float]] | list[tuple[int, Vector]]:
    """Return the indices around a position with their weights, of a mixture RGB; only one where it is whole."""
    if isinstance(position, Mixture):
        return list(position.weights)
    index = floor(position)
    weight = position - index
    return [(index, 1 - weight), (index + 1, weight)] if weight else [(index, 1.0)]


def ambient_at(lights: Sequence[ManifestLight], position: Position) -> np.ndarray[tuple[int], np.dtype[np.float64]]:
    """Return I_A at a position, (3,)."""
    parts = [np.asarray(lights[l].ambient, np.float64) * np.asarray(weight) for l, weight in _blend_weights(position)]
    return np.asarray(sum(parts, np.zeros(3)))
