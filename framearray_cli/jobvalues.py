"""What a job file is made of: points, directions, colours, sizes, file names, and the base of its tables.

Each kind checks itself and says in plain words what it expected and what it found.
"""

import json
import math
import os
import re
from collections.abc import Callable, Sequence
from functools import cache
from pathlib import Path
from typing import Annotated, Any, Literal, NoReturn, TypeAlias, TypeVar

from pydantic import BaseModel, ConfigDict, PlainValidator, TypeAdapter, ValidationError, ValidationInfo, WithJsonSchema
from pydantic_core import InitErrorDetails, PydanticCustomError

Place: TypeAlias = tuple[int | str, ...]  # keys and list positions from the value at hand down to the problem
Float3: TypeAlias = tuple[float, float, float]
Auto: TypeAlias = Literal["auto"]  # chosen from the camera path, see auto.py

FARTHEST = 1e12  # scene units; squares and cubes of it still fit in float32 (3e38)
BRIGHTEST = 1e20  # W/sr, W/m2 or radiance; times any reflectivity and over any squared distance it stays finite
SHORTEST = 1e-12  # scene units; a shorter direction is taken for zero
LONGEST_SHOWN = 40  # characters of a found value in a message
LONGEST_NAME = 1000  # characters of a file name with its folders; systems take 1024, some 4096


def fail(problems: Sequence[tuple[Place, str]]) -> NoReturn:
    """Raise every problem of one value at once, each at its own place below that value."""
    details = [
        InitErrorDetails(type=PydanticCustomError("job", "{text}", {"text": text}), loc=place, input=None)
        for place, text in problems
    ]
    raise ValidationError.from_exception_data("job", details)


def shown(value: object) -> str:
    """Describe a found value as it would stand in a TOML file, shortened."""
    if isinstance(value, dict):
        return "a table"
    if isinstance(value, list | tuple):
        if 0 < len(value) <= 4 and not any(isinstance(item, dict | list | tuple) for item in value):
            whole = f"[{', '.join(shown(item) for item in value)}]"
            if len(whole) <= LONGEST_SHOWN:
                return whole
        kind = "table" if value and isinstance(value[0], dict) else "value"
        return f"a list of {len(value)} {kind}{'s' if len(value) != 1 else ''}"
    if isinstance(value, bool | str):
        text = json.dumps(value[:1000] if isinstance(value, str) else value, ensure_ascii=False)
    elif isinstance(value, int) and value.bit_length() > 64:
        return "a number beyond 64 bits"
    else:
        text = str(value)
    return text if len(text) <= LONGEST_SHOWN else text[: LONGEST_SHOWN - 4] + "..." + text[-1]


# The reader of TOML takes time and memory by the square of this number.
MOST_PARTS = 6  # keys with dots between them; no file has more than 4
_KEY = r"""(?:[A-Za-z0-9_-]++|"[^"\n]*+"|'[^'\n]*+')"""
_LONG_KEY = re.compile(rf"(?:^|[\[{{,])[ \t]*+{_KEY}(?:[ \t]*+\.[ \t]*+{_KEY}){{{MOST_PARTS}}}", re.MULTILINE)


def long_key(text: str) -> str | None:
    """What is wrong with a TOML text whose keys have too many parts, or None."""
    found = _LONG_KEY.search(text)
    if not found:
        return None
    line = text.count("\n", 0, found.start()) + 1
    return f"line {line}: expected at most {MOST_PARTS} keys with dots between them, got more"


def between(low: float, high: float) -> str:
    """Say a range of numbers, "from 0 to 1"; bounds that only protect the arithmetic are left out."""
    if high >= FARTHEST:
        return "" if low <= -FARTHEST else f"of at least {number(low)}"
    return f"from {number(low)} to {number(high)}"


def number(value: float) -> str:
    """Write a bound: whole numbers in full where they are short."""
    return str(int(value)) if value == int(value) and abs(value) < FARTHEST else f"{value:g}"


def _number_problem(value: object, low: float, high: float, whole: bool) -> str | None:
    """Say what is wrong with one number, or nothing."""
    right_type = isinstance(value, int if whole else int | float) and not isinstance(value, bool)
    if right_type and low <= value <= high:  # type: ignore[operator]
        return None
    beyond = right_type and (value < -FARTHEST or value > FARTHEST)  # type: ignore[operator]
    wanted = f"from {low:g} to {high:g}" if beyond else between(low, high)
    kind = "a whole number" if whole else "a number"
    return f"expected {kind} {wanted}".rstrip() + f", got {shown(value)}"


def _vector(
    count: int, low: float, high: float, *, grey: bool = False, whole: bool = False
) -> Callable[[object], tuple[Any, ...]]:
    """Make a check for `count` numbers within bounds; with `grey` one number stands for all of them."""
    kind = "whole numbers" if whole else "numbers"

    def check(value: object) -> tuple[Any, ...]:
        if grey and not isinstance(value, list | tuple):
            if isinstance(value, str | dict):
                fail([((), f"expected a number or {count} numbers, got {shown(value)}")])
            if problem := _number_problem(value, low, high, whole):
                fail([((), problem)])
            value = [value] * count
        if not isinstance(value, list | tuple):
            fail([((), f"expected {count} {kind}, got {shown(value)}")])
        if len(value) != count:
            fail([((), f"expected {count} {kind}, got {len(value)}")])
        found = [((i,), _number_problem(item, low, high, whole)) for i, item in enumerate(value)]
        if problems := [(place, text) for place, text in found if text]:
            fail(problems)
        return tuple(item if whole else float(item) for item in value)

    return check


def _direction(value: object) -> tuple[Any, ...]:
    """Check three numbers that are not all zero."""
    vector = _vector(3, -FARTHEST, FARTHEST)(value)
    if math.hypot(*vector) < SHORTEST:
        fail([((), f"expected a direction, got the zero vector {shown(value)}")])
    return vector


def _file_name(value: object, info: ValidationInfo) -> Path:
    """Make a path absolute; a relative one starts at the folder of the job file."""
    if not isinstance(value, str | Path) or not str(value).strip() or "\0" in str(value):
        fail([((), f"expected a file name, got {shown(value)}")])
    if len(str(value)) > LONGEST_NAME:
        fail([((), f"expected a file name of at most {LONGEST_NAME} characters, got one of {len(str(value))}")])
    job_file = (info.context or {}).get("job_file")
    return absolute(Path(value), job_file)


def absolute(path: Path, job_file: Path | None) -> Path:
    """Resolve a path against the folder of the job file, or the working directory.

    Links on the way are followed, so that `..` means what the file system means; a link at the end
    stays, because a scene's textures lie beside its name.
    """
    whole = (Path(job_file).parent if job_file else Path.cwd()) / path
    if path.name in ("", ".."):
        return Path(os.path.realpath(whole))
    return Path(os.path.realpath(whole.parent)) / path.name


_UNITS = {
    "b": 1,
    "kib": 2**10,
    "mib": 2**20,
    "gib": 2**30,
    "tib": 2**40,
    "kb": 10**3,
    "mb": 10**6,
    "gb": 10**9,
    "tb": 10**12,
}


def _bytes(value: object) -> int:
    """Check an amount of memory: a number of bytes, or text such as "8 GiB"."""
    if isinstance(value, int) and not isinstance(value, bool) and value > 0:
        return value
    match = re.fullmatch(r"\s*([0-9.]{1,20})\s*([A-Za-z]{1,3})\s*", value) if isinstance(value, str) else None
    if match and match[2].lower() in _UNITS and match[1].count(".") <= 1 and match[1] != ".":
        size = int(float(match[1]) * _UNITS[match[2].lower()])
        if size > 0:
            return size
    fail([((), f'expected an amount of memory such as "8 GiB" or "500 MB", got {shown(value)}')])


MOST_HITS = 65000  # hits of one pixel in one frame; random streams tell 2^16 apart
SHARES = (1 / 2, 1 / 3, 1 / 4, 1 / 5, 1 / 6, 1 / 7, 1 / 8)  # of pixels that may get a hit in a frame


def _hits(value: object) -> float | Auto:
    """Check a number of hits a pixel: a whole number, a unit fraction down to 1/8, or "auto"."""
    if value == "auto":
        return "auto"
    if isinstance(value, int | float) and not isinstance(value, bool):
        if 1 <= value <= MOST_HITS and value == int(value):
            return float(value)
        for share in SHARES if 0 < value < 1 else ():
            if abs(value - share) < 1e-3:  # 0.333 means a third
                return share
    fail([((), f'expected a whole number from 1 to {MOST_HITS}, 1/2, 1/3, ... 1/8 or "auto", got {shown(value)}')])


LONGEST_WINDOW = 64  # frames to either side; more would not fit into memory


def _window(value: object) -> int | Auto:
    """Check N_r, or "auto"."""
    if value == "auto":
        return "auto"
    if isinstance(value, int) and not isinstance(value, bool) and 0 <= value <= LONGEST_WINDOW:
        return value
    fail([((), f'expected a whole number from 0 to {LONGEST_WINDOW} or "auto", got {shown(value)}')])


def _vector_schema(count: int, *, grey: bool = False, whole: bool = False, **bounds: float) -> WithJsonSchema:
    """Describe `count` numbers, or one grey number, in JSON Schema."""
    item = {"type": "integer" if whole else "number", **bounds}
    vector = {"type": "array", "items": item, "minItems": count, "maxItems": count}
    return WithJsonSchema({"anyOf": [item, vector]} if grey else vector)


Point: TypeAlias = Annotated[Float3, PlainValidator(_vector(3, -FARTHEST, FARTHEST)), _vector_schema(3)]
Direction: TypeAlias = Annotated[Float3, PlainValidator(_direction), _vector_schema(3)]
Emission: TypeAlias = Annotated[
    Float3, PlainValidator(_vector(3, 0.0, BRIGHTEST, grey=True)), _vector_schema(3, grey=True, minimum=0)
]
Reflectivity: TypeAlias = Annotated[
    Float3, PlainValidator(_vector(3, 0.0, 1.0, grey=True)), _vector_schema(3, grey=True, minimum=0, maximum=1)
]
Size: TypeAlias = Annotated[
    tuple[int, int],
    PlainValidator(_vector(2, 1, 16384, whole=True)),
    _vector_schema(2, whole=True, minimum=1, maximum=16384),
]
HitCount: TypeAlias = Annotated[
    int | float | Auto,
    PlainValidator(_hits),
    WithJsonSchema(
        {
            "anyOf": [
                {"type": "number", "minimum": 0.125, "maximum": MOST_HITS, "x-words": "a number"},
                {"const": "auto"},
            ]
        }
    ),
]
Window: TypeAlias = Annotated[
    int | Auto,
    PlainValidator(_window),
    WithJsonSchema({"anyOf": [{"type": "integer", "minimum": 0, "maximum": LONGEST_WINDOW}, {"const": "auto"}]}),
]
Bytes: TypeAlias = Annotated[
    int,
    PlainValidator(_bytes),
    WithJsonSchema(
        {"anyOf": [{"type": "string"}, {"type": "integer", "minimum": 1}], "x-words": 'text such as "8 GiB"'}
    ),
]
FileName: TypeAlias = Annotated[
    Path, PlainValidator(_file_name), WithJsonSchema({"type": "string", "minLength": 1, "x-words": "a file name"})
]


class Table(BaseModel):
    """Base of all tables: unknown keys, loose types and non-finite numbers are errors."""

    model_config = ConfigDict(frozen=True, extra="forbid", strict=True, allow_inf_nan=False)


_Table = TypeVar("_Table", bound=Table)


def fill(table: Table, key: str, value: object) -> None:
    """Set what the file left out; only while a table is being made."""
    object.__setattr__(table, key, value)


def changed(table: _Table, **values: object) -> _Table:
    """Copy a table with other values, each checked as one of a file is; `model_copy` takes any name and any value.

    Only single values are checked: a report measures settings that do not go together in a file. A value that is a
    table has been checked already; its own rules on what goes together would refuse such settings.

    Raises:
        ValidationError: a key has no such value.
        TypeError: a key holds another table.
        KeyError: there is no such key.
    """
    for key, value in values.items():
        if not isinstance(value, Table):
            _value_check(type(table), key).validate_python(value, strict=True)
        elif not isinstance(value, type(getattr(table, key))):
            raise TypeError(f"{key}: expected a {type(getattr(table, key)).__name__}, got a {type(value).__name__}")
    return table.model_copy(update=values)


@cache
def _value_check(kind: type[Table], key: str) -> TypeAdapter[Any]:
    field = kind.model_fields[key]
    bounds = tuple(field.metadata)
    checked: Any = Annotated[(field.annotation, *bounds)] if bounds else field.annotation
    return TypeAdapter(checked)


def computed(text: str) -> dict[str, Any]:
    """Describe a default that depends on other keys; it replaces the stored default in schema and docs."""
    return {"x-default": text}
