"""`[light]`: the light sources, and the groups and axes that they belong to."""

import re
from collections.abc import Sequence
from typing import Annotated, Any, Literal, NamedTuple, TypeAlias

from pydantic import AfterValidator, Field, ValidationInfo, field_validator, model_validator

from framearray_cli.base.forms.table import Place, Table, default_text, fail, fill
from framearray_cli.base.forms.words import shown

from .keys import MOST_EYES, key_problems, late_key_problems
from .times import Clock, Date, Zone
from .values import Direction, Emission, Point

MAIN_AXIS = "light"  # axis of the sources that name none
REST_GROUP = "main"  # group of the sources that name none, where others do


_GROUP_NAME = "[A-Za-z0-9_][A-Za-z0-9_-]{0,39}"
_TAKEN = ("ambient", "background", "layers", MAIN_AXIS)  # parts of file names, and the first axis


def _group_name(name: str) -> str:
    """Check the name of a group or an axis, which becomes part of file names."""
    if not re.fullmatch(_GROUP_NAME, name):
        fail([((), f'expected at most 40 letters, digits, "_" or "-", got {shown(name)}')])
    if name in _TAKEN:
        fail([((), f"expected another name, as {shown(name)} has a meaning of its own")])
    return name


GroupName: TypeAlias = Annotated[
    str, AfterValidator(_group_name), Field(json_schema_extra={"pattern": f"^{_GROUP_NAME}$", "x-words": "a name"})
]


class PointKey(Table):
    """A point source at one light frame."""

    frame: int = Field(ge=0, lt=MOST_EYES, description="Number of the light position, counted from 0.")
    position: Point = Field(description="Position, in the coordinates of the scene file.")
    intensity: Emission = Field(description="Radiant intensity, W/sr; one number means white.")
    color: Emission | None = Field(
        default=None,
        description="Multiplies `intensity` by channel. Given at every key of a source or at none.",
        json_schema_extra=default_text("1"),
    )


class DirectionalKey(Table):
    """A directional source, such as the sun, at one light frame."""

    frame: int = Field(ge=0, lt=MOST_EYES, description="Number of the light position, counted from 0.")
    direction: Direction = Field(description="The way the light travels: from the sun to the scene. Any length.")
    irradiance: Emission = Field(
        description="Irradiance of a surface that faces the light, W/m2; one number means white."
    )
    color: Emission | None = Field(
        default=None,
        description="Multiplies `irradiance` by channel. Given at every key of a source or at none.",
        json_schema_extra=default_text("1"),
    )


def _consistent_light_keys(keys: Any) -> Any:
    """Check the keys of one source against each other."""
    if problems := key_problems(keys, "direction", "color"):
        fail(problems)
    return keys


class _Source(Table):
    """What all kinds of source have."""

    group: GroupName | None = Field(
        default=None,
        description="Name of a group. If any source has one, the program stores the light of every group separately, "
        "so that its strength and colour can change in the finished array; sources without a group are the group "
        f'"{REST_GROUP}".',
        json_schema_extra=default_text("none"),
    )
    axis: GroupName | None = Field(
        default=None,
        description="Name of a light axis of its own, for all sources of the group: N_c x (N_1 + N_2) images then "
        "serve N_c x N_1 x N_2 pictures. Key frames count along it.",
        json_schema_extra=default_text("that of all other sources"),
    )


class PointSource(_Source):
    """A small lamp that shines equally in all directions."""

    type: Literal["point"] = Field(description="Kind of source.")
    keys: Annotated[tuple[PointKey, ...], AfterValidator(_consistent_light_keys)] = Field(
        strict=False,
        min_length=1,
        description="The source at some frames; between them all its values change smoothly, before the first "
        "and after the last they stay as they are.",
    )


class DirectionalSource(_Source):
    """A source infinitely far away, such as the sun."""

    type: Literal["directional"] = Field(description="Kind of source.")
    keys: Annotated[tuple[DirectionalKey, ...], AfterValidator(_consistent_light_keys)] = Field(
        strict=False,
        min_length=1,
        description="The source at some frames; between them all its values change smoothly, before the first "
        "and after the last they stay as they are.",
    )


class SunSource(_Source):
    """The sun over a place on Earth on one day; below the horizon it shines 0. It needs the extra `sun`."""

    type: Literal["sun"] = Field(description="Kind of source.")
    latitude: float = Field(ge=-90, le=90, description="Of the place, degrees; north is positive.")
    longitude: float = Field(ge=-180, le=180, description="Of the place, degrees; east is positive.")
    date: Date = Field(description="The day.")
    timezone: Zone = Field(description="Whose clocks show the times: a name of the IANA, or the hours ahead of UTC.")
    start: Clock = Field(description="Local time of the first light position.")
    stop: Clock = Field(
        description="Local time of the last. The positions of `[light] frames` are evenly spaced in time between them."
    )
    north: Direction | None = Field(
        default=None,
        description="Direction in the scene that points north; its component along the up axis does not count.",
        json_schema_extra=default_text("-z in a scene with y up, y in one with z up, so that east is x"),
    )
    irradiance: Emission = Field(
        description="Irradiance of a surface that faces the sun, W/m2; one number means white. Clear air lets about "
        "1000 W/m2 through; choose what suits the exposure."
    )

    @field_validator("stop")
    @classmethod
    def _after_start(cls, stop: str, info: ValidationInfo) -> str:
        if stop <= info.data.get("start", ""):
            fail([((), f"expected a time after the start, {info.data['start']}, got {stop}")])
        return stop

    @property
    def keys(self) -> tuple[DirectionalKey, ...]:
        """No key frames: the positions follow from the times."""
        return ()


LightSource: TypeAlias = Annotated[PointSource | DirectionalSource | SunSource, Field(discriminator="type")]


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


def _group_problems(sources: Sequence[LightSource]) -> list[tuple[Place, str]]:
    """Check that the sources of a group share one axis, and that a source with an axis has a group."""
    problems: list[tuple[Place, str]] = []
    axes: dict[str, tuple[int, str | None]] = {}
    for i, source in enumerate(sources):
        if source.axis and not source.group:
            problems.append(((i, "axis"), 'expected a `group` beside it, as in group = "lamps"'))
        first, axis = axes.setdefault(source.group or REST_GROUP, (i, source.axis))
        if source.group and source.axis != axis:
            wanted = f'"{axis}"' if axis else "no axis"
            problems.append(((i, "axis"), f"expected {wanted}, as at sources[{first}] of the same group"))
    return problems


class LightTable(Table):
    """The light positions."""

    frames: int = Field(
        default=0,
        ge=1,
        le=MOST_EYES,
        description="Number of light positions, N_l.",
        json_schema_extra=default_text("the last key's frame + 1"),
    )
    axes: dict[GroupName, Annotated[int, Field(ge=1, le=MOST_EYES)]] = Field(
        default={},
        description="Number of light positions along further axes, by name: { lamps = 12 }.",
        json_schema_extra={
            **default_text("the last key's frame + 1 of each"),
            "x-words": "names with whole numbers",
        },
    )
    sources: tuple[LightSource, ...] = Field(
        strict=False,
        min_length=1,
        description="One or more sources; all of them shine together at each light position.",
    )

    @field_validator("sources")
    @classmethod
    def _within_frames(cls, sources: tuple[LightSource, ...], info: ValidationInfo) -> tuple[LightSource, ...]:
        frames, axes = info.data.get("frames", 0), info.data.get("axes", {})
        late = [
            ((i, "keys", *place), text)
            for i, s in enumerate(sources)
            for place, text in late_key_problems(s.keys, axes.get(s.axis, 0) if s.axis else frames)
        ]
        if problems := late + _group_problems(sources):
            fail(problems)
        return sources

    @model_validator(mode="after")
    def _fill_frames(self) -> "LightTable":
        last = {axis: -1 for axis in self.axes}
        counted = {*self.axes, *([MAIN_AXIS] if "frames" in self.model_fields_set else [])}
        for source in self.sources:
            axis = source.axis or MAIN_AXIS
            last[axis] = max(last.get(axis, -1), source.keys[-1].frame if source.keys else 0)
            counted |= {axis} if source.keys else set()
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
