"""Sources with key frames, or with a file that has one light position per row."""

from collections.abc import Mapping
from typing import Any, Literal, NamedTuple

from pydantic import Field, ValidationInfo, model_validator

from framearray_cli.base.forms.table import default_text, fail
from framearray_cli.base.units import FARTHEST

from .sourcetable import ShownSource
from .values import FileName, Point


class RowForm(NamedTuple):
    """What rows of a file hold for one type of source, by the names of its keys.

    Attributes:
        vector: what x, y and z are.
        strengths: one of them is in every row, or beside `file`.
        vectors: further triples of numbers.
        numbers: single numbers.
    """

    vector: str
    strengths: tuple[str, ...]
    vectors: tuple[str, ...]
    numbers: tuple[str, ...]

    @property
    def values(self) -> tuple[str, ...]:
        """Keys that hold for all rows where they stand beside `file`."""
        return (*self.strengths, "color", *self.vectors, *self.numbers)


_AIM = ("direction", "target")
FORMS: Mapping[str, RowForm] = {
    "point": RowForm("position", ("intensity",), ("up",), ("radius",)),
    "directional": RowForm("direction", ("irradiance",), (), ("angle",)),
    "spot": RowForm("position", ("intensity",), (*_AIM, "up"), ("radius", "inner", "outer")),
    "rect": RowForm("position", ("power", "radiance"), (*_AIM, "up"), ("width", "height")),
    "disc": RowForm("position", ("power", "radiance"), _AIM, ("radius",)),
}

KEYS = "between them all its values change smoothly, before the first and after the last they stay as they are."
ROWS = default_text("the rows of `file`") | {"minItems": 1}


def beside_file(what: str, otherwise: str = "") -> Any:
    """A key of a source that holds for all rows of its file."""
    default = f"that of the file{', or ' if otherwise else ''}{otherwise}"
    return Field(
        default=None,
        description=f"Only beside `file`: {what}, if the file has none.",
        json_schema_extra=default_text(default),
    )


def one_of_both(keys: Any, info: ValidationInfo) -> Any:
    """Check that a source has either keys or a file."""
    has_file = info.data.get("file") is not None
    if has_file and keys:
        fail([((), "expected either `keys` or `file`, got both")])
    if not keys and not has_file and "file" in info.data:
        fail([((), "expected a list of tables, at least 1, got 0; give `keys` or `file`")])
    return keys


class PlacedSource(ShownSource):
    """Sources with key frames, or with a file that has one position per row."""

    file: FileName | None = Field(
        default=None,
        description="CSV, JSON, .npy, or .lp or .dome of reflectance imaging: one light position per row, instead of "
        "`keys`.",
        json_schema_extra=default_text("none"),
    )
    space: Literal["scene", "camera"] | None = Field(
        default=None,
        description='Axes of the positions, targets and directions. "camera": x to the right in the first picture, y '
        "up in it, z towards the camera, as reflectance imaging has them.",
        json_schema_extra=default_text('"scene"'),
    )

    @model_validator(mode="after")
    def _only_beside_file(self) -> "PlacedSource":
        if self.file is None:
            names = FORMS[self.type].values  # type: ignore[attr-defined]  # of the subclasses
            text = "expected it only beside `file`, as `keys` have their own"
            if problems := [((name,), text) for name in names if getattr(self, name) is not None]:
                fail(problems)
        return self

    @property
    def count(self) -> int:
        """Number of light positions that the keys reach."""
        return self.keys[-1].frame + 1 if self.keys else 0  # type: ignore[attr-defined]  # of the subclasses


class PlacedLamp(PlacedSource):
    """Such sources that are somewhere in the scene."""

    scale: float | None = Field(
        default=None,
        gt=0,
        le=FARTHEST,
        description="Scene units per unit of the positions.",
        json_schema_extra=default_text("1"),
    )
    center: Point | None = Field(
        default=None,
        description="Where the positions have their origin, in the coordinates of the scene file.",
        json_schema_extra=default_text('the origin; with space = "camera" the first target of the camera'),
    )
