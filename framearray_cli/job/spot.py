"""Spots: points with a cone, along key frames or from a file."""

from typing import Annotated, Literal, TypeAlias

from pydantic import AfterValidator, Field, model_validator

from framearray_cli.base.forms.table import default_text, fail

from .aimed import aim_problems, same_choice_problems
from .keys import key_problems
from .placed import PointKey, Radius, profile_problems
from .rowsource import KEYS, ROWS, PlacedLamp, beside_file, one_of_both
from .units import IES, LAMP_UNITS, LampUnits
from .values import Colour, Direction, Emission, FileName, Point

FLATTEST = 90.0  # degrees from the axis; a light that shines further back is no spot
NARROWEST = 0.5  # degrees; single precision knows no narrower cones
Inner: TypeAlias = Annotated[float, Field(ge=0, le=FLATTEST)]
Outer: TypeAlias = Annotated[float, Field(ge=NARROWEST, le=FLATTEST)]


class SpotKey(PointKey):
    """A spot at one light frame."""

    direction: Direction | None = Field(
        default=None,
        description="The way the middle of its light goes. Any length. Given at every key of a source, or `target`.",
        json_schema_extra=default_text("by `target`"),
    )
    target: Point | None = Field(
        default=None,
        description="Point that it shines at, in the coordinates of the scene file; it moves between keys.",
        json_schema_extra=default_text("by `direction`"),
    )
    inner: Inner = Field(
        default=0.0,
        description="Angle from the axis up to which it has its full `intensity`, degrees; from there it falls off.",
    )
    outer: Outer = Field(default=45.0, description="Angle from the axis beyond which it is dark, degrees.")

    @model_validator(mode="after")
    def _one_aim(self) -> "SpotKey":
        problems = aim_problems(self)
        if self.inner > self.outer:
            problems.append((("inner",), f"expected at most {self.outer:g}, the angle `outer`, got {self.inner:g}"))
        if problems:
            fail(problems)
        return self


def _consistent_spot_keys(keys: tuple[SpotKey, ...]) -> tuple[SpotKey, ...]:
    """Check the keys of one spot against each other."""
    problems = key_problems(keys, "direction", "color", "radius")
    problems += same_choice_problems(keys, ("target", "direction")) if keys else []
    problems += key_problems(keys, "none", "intensity", "up")
    if problems:
        fail(problems)
    return keys


class SpotSource(PlacedLamp):
    """A lamp that shines into a cone, as KHR_lights_punctual of glTF defines it, or as its file says."""

    type: Literal["spot"] = Field(description="Kind of source.")
    ies: FileName | None = Field(default=None, description=IES, json_schema_extra=default_text("none"))
    units: LampUnits | None = Field(default=None, description=LAMP_UNITS, json_schema_extra=default_text('"W/sr"'))
    intensity: Emission | None = beside_file(
        "radiant intensity of all its positions, W/sr unless `units` says otherwise"
    )
    color: Colour | None = beside_file("colour of all its positions", "1")
    direction: Direction | None = beside_file("the way the middle of its light goes at all positions", "by `target`")
    target: Point | None = beside_file("point that it shines at from all positions", "by `direction`")
    up: Direction | None = beside_file("direction of horizontal angle 0 of `ies`", "level at first, or x")
    radius: Radius | None = beside_file("radius of the lamp at all its positions, scene units", "0")
    inner: Inner | None = beside_file("angle from the axis up to which it has its full intensity, degrees", "0")
    outer: Outer | None = beside_file("angle from the axis beyond which it is dark, degrees", "45")
    keys: Annotated[tuple[SpotKey, ...], AfterValidator(_consistent_spot_keys), AfterValidator(one_of_both)] = Field(
        default=(),
        validate_default=True,
        strict=False,
        description=f"The spot at some frames; {KEYS}",
        json_schema_extra=ROWS,
    )

    @model_validator(mode="after")
    def _cone_or_profile(self) -> "SpotSource":
        problems = profile_problems(self.keys, has_profile=self.ies is not None)
        default = {name: SpotKey.model_fields[name].default for name in ("inner", "outer")}
        for k, key in enumerate(self.keys if self.ies else ()):
            text = "expected none beside `ies`, as the file says where the lamp shines"
            problems += [(("keys", k, name), text) for name in default if getattr(key, name) != default[name]]
        if problems:
            fail(problems)
        return self
