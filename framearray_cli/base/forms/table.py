"""Base of the tables of job files and movie path files, and how their validators report problems."""

from collections.abc import Iterable, Mapping
from functools import cache
from typing import Annotated, Any, NoReturn, Self, TypeAlias, TypeVar

from pydantic import (
    BaseModel,
    ConfigDict,
    Field,
    ModelWrapValidatorHandler,
    TypeAdapter,
    ValidationError,
    model_validator,
)
from pydantic_core import InitErrorDetails, PydanticCustomError

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


def optional(text: str, default: Any = None, schema: Mapping[str, Any] | None = None, **more: Any) -> Any:
    """Declare a key that a file may leave out.

    Args:
        text: description of the default in schema and docs, for one that depends on other keys.
        default: value until a validator replaces it.
        schema: further keywords of the key's schema.
    """
    return Field(default=default, json_schema_extra={"x-default": text, **(schema or {})}, **more)
