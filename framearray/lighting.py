"""The light of an array: factors of its groups, and sums over its light positions."""

import os
from collections.abc import Mapping
from dataclasses import dataclass
from typing import TypeAlias

from numpy.typing import ArrayLike

from framearray_cli.array.mixtures import Mixture
from framearray_cli.array.pictures import AS_RENDERED, Positions, Relight

Factor: TypeAlias = float | tuple[float, float, float]  # one number for all three channels, or one for each
Weights: TypeAlias = str | os.PathLike[str] | Mapping[int, Factor] | ArrayLike
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
        """Put the sum along the first axis in place of a position."""
        first, *rest = positions
        if self.mixture is not None:
            return (self.mixture, *rest)
        if self.soft is None or isinstance(first, Mixture):
            return positions
        from framearray_cli.tools.mixing.mixer import mean_around  # loads pydantic

        return (mean_around(first, self.soft, self.n), *rest)
