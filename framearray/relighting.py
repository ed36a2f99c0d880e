"""The light of an array: factors of its groups, and sums over its light positions; from the arguments of `relight`."""

import os
import warnings
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any, TypeAlias

import numpy as np
from numpy.typing import ArrayLike

from framearray_cli.array.manifest import Manifest, Vector
from framearray_cli.array.mixtures import Mixture
from framearray_cli.array.pictures import AS_RENDERED, Positions, Relight
from framearray_cli.base.arrays import Float64
from framearray_cli.base.errors import OutputError
from framearray_cli.tools.mixing import mean_around, prepare_map, read_map, turn_environment

Factor: TypeAlias = float | tuple[float, float, float]  # one number for all three channels, or one for each
Weights: TypeAlias = Mapping[int, Factor] | ArrayLike
Environment: TypeAlias = str | os.PathLike[str] | ArrayLike


@dataclass(frozen=True, slots=True, kw_only=True)
class Lighting:
    """The light of an array as `FrameArray.relight` changed it.

    Attributes:
        relight: factors of groups and of the ambient light.
        mixture: sum that takes the place of all positions along the first axis.
        soft: the number of positions along the first axis whose mean takes the place of one.
        n: number of positions along the first axis, before they are summed.
    """

    relight: Relight = AS_RENDERED
    mixture: Mixture | None = None
    soft: float | None = None
    n: int

    @property
    def changes_nothing(self) -> bool:
        return self.relight.changes_nothing and self.mixture is None and self.soft is None

    def mix(self, positions: Positions) -> Positions:
        """Replace a position by the sum along the first axis."""
        first, *rest = positions
        if self.mixture is not None:
            return (self.mixture, *rest)
        if self.soft is None or isinstance(first, Mixture):
            return positions
        return (mean_around(first, self.soft, self.n), *rest)


def no_group(manifest: Manifest, unknown: Sequence[str]) -> Exception:
    """Make the error of an array without some groups, or without any."""
    known = manifest.group_names
    if known:
        return KeyError(f"no group {unknown[0]!r}; the array has {', '.join(known)}")
    return OutputError(
        f"{manifest.directory}: the light cannot be changed, as this array stores it all together; render "
        'again with group = "..." in [[light.sources]]'
    )


def environment_mixture(manifest: Manifest, environment: Environment, rotate: float) -> Mixture:
    """Return the sum of light positions that stands for a panorama."""
    texts: list[str] = []
    if isinstance(environment, str | os.PathLike):
        name, image = os.fspath(environment), read_map(Path(environment))
    else:
        name, image = "environment", prepare_map(np.asarray(environment, np.float32), "environment")
    mixture = turn_environment(manifest, name, image, float(rotate), texts.append)(float(rotate))
    for text in texts:
        warnings.warn(text, stacklevel=3)  # the caller of `relight`
    return mixture


def read_weights(weights: Any, n: int) -> Float64:
    """Return the weights of n light positions, (n, 3)."""
    if isinstance(weights, Mapping):
        found = np.zeros((n, 3))
        for l, weight in weights.items():
            if not (isinstance(l, int | np.integer) and -n <= l < n):
                raise IndexError(f"weights: expected light positions from 0 to {n - 1}, got {l!r}")
            found[l] = read_factor(f"weights[{l}]", weight)
        return found
    given = _numbers(weights)
    if given is None:
        raise ValueError(f"weights: expected numbers, got {weights!r}")
    if given.shape not in ((n,), (n, 3)):
        raise ValueError(f"weights: expected the shape ({n},) or ({n}, 3), got {given.shape}")
    if not np.isfinite(given).all():
        raise ValueError("weights: expected finite numbers")
    return np.array(np.broadcast_to(given[:, None] if given.ndim == 1 else given, (n, 3)))


def read_factor(name: str, factor: Factor) -> Vector:
    """Return a factor per channel."""
    found = _numbers(factor)
    if found is None or found.shape not in ((), (3,)) or not np.isfinite(found).all():
        raise ValueError(f"{name}: expected a finite number or 3 of them, got {factor!r}")
    red, green, blue = np.broadcast_to(found, 3).tolist()
    return red, green, blue


def _numbers(values: Any) -> Float64 | None:
    """Return an array of numbers; None: they are none."""
    try:
        return np.asarray(values, np.float64)
    except (TypeError, ValueError):
        return None
