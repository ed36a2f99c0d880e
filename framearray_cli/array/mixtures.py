"""Weighted sums of light positions, and checks that the images of an array may be added up.

Rendering is linear: a picture of several light positions at once is the sum of their pictures, each times a factor.
What does not change along a light axis (the background, sources that stay, a fixed ambient light) may be added only
once. In an array with groups it is kept apart; else every image holds it, and only weights of sum 1 are right.
"""

from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any, TypeAlias

from framearray_cli.base.errors import OutputError

from .manifest import BACKGROUND, Manifest, ManifestLight, Vector

LINEAR = (".exr", ".tif")
# Rounding of weights that sum to 1: of numbers with six digits in a file.
MEAN_ERROR = 1e-4
_STRENGTHS = ("intensity", "irradiance", "radiance")
_NOTES = {"time", "azimuth", "elevation"}  # keys of a source that its light does not depend on


@dataclass(frozen=True, slots=True)
class Mixture:
    """A weighted sum of light positions of one axis, instead of one position.

    Attributes:
        weights: index of each light position, and its factor, RGB; none is zero.
    """

    weights: tuple[tuple[int, Vector], ...]

    @property
    def total(self) -> Vector:
        """The sum of the weights, RGB."""
        red, green, blue = (sum(weight[k] for _, weight in self.weights) for k in range(3))
        return red, green, blue

    @property
    def is_mean(self) -> bool:
        """True if the weights sum to 1."""
        return all(abs(total - 1) <= MEAN_ERROR for total in self.total)


Position: TypeAlias = float | Mixture


def position_text(position: Position) -> str:
    """Write a position for people: "3.25", or "sum of 48"."""
    return f"sum of {len(position.weights)}" if isinstance(position, Mixture) else f"{round(position, 2):g}"


def check_linear(manifest: Manifest) -> None:
    """Check that the images of an array can be added up.

    Raises:
        OutputError: they are 8-bit codes.
    """
    suffix = Path(manifest.parts[0].images).suffix
    if suffix not in LINEAR:
        raise OutputError(
            f"{manifest.directory}: sums of light positions need linear light, and images are {suffix}; render again "
            'with output.format = "exr" or "tif"'
        )


def check_mixture(manifest: Manifest, mixture: Mixture) -> None:
    """Check that a sum of light positions of an array is right.

    Raises:
        OutputError: the sum would hold light that no position changes more than once, or the ambient light of
            positions does not add up.
    """
    if mixture.is_mean:
        return
    if parts := constant_parts(manifest):
        total = max(mixture.total, key=lambda value: abs(value - 1))
        raise OutputError(
            f"{manifest.directory}: every image holds {' and '.join(parts)}, which a sum may contain only once; "
            f"expected weights of sum 1, got {total:.4g}; render again with groups, which keep it apart "
            '(group = "..." in [[light.sources]])'
        )


def constant_parts(manifest: Manifest) -> list[str]:
    """List the light in images that move along a light axis that does not change along it, in words."""
    parts: list[str] = []
    if not manifest.groups:
        background = manifest.job.get("scene", {}).get("background", ())
        parts += [f"the {BACKGROUND}"] if any(background) else []
        fixed = manifest.job.get("ambient", {}).get("intensity", ()) if manifest.uses_ambient else ()
        parts += ["a fixed ambient light"] if any(fixed) else []
    for part in manifest.parts:
        if not is_constant(part.lights):
            parts += [f"source {k}, which stays" for k in constant_sources(part.lights)]
    return parts


def constant_sources(lights: Sequence[ManifestLight]) -> list[int]:
    """Return the numbers of the sources that shine, and are the same at all of several light positions."""
    if len(lights) < 2 or len({len(light.sources) for light in lights}) > 1:
        return []
    return [
        k
        for k, first in enumerate(lights[0].sources)
        if any(any(_values(first.get(key))) for key in _STRENGTHS)
        and all(_same(first, light.sources[k]) for light in lights[1:])
    ]


def is_constant(lights: Sequence[ManifestLight]) -> bool:
    """Return whether all sources stay as they are, at several light positions."""
    return len(lights) > 1 and len(constant_sources(lights)) == len(lights[0].sources) > 0


def _same(a: dict[str, Any], b: dict[str, Any]) -> bool:
    return all(_values(a.get(key)) == _values(b.get(key)) for key in (a.keys() | b.keys()) - _NOTES)


def _values(value: Any) -> tuple[Any, ...]:
    return tuple(value) if isinstance(value, list | tuple) else (value,) if value is not None else ()
