"""Sources of `[light]`: one class per value of `type`, with the values of their keys."""

from datetime import datetime
from typing import Annotated, Generic, Literal, TypeAlias, TypeVar, get_args

from pydantic import AfterValidator, Field, ValidationInfo, field_validator, model_validator

from framearray_cli.base.forms.table import Problems, fail, optional
from framearray_cli.base.forms.words import shown
from framearray_cli.base.units import FARTHEST, MOST_EMISSION

from .keys import (
    MOST_EYES,
    Key,
    LightKey,
    PlacedSource,
    ShownSource,
    SourceTable,
    consistent_keys,
    key_type,
    units,
    with_rows,
)
from .values import (
    Clock,
    Colour,
    Dates,
    Direction,
    Emission,
    FileName,
    Point,
    Zone,
    count_steps,
    even_moments,
    is_skipped,
)

WIDEST = 90.0  # degrees; a wider source in the sky is no sun
FLATTEST = 90.0  # degrees from the axis; a light with a wider cone is no spot
NARROWEST = 0.5  # degrees; the narrowest cone in single precision
LampUnits: TypeAlias = Literal["W/sr", "cd", "lm"]
SkyUnits: TypeAlias = Literal["W/m2", "lux"]
Sky: TypeAlias = Literal["preetham", "clear", "intermediate", "overcast", "perez"]
PanelUnits: TypeAlias = Literal["W", "lm", "W/(m2 sr)", "cd/m2"]

Length: TypeAlias = Annotated[float, Field(gt=0, le=FARTHEST)]
Tint: TypeAlias = Annotated[
    Colour | None,
    optional(
        "1",
        description='Factor of the strength by channel; a temperature, such as "3200 K", gives the colour of a black '
        "body of luminance 1.",
    ),
]
Angle: TypeAlias = Annotated[
    Annotated[float, Field(ge=0, le=WIDEST)] | None,
    optional(
        "0",
        description="Angular diameter of the source, degrees: 0.53 for the sun. Soft shadows need no more rays than "
        "hard ones. `irradiance` is the irradiance of the whole source.",
    ),
]


class PlacedLamp(PlacedSource[Key], Generic[Key]):
    """Placed sources that are somewhere in the scene.

    Attributes:
        scale: Scene units per unit of the positions.
        center: Origin of the positions, in the coordinates of the scene file.
    """

    scale: float | None = optional("1", gt=0, le=FARTHEST)
    center: Point | None = optional('the origin; with space = "camera" the first target of the camera')


class PointKey(LightKey):
    """A point source at one light frame.

    Attributes:
        position: Position, in the coordinates of the scene file.
        intensity: Radiant intensity, W/sr unless `units` says otherwise; one number means white. With `ies` it is the
            largest intensity, and may be left out at every key.
        radius: Radius of a spherical lamp, scene units. Soft shadows need no more rays than hard ones. `intensity` is
            the intensity of the whole lamp. Points inside the sphere get none of its light.
        up: Only with `ies`: direction of horizontal angle 0 of the file, as far as the lamp's own direction allows.
    """

    place = "position"

    position: Point
    intensity: Emission | None = optional("none; with `ies` the intensity of the file")
    color: Tint = None
    radius: Annotated[float, Field(ge=0, le=FARTHEST)] | None = optional("0")
    up: Direction | None = optional("level at first, or x; the lamp moves without turning")


class DirectionalKey(LightKey):
    """A directional source, such as the sun, at one light frame.

    Attributes:
        direction: Direction of the light, from the sun to the scene. Any length.
        irradiance: Irradiance of a surface that faces the light, W/m2 unless `units` says otherwise; one number means
            white.
    """

    place = "direction"

    direction: Direction
    irradiance: Emission
    color: Tint = None
    angle: Angle = None


class SpotKey(PointKey):
    """A spot at one light frame.

    Attributes:
        direction: Direction of the axis of the cone. Any length.
        target: Point on the axis of the cone, in the coordinates of the scene file; it moves between keys.
        inner: Angle from the axis up to which the spot has its full `intensity`, degrees.
        outer: Angle from the axis beyond which the spot is dark, degrees.
    """

    either = (("direction", "target"),)

    direction: Direction | None = optional("by `target`")
    target: Point | None = optional("by `direction`")
    inner: Annotated[float, Field(ge=0, le=FLATTEST)] = 0.0
    outer: Annotated[float, Field(ge=NARROWEST, le=FLATTEST)] = 45.0

    def problems(self) -> Problems:
        """Check the aim, and the order of the angles."""
        yield from super().problems()
        if self.inner > self.outer:
            yield ("inner",), f"expected at most {self.outer:g}, the angle `outer`, got {self.inner:g}"


class PanelKey(LightKey):
    """Values of rectangles and discs at one light frame.

    Attributes:
        position: Middle of the panel, in the coordinates of the scene file.
        direction: Direction that the front of the panel faces. Any length.
        target: Point that the front of the panel faces, in the coordinates of the scene file; it moves between keys.
        power: Power of all light of the panel, W unless `units` says otherwise; one number means white.
        radiance: Radiance, W/(m2 sr) unless `units` says otherwise, constant over the panel and all directions; one
            number means white. A larger panel emits more.
    """

    place = "position"
    either = (("direction", "target"), ("power", "radiance"))

    position: Point
    direction: Direction | None = optional("by `target`")
    target: Point | None = optional("by `direction`")
    power: Emission | None = optional("by `radiance`")
    radiance: Emission | None = optional("by `power`")
    color: Tint = None


class RectKey(PanelKey):
    """A rectangle at one light frame.

    Attributes:
        width: Scene units.
        height: Scene units.
        up: Direction of the height, as far as the panel's own direction allows.
    """

    width: Length
    height: Length
    up: Direction | None = optional("at the first position the width is level, and the panel moves without turning")

    @property
    def sides(self) -> tuple[float, float]:
        """Width and height."""
        return self.width, self.height


class DiscKey(PanelKey):
    """A disc at one light frame.

    Attributes:
        radius: Scene units.
    """

    radius: Length

    @property
    def sides(self) -> tuple[float, float]:
        """The diameter, twice."""
        return 2 * self.radius, 2 * self.radius


class MeshKey(LightKey):
    """Strength of an emitting material at one light frame.

    Attributes:
        intensity: Factor of the emission and its texture in the scene file; one number applies to all channels.
        radiance: Uniform radiance instead of the emission in the scene file, W/(m2 sr) unless `units` says otherwise;
            one number means white.
    """

    intensity: Emission | None = optional("1; none with `radiance`")
    radiance: Emission | None = optional("the emission in the scene file")
    color: Tint = None

    def problems(self) -> Problems:
        """Check that a key has at most one strength."""
        if self.intensity is not None and self.radiance is not None:
            yield (), "expected either `intensity` or `radiance`, got both"


class EnvironmentKey(LightKey):
    """An environment at one light frame.

    Attributes:
        rotation: Rotation of the map about the up axis, degrees, clockwise as seen from above. At 0 its middle is
            north: -z in a scene with y up, y in one with z up.
        intensity: Factor of the map's radiance; one number means white.
    """

    rotation: float = Field(default=0.0, ge=-FARTHEST, le=FARTHEST)
    intensity: Emission = (1.0, 1.0, 1.0)
    color: Tint = None


_PointKey = TypeVar("_PointKey", bound=PointKey)


class ProfiledSource(PlacedLamp[_PointKey], Generic[_PointKey]):
    """Lamps that may have a measured profile.

    Attributes:
        ies: IES LM-63 file with the intensity of a lamp by direction, photometry of type C or B. A `point` with a file
            hangs: vertical angle 0 is straight down. A `spot` with a file has no cone: vertical angle 0 is its
            `direction`.
    """

    extent = "radius"

    ies: FileName | None = optional("none")
    units: LampUnits | None = units("every `intensity` of the source", '"W/sr"')

    def problems(self) -> Problems:
        """Check that each key has a cone and an intensity, or none next to a file with them."""
        yield from super().problems()
        for k, key in enumerate(self.keys):
            if self.ies is None:
                wrong = [("intensity", "missing; expected a number or 3 numbers of at least 0")] * (
                    key.intensity is None
                )
                if key.up is not None and k == 0:
                    text = "expected it only next to `ies`, as other lamps look the same from all sides of their axis"
                    wrong.append(("up", text))
            else:
                cone = {name: type(key).model_fields[name].default for name in ("inner", "outer") if hasattr(key, name)}
                text = "expected none next to `ies`, as the file has the intensity by direction"
                wrong = [(name, text) for name, default in cone.items() if getattr(key, name) != default]
            yield from ((("keys", k, name), text) for name, text in wrong)


@with_rows
class PointSource(ProfiledSource[PointKey]):
    """A lamp, a point or a sphere, that emits equally in all directions, or as its file says."""

    type: Literal["point"]


@with_rows
class SpotSource(ProfiledSource[SpotKey]):
    """A lamp that emits into a cone, as KHR_lights_punctual of glTF defines it, or as its file says."""

    type: Literal["spot"]


@with_rows
class DirectionalSource(PlacedSource[DirectionalKey]):
    """A source infinitely far away, such as the sun."""

    extent = "angle"

    type: Literal["directional"]
    units: SkyUnits | None = units("every `irradiance` of the source", '"W/m2"')


_PanelKey = TypeVar("_PanelKey", bound=PanelKey)


class PanelSource(PlacedLamp[_PanelKey], Generic[_PanelKey]):
    """Keys of rectangles and discs.

    Attributes:
        two_sided: Let the back emit, too. The `power` is the power of both sides together.
    """

    two_sided: bool = False
    units: PanelUnits | None = units("every `power` or `radiance` of the source", '"W" or "W/(m2 sr)"')

    def problems(self) -> Problems:
        """Check that `units` belong to the strength of the keys."""
        yield from super().problems()
        if self.keys:
            yield from self._unit_problems("radiance" if self.keys[0].power is None else "power")


@with_rows
class RectSource(PanelSource[RectKey]):
    """A flat lamp, a window or a screen: a rectangle that emits evenly. It never occludes."""

    type: Literal["rect"]


@with_rows
class DiscSource(PanelSource[DiscKey]):
    """A disc that emits evenly. It never occludes."""

    type: Literal["disc"]


class MeshSource(SourceTable):
    """A lamp, a screen or a window of the scene: all surfaces of a material emit, and are visible.

    Attributes:
        material: Name of the material in the scene file.
        two_sided: Let both sides of the surfaces emit; otherwise only the side with corners in counter-clockwise order.
    """

    type: Literal["mesh"]
    material: str = Field(min_length=1)
    two_sided: bool = True
    units: Literal["W/(m2 sr)", "cd/m2"] | None = units(
        "every `radiance` of the source, and of the emission in the scene file", '"W/(m2 sr)"'
    )
    keys: Annotated[tuple[MeshKey, ...], AfterValidator(consistent_keys)] = optional(
        "the emission in the scene file, at every light position", (), strict=False
    )

    def problems(self) -> Problems:
        """Check the name."""
        if not self.material.strip():
            yield ("material",), "expected the name of a material, got blanks"

    @property
    def count(self) -> int:
        """Number of light positions that the keys reach; 1 without keys."""
        return super().count or 1

    @property
    def has_radiance(self) -> bool:
        """True if the keys replace the emission in the scene file."""
        return any(key.radiance is not None for key in self.keys)


class EnvironmentSource(SourceTable):
    """Light from all directions, infinitely far away, by an image.

    Attributes:
        file: EXR, HDR or TIFF with a panorama of linear radiance, W/(m2 sr), twice as wide as high: straight up is the
            top row, north the middle column, east to the right of it.
    """

    type: Literal["environment"]
    file: FileName
    keys: Annotated[tuple[EnvironmentKey, ...], AfterValidator(consistent_keys)] = Field(min_length=1, strict=False)


class DomeSource(SourceTable):
    """Positions that are spread evenly over a hemisphere or sphere: points with `radius`, directions without.

    Attributes:
        positions: Number of light positions.
        shape: Shape that the positions are spread over; "tregenza" and "reinhart" are the patches of a sky, as discs of
            the same solid angle, for the daylight of a year.
        top: Direction of the first position, from the target: the middle of the hemisphere.
        target: Centre of the shape, in the coordinates of the scene file.
        radius: Distance of points from the target, scene units.
        intensity: Radiant intensity of each point, W/sr unless `units` says otherwise; needs `radius`.
        irradiance: Irradiance of a surface that faces the light, W/m2 unless `units` says otherwise; without `radius`.
    """

    type: Literal["dome"]
    positions: Annotated[int, Field(ge=1, le=MOST_EYES)] | None = optional('145 of "tregenza", 577 of "reinhart"')
    shape: Literal["hemisphere", "sphere", "tregenza", "reinhart"] = "hemisphere"
    top: Direction | None = optional("the scene's up axis")
    target: Point = (0.0, 0.0, 0.0)
    radius: Length | None = optional("none: the light comes from infinitely far away")
    intensity: Emission | None = optional("none")
    irradiance: Emission | None = optional("none")
    units: Literal["W/sr", "cd", "lm", "W/m2", "lux"] | None = units("`intensity` or `irradiance`", '"W/sr" or "W/m2"')
    color: Tint = None

    def problems(self) -> Problems:
        """Check that the strength is the one of points, or the one of directions."""
        wanted, other = ("irradiance", "intensity") if self.radius is None else ("intensity", "irradiance")
        about = "without `radius`" if self.radius is None else "with `radius`"
        yield from self._unit_problems(wanted)
        if getattr(self, wanted) is None:
            yield (wanted,), f"missing; expected a number or 3 numbers, {about}"
        if getattr(self, other) is not None:
            yield (other,), f"expected no value {about}; the strength is `{wanted}`"
        if not self.parts and self.positions is None:
            yield ("positions",), "missing; expected the number of light positions"
        for key in ("positions", "top", "radius") if self.parts else ():
            if getattr(self, key) is not None:
                yield (key,), f'expected none next to shape = "{self.shape}", whose patches are fixed'

    @property
    def parts(self) -> int:
        """Number of parts along each side of a patch of Tregenza's sky; 0 of other shapes."""
        return {"tregenza": 1, "reinhart": 2}.get(self.shape, 0)

    @property
    def count(self) -> int:
        """Number of light positions."""
        return self.positions or 144 * self.parts**2 + 1


class DaySource(SourceTable):
    """A source over a place on Earth on one or more days.

    Attributes:
        latitude: Latitude of the place, degrees; north is positive.
        longitude: Longitude of the place, degrees; east is positive.
        date: The day, or a list of different days, one behind the other on the light axis: each has the times below.
        timezone: Time zone of `start` and `stop`: an IANA name, or the hours ahead of UTC.
        start: Local time of the first light position.
        stop: Local time of the last. The positions of `[light] frames` are evenly spaced in time between them.
        step: Minutes from one position to the next, of elapsed time also where clocks change. The number of positions
            follows, and the last is at `stop` or less than a step before it.
        north: Direction in the scene that points north; its component along the up axis does not count.
        weather: Weather file (EPW) whose hours give the strength; its year does not count.
    """

    latitude: float = Field(ge=-90, le=90)
    longitude: float = Field(ge=-180, le=180)
    date: Dates
    timezone: Zone
    start: Clock
    stop: Clock
    step: Annotated[float, Field(ge=1 / 60, le=24 * 60)] | None = optional("by `[light] frames`")
    north: Direction | None = optional("-z in a scene with y up, y in one with z up, so that east is x")
    weather: FileName | None = optional("none")
    units: SkyUnits | None = units("`irradiance`", '"W/m2"')
    color: Tint = None

    @field_validator("stop")
    @classmethod
    def _after_start(cls, stop: str, info: ValidationInfo) -> str:
        if stop <= info.data.get("start", ""):
            fail([((), f"expected a time after the start, {info.data['start']}, got {stop}")])
        return stop

    @model_validator(mode="after")
    def _on_clocks(self) -> "DaySource":
        for key, clock in (("start", self.start), ("stop", self.stop)):
            if skipped := [date for date in self.dates if is_skipped(date, clock, self.timezone)]:
                fail([((key,), f"expected a time that exists on {skipped[0]}; clocks skip {clock}")])
        return self

    @property
    def dates(self) -> tuple[str, ...]:
        """All days."""
        return (self.date,) if isinstance(self.date, str) else self.date

    @property
    def count(self) -> int:
        """Number of light positions, if `step` determines it; otherwise 0."""
        times = self.start, self.stop, self.timezone
        return sum(count_steps(date, *times, self.step) for date in self.dates) if self.step else 0

    def moments(self, n: int) -> tuple[datetime, ...]:
        """Return the local date and time of n light positions, a multiple of the number of days unless by `step`."""
        times, each = (self.start, self.stop, self.timezone), n // len(self.dates)
        return tuple(time for date in self.dates for time in even_moments(date, *times, each, self.step))


class SunSource(DaySource, ShownSource):
    """The sun over a place on Earth on one or more days; below the horizon it emits nothing.

    Attributes:
        irradiance: Irradiance of a surface that faces the sun, W/m2 unless `units` says otherwise; one number means
            white.
    """

    extent = "angle"

    type: Literal["sun"]
    irradiance: Emission | None = optional("by `weather`, or in clear air: up to 102,000 lux, less when it is low")
    angle: Angle = None

    def problems(self) -> Problems:
        """Check that there is one strength."""
        yield from super().problems()
        if self.weather is not None and self.irradiance is not None:
            yield ("irradiance",), "expected none next to `weather`, which gives it by hour"


class SkySource(DaySource):
    """The sky without the sun over a place on Earth, and the ground below it; dark while the sun is down.

    Attributes:
        sky: "preetham": clear, in colour, by `turbidity`. "clear", "intermediate" and "overcast", or 1 to 15: standard
            skies of the CIE. "perez": any weather, by `direct` and `irradiance`, or by `weather`.
        irradiance: Irradiance of a level surface by the sky, W/m2 unless `units` says otherwise; one number means
            white.
        direct: Only with "perez": irradiance of a surface that faces the sun, in the same unit.
        turbidity: Turbidity of the air: 2 is clear, 6 hazy.
        albedo: Reflectivity of the ground beyond the scene, which the sky and the sun light.
    """

    type: Literal["sky"]
    sky: Sky | Annotated[int, Field(ge=1, le=15)] = optional('"preetham"; with `weather` "perez"', "preetham")
    irradiance: Emission | None = optional("by `weather`, or by the height of the sun")
    direct: Annotated[float, Field(ge=0, le=MOST_EMISSION)] | None = optional("none")
    turbidity: float = Field(default=2.45, ge=1.8, le=10)
    albedo: float = Field(default=0.2, ge=0, le=1)

    def problems(self) -> Problems:
        """Check that the model has the strengths that it needs, once."""
        yield from super().problems()
        perez, given = self.model == "perez", ("irradiance", "direct")
        for key in given:
            value = getattr(self, key)
            if self.weather is not None and value is not None:
                yield (key,), "expected none next to `weather`, which gives it by hour"
            elif self.weather is None and perez and value is None:
                yield (key,), 'missing; expected it with sky = "perez", or `weather`'
        if self.direct is not None and not perez:
            yield ("direct",), f'expected it only with sky = "perez", got {shown(self.sky)}'

    @property
    def model(self) -> str | int:
        """The sky, "perez" by default with `weather`."""
        return "perez" if self.weather is not None and "sky" not in self.model_fields_set else self.sky


AnyPanel: TypeAlias = RectSource | DiscSource
LightSource: TypeAlias = Annotated[
    PointSource
    | DirectionalSource
    | SpotSource
    | AnyPanel
    | MeshSource
    | SunSource
    | SkySource
    | DomeSource
    | EnvironmentSource,
    Field(discriminator="type"),
]
ROW_KEYS = {  # class of the keys that rows of a file of positions make, by type of source
    get_args(source.model_fields["type"].annotation)[0]: key_type(source)
    for source in get_args(get_args(LightSource)[0])
    if issubclass(source, PlacedSource)
}
