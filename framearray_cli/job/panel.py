"""Panels: rectangles and discs that shine, along key frames or from a file."""

from collections.abc import Sequence
from typing import Annotated, Literal, TypeAlias

from pydantic import AfterValidator, Field, model_validator

from framearray_cli.base.forms.table import Table, default_text, fail
from framearray_cli.base.units import FARTHEST

from .aimed import aim_problems, same_choice_problems
from .keys import MOST_EYES, key_problems
from .rowsource import KEYS, ROWS, PlacedLamp, beside_file, one_of_both
from .units import PANEL_UNITS, UNITS_OF_PANELS, PanelUnits
from .values import Colour, Direction, Emission, Point

Length: TypeAlias = Annotated[float, Field(gt=0, le=FARTHEST)]
_AT_EVERY_KEY = " Given at every key of a source or at none."


class PanelKey(Table):
    """What keys of rectangles and of discs have."""

    frame: int = Field(ge=0, lt=MOST_EYES, description="Number of the light position, counted from 0.")
    position: Point = Field(description="Its middle, in the coordinates of the scene file.")
    direction: Direction | None = Field(
        default=None,
        description="The way its front faces. Any length. Given at every key of a source, or `target`.",
        json_schema_extra=default_text("by `target`"),
    )
    target: Point | None = Field(
        default=None,
        description="Point that its front faces, in the coordinates of the scene file; it moves between keys.",
        json_schema_extra=default_text("by `direction`"),
    )
    power: Emission | None = Field(
        default=None,
        description="Power of all its light, W unless `units` says otherwise; one number means white. Given at every "
        "key of a source, or `radiance`.",
        json_schema_extra=default_text("by `radiance`"),
    )
    radiance: Emission | None = Field(
        default=None,
        description="Radiance, W/(m2 sr) unless `units` says otherwise, the same everywhere and to all sides; one "
        "number means white. A larger panel shines more.",
        json_schema_extra=default_text("by `power`"),
    )
    color: Colour | None = Field(
        default=None,
        description="Multiplies the strength by channel; a temperature stands for the colour of a black body, of "
        "luminance 1." + _AT_EVERY_KEY,
        json_schema_extra=default_text("1"),
    )

    @model_validator(mode="after")
    def _one_aim_and_strength(self) -> "PanelKey":
        problems = aim_problems(self)
        if (self.power is None) == (self.radiance is None):
            found = "neither" if self.power is None else "both"
            problems.append(((), f"expected either `power` or `radiance`, got {found}"))
        if problems:
            fail(problems)
        return self


class RectKey(PanelKey):
    """A rectangle at one light frame."""

    width: Length = Field(description="Scene units.")
    height: Length = Field(description="Scene units.")
    up: Direction | None = Field(
        default=None,
        description="Direction in which the height runs, as far as the panel's own allows." + _AT_EVERY_KEY,
        json_schema_extra=default_text("at the first position the width is level, and it moves without turning"),
    )

    @property
    def sides(self) -> tuple[float, float]:
        """Width and height."""
        return self.width, self.height


class DiscKey(PanelKey):
    """A disc at one light frame."""

    radius: Length = Field(description="Scene units.")

    @property
    def sides(self) -> tuple[float, float]:
        """Its diameter, twice."""
        return 2 * self.radius, 2 * self.radius


def _consistent_keys(keys: Sequence[PanelKey]) -> Sequence[PanelKey]:
    """Check the keys of one panel against each other."""
    problems = key_problems(keys, "direction", "color", "up")
    problems += same_choice_problems(keys, ("target", "direction"), ("power", "radiance")) if keys else []
    if problems:
        fail(problems)
    return keys


class _PanelSource(PlacedLamp):
    """What rectangles and discs have."""

    two_sided: bool = Field(
        default=False, description="Whether the back shines as the front does. The `power` is that of both sides."
    )

    units: PanelUnits | None = Field(
        default=None, description=PANEL_UNITS, json_schema_extra=default_text('"W" or "W/(m2 sr)"')
    )

    power: Emission | None = beside_file("power of all its light, W unless `units` says otherwise", "by `radiance`")
    radiance: Emission | None = beside_file("radiance, W/(m2 sr) unless `units` says otherwise", "by `power`")
    color: Colour | None = beside_file("colour at all its positions", "1")
    direction: Direction | None = beside_file("the way its front faces at all positions", "by `target`")
    target: Point | None = beside_file("point that its front faces from all positions", "by `direction`")

    @model_validator(mode="after")
    def _units_of_the_strength(self) -> "_PanelSource":
        if not self._keys:
            return self
        strength = "power" if self._keys[0].power is not None else "radiance"
        known = UNITS_OF_PANELS[strength]
        if self.units is not None and self.units not in known:
            units = " or ".join(f'"{unit}"' for unit in known)
            fail([(("units",), f'expected {units}, as the keys give `{strength}`, got "{self.units}"')])
        return self

    @property
    def _keys(self) -> Sequence[PanelKey]:
        keys: Sequence[PanelKey] = self.keys  # type: ignore[attr-defined]  # of the subclasses
        return keys


class RectSource(_PanelSource):
    """A flat lamp, a window or a screen: a rectangle that shines evenly. It hides nothing."""

    type: Literal["rect"] = Field(description="Kind of source.")
    width: Length | None = beside_file("width at all its positions, scene units")
    height: Length | None = beside_file("height at all its positions, scene units")
    up: Direction | None = beside_file("direction in which the height runs", "that of the first position")
    keys: Annotated[tuple[RectKey, ...], AfterValidator(_consistent_keys), AfterValidator(one_of_both)] = Field(
        default=(),
        validate_default=True,
        strict=False,
        description=f"The panel at some frames; {KEYS}",
        json_schema_extra=ROWS,
    )


class DiscSource(_PanelSource):
    """A disc that shines evenly. It hides nothing."""

    type: Literal["disc"] = Field(description="Kind of source.")
    radius: Length | None = beside_file("radius at all its positions, scene units")
    keys: Annotated[tuple[DiscKey, ...], AfterValidator(_consistent_keys), AfterValidator(one_of_both)] = Field(
        default=(),
        validate_default=True,
        strict=False,
        description=f"The panel at some frames; {KEYS}",
        json_schema_extra=ROWS,
    )
