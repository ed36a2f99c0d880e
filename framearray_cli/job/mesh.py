"""Surfaces of the scene that shine: all triangles of a material."""

from collections.abc import Sequence
from typing import Annotated, Literal

from pydantic import AfterValidator, Field, model_validator

from framearray_cli.base.forms.table import Place, Table, default_text, fail

from .keys import MOST_EYES, key_problems
from .sourcetable import SourceTable
from .units import RadianceUnits
from .values import Colour, Emission

_AT_EVERY_KEY = " Given at every key of a source or at none."


class MeshKey(Table):
    """How strongly a material shines at one light frame."""

    frame: int = Field(ge=0, lt=MOST_EYES, description="Number of the light position, counted from 0.")
    intensity: Emission | None = Field(
        default=None,
        description="Multiplies the emission that the scene file gives the material, with its texture; one number "
        "serves all channels." + _AT_EVERY_KEY,
        json_schema_extra=default_text("1; none beside `radiance`"),
    )
    radiance: Emission | None = Field(
        default=None,
        description="Radiance, W/(m2 sr) unless `units` says otherwise, everywhere the same, in place of what the "
        "scene file says; one number means white." + _AT_EVERY_KEY,
        json_schema_extra=default_text("that of the scene file"),
    )
    color: Colour | None = Field(
        default=None,
        description="Multiplies the strength by channel; a temperature stands for the colour of a black body, of "
        "luminance 1." + _AT_EVERY_KEY,
        json_schema_extra=default_text("1"),
    )


def _consistent_keys(keys: Sequence[MeshKey]) -> Sequence[MeshKey]:
    """Check the keys of one source against each other."""
    problems: list[tuple[Place, str]] = key_problems(keys, "", "intensity", "radiance", "color")
    text = "expected either `intensity` or `radiance`, got both"
    problems += [((k,), text) for k, key in enumerate(keys) if None not in (key.intensity, key.radiance)]
    if problems:
        fail(problems)
    return keys


class MeshSource(SourceTable):
    """A lamp, a screen or a window of the scene: all surfaces of a material shine, and are seen to."""

    type: Literal["mesh"] = Field(description="Kind of source.")
    material: str = Field(min_length=1, description="Name of the material in the scene file.")
    two_sided: bool = Field(
        default=True,
        description="Whether both sides of the surfaces shine. If not, that from which their corners run "
        "counter-clockwise.",
    )
    units: RadianceUnits | None = Field(
        default=None,
        description="Unit of every `radiance` of the source, and of the emission in the scene file. A watt of light is "
        "683 lumens.",
        json_schema_extra=default_text('"W/(m2 sr)"'),
    )
    keys: Annotated[tuple[MeshKey, ...], AfterValidator(_consistent_keys)] = Field(
        default=(),
        strict=False,
        description="The source at some frames; between them all its values change smoothly, before the first and "
        "after the last they stay as they are.",
        json_schema_extra=default_text("as the scene file says, at every light position"),
    )

    @model_validator(mode="after")
    def _no_empty_name(self) -> "MeshSource":
        if not self.material.strip():
            fail([(("material",), "expected the name of a material, got blanks")])
        return self

    @property
    def count(self) -> int:
        """Number of light positions that the keys reach."""
        return self.keys[-1].frame + 1 if self.keys else 1

    @property
    def has_radiance(self) -> bool:
        """Whether the keys replace the emission of the scene file."""
        return any(key.radiance is not None for key in self.keys)
