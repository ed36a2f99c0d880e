"""Types of values in a job, each with its check and its schema."""

import math
import os
import re
from collections.abc import Callable
from pathlib import Path
from typing import Annotated, Any, Literal, TypeAlias

from pydantic import PlainValidator, ValidationInfo, WithJsonSchema

from framearray_cli.base.colour import TEMPERATURE_EXAMPLE, TEMPERATURE_SCHEMA, temperature_colour
from framearray_cli.base.forms.table import Float3, fail
from framearray_cli.base.forms.words import range_text, shown
from framearray_cli.base.units import FARTHEST, MOST_EMISSION

Auto: TypeAlias = Literal["auto"]  # see render/automatic/choose.py


MOST_SIDE = 300  # points along a side of a grid; 300 x 300 are nearly MOST_EYES

MOST_SHIFT = 10.0  # of a lens, sides of the picture; whoever wants more turns the camera

SHORTEST = 1e-12  # scene units; shorter directions count as zero

LONGEST_PATH = 1000  # characters of a file name with its folders; systems take 1024, some 4096


def _number_problem(value: object, low: float, high: float, whole: bool) -> str | None:
    """Describe what is wrong with one number, if anything."""
    right_type = isinstance(value, int if whole else int | float) and not isinstance(value, bool)
    if right_type and low <= value <= high:  # type: ignore[operator]
        return None
    beyond = right_type and (value < -FARTHEST or value > FARTHEST)  # type: ignore[operator]
    wanted = f"from {low:g} to {high:g}" if beyond else range_text(low, high)
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
    """Check a file name and make it absolute."""
    if not isinstance(value, str | Path) or not str(value).strip() or "\0" in str(value):
        fail([((), f"expected a file name, got {shown(value)}")])
    if re.match(r"([A-Za-z]:|\\).*[\x00-\x1f]", str(value), re.DOTALL):
        remedy = "TOML reads a backslash in double quotes as an escape; write / for it, or use single quotes"
        fail([((), f"expected a file name, got {shown(value)}: {remedy}")])
    if len(str(value)) > LONGEST_PATH:
        fail([((), f"expected a file name of at most {LONGEST_PATH} characters, got one of {len(str(value))}")])
    job_file = (info.context or {}).get("job_file")
    return absolute(Path(value), job_file)


def absolute(path: Path, job_file: Path | None) -> Path:
    """Resolve a path against the folder of the job file, or the working directory.

    Links among its folders are followed, so that `..` means what it means to the file system. A link at the end stays:
    the textures of a scene lie next to the link, not next to its target.
    """
    whole = (Path(job_file).parent if job_file else Path.cwd()) / path
    if path.name in ("", ".."):
        return Path(os.path.realpath(whole))
    return Path(os.path.realpath(whole.parent)) / path.name


def _colour(value: object) -> tuple[Any, ...]:
    """Check factors by channel, or read a colour temperature."""
    if not isinstance(value, str):
        return _vector(3, 0.0, MOST_EMISSION, grey=True)(value)
    try:
        found = temperature_colour(value)
    except ValueError as error:
        fail([((), str(error))])
    if found is None:
        fail([((), f"expected a number, 3 numbers or {TEMPERATURE_EXAMPLE}, got {shown(value)}")])
    return found


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


def _memory_size(value: object) -> int:
    """Check an amount of memory: a number of bytes, or text such as "8 GiB"."""
    if isinstance(value, int) and not isinstance(value, bool) and value > 0:
        return value
    match = re.fullmatch(r"\s*([0-9.]{1,20})\s*([A-Za-z]{1,3})\s*", value) if isinstance(value, str) else None
    if match and match[2].lower() in _UNITS and match[1].count(".") <= 1 and match[1] != ".":
        size = int(float(match[1]) * _UNITS[match[2].lower()])
        if size > 0:
            return size
    fail([((), f'expected an amount of memory such as "8 GiB" or "500 MB", got {shown(value)}')])


MOST_HITS = 65000  # per pixel and frame; random streams distinguish 2^16

SHARES = (1 / 2, 1 / 3, 1 / 4, 1 / 5, 1 / 6, 1 / 7, 1 / 8)  # of pixels that get a hit in one frame


def _hits(value: object) -> float | Auto:
    """Check a number of hits per pixel: a whole number, a unit fraction down to 1/8, or "auto"."""
    if value == "auto":
        return "auto"
    if isinstance(value, int | float) and not isinstance(value, bool):
        if 1 <= value <= MOST_HITS and value == int(value):
            return float(value)
        for share in SHARES if 0 < value < 1 else ():
            if abs(value - share) < 1e-3:  # 0.333 means a third
                return share
    fail([((), f'expected a whole number from 1 to {MOST_HITS}, 1/2, 1/3, ... 1/8 or "auto", got {shown(value)}')])


MOST_N_R = 64  # more would not fit into memory


def _half_window(value: object) -> int | Auto:
    """Check N_r, or "auto"."""
    if value == "auto":
        return "auto"
    if isinstance(value, int) and not isinstance(value, bool) and 0 <= value <= MOST_N_R:
        return value
    fail([((), f'expected a whole number from 0 to {MOST_N_R} or "auto", got {shown(value)}')])


def _vector_schema(count: int, *, grey: bool = False, whole: bool = False, **bounds: float) -> WithJsonSchema:
    """Describe `count` numbers, or one grey number, in JSON Schema."""
    item = {"type": "integer" if whole else "number", **bounds}
    vector = {"type": "array", "items": item, "minItems": count, "maxItems": count}
    return WithJsonSchema({"anyOf": [item, vector]} if grey else vector)


Point: TypeAlias = Annotated[Float3, PlainValidator(_vector(3, -FARTHEST, FARTHEST)), _vector_schema(3)]

LensShift: TypeAlias = Annotated[
    tuple[float, float], PlainValidator(_vector(2, -MOST_SHIFT, MOST_SHIFT)), _vector_schema(2)
]

Direction: TypeAlias = Annotated[Float3, PlainValidator(_direction), _vector_schema(3)]

Emission: TypeAlias = Annotated[
    Float3, PlainValidator(_vector(3, 0.0, MOST_EMISSION, grey=True)), _vector_schema(3, grey=True, minimum=0)
]

Colour: TypeAlias = Annotated[
    Float3,
    PlainValidator(_colour),
    WithJsonSchema(
        {
            "anyOf": [
                {"type": "number", "minimum": 0},
                {"type": "array", "items": {"type": "number", "minimum": 0}, "minItems": 3, "maxItems": 3},
                TEMPERATURE_SCHEMA,
            ],
            "x-words": f"a number or 3 numbers of at least 0, or {TEMPERATURE_EXAMPLE}",
        }
    ),
]

GridSize: TypeAlias = Annotated[
    tuple[int, int],
    PlainValidator(_vector(2, 1, MOST_SIDE, whole=True)),
    _vector_schema(2, whole=True, minimum=1, maximum=MOST_SIDE),
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

HalfWindow: TypeAlias = Annotated[
    int | Auto,
    PlainValidator(_half_window),
    WithJsonSchema({"anyOf": [{"type": "integer", "minimum": 0, "maximum": MOST_N_R}, {"const": "auto"}]}),
]

MemorySize: TypeAlias = Annotated[
    int,
    PlainValidator(_memory_size),
    WithJsonSchema(
        {"anyOf": [{"type": "string"}, {"type": "integer", "minimum": 1}], "x-words": 'text such as "8 GiB"'}
    ),
]

FileName: TypeAlias = Annotated[
    Path, PlainValidator(_file_name), WithJsonSchema({"type": "string", "minLength": 1, "x-words": "a file name"})
]
