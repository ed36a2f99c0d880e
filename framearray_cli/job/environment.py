"""Environments: a panorama of light from infinitely far away, along key frames."""

from typing import Annotated, Literal

from pydantic import AfterValidator, Field

from framearray_cli.base.forms.table import Table, default_text, fail
from framearray_cli.base.units import FARTHEST

from .keys import MOST_EYES, key_problems
from .sourcetable import SourceTable
from .values import Colour, Emission, FileName


class EnvironmentKey(Table):
    """An environment at one light frame."""

    frame: int = Field(ge=0, lt=MOST_EYES, description="Number of the light position, counted from 0.")
    rotation: float = Field(
        default=0.0,
        ge=-FARTHEST,
        le=FARTHEST,
        description="Turn of the map about the up axis, degrees, clockwise as seen from above. At 0 its middle is "
        "north: -z in a scene with y up, y in one with z up.",
    )
    intensity: Emission = Field(
        default=(1.0, 1.0, 1.0), description="Factor of the map's radiance; one number means white."
    )
    color: Colour | None = Field(
        default=None,
        description="Multiplies `intensity` by channel; a temperature stands for the colour of a black body, of "
        "luminance 1. Given at every key of a source or at none.",
        json_schema_extra=default_text("1"),
    )


def _consistent_keys(keys: tuple[EnvironmentKey, ...]) -> tuple[EnvironmentKey, ...]:
    """Check the keys of one environment against each other."""
    if problems := key_problems(keys, "none", "color"):
        fail(problems)
    return keys


class EnvironmentSource(SourceTable):
    """Light from all directions, infinitely far away, by an image."""

    type: Literal["environment"] = Field(description="Kind of source.")
    file: FileName = Field(
        description="EXR, HDR or TIFF with a panorama of linear radiance, W/(m2 sr), twice as wide as high: straight "
        "up is the top row, north the middle column, east to the right of it."
    )
    keys: Annotated[tuple[EnvironmentKey, ...], AfterValidator(_consistent_keys)] = Field(
        min_length=1,
        strict=False,
        description="The environment at some frames; between them all its values change smoothly, before the first "
        "and after the last they stay as they are.",
    )

    @property
    def count(self) -> int:
        """Number of light positions that the keys reach."""
        return self.keys[-1].frame + 1
