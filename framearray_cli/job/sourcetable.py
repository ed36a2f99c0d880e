"""What all kinds of light source have: a group and an axis."""

import re
from typing import Annotated, TypeAlias

from pydantic import AfterValidator, Field, model_validator

from framearray_cli.base.forms.table import Table, default_text, fail
from framearray_cli.base.forms.words import shown

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


class SourceTable(Table):
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


_SIZES = {"point": "radius", "spot": "radius", "directional": "angle", "sun": "angle"}  # rectangles and discs have one


class ShownSource(SourceTable):
    """Sources with a shape that pictures may show."""

    visible: bool | None = Field(
        default=None,
        description="Whether eyes and mirrors see its shape, which needs a size (`radius` or `angle`). It hides "
        "nothing: its light is added to what lies behind it.",
        json_schema_extra=default_text("false"),
    )

    @model_validator(mode="after")
    def _has_a_shape(self) -> "ShownSource":
        kind = str(getattr(self, "type", ""))
        size, keys = _SIZES.get(kind), getattr(self, "keys", ())
        if not self.visible:
            return self
        if getattr(self, "ies", None) is not None:
            fail([(("visible",), "expected none beside `ies`, as the file does not say what the lamp looks like")])
        if size and (keys or kind == "sun") and not any(getattr(table, size, None) for table in (self, *keys)):
            what = f"`{size}` of at least one key above 0" if keys else f"`{size}` above 0"
            fail([(("visible",), f"expected {what}, as a source without size has no shape")])
        return self
