"""From options to sums: what each picture is a sum of."""

from collections.abc import Callable
from dataclasses import dataclass
from functools import partial
from pathlib import Path
from typing import Protocol

import numpy as np

from framearray_cli.array.manifest import Manifest
from framearray_cli.array.mixtures import Mixture, Position, check_linear, check_mixture
from framearray_cli.array.pictures import Pictures, Positions
from framearray_cli.base.arrays import Float64, Image
from framearray_cli.base.errors import JobError

from .environment import LightField, environment_weights, light_field, read_map
from .weightfile import read_weights

# Below this share of a map's light pictures miss some of it that people would see.
MOST_LIGHT = 0.95
# Weights below this share of the largest are rounding: of texels that lie between two cells.
LEAST_WEIGHT = 1e-9


@dataclass(frozen=True, slots=True, kw_only=True)
class SumOptions:
    """What pictures are sums of; at most one of `environment`, `soft` and `weights`.

    Attributes:
        environment: a map whose light the positions along the first axis stand for.
        rotate: degrees that the map is turned clockwise, in the first and in the last picture of a movie.
        soft: the number of positions whose mean takes the place of one.
        weights: a CSV file with the weight of each position.
    """

    environment: Path | None = None
    rotate: tuple[float, float] = (0.0, 0.0)
    soft: float | None = None
    weights: Path | None = None

    @property
    def collapses(self) -> bool:
        """Whether all positions along the first axis become one picture."""
        return self.environment is not None or self.weights is not None

    @property
    def turns(self) -> bool:
        """Whether an environment turns during a movie."""
        return self.rotate[0] != self.rotate[1]

    @property
    def any(self) -> bool:
        """Whether pictures are sums."""
        return self.environment is not None or self.soft is not None or self.weights is not None


class Mixer(Protocol):
    """Puts sums in place of positions."""

    def __call__(self, positions: Positions, share: float) -> Positions:
        """Return the positions of a picture.

        Args:
            share: of the movie that has passed, 0 to 1.
        """


def make_mixer(manifest: Manifest, options: SumOptions, warn: Callable[[str], None]) -> Mixer | None:
    """Make the sums of an array; None if pictures stay as they are.

    Args:
        warn: called with what is left out.

    Raises:
        JobError: options exclude each other, or a file of weights is broken.
        OutputError: the array cannot be summed, or the map cannot be read.
    """
    if not options.any:
        return None
    if sum(value is not None for value in (options.environment, options.soft, options.weights)) > 1:
        raise JobError("--environment", ["expected only one of --environment, --soft and --weights"])
    check_linear(manifest)
    if options.environment is not None:
        return _environment_mixer(manifest, options.environment, options.rotate, warn)
    n = manifest.n_lights
    if options.soft is not None:
        width = options.soft
        return lambda positions, share: (mean_around(_number(positions[0]), width, n), *positions[1:])
    assert options.weights is not None
    mixture = mixture_of(read_weights(options.weights, n))
    check_mixture(manifest, mixture)
    return lambda positions, share: (mixture, *positions[1:])


def _environment_mixer(
    manifest: Manifest, file: Path, rotate: tuple[float, float], warn: Callable[[str], None]
) -> Mixer:
    field, (panorama, note) = light_field(manifest), read_map(file)
    if note:
        warn(note)
    first, last = rotate
    _, covered = environment_mixture(manifest, field, panorama, first)
    if covered < MOST_LIGHT:
        warn(f"{file}: {1 - covered:.0%} of its light comes from where the array has no light position")

    def mix(positions: Positions, share: float) -> Positions:
        turned, _ = environment_mixture(manifest, field, panorama, first + (last - first) * share)
        return (turned, *positions[1:])

    return mix


def environment_mixture(
    manifest: Manifest, field: LightField, panorama: Image, rotate_deg: float
) -> tuple[Mixture, float]:
    """Return the sum of light positions that an environment is, and the share of its light that they stand for.

    Args:
        field, panorama, rotate_deg: as in `environment_weights`.

    Raises:
        OutputError: the sum would be wrong, as in `check_mixture`.
    """
    weights, covered = environment_weights(field, panorama, rotate_deg)
    mixture = mixture_of(weights)
    check_mixture(manifest, mixture)
    return mixture, covered


def scaled(positions: tuple[Position, ...], factor: float) -> tuple[Position, ...]:
    """Multiply the weights of the mixture along the first axis."""
    first = positions[0]
    assert isinstance(first, Mixture)
    weights = tuple((l, (r * factor, g * factor, b * factor)) for l, (r, g, b) in first.weights) if factor else ()
    return (Mixture(weights), *positions[1:])


def open_pictures(manifest: Manifest, options: SumOptions) -> tuple[Pictures, tuple[str, ...]]:
    """Return the pictures of an array, as sums if the options say so, and warnings about what is left out.

    Raises:
        JobError, OutputError: as `make_mixer`.
    """
    left_out: list[str] = []
    mixer = make_mixer(manifest, options, left_out.append)
    mix = None if mixer is None else partial(mixer, share=0.0)
    return Pictures(manifest, mix=mix), tuple(left_out)


def mixture_of(weights: Float64) -> Mixture:
    """Make the mixture of weights (n, 3) of all light positions."""
    least = LEAST_WEIGHT * np.abs(weights).max(initial=0.0)
    rows = [(l, (float(r), float(g), float(b))) for l, (r, g, b) in enumerate(weights.tolist())]
    return Mixture(tuple((l, weight) for l, weight in rows if max(map(abs, weight)) > least))


def mean_around(position: float, width: float, n: int) -> Mixture:
    """Return the mean of `width` light positions around one, where the axis has them; the weights sum to 1.

    A position stands for the stretch from half a step before to half a step after it.

    Args:
        position: from 0 to n - 1.
        width: at least 1.
    """
    at = np.arange(n)
    low, high = max(position - width / 2, -0.5), min(position + width / 2, n - 0.5)
    overlap = np.clip(np.minimum(high, at + 0.5) - np.maximum(low, at - 0.5), 0, None)
    share = overlap / overlap.sum()
    return mixture_of(np.repeat(share[:, None], 3, axis=1))


def _number(position: float | Mixture) -> float:
    assert not isinstance(position, Mixture)
    return position
