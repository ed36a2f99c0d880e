"""Light that changes over a movie: intensity and colour of groups and of ambient light, as constants or curves."""

from collections.abc import Mapping, Sequence
from itertools import pairwise
from typing import Annotated, Any, Generic, TypeAlias, TypeVar

import numpy as np
from pydantic import AfterValidator, Field, PlainValidator, TypeAdapter, WithJsonSchema

from framearray_cli.array.pictures import AS_RENDERED, Relight
from framearray_cli.array.places import percent
from framearray_cli.base.arrays import Float64, is_number
from framearray_cli.base.colour import TEMPERATURE_EXAMPLE, TEMPERATURE_SCHEMA, temperature_colour
from framearray_cli.base.forms.schema import Schema, toml_key
from framearray_cli.base.forms.table import Float3, Table, fail
from framearray_cli.base.forms.words import shown

STRONGEST = 1e6  # times the rendered light; half floats overflow before that
WIDEST = 1e5  # light positions
LONGEST_S = 1e6  # seconds; a later key frame is a typing error
Value = TypeVar("Value")
# Key frames (time, RGB); a time is in seconds or "50%" of the movie; a single key frame is a constant.
LightCurve: TypeAlias = tuple[tuple[float | str, Float3], ...]
_TIME = 'seconds, or a percentage such as "50%"'
_COLOR = f"a number or 3 numbers from 0 to {STRONGEST:.0f}, or {TEMPERATURE_EXAMPLE}"
_STRENGTH: Schema = {"type": "number", "minimum": 0, "maximum": STRONGEST}
_TIME_SCHEMA: Schema = {"anyOf": [{"type": "number", "minimum": 0}, {"type": "string"}], "x-words": _TIME}


def _check_time(value: Any) -> float | str:
    if isinstance(value, str) and percent(value) is not None:
        return value
    if not (is_number(value) and 0 <= value <= LONGEST_S):
        fail([((), f"expected {_TIME}, got {shown(value)}")])
    return float(value)


class _Key(Table, Generic[Value]):
    time: Annotated[float | str, PlainValidator(_check_time)]
    value: Value


def _keys(value: object, kind: Any) -> LightCurve:
    """Check a value of a kind, or a list of key frames."""
    if isinstance(value, list) and any(isinstance(item, dict) for item in value):
        found = TypeAdapter(list[_Key[kind]]).validate_python(value)
        return tuple((key.time, key.value) for key in found)
    return ((0.0, TypeAdapter(kind).validate_python(value, strict=True)),)


def _check_color(value: object) -> Float3:
    """Check one number, or three, or read a temperature."""
    if isinstance(value, str):
        try:
            found = temperature_colour(value)
        except ValueError as error:
            fail([((), str(error))])
        if found is not None:
            return found
    numbers: list[Any] = value if isinstance(value, list) else [value] * 3
    if len(numbers) != 3 or not all(is_number(x) and 0 <= x <= STRONGEST for x in numbers):
        fail([((), f"expected {_COLOR}, got {shown(value)}")])
    r, g, b = (float(x) for x in numbers)
    return r, g, b


def _curve(kind: Any, schema: Schema, words: str) -> tuple[PlainValidator, WithJsonSchema]:
    """Return check and schema of a value, or of a list of key frames with such values; `words` are for messages."""
    key = {
        "type": "object",
        "properties": {"time": _TIME_SCHEMA, "value": schema | {"x-words": words}},
        "required": ["time", "value"],
        "x-words": "a table with time and value",
    }
    either = [schema, {"type": "array", "items": key, "minItems": 1}]
    return PlainValidator(lambda value: _keys(value, kind)), WithJsonSchema({"anyOf": either, "x-words": words})


def _number(low: float, high: float) -> tuple[PlainValidator, WithJsonSchema]:
    """Return check and schema of curves of single numbers, which are stored as grey values."""
    kind = Annotated[float, Field(ge=low, le=high), AfterValidator(lambda value: (value,) * 3)]
    schema = {"type": "number", "minimum": low, "maximum": high}
    return _curve(kind, schema, f"a number from {low:.0f} to {high:.0f}")


_VECTOR = {"type": "array", "items": _STRENGTH, "minItems": 3, "maxItems": 3}
Intensity: TypeAlias = Annotated[LightCurve, *_number(0, STRONGEST)]
Width: TypeAlias = Annotated[LightCurve, *_number(1, WIDEST)]
Colour: TypeAlias = Annotated[
    LightCurve,
    *_curve(Annotated[Any, PlainValidator(_check_color)], {"anyOf": [_STRENGTH, _VECTOR, TEMPERATURE_SCHEMA]}, _COLOR),
]
Degrees: TypeAlias = Intensity  # bounds suit a thousand turns


class LightChange(Table):
    """The factor of the light of a group, or of ambient light: intensity times colour."""

    intensity: Intensity = Field(default=1.0, validate_default=True, description="Factor; 0 turns the light off.")
    color: Colour = Field(
        default=1.0,
        validate_default=True,
        description="Factor of red, green and blue, one for all, or a temperature in kelvin.",
    )


def relights(
    groups: Mapping[str, LightChange],
    ambient: LightChange | None,
    times: Sequence[float],
    problems: list[str],
) -> list[Relight]:
    """Return the light of each frame.

    Args:
        groups: changes by name of the group.
        times: of the frames, seconds, from 0; the last is 100%.
        problems: receives a line for each key frame out of order.
    """
    if not times or not (groups or ambient):
        return [AS_RENDERED] * len(times)
    by_group = {name: _factors(f"groups.{toml_key(name)}", change, times, problems) for name, change in groups.items()}
    of_ambient = _factors("ambient", ambient or LightChange(), times, problems)
    return [
        Relight(groups={name: factors[k] for name, factors in by_group.items()}, ambient=of_ambient[k])
        for k in range(len(times))
    ]


def _factors(key: str, change: LightChange, times: Sequence[float], problems: list[str]) -> list[Float3]:
    """Return intensity times colour at each time."""
    intensity = values_at(f"{key}.intensity", change.intensity, times, problems)
    color = values_at(f"{key}.color", change.color, times, problems)
    return [(r, g, b) for r, g, b in (intensity * color).tolist()]


def values_at(key: str, curve: LightCurve, times: Sequence[float], problems: list[str]) -> Float64:
    """Evaluate a curve at each time, (n, 3): linear between key frames, constant outside, of two at one time the later.

    Args:
        key: its place in the file.
        times: of the frames, seconds, from 0; the last is 100%.
        problems: receives a line for each key frame before its predecessor.
    """
    end = times[-1]
    seconds = [end * (percent(time) or 0.0) / 100 if isinstance(time, str) else time for time, _ in curve]
    typed = [
        f'"{time}", {s:g} s' if isinstance(time, str) else f"{s:g} s"
        for (time, _), s in zip(curve, seconds, strict=True)
    ]
    for k, (before, time) in enumerate(pairwise(seconds), start=1):
        if time < before:
            problems.append(f"{key}[{k}].time: expected at least the time before ({typed[k - 1]}), got {typed[k]}")
    channels = zip(*(value for _, value in curve), strict=True)
    return np.stack([np.interp(times, seconds, channel) for channel in channels], axis=-1)
