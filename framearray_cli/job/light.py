"""`[light]`: the positions of the light, and the sources with their groups and axes."""

from collections.abc import Sequence
from datetime import datetime
from typing import Annotated, NamedTuple

from pydantic import Field, ValidationInfo, field_validator, model_validator

from framearray_cli.base.forms.table import Problems, Table, fail, fill, optional, refuse
from framearray_cli.base.units import counted

from .keys import MAIN_AXIS, MOST_EYES, REST_GROUP, GroupName, late_key_problems
from .sources import DaySource, LightSource


class SourceGroup(NamedTuple):
    """Sources whose light the program stores separately.

    Attributes:
        axis: MAIN_AXIS, or an axis of the group's own.
        n: number of light positions along that axis.
        sources: their indices in `light.sources`.
    """

    name: str
    axis: str
    n: int
    sources: tuple[int, ...]


def _group_problems(sources: Sequence[LightSource]) -> Problems:
    """Check that the sources of a group share one axis, and that a source with an axis has a group."""
    axes: dict[str, tuple[int, str | None]] = {}
    for i, source in enumerate(sources):
        if source.axis and not source.group:
            yield (i, "axis"), 'expected a `group` next to it, as in group = "lamps"'
        first, axis = axes.setdefault(source.group or REST_GROUP, (i, source.axis))
        if source.group and source.axis != axis:
            wanted = f'"{axis}"' if axis else "no axis"
            yield (i, "axis"), f"expected {wanted}, as at sources[{first}] of the same group"


def _position_problems(source: LightSource, n: int) -> Problems:
    """Check the positions of a source against the number of its axis, if given."""
    yield from ((("keys", *place), text) for place, text in late_key_problems(source.key_frames, n))
    count, days = source.count, len(source.dates) if isinstance(source, DaySource) else 0
    if days and n and not count:
        if n % days:
            wanted = f"a number of days that divides the number of light positions, {n}, got {days}; or give `step`"
            yield ("date",), f"expected {wanted}"
    elif days and n and count != n:
        wanted = f"as many light positions as its axis has, {n}, got {count}; remove the number of the axis"
        yield ("step",), f"expected {wanted}"
    elif not source.key_frames and n and count > n:
        yield (), f"expected at most {counted(n, 'position')}, as its axis has, got {count}"


class LightTable(Table):
    """The light positions.

    Attributes:
        frames: Number of light positions, N_l.
        axes: Number of light positions along further axes, by name: { lamps = 12 }.
        sources: One or more sources; all of them shine together at each light position.
    """

    frames: int = optional("the last key's frame + 1, or the positions of a source without keys", 0, ge=1, le=MOST_EYES)
    axes: dict[GroupName, Annotated[int, Field(ge=1, le=MOST_EYES)]] = optional(
        "the last key's frame + 1 of each", {}, {"x-words": "names with whole numbers"}
    )
    sources: tuple[LightSource, ...] = Field(strict=False, min_length=1)

    @field_validator("sources")
    @classmethod
    def _within_frames(cls, sources: tuple[LightSource, ...], info: ValidationInfo) -> tuple[LightSource, ...]:
        frames, axes = info.data.get("frames", 0), info.data.get("axes", {})
        problems = list(_group_problems(sources))
        for i, source in enumerate(sources):
            n = axes.get(source.axis, 0) if source.axis else frames
            problems += [((i, *place), text) for place, text in _position_problems(source, n)]
        refuse(problems)
        return sources

    @model_validator(mode="after")
    def _fill_frames(self) -> "LightTable":
        last = {axis: -1 for axis in self.axes}
        counted = {*self.axes, *([MAIN_AXIS] if "frames" in self.model_fields_set else [])}
        for source in self.sources:
            axis = source.axis or MAIN_AXIS
            last[axis] = max(last.get(axis, -1), source.count - 1, 0)
            counted |= {axis} if source.count or not isinstance(source, DaySource) else set()
        for axis, frame in last.items():
            if frame < 0:
                fail([(("axes", axis), "expected a source with this axis, found none")])
            if axis not in counted:
                place = ("frames",) if axis == MAIN_AXIS else ("axes", axis)
                fail([(place, "missing; expected the number of positions of the sun, which has no key frames")])
        if "frames" not in self.model_fields_set:
            fill(self, "frames", last.get(MAIN_AXIS, 0) + 1)
        elif MAIN_AXIS not in last and self.frames != 1:  # a job written with all its defaults says 1
            fail([(("frames",), "expected none, as every source has an axis of its own; give `axes`")])
        fill(self, "axes", {axis: self.axes.get(axis, n + 1) for axis, n in last.items() if axis != MAIN_AXIS})
        return self

    @property
    def moments(self) -> dict[str, tuple[datetime, ...]]:
        """Local date and time of all positions of each axis with a sun, by its name."""
        found: dict[str, tuple[datetime, ...]] = {}
        for source in self.sources:
            if isinstance(source, DaySource):
                n = self.axes[source.axis] if source.axis else self.frames
                found.setdefault(source.axis or MAIN_AXIS, source.moments(n))
        return found

    @property
    def groups(self) -> tuple[SourceGroup, ...]:
        """The groups, in the order of their first sources; empty if no source names one."""
        if not any(source.group for source in self.sources):
            return ()
        found: dict[str, list[int]] = {}
        for i, source in enumerate(self.sources):
            found.setdefault(source.group or REST_GROUP, []).append(i)
        axes = {name: self.sources[numbers[0]].axis for name, numbers in found.items()}
        return tuple(
            SourceGroup(name, axis or MAIN_AXIS, self.axes[axis] if axis else self.frames, tuple(found[name]))
            for name, axis in axes.items()
        )
