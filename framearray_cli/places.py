"""Places of a frame array that a person names on the command line: cameras, and light positions along each axis.

Notation: a place on one axis is an index; a light place is a tuple of them, one for each axis of `Manifest.axes`.
"""

import re
from collections.abc import Mapping, Sequence
from itertools import product
from typing import TypeAlias

from framearray_cli.array.manifest import MAIN_AXIS, Manifest
from framearray_cli.base.errors import JobError
from framearray_cli.base.forms.words import shown
from framearray_cli.movie.places import nearest, position_of, read_place

LightPlace: TypeAlias = tuple[int, ...]

ALL, MIDDLE = "all", "50%"
_PLACE = r"[+-]?\d{1,9}|first|last|[\d.]+ ?%"  # whole indices alone: nothing is blended here
_WANTED = '"all", or indices, "first", "last" or percentages with commas between them'


def indices(option: str, text: str, n: int) -> tuple[int, ...]:
    """Read "all", or places with commas between them: "0,3,-1", "first", "last", "50%" (the nearest index).

    Args:
        option: what the text was given as, for messages.
        n: indices on the axis.

    Returns:
        The indices, in the order given, none twice.

    Raises:
        JobError: it is none of these, or lies outside of the axis.
    """
    if text.strip() == ALL:
        return tuple(range(n))
    found: dict[int, None] = {}
    for place in text.split(","):
        index = _index(place.strip(), n)
        if index is None:
            raise JobError(option, [f"expected {_WANTED}, got {shown(text)}"])
        if not 0 <= index < n:
            raise JobError(option, [f"expected 0 to {n - 1}, or -{n} to -1, got {place.strip()}"])
        found[index] = None
    return tuple(found)


def light_places(manifest: Manifest, light: str | None, at: Sequence[str], default: str) -> list[LightPlace]:
    """Read the light positions along every axis, and combine them.

    Args:
        light: places along the first axis; None: `default`.
        at: "AXIS=PLACES" for others, or for the first.
        default: places along the axes of which nothing is said.

    Raises:
        JobError: a place or an axis is not known, or one is told twice.
    """
    axes = manifest.axes
    told = _told(axes, at)
    first = next(iter(axes))
    if light is not None:
        if first in told:
            raise JobError("--light", [f"expected either this or --at {first}=..., got both"])
        told[first] = ("--light", light)
    chosen = [indices(*told.get(axis, (f"--at {axis}", default)), n) for axis, n in axes.items()]
    return list(product(*chosen))


def spread_with_ends(n: int, most: int) -> tuple[int, ...]:
    """At most so many of n indices, evenly, the first and the last among them; the middle one if there is one."""
    if n <= most:
        return tuple(range(n))
    if most == 1:
        return ((n - 1) // 2,)
    return tuple(round(k * (n - 1) / (most - 1)) for k in range(most))


def plain_names(axes: Mapping[str, int]) -> dict[str, str]:
    """Names of axes for keys and columns, of letters, digits and _: "light" for the main one, "light_..." for others.

    No two are the same.
    """
    names: dict[str, str] = {}
    for axis in axes:
        name = MAIN_AXIS if axis == MAIN_AXIS else f"light_{re.sub(r'[^0-9A-Za-z]+', '_', axis).strip('_')}"
        while name in names.values():
            name += "_"
        names[axis] = name
    return names


def _told(axes: Mapping[str, int], at: Sequence[str]) -> dict[str, tuple[str, str]]:
    """Axis -> the option and its places."""
    told: dict[str, tuple[str, str]] = {}
    for text in at:
        axis, equals, places = text.partition("=")
        if not equals or axis not in axes or axis in told:
            known = ", ".join(f"{name} (0 to {n - 1})" for name, n in axes.items())
            problem = "twice the same axis" if axis in told else shown(text)
            raise JobError("--at", [f"expected AXIS=PLACES with one of the axes {known}, got {problem}"])
        told[axis] = (f"--at {axis}", places)
    return told


def _index(place: str, n: int) -> int | None:
    """The index that a place means, which may lie outside; None if it means nothing."""
    if not re.fullmatch(_PLACE, place):
        return None
    try:
        return nearest(position_of(read_place(place), n))
    except ValueError:  # more than 100 %
        return None
