"""Key frames of cameras and light sources, and the base of all light sources.

A source with key frames declares each value once, in the class of its keys: `with_rows` makes a key of the source from
it, which applies to all rows of the `file` of positions.
"""

import re
from collections.abc import Sequence
from itertools import pairwise
from math import hypot
from typing import Annotated, Any, ClassVar, Generic, Literal, TypeAlias, TypeVar, get_args

from pydantic import AfterValidator, Field, ValidationInfo, create_model

from framearray_cli.base.forms.table import Float3, Problems, Table, fail, optional, refuse, value_type
from framearray_cli.base.forms.words import shown

from .values import FileName

MOST_EYES = 100_000  # an hour at 24 frames per second; more is a typing error
OPPOSITE = 1 - 1e-8  # cosine of 0.01 degrees: between directions closer to opposite there is no shortest turn
MAIN_AXIS = "light"  # axis of the sources that name none
REST_GROUP = "main"  # group of the sources that name none, where others do
UNITS = {  # of strengths, by the key
    "intensity": ("W/sr", "cd", "lm"),
    "irradiance": ("W/m2", "lux"),
    "power": ("W", "lm"),
    "radiance": ("W/(m2 sr)", "cd/m2"),
}


class KeyFrame(Table):
    """A table of values at one frame."""

    frame: int = Field(ge=0, lt=MOST_EYES)


def key_problems(keys: Sequence[KeyFrame], frames: int, directions: str, *names: str) -> Problems:
    """Check keys against each other: their order, values that only some of them give, turns by half a circle.

    Args:
        frames: number of frames, beyond which no key may lie; 0: the last key is the last frame.
    """
    for i, (before, key) in enumerate(pairwise(keys), start=1):
        if key.frame <= before.frame:
            yield (i, "frame"), f"expected more than {before.frame}, the frame of the key before, got {key.frame}"
        a, b = getattr(before, directions, None), getattr(key, directions, None)
        if a and b and key.frame > before.frame + 1 and _opposite(a, b):  # neighbours have nothing between them
            text = "expected less than half a turn from the key before, got the opposite direction; add a key between"
            yield (i, directions), text
    for name in names:
        given = [i for i, key in enumerate(keys) if getattr(key, name, None) is not None]
        if given and len(given) < len(keys):
            missing = next(i for i in range(len(keys)) if i not in given)
            yield (missing, name), f"missing; keys[{given[0]}] gives it, so every key of this list must"
    yield from late_key_problems(keys, frames)


def _opposite(a: Float3, b: Float3) -> bool:
    return a[0] * b[0] + a[1] * b[1] + a[2] * b[2] <= -hypot(*a) * hypot(*b) * OPPOSITE


def late_key_problems(keys: Sequence[KeyFrame], frames: int) -> Problems:
    """Check that no key lies beyond the last frame; with `frames` = 0 the last key is the last frame."""
    for i, key in enumerate(keys):
        if frames and key.frame >= frames:
            yield (i, "frame"), f"expected at most {frames - 1} (frames = {frames}), got {key.frame}"


def keys_or_file(keys: Any, info: ValidationInfo) -> Any:
    """Check that a table has either `keys` or `file`."""
    has_file = info.data.get("file") is not None
    if has_file and keys:
        fail([((), "expected either `keys` or `file`, got both")])
    if not keys and not has_file and "file" in info.data:
        fail([((), "expected a list of tables, at least 1, got 0; give `keys` or `file`")])
    return keys


class LightKey(KeyFrame):
    """Key frame of a light source: each value has one declaration, for keys and for rows of a file.

    Attributes:
        place: key for the position or direction of the light, which every row of a file has.
        either: pairs of keys of which each key frame has one, and all key frames of a source the same.
        frame: Number of the light position, counted from 0.
    """

    place: ClassVar[str] = ""
    either: ClassVar[tuple[tuple[str, str], ...]] = ()

    def problems(self) -> Problems:
        """Check the values of this key against each other."""
        for one, other in self.either:
            given = (getattr(self, one) is not None) + (getattr(self, other) is not None)
            if given != 1:
                yield (), f"expected either `{one}` or `{other}`, got {'both' if given else 'neither'}"
        target = getattr(self, "target", None)
        if target is not None and target == getattr(self, "position", None):
            yield ("target",), "expected a point away from `position`, got the same point"

    @classmethod
    def row_values(cls) -> list[str]:
        """Names of all values that a row of a file may have next to its place."""
        return [name for name in cls.model_fields if name not in ("frame", cls.place)]


Key = TypeVar("Key", bound=LightKey)
_Keys = TypeVar("_Keys", bound=Sequence[LightKey])


def consistent_keys(keys: _Keys) -> _Keys:
    """Check the keys of one light source against each other."""
    if not keys:
        return keys
    kind = type(keys[0])
    chosen = [one if getattr(keys[0], one) is not None else other for one, other in kind.either]
    free = {name for pair in kind.either for name in pair} - set(chosen)
    names = [name for name, field in kind.model_fields.items() if field.default is None and name not in free]
    refuse(key_problems(keys, 0, "direction", *names))
    return keys


_GROUP_NAME = "[A-Za-z0-9_][A-Za-z0-9_-]{0,39}"
_TAKEN = ("ambient", "background", "layers", MAIN_AXIS)  # parts of file names, and the first axis


def _group_name(name: str) -> str:
    """Check the name of a group or an axis, which becomes part of file names."""
    if not re.fullmatch(_GROUP_NAME, name):
        fail([((), f'expected at most 40 letters, digits, "_" or "-", got {shown(name)}')])
    if name in _TAKEN:
        fail([((), f"expected another name, as {shown(name)} is reserved")])
    return name


GroupName: TypeAlias = Annotated[
    str, AfterValidator(_group_name), Field(json_schema_extra={"pattern": f"^{_GROUP_NAME}$", "x-words": "a name"})
]


def units(strengths: str, default: str) -> Any:
    """Declare the key for the unit of a strength."""
    lumens = "; lumens count all light of a lamp" if "intensity" in strengths else ""
    return optional(default, description=f"Unit of {strengths}{lumens}. A watt of light is 683 lumens.")


class SourceTable(Table):
    """Keys of all sources.

    Attributes:
        type: Kind of source.
        keys: The source at some frames. Values change smoothly between keys, and are constant before the first and
            after the last. Each value is given at every key or at none.
        group: Name of a group. If any source has one, the program stores the light of every group separately, so that
            its strength and colour can change in the finished array; sources without a group are the group "main".
        axis: Name of a light axis of its own, for all sources of the group: N_c x (N_1 + N_2) images then serve N_c x
            N_1 x N_2 pictures. Key frames count along it.
    """

    type: str
    group: GroupName | None = optional("none")
    axis: GroupName | None = optional("the axis of all other sources")

    @property
    def key_frames(self) -> Sequence[LightKey]:
        """Key frames; none for positions that follow from other keys."""
        return getattr(self, "keys", ())

    @property
    def count(self) -> int:
        """Number of light positions that the source determines; 0 if it has none of its own."""
        return self.key_frames[-1].frame + 1 if self.key_frames else 0

    def _unit_problems(self, strength: str) -> Problems:
        """Check that `units` belong to the strength that the source has."""
        unit, known = getattr(self, "units", None), UNITS[strength]
        if unit is not None and unit not in known:
            yield ("units",), f'expected {" or ".join(map(shown, known))} with `{strength}`, got "{unit}"'


class ShownSource(SourceTable):
    """Sources with a shape that pictures may show.

    Attributes:
        extent: key for the size of the shape; "" if every such source has a size.
        visible: Make the shape of the source visible to eyes and mirrors; needs a size (`radius` or `angle`). The shape
            never occludes: its light is added to the light from behind it.
    """

    extent: ClassVar[str] = ""

    visible: bool | None = optional("false")

    def problems(self) -> Problems:
        """Check that a visible source has a shape."""
        sized = any(getattr(table, self.extent, None) for table in (self, *self.key_frames))
        if self.visible and getattr(self, "ies", None) is not None:
            yield ("visible",), "expected none next to `ies`, as the file has no shape of the lamp"
        elif self.visible and self.extent and not sized and getattr(self, "file", None) is None:
            size = f"`{self.extent}`{' of at least one key' if self.key_frames else ''} above 0"
            yield ("visible",), f"expected {size}, as a source without size has no shape"


class PlacedSource(ShownSource, Generic[Key]):
    """Sources with key frames, or with a file that has one position per row.

    Attributes:
        file: CSV, JSON or .npy: one light position per row, instead of `keys`.
        space: Axes of the positions, targets and directions. "camera": x to the right in the first picture, y up in it,
            z towards the camera, as in reflectance imaging.
    """

    file: FileName | None = optional("none")
    space: Literal["scene", "camera"] | None = optional('"scene"')
    keys: Annotated[tuple[Key, ...], AfterValidator(consistent_keys), AfterValidator(keys_or_file)] = optional(
        "the rows of `file`", (), {"minItems": 1}, strict=False, validate_default=True
    )

    def problems(self) -> Problems:
        """Check that values of keys stand next to the source only if a file replaces its keys."""
        yield from super().problems()
        for name in key_type(type(self)).row_values() if self.file is None else ():
            if getattr(self, name, None) is not None:
                yield (name,), "expected it only next to `file`, as `keys` have their own"


def key_type(source: type[SourceTable]) -> type[LightKey]:
    """Return the class of a source's keys."""
    kind: type[LightKey] = get_args(source.model_fields["keys"].annotation)[0]
    return kind


_Source = TypeVar("_Source", bound=PlacedSource[Any])


def with_rows(source: type[_Source]) -> type[_Source]:
    """Give a source the values of its keys, for all rows of its file."""
    key, values = key_type(source), dict[str, Any]()
    for name in key.row_values():
        field = key.model_fields[name]
        extra = field.json_schema_extra if isinstance(field.json_schema_extra, dict) else {}
        own = "" if field.is_required() else f", or {extra.get('x-default', field.default)}"
        text = f"Only next to `file`: `{name}` of all its positions, as in keys, if its rows have none."
        values[name] = (value_type(key, name) | None, optional(f"the rows of `file`{own}", description=text))
    made: type[_Source] = create_model(
        source.__name__, __base__=source, __module__=source.__module__, __doc__=source.__doc__, **values
    )
    return made
