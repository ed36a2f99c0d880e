"""Choices along the axes of an array: places as options name them, or a few that are evenly spaced."""

from collections.abc import Mapping, Sequence
from itertools import product
from typing import TypeAlias

from framearray_cli.array.manifest import Manifest
from framearray_cli.array.places import read_indices
from framearray_cli.base.errors import JobError
from framearray_cli.base.forms.words import shown

LightIndices: TypeAlias = tuple[int, ...]  # one index per light axis, in the order of `Manifest.axes`


def read_light_indices(manifest: Manifest, light: str | None, at: Sequence[str], default: str) -> list[LightIndices]:
    """Read places along every light axis, and combine them.

    Args:
        light: places along the first axis; None: `default`.
        at: "AXIS=PLACES" for other axes, or for the first.
        default: places along the axes that neither names.

    Raises:
        JobError: a place or an axis is unknown, or an axis is given twice.
    """
    given = named_places(manifest.axes, axes_of_groups(manifest), light, at)
    chosen = [read_indices(*given.get(axis, (f"--at {axis}", default)), n, axis) for axis, n in manifest.axes.items()]
    return list(product(*chosen))


def named_places(
    axes: Mapping[str, int], groups: Mapping[str, str], light: str | None, at: Sequence[str]
) -> dict[str, tuple[str, str]]:
    """Return the places that options name along light axes: axis -> the option for messages, and the places.

    Args:
        axes: the number of indices of each axis.
        groups: the axis of each group of sources, whose name may stand for the name of the axis.
        light: places along the first axis, of `--light`.
        at: "AXIS=PLACES", of `--at`.

    Raises:
        JobError: an axis is unknown, or is given twice.
    """
    given: dict[str, tuple[str, str]] = {}
    for text in at:
        name, equals, places = text.partition("=")
        axis = name if name in axes else groups.get(name, "")
        if not equals or axis not in axes or axis in given:
            known = ", ".join(f"{name} (0 to {n - 1})" for name, n in axes.items())
            problem = "twice the same axis" if axis in given else shown(text)
            raise JobError("--at", [f"expected AXIS=PLACES with one of the axes {known}, got {problem}"])
        given[axis] = (f"--at {name}", places)
    first = next(iter(axes))
    if light is not None:
        if first in given:
            raise JobError("--light", [f"expected either this or {given[first][0]}=..., got both"])
        given[first] = ("--light", light)
    return given


def axes_of_groups(manifest: Manifest) -> dict[str, str]:
    """Return the light axis of each group of sources, by name."""
    return {group.name: group.axis for group in manifest.groups}


def evenly_spaced(n: int, most: int) -> tuple[int, ...]:
    """Choose at most `most` of n indices, evenly spaced from first to last; the middle one if `most` is 1."""
    if n <= most:
        return tuple(range(n))
    if most == 1:
        return ((n - 1) // 2,)
    return tuple(round(k * (n - 1) / (most - 1)) for k in range(most))
