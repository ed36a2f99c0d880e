"""Named tuples of arrays that kernels take by reference.

numba passes a named tuple as all of its numbers, nine for an array of two dimensions: a kernel that gathers light would
have 1,700 parameters, and every step between calls would copy them. A bundle is one address instead. Its words of eight
bytes never change: of an array its address and its lengths, of a number its value, of a bundle in it all of its words.
"""

from . import start  # noqa: F401  # isort: skip  # before any of numba

from functools import cached_property
from itertools import accumulate
from typing import Any, TypeVar, get_args, get_origin, get_type_hints

import numpy as np
from llvmlite import ir
from numba import from_dtype, typeof, types
from numba.core import cgutils
from numba.core.typing.templates import AttributeTemplate
from numba.extending import (
    NativeValue,
    infer_getattr,
    lower_getattr_generic,
    models,
    register_model,
    typeof_impl,
    unbox,
)
from numba.np.numpy_support import as_dtype

from framearray_cli.base.arrays import with_room

T = TypeVar("T")

_WORD = ir.IntType(64)
_WORD_BYTES = 8


class Bundle(types.Type):
    """The type of a bundle: its class, and the types of its fields."""

    def __init__(self, name: str, fields: tuple[str, ...], kinds: tuple[Any, ...]) -> None:
        self.fields, self.kinds = fields, kinds
        self.first_words = (0, *accumulate(map(_words, kinds)))  # of each field; the number of all words
        super().__init__(f"{name}({', '.join(map(str, kinds))})")


def bundle(cls: type[T]) -> type[T]:
    """Declare a named tuple whose arrays and numbers kernels take by reference.

    Arrays must not be moved, and must be contiguous.
    """
    names = {"__module__": cls.__module__, "__qualname__": cls.__qualname__, "__doc__": cls.__doc__}
    kept = {
        name: made for name, made in vars(cls).items() if isinstance(made, cached_property)
    }  # named tuples name none
    kept |= {"_packed": cached_property(_pack), "_address": cached_property(_start), "_row": cached_property(_row)}
    found: Any = type(cls.__name__, (cls,), names | kept)
    typeof_impl.register(found)(lambda value, context: value._packed[0])
    return found


def allocated(cls: type[T], **values: Any) -> T:
    """Allocate the arrays of a named tuple, with room behind each.

    Args:
        values: of all fields: the shape of an array, or an array or other value as it is.
    """

    def made(kind: Any, value: Any) -> Any:
        if get_origin(kind) is not np.ndarray or isinstance(value, np.ndarray):
            return value
        (dtype,) = get_args(get_args(kind)[1])
        return with_room(value if isinstance(value, tuple) else (value,), dtype)

    kinds = get_type_hints(cls)
    return cls(**{name: made(kinds[name], value) for name, value in values.items()})


def rows_from(value: T, first: int) -> T:
    """Return a bundle of the rows from `first` on of a bundle of arrays; shares memory."""
    arrays: Any = value
    found = type(arrays)._make(array[first:] for array in arrays)
    kind, words = arrays._packed
    found._packed = kind, words + first * arrays._row
    return found


def _row(value: Any) -> Any:
    """Return what a row of a bundle of arrays, all of the same length, adds to its words: bytes, and a length of -1."""
    found = []
    for array in value:
        found += [array.strides[0], -1, *[0] * (array.ndim - 1)]
    return np.array(found, np.int64)


def _words(kind: Any) -> int:
    """Return the number of words of a type."""
    if isinstance(kind, Bundle):
        return kind.first_words[-1]
    if isinstance(kind, types.Array):
        return 1 + kind.ndim
    return len(kind) if isinstance(kind, types.BaseTuple) else 1


_kinds: dict[Any, Any] = {}  # of bundles, arrays and numbers, by what they follow from


def _pack(value: Any) -> tuple[Any, Any]:
    """Return the type and the words of a bundle."""
    words: list[int] = []
    kinds = tuple([_add(field, words) for field in value])
    key = type(value), kinds
    if key not in _kinds:
        _kinds[key] = Bundle(type(value).__name__, value._fields, kinds)
    return _kinds[key], np.array(words, np.int64)


def _start(value: Any) -> int:
    """Return the address of the words of a bundle."""
    return value._packed[1].ctypes.data


def _add(value: Any, words: list[int]) -> Any:
    """Append the words of a field; return its type."""
    if isinstance(value, np.ndarray):
        if not value.flags.c_contiguous:
            raise ValueError("an array of a bundle must be contiguous")
        words.append(value.__array_interface__["data"][0])
        words.extend(value.shape)
        key = value.dtype.num, value.ndim
        if key not in _kinds:
            _kinds[key] = types.Array(from_dtype(value.dtype), value.ndim, "C")
        return _kinds[key]
    if hasattr(value, "_packed"):
        kind, of_bundle = value._packed
        words.extend(of_bundle.tolist())
        return kind
    if isinstance(value, tuple):
        return types.Tuple([_add(each, words) for each in value])
    kind = _kind_of(type(value))
    if kind is types.int64:
        words.append(value)
    else:
        number = np.asarray(value, as_dtype(kind)).tobytes().ljust(_WORD_BYTES, b"\0")
        words.append(int.from_bytes(number, "little", signed=True))
    return kind


def _kind_of(cls: Any) -> Any:
    """Return the type of a number."""
    if cls not in _kinds:
        _kinds[cls] = typeof(cls(0))
    return _kinds[cls]


@register_model(Bundle)
class _Reference(models.PrimitiveModel):
    def __init__(self, dmm: Any, fe_type: Any) -> None:
        super().__init__(dmm, fe_type, ir.ArrayType(_WORD, _words(fe_type)).as_pointer())


@unbox(Bundle)
def _address(kind: Any, value: Any, c: Any) -> Any:
    """The address of the words of a bundle."""
    packed = c.pyapi.object_getattr_string(value, "_address")
    address = c.pyapi.number_as_ssize_t(packed)
    c.pyapi.decref(packed)
    return NativeValue(c.builder.inttoptr(address, c.context.get_value_type(kind)))


@infer_getattr
class _Fields(AttributeTemplate):
    key = Bundle

    def generic_resolve(self, kind: Any, attr: str) -> Any:
        return kind.kinds[kind.fields.index(attr)] if attr in kind.fields else None


@lower_getattr_generic(Bundle)
def _field(context: Any, builder: Any, kind: Any, value: Any, attr: str) -> Any:
    for argument in builder.function.args:  # of any bundle: its words may be read early
        words = getattr(argument.type, "pointee", None)
        if isinstance(words, ir.ArrayType) and words.element == _WORD:
            argument.attributes.dereferenceable = _WORD_BYTES * words.count
    field = kind.fields.index(attr)
    return _read(context, builder, kind.kinds[field], builder.gep(value, [_WORD(0), _WORD(kind.first_words[field])]))


def _read(context: Any, builder: Any, kind: Any, place: Any) -> Any:
    """Read a field at an address."""
    if isinstance(kind, Bundle):
        return builder.bitcast(place, context.get_value_type(kind))
    if isinstance(kind, types.Array):
        return _array(context, builder, kind, place)
    if isinstance(kind, types.BaseTuple):
        parts = [_read(context, builder, each, builder.gep(place, [_WORD(i)])) for i, each in enumerate(kind)]
        return context.make_tuple(builder, kind, parts)
    stored = context.get_data_type(kind)
    found = _load(builder, builder.bitcast(place, stored.as_pointer()))
    return context.data_model_manager[kind].from_data(builder, found)


def _array(context: Any, builder: Any, kind: Any, place: Any) -> Any:
    made = context.make_array(kind)(context, builder)
    lengths = [_load(builder, builder.gep(place, [_WORD(1 + axis)])) for axis in range(kind.ndim)]
    size = context.get_abi_sizeof(context.get_data_type(kind.dtype))
    strides, total = [], _WORD(size)
    for length in reversed(lengths):
        strides.append(total)
        total = builder.mul(total, length, flags=["nsw"])
    data = builder.inttoptr(_load(builder, place), context.get_data_type(kind.dtype).as_pointer())
    context.populate_array(
        made,
        data=data,
        shape=cgutils.pack_array(builder, lengths),
        strides=cgutils.pack_array(builder, strides[::-1]),
        itemsize=_WORD(size),
        meminfo=None,
    )
    return made._getvalue()


def _load(builder: Any, place: Any) -> Any:
    found = builder.load(place)
    found.set_metadata("invariant.load", builder.module.add_metadata([]))
    return found
