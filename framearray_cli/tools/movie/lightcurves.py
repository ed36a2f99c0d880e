"""Light that changes over a movie: intensity and colour of groups and of ambient light, as constants or curves."""

from bisect import bisect_right
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from itertools import pairwise
from typing import Annotated, Any, Generic, TypeAlias, TypeVar

from pydantic import Field, PlainValidator, ValidationError, WithJsonSchema

from framearray_cli.array.pictures import AS_RENDERED, Relight
from framearray_cli.array.places import percent
from framearray_cli.base.colour import TEMPERATURE_EXAMPLE, TEMPERATURE_SCHEMA, temperature_colour
from framearray_cli.base.forms.schema import toml_key
from framearray_cli.base.forms.table import Float3, Place, Table, fail
from framearray_cli.base.forms.words import shown

STRONGEST = 1e6  # times the rendered light; half floats overflow before that
WIDEST = 1e5  # light positions
LONGEST_NAME = 1000  # letters
LONGEST_S = 1e6  # seconds; a later key frame is a typing error
Value = TypeVar("Value", Float3, str)
_COLOR_WANTED = f"a number or 3 numbers from 0 to {STRONGEST:.0f}, or {TEMPERATURE_EXAMPLE}"
_FILE_WANTED = "the name of a file"
_STRENGTH_SCHEMA: dict[str, Any] = {"type": "number", "minimum": 0, "maximum": STRONGEST}
_VECTOR_SCHEMA = {"type": "array", "items": _STRENGTH_SCHEMA, "minItems": 3, "maxItems": 3}
TimedValues: TypeAlias = tuple[list[float], list[Float3]]  # times in seconds, in order, and values


@dataclass(frozen=True, slots=True)
class LightCurve:
    """Key frames (time, RGB); a time is in seconds or "50%" of the movie; a single key frame is a constant."""

    keys: tuple[tuple[float | str, Float3], ...]


@dataclass(frozen=True, slots=True)
class FileCurve:
    """Key frames whose values are files.

    Attributes:
        files: one per key frame.
        places: a place among the files, from 0; between two key frames both count.
    """

    files: tuple[str, ...]
    places: LightCurve


@dataclass(frozen=True, slots=True)
class _Kind(Generic[Value]):
    """A kind of value in a curve.

    Attributes:
        check: of one value, at its place in the key.
        wanted: how messages name it.
        instead: replacement of a broken one.
    """

    check: Callable[[object, Place], Value]
    wanted: str
    instead: Value


def _keys(value: object, kind: _Kind[Value]) -> tuple[tuple[float | str, Value], ...]:
    """Check a value, or a list of key frames."""
    if not (isinstance(value, list) and any(isinstance(item, dict) for item in value)):
        return ((0.0, kind.check(value, ())),)
    problems: list[tuple[Place, str]] = []
    keys = [_key(item, kind, k, problems) for k, item in enumerate(value)]
    if problems:
        fail(problems)
    return tuple(keys)


def _key(item: object, kind: _Kind[Value], k: int, problems: list[tuple[Place, str]]) -> tuple[float | str, Value]:
    """Check one key frame."""
    value = kind.instead
    if not isinstance(item, dict):
        problems.append(((k,), f"expected a table with time and value, got {shown(item)}"))
        return 0.0, value
    for name in item.keys() - {"time", "value"}:
        problems.append(((k, name), "unknown key; known here: time, value"))
    time: Any = item.get("time")
    if not _is_time(time):
        problems.append(((k, "time"), f'expected seconds, or a percentage such as "50%", {_found(item, "time")}'))
        time = 0.0
    if "value" not in item:
        problems.append(((k, "value"), f"missing; expected {kind.wanted}"))
    else:
        try:
            value = kind.check(item["value"], (k, "value"))
        except ValidationError as error:
            problems += [(detail["loc"], detail["msg"]) for detail in error.errors()]
    return time if isinstance(time, str) else float(time), value


def _is_time(time: Any) -> bool:
    if isinstance(time, str):
        return percent(time) is not None
    return isinstance(time, int | float) and not isinstance(time, bool) and 0 <= time <= LONGEST_S


def _found(item: Mapping[str, object], key: str) -> str:
    return f"got {shown(item[key])}" if key in item else "got none"


def _number(low: float, high: float) -> _Kind[Float3]:
    """One number within bounds, as a grey value."""
    wanted = f"a number from {low:.0f} to {high:.0f}"

    def check(value: object, place: Place) -> Float3:
        if not (isinstance(value, int | float) and not isinstance(value, bool) and low <= value <= high):
            fail([(place, f"expected {wanted}, got {shown(value)}")])
        return (float(value),) * 3

    return _Kind(check, wanted, (0.0, 0.0, 0.0))


def _check_color(value: object, place: Place) -> Float3:
    """Check one number, or three, or read a temperature."""
    if isinstance(value, str):
        try:
            found = temperature_colour(value)
        except ValueError as error:
            fail([(place, str(error))])
        if found is not None:
            return found
    numbers: list[Any] = value if isinstance(value, list) else [value] * 3
    good = [isinstance(x, int | float) and not isinstance(x, bool) and 0 <= x <= STRONGEST for x in numbers]
    if len(numbers) != 3 or not all(good):
        fail([(place, f"expected {_COLOR_WANTED}, got {shown(value)}")])
    r, g, b = (float(x) for x in numbers)
    return r, g, b


def _check_file(value: object, place: Place) -> str:
    if not (isinstance(value, str) and 0 < len(value) <= LONGEST_NAME):
        fail([(place, f"expected {_FILE_WANTED}, got {shown(value)}")])
    return value


_COLOR = _Kind(_check_color, _COLOR_WANTED, (0.0, 0.0, 0.0))
_FILE = _Kind(_check_file, _FILE_WANTED, "")
_INTENSITY, _WIDTH = _number(0, STRONGEST), _number(1, WIDEST)


def _check_files(value: object) -> FileCurve:
    keys = _keys(value, _FILE)
    places = tuple((time, (float(k),) * 3) for k, (time, _) in enumerate(keys))
    return FileCurve(tuple(file for _, file in keys), LightCurve(places))


def _schema(value: dict[str, Any]) -> WithJsonSchema:
    time = {"anyOf": [{"type": "number", "minimum": 0}, {"type": "string"}]}
    key = {"type": "object", "properties": {"time": time, "value": value}, "required": ["time", "value"]}
    return WithJsonSchema({"anyOf": [value, {"type": "array", "items": key, "minItems": 1}]})


Intensity: TypeAlias = Annotated[
    LightCurve, PlainValidator(lambda value: LightCurve(_keys(value, _INTENSITY))), _schema(_STRENGTH_SCHEMA)
]
Colour: TypeAlias = Annotated[
    LightCurve,
    PlainValidator(lambda value: LightCurve(_keys(value, _COLOR))),
    _schema({"anyOf": [_STRENGTH_SCHEMA, _VECTOR_SCHEMA, TEMPERATURE_SCHEMA]}),
]
Width: TypeAlias = Annotated[
    LightCurve,
    PlainValidator(lambda value: LightCurve(_keys(value, _WIDTH))),
    _schema({"type": "number", "minimum": 1, "maximum": WIDEST}),
]
Files: TypeAlias = Annotated[
    FileCurve, PlainValidator(_check_files), _schema({"type": "string", "minLength": 1, "maxLength": LONGEST_NAME})
]

Degrees: TypeAlias = Intensity  # bounds suit a thousand turns

ONE = LightCurve(((0.0, (1.0, 1.0, 1.0)),))
NOT_TURNED = LightCurve(((0.0, (0.0, 0.0, 0.0)),))


class LightChange(Table):
    """The factor of the light of a group, or of ambient light: intensity times colour."""

    intensity: Intensity = Field(default=ONE, description="Factor; 0 turns the light off.")
    color: Colour = Field(
        default=ONE, description="Factor of red, green and blue, one for all, or a temperature in kelvin."
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
    intensity = _timed(f"{key}.intensity", change.intensity, times[-1], problems)
    color = _timed(f"{key}.color", change.color, times[-1], problems)
    found = []
    for time in times:
        r, g, b = (float(x * y) for x, y in zip(value_at(intensity, time), value_at(color, time), strict=True))
        found.append((r, g, b))
    return found


def numbers_at(key: str, curve: LightCurve, times: Sequence[float], problems: list[str]) -> list[float]:
    """Return the value of a curve of single numbers at each time.

    Args:
        key: its place in the file.
        times: of the frames, seconds, from 0; the last is 100%.
        problems: receives a line for each key frame out of order.
    """
    timed = _timed(key, curve, times[-1], problems)
    return [value_at(timed, time)[0] for time in times]


def _timed(key: str, curve: LightCurve, end: float, problems: list[str]) -> TimedValues:
    """Convert times to seconds; a key frame before its predecessor is a problem."""
    seconds = [end * (percent(time) or 0.0) / 100 if isinstance(time, str) else time for time, _ in curve.keys]
    typed = [
        f'"{time}", {s:g} s' if isinstance(time, str) else f"{s:g} s"
        for (time, _), s in zip(curve.keys, seconds, strict=True)
    ]
    for k, (before, time) in enumerate(pairwise(seconds), start=1):
        if time < before:
            problems.append(f"{key}[{k}].time: expected at least the time before ({typed[k - 1]}), got {typed[k]}")
    return seconds, [value for _, value in curve.keys]


def value_at(curve: TimedValues, time: float) -> Float3:
    """Evaluate a curve: linear between key frames, constant outside; of two at one time the later one counts."""
    times, values = curve
    k = bisect_right(times, time)
    if k in (0, len(times)):
        return values[max(k - 1, 0)]
    share = (time - times[k - 1]) / (times[k] - times[k - 1])
    r, g, b = (x + (y - x) * share for x, y in zip(values[k - 1], values[k], strict=True))
    return r, g, b
