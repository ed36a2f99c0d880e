"""A few of many light positions, which show what all of them cost."""

from collections.abc import Sequence
from dataclasses import replace

import numpy as np

from .paths import LightGroup, Lights


def few_planes(lights: Lights, most: int, *, consecutive: bool = False) -> list[int]:
    """Return at least one light position of every group, at most about `most` in all, and all planes without light.

    Args:
        consecutive: from the middle of each group's path, instead of all along it.
    """
    lit = sum(plane.lit for plane in lights.planes)
    if lit <= most:
        return list(range(lights.n))
    found: list[int] = []
    for positions in [group.positions for group in lights.groups] or [range(lit)]:
        n = max(most * len(positions) // lit, 1)
        first = (len(positions) - n) // 2
        at = range(first, first + n) if consecutive else np.linspace(0, len(positions) - 1, n).round().astype(int)
        found += [positions[int(k)] for k in at]
    return found + [p for p, plane in enumerate(lights.planes) if not plane.lit]


def lights_at(lights: Lights, planes: Sequence[int]) -> Lights:
    """Return the same sources at some planes only, in rising order; every group keeps one at least."""
    chosen = list(planes)

    def moved(group: LightGroup) -> LightGroup:
        own = [k for k, p in enumerate(chosen) if p in group.positions]
        return replace(group, positions=range(own[0], own[-1] + 1))

    return replace(
        lights,
        sources=tuple(path.at(chosen) for path in lights.sources),
        groups=tuple(map(moved, lights.groups)),
        planes=tuple(lights.planes[p] for p in chosen),
    )
