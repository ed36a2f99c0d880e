"""Base of the tables of job files and movie path files, and how their validators report problems."""

import inspect
import re
from collections.abc import Iterable
from functools import cache
from typing import Annotated, Any, NoReturn, Self, TypeAlias, TypeVar

from pydantic import (
    BaseModel,
    ConfigDict,
    Field,
    GetJsonSchemaHandler,
    ModelWrapValidatorHandler,
    TypeAdapter,
    ValidationError,
    model_validator,
)
from pydantic_core import CoreSchema, InitErrorDetails, PydanticCustomError

Place: TypeAlias = tuple[int | str, ...]  # keys and list positions, from a value down to its problem
Problems: TypeAlias = Iterable[tuple[Place, str]]  # of one value, each with its place below it
Float3: TypeAlias = tuple[float, float, float]
_Model = TypeVar("_Model", bound=BaseModel)


def fail(problems: Problems) -> NoReturn:
    """Raise every problem of one value at once, each with its place below that value."""
    raise ValidationError.from_exception_data("job", _details(problems))


def refuse(problems: Problems) -> None:
    """Raise every problem of one value at once, if there are any."""
    if found := list(problems):
        fail(found)


def _details(problems: Problems) -> list[InitErrorDetails]:
    return [
        InitErrorDetails(type=PydanticCustomError("job", "{text}", {"text": text}), loc=place, input=None)
        for place, text in problems
    ]


def check_with(problems: Problems, value: object, check: ModelWrapValidatorHandler[_Model]) -> _Model:
    """Check a table, and raise its problems together with some that were found before, in a validator that wraps."""
    try:
        table = check(value)
    except ValidationError as error:
        found = [
            InitErrorDetails(
                type=PydanticCustomError("job", "{text}", each["ctx"]) if each["type"] == "job" else each["type"],
                loc=each["loc"],
                input=each["input"],
                ctx=each.get("ctx", {}),
            )
            for each in error.errors(include_url=False)
        ]
        raise ValidationError.from_exception_data("job", [*found, *_details(problems)]) from error
    refuse(problems)
    return table


def described(docstring: str | None) -> tuple[str, dict[str, str]]:
    """Split the docstring of a class into the part before its attributes, and a text for each attribute."""
    text, _, attributes = inspect.cleandoc(docstring or "").partition("\n\nAttributes:\n")
    found = re.findall(r"^    ([\w, ]+): (.*(?:\n {8}.*)*)", attributes, re.MULTILINE)
    return text, {name: " ".join(words.split()) for names, words in found for name in names.split(", ")}


class Table(BaseModel):
    """Base of all tables: unknown keys, loose types and non-finite numbers are errors.

    The docstring of a table describes its keys, also for schema and docs.
    """

    model_config = ConfigDict(frozen=True, extra="forbid", strict=True, allow_inf_nan=False)

    def problems(self) -> Problems:
        """Check the keys of the table against each other."""
        return ()

    @model_validator(mode="after")
    def _check(self) -> Self:
        refuse(self.problems())
        return self

    @classmethod
    def __get_pydantic_json_schema__(cls, core_schema: CoreSchema, handler: GetJsonSchemaHandler) -> dict[str, Any]:
        """Describe the table, and each key whose declaration has no description, by the docstrings of its classes."""
        found = handler(core_schema)
        table = handler.resolve_ref_schema(found)
        words = {name: text for kind in reversed(cls.__mro__) for name, text in described(kind.__doc__)[1].items()}
        table["description"] = described(cls.__doc__)[0]
        for name, schema in table["properties"].items():
            if name in words:
                schema.setdefault("description", words[name])
        return found


_Table = TypeVar("_Table", bound=Table)


def fill(table: Table, key: str, value: object) -> None:
    """Set a key that the file leaves out; only for validators, as tables are frozen."""
    object.__setattr__(table, key, value)


def changed(table: _Table, **values: object) -> _Table:
    """Copy a table with other values, each checked as if it came from a file; `model_copy` checks nothing.

    Rules between keys do not apply: a report measures combinations of settings that no file may have. A value that is
    a table was checked when it was made.

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
    return TypeAdapter(value_type(kind, key))


def value_type(kind: type[Table], key: str) -> Any:
    """Return the type of a key with its checks and bounds."""
    field = kind.model_fields[key]
    return Annotated[(field.annotation, *field.metadata)] if field.metadata else field.annotation


def default_text(text: str) -> dict[str, Any]:
    """Describe a default that depends on other keys, instead of the stored default in schema and docs."""
    return {"x-default": text}


def optional(default: str, **more: Any) -> Any:
    """Declare a key that a file may leave out; schema and docs describe its default by a text."""
    return Field(default=None, json_schema_extra=default_text(default), **more)
