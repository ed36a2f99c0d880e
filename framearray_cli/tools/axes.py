"""Choices along the axes of an array: places as options name them, or a few that are evenly spaced."""

import re
from collections.abc import Callable, Mapping, Sequence
from datetime import datetime
from itertools import product
from typing import TypeAlias

from framearray_cli.array.manifest import Manifest, axis_moments
from framearray_cli.array.places import read_indices
from framearray_cli.base.errors import JobError
from framearray_cli.base.forms.words import shown
from framearray_cli.base.sundays import moment_text, sun_days

MOST_DAYS = 8  # in a message
_MOMENT = re.compile(r"\d{4}-\d\d-\d\dT(?:[01]\d|2[0-3]):[0-5]\d")
LightIndices: TypeAlias = tuple[int, ...]  # one index per light axis, in the order of `Manifest.axes`


def read_light_indices(
    manifest: Manifest,
    light: str | None,
    at: Sequence[str],
    default: str,
    note: Callable[[str], None] = lambda text: None,
) -> list[LightIndices]:
    """Read places along every light axis, and combine them.

    Args:
        light: places along the first axis; None: `default`.
        at: "AXIS=PLACES" for other axes, or for the first.
        default: places along the axes that neither names.
        note: as for `given_places`.

    Raises:
        JobError: a place or an axis is unknown, or an axis is given twice.
    """
    given = given_places(manifest, light, at, note)
    chosen = [read_indices(*given.get(axis, (f"--at {axis}", default)), n, axis) for axis, n in manifest.axes.items()]
    return list(product(*chosen))


def given_places(
    manifest: Manifest, light: str | None, at: Sequence[str], note: Callable[[str], None] = lambda text: None
) -> dict[str, tuple[str, str]]:
    """Return `named_places` of an array, with an index for each moment such as 2026-06-21T12:00.

    Args:
        note: called with the true time of a position that is not exact to the minute.

    Raises:
        JobError: as `named_places`; or the array has no such moment.
    """
    given = named_places(manifest.axes, axes_of_groups(manifest), light, at)
    named = {axis: set(_MOMENT.findall(text)) for axis, (_, text) in given.items()}
    moments = axis_moments(manifest) if any(named.values()) else {}
    for axis, (option, text) in given.items():
        for moment in sorted(named[axis]):
            text = text.replace(moment, str(_nearest(option, moment, moments.get(axis, ()), note)))
        given[axis] = option, text
    return given


def _nearest(option: str, text: str, moments: Sequence[datetime], note: Callable[[str], None]) -> int:
    """Return the light position nearest to a local date and time, at most a step, or an hour, away on that day."""
    if not moments:
        raise JobError(option, [f"expected an index, as this axis has no sun with date and time, got {shown(text)}"])
    days = sun_days(moments)
    steps = [max(day.step_h, 1.0) for day in days if day.date == text[:10]]
    wanted = datetime.fromisoformat(text) if steps else datetime.max
    away = [abs((moment.replace(tzinfo=None) - wanted).total_seconds()) for moment in moments]
    l = away.index(min(away))
    if away[l] > 3600 * max(steps, default=0.0):
        known = "; ".join([day.text for day in days[:MOST_DAYS]] + ["..."] * (len(days) > MOST_DAYS))
        raise JobError(option, [f"expected a moment within {known}, got {shown(text)}"])
    if away[l] >= 60:
        note(f"{option}: the light position nearest to {text} is {l}, of {moment_text(moments[l])}")
    return l


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
