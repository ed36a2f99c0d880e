"""Points and directional sources, along key frames or from a file."""

from collections.abc import Sequence
from typing import Annotated, Any, Literal, TypeAlias

from pydantic import AfterValidator, Field, model_validator

from framearray_cli.base.forms.table import Place, Table, default_text, fail
from framearray_cli.base.units import FARTHEST

from .keys import MOST_EYES, key_problems
from .rowsource import KEYS, ROWS, PlacedLamp, PlacedSource, beside_file, one_of_both
from .units import IES, LAMP_UNITS, SKY_UNITS, LampUnits, SkyUnits
from .values import Colour, Direction, Emission, FileName, Point

WIDEST = 90.0  # degrees; a source of the sky that is wider is no sun

_RADIUS = (
    "Radius of a lamp that is a sphere, scene units: shadows get soft edges, at the same cost. `intensity` stays that "
    "of the whole lamp. A point inside it gets none of its light."
)
_ANGLE = (
    "Angle under which the source is seen, degrees: shadows get soft edges, at the same cost; the sun's is 0.53. "
    "`irradiance` stays that of the whole source."
)
_AT_EVERY_KEY = " Given at every key of a source or at none."
Radius: TypeAlias = Annotated[float, Field(ge=0, le=FARTHEST)]
Angle: TypeAlias = Annotated[float, Field(ge=0, le=WIDEST)]


_UP = "Only with `ies`: direction of horizontal angle 0 of the file, as far as the lamp's own direction allows."


class PointKey(Table):
    """A point source at one light frame."""

    frame: int = Field(ge=0, lt=MOST_EYES, description="Number of the light position, counted from 0.")
    position: Point = Field(description="Position, in the coordinates of the scene file.")
    intensity: Emission | None = Field(
        default=None,
        description="Radiant intensity, W/sr unless `units` says otherwise; one number means white. With `ies` it is "
        "the largest, and may be left out at every key.",
        json_schema_extra=default_text("none; with `ies` that of the file"),
    )
    color: Colour | None = Field(
        default=None,
        description="Multiplies `intensity` by channel; a temperature stands for the colour of a black body, of "
        "luminance 1. Given at every key of a source or at none.",
        json_schema_extra=default_text("1"),
    )
    radius: Radius | None = Field(
        default=None, description=_RADIUS + _AT_EVERY_KEY, json_schema_extra=default_text("0")
    )
    up: Direction | None = Field(
        default=None,
        description=_UP + _AT_EVERY_KEY,
        json_schema_extra=default_text("level at first, or x; the lamp moves without turning"),
    )


class DirectionalKey(Table):
    """A directional source, such as the sun, at one light frame."""

    frame: int = Field(ge=0, lt=MOST_EYES, description="Number of the light position, counted from 0.")
    direction: Direction = Field(description="The way the light travels: from the sun to the scene. Any length.")
    irradiance: Emission = Field(
        description="Irradiance of a surface that faces the light, W/m2 unless `units` says otherwise; one number "
        "means white."
    )
    color: Colour | None = Field(
        default=None,
        description="Multiplies `irradiance` by channel; a temperature stands for the colour of a black body, of "
        "luminance 1. Given at every key of a source or at none.",
        json_schema_extra=default_text("1"),
    )
    angle: Angle | None = Field(default=None, description=_ANGLE + _AT_EVERY_KEY, json_schema_extra=default_text("0"))


def _consistent_light_keys(keys: Any) -> Any:
    """Check the keys of one source against each other."""
    if problems := key_problems(keys, "direction", "color", "intensity", "up", "radius", "angle"):
        fail(problems)
    return keys


def profile_problems(keys: Sequence[PointKey], *, has_profile: bool) -> list[tuple[Place, str]]:
    """Check that lamps without a measured profile have all that it would say, and nothing that turns it."""
    if has_profile:
        return []
    wanted = "missing; expected a number or 3 numbers of at least 0"
    problems = [(("keys", k, "intensity"), wanted) for k, key in enumerate(keys) if key.intensity is None]
    turned = next((k for k, key in enumerate(keys) if key.up is not None), None)
    text = "expected it only beside `ies`, as other lamps of this kind look the same from all sides of their axis"
    return [*problems, *([] if turned is None else [(("keys", turned, "up"), text)])]


class PointSource(PlacedLamp):
    """A lamp that shines equally in all directions, or down as its file says: a point, or a sphere."""

    type: Literal["point"] = Field(description="Kind of source.")
    intensity: Emission | None = beside_file(
        "radiant intensity of all its positions, W/sr unless `units` says otherwise"
    )
    color: Colour | None = beside_file("colour of all its positions", "1")
    ies: FileName | None = Field(default=None, description=IES, json_schema_extra=default_text("none"))
    units: LampUnits | None = Field(default=None, description=LAMP_UNITS, json_schema_extra=default_text('"W/sr"'))
    radius: Radius | None = beside_file("radius of the lamp at all its positions, scene units", "0")
    up: Direction | None = beside_file("direction of horizontal angle 0 of `ies`", "level at first, or x")
    keys: Annotated[tuple[PointKey, ...], AfterValidator(_consistent_light_keys), AfterValidator(one_of_both)] = Field(
        default=(),
        validate_default=True,
        strict=False,
        description=f"The source at some frames; {KEYS}",
        json_schema_extra=ROWS,
    )

    @model_validator(mode="after")
    def _whole_without_profile(self) -> "PointSource":
        if problems := profile_problems(self.keys, has_profile=self.ies is not None):
            fail(problems)
        return self


class DirectionalSource(PlacedSource):
    """A source infinitely far away, such as the sun."""

    type: Literal["directional"] = Field(description="Kind of source.")
    units: SkyUnits | None = Field(default=None, description=SKY_UNITS, json_schema_extra=default_text('"W/m2"'))
    irradiance: Emission | None = beside_file(
        "irradiance of a surface that faces the light, W/m2 unless `units` says otherwise, at all its positions"
    )
    color: Colour | None = beside_file("colour of all its positions", "1")
    angle: Angle | None = beside_file("angle under which the source is seen, degrees", "0")
    keys: Annotated[tuple[DirectionalKey, ...], AfterValidator(_consistent_light_keys), AfterValidator(one_of_both)] = (
        Field(
            default=(),
            validate_default=True,
            strict=False,
            description=f"The source at some frames; {KEYS}",
            json_schema_extra=ROWS,
        )
    )
