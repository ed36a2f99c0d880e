"""Spots: points with a cone, along key frames."""

from typing import Annotated, Literal

from pydantic import AfterValidator, Field, model_validator

from framearray_cli.base.forms.table import default_text, fail

from .aimed import aim_problems, same_choice_problems
from .keys import key_problems
from .placed import SIZES, PointKey, profile_problems
from .sourcetable import SourceTable
from .units import IES, LAMP_UNITS, LampUnits
from .values import Direction, FileName, Point

FLATTEST = 90.0  # degrees from the axis; a light that shines further back is no spot
NARROWEST = 0.5  # degrees; single precision knows no narrower cones


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
    inner: float = Field(
        default=0.0,
        ge=0,
        le=FLATTEST,
        description="Angle from the axis up to which it has its full `intensity`, degrees; from there it falls off.",
    )
    outer: float = Field(
        default=45.0, ge=NARROWEST, le=FLATTEST, description="Angle from the axis beyond which it is dark, degrees."
    )

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
    problems = key_problems(keys, "direction", "color", SIZES["point"])
    problems += same_choice_problems(keys, ("target", "direction"))
    problems += key_problems(keys, "none", "intensity", "up")
    if problems:
        fail(problems)
    return keys


class SpotSource(SourceTable):
    """A lamp that shines into a cone, as KHR_lights_punctual of glTF defines it, or as its file says."""

    type: Literal["spot"] = Field(description="Kind of source.")
    ies: FileName | None = Field(default=None, description=IES, json_schema_extra=default_text("none"))
    units: LampUnits | None = Field(default=None, description=LAMP_UNITS, json_schema_extra=default_text('"W/sr"'))
    keys: Annotated[tuple[SpotKey, ...], AfterValidator(_consistent_spot_keys)] = Field(
        min_length=1,
        strict=False,
        description="The spot at some frames; between them all its values change smoothly, before the first and after "
        "the last they stay as they are.",
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

    @property
    def count(self) -> int:
        """Number of light positions that the keys reach."""
        return self.keys[-1].frame + 1
