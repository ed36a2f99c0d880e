"""Kinds of light sources in a job; here those without key frames: domes, grids, and the sun."""

from datetime import datetime
from typing import Annotated, Literal, TypeAlias

from pydantic import Field, ValidationInfo, field_validator, model_validator

from framearray_cli.base.forms.table import Place, default_text, fail
from framearray_cli.base.units import FARTHEST

from .environment import EnvironmentSource
from .keys import MOST_EYES
from .mesh import MeshSource
from .panel import DiscSource, RectSource
from .placed import Angle, DirectionalKey, DirectionalSource, PointSource
from .sourcetable import ShownSource, SourceTable
from .spot import SpotSource
from .times import Almanac, Clock, Dates, Zone, clock_minutes, even_moments
from .units import LAMP_UNITS, SKY_UNITS, UNITS_OF_DOMES, DomeUnits, LampUnits, SkyUnits
from .values import Colour, Direction, Emission, GridSize, Point

ROUNDING = 1e-6  # of steps; a third of an hour ends after three of them


class DomeSource(SourceTable):
    """Positions that are spread evenly over a hemisphere or sphere: points with `radius`, directions without."""

    type: Literal["dome"] = Field(description="Kind of source.")
    positions: int = Field(ge=1, le=MOST_EYES, description="Number of light positions.")
    shape: Literal["hemisphere", "sphere"] = Field(default="hemisphere", description="What they are spread over.")
    top: Direction | None = Field(
        default=None,
        description="Direction of the first position, from the target: the middle of the hemisphere.",
        json_schema_extra=default_text("the scene's up axis"),
    )
    target: Point = Field(default=(0.0, 0.0, 0.0), description="The middle, in the coordinates of the scene file.")
    radius: float | None = Field(
        default=None,
        gt=0,
        le=FARTHEST,
        description="Distance of points from the target, scene units.",
        json_schema_extra=default_text("none: the light comes from infinitely far away"),
    )
    intensity: Emission | None = Field(
        default=None,
        description="Radiant intensity of each point, W/sr unless `units` says otherwise; needs `radius`.",
        json_schema_extra=default_text("none"),
    )
    irradiance: Emission | None = Field(
        default=None,
        description="Irradiance of a surface that faces the light, W/m2 unless `units` says otherwise; without "
        "`radius`.",
        json_schema_extra=default_text("none"),
    )
    units: DomeUnits | None = Field(
        default=None,
        description="Unit of `intensity` or `irradiance`; lumens are those of all light of a point. A watt of light "
        "is 683 lumens.",
        json_schema_extra=default_text('"W/sr" or "W/m2"'),
    )
    color: Colour | None = Field(
        default=None, description="Multiplies the strength by channel.", json_schema_extra=default_text("1")
    )

    @model_validator(mode="after")
    def _one_strength(self) -> "DomeSource":
        wanted, other = ("irradiance", "intensity") if self.radius is None else ("intensity", "irradiance")
        about = "without `radius`" if self.radius is None else "with `radius`"
        problems: list[tuple[Place, str]] = []
        if getattr(self, wanted) is None:
            problems.append(((wanted,), f"missing; expected a number or 3 numbers, {about}"))
        if getattr(self, other) is not None:
            problems.append(((other,), f"expected no value {about}, whose strength is `{wanted}`"))
        if self.units is not None and self.units not in UNITS_OF_DOMES[wanted]:
            known = " or ".join(f'"{unit}"' for unit in UNITS_OF_DOMES[wanted])
            problems.append((("units",), f'expected {known} {about}, got "{self.units}"'))
        if problems:
            fail(problems)
        return self

    @property
    def keys(self) -> tuple[()]:
        """No key frames: the positions follow from their number."""
        return ()

    @property
    def count(self) -> int:
        """Number of light positions."""
        return self.positions


class GridSource(SourceTable):
    """Points on a flat grid, row by row."""

    type: Literal["grid"] = Field(description="Kind of source.")
    counts: GridSize = Field(description="Number of points along the two sides.")
    corner: Point = Field(description="First point, in the coordinates of the scene file.")
    side: Direction = Field(description="From the first point to the last of the first row.")
    other_side: Direction = Field(description="From the first point to the first of the last row.")
    intensity: Emission = Field(
        description="Radiant intensity of each point, W/sr unless `units` says otherwise; one number means white."
    )
    units: LampUnits | None = Field(default=None, description=LAMP_UNITS, json_schema_extra=default_text('"W/sr"'))
    color: Colour | None = Field(
        default=None, description="Multiplies `intensity` by channel.", json_schema_extra=default_text("1")
    )

    @property
    def keys(self) -> tuple[()]:
        """No key frames: the positions follow from the counts."""
        return ()

    @property
    def count(self) -> int:
        """Number of light positions."""
        return self.counts[0] * self.counts[1]


class SunSource(ShownSource):
    """The sun over a place on Earth on one day; below the horizon it shines 0."""

    type: Literal["sun"] = Field(description="Kind of source.")
    latitude: float = Field(ge=-90, le=90, description="Of the place, degrees; north is positive.")
    longitude: float = Field(ge=-180, le=180, description="Of the place, degrees; east is positive.")
    date: Dates = Field(
        description="The day, or a list of different days, one behind the other on the light axis: each has the times "
        "below."
    )
    timezone: Zone = Field(description="Whose clocks show the times: a name of the IANA, or the hours ahead of UTC.")
    start: Clock = Field(description="Local time of the first light position.")
    stop: Clock = Field(
        description="Local time of the last. The positions of `[light] frames` are evenly spaced in time between them."
    )
    step: float | None = Field(
        default=None,
        ge=1 / 60,
        le=24 * 60,
        description="Minutes from one position to the next. The number of positions follows, and the last is at `stop` "
        "or less than a step before it.",
        json_schema_extra=default_text("by `[light] frames`"),
    )
    north: Direction | None = Field(
        default=None,
        description="Direction in the scene that points north; its component along the up axis does not count.",
        json_schema_extra=default_text("-z in a scene with y up, y in one with z up, so that east is x"),
    )
    almanac: Almanac = Field(
        default="ephem",
        description='Library that computes where the sun is. "pvlib", which needs the extra `sun`, differs by up to '
        "0.006 degrees; arrays that were begun before there was a choice have it.",
    )
    units: SkyUnits | None = Field(default=None, description=SKY_UNITS, json_schema_extra=default_text('"W/m2"'))
    irradiance: Emission = Field(
        description="Irradiance of a surface that faces the sun, W/m2 unless `units` says otherwise; one number "
        "means white. Clear air lets about "
        "1000 W/m2 through; choose what suits the exposure."
    )
    color: Colour | None = Field(
        default=None, description="Multiplies `irradiance` by channel.", json_schema_extra=default_text("1")
    )
    angle: Angle | None = Field(
        default=None,
        description="Angle under which the sun is seen, degrees: 0.53 is right, and gives shadows soft edges at the "
        "same cost.",
        json_schema_extra=default_text("0"),
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

    @property
    def dates(self) -> tuple[str, ...]:
        """All days."""
        return (self.date,) if isinstance(self.date, str) else self.date

    @property
    def count(self) -> int:
        """Number of light positions, if `step` determines it; else 0."""
        if self.step is None:
            return 0
        minutes = clock_minutes(self.stop) - clock_minutes(self.start)
        return len(self.dates) * (int(minutes / self.step + ROUNDING) + 1)

    def moments(self, n: int) -> tuple[datetime, ...]:
        """Return the local date and time of n light positions."""
        return even_moments(self.dates, self.start, self.stop, self.timezone, n, self.step)


LightSource: TypeAlias = Annotated[
    PointSource
    | DirectionalSource
    | SpotSource
    | RectSource
    | DiscSource
    | MeshSource
    | SunSource
    | DomeSource
    | GridSource
    | EnvironmentSource,
    Field(discriminator="type"),
]
