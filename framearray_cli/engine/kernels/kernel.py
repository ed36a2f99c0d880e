"""Compile hot loops, and keep them on disk.

`kernel` turns off two defaults of numba that would cost more than the loops themselves: reference counts of every array
passed on (an atomic instruction each, for arrays that the caller holds anyway), and the check of every division for
zero. Without reference counts a kernel must not allocate; its caller passes scratch arrays. A kernel releases the GIL,
and is compiled once for all runs.

`step` is for parts of a kernel that only kernels call, `inlined` for the small functions that kernels are written
with, `outlined` for branches that few scenes need.

Decorating a function only declares it. The first call loads its machine code from disk, or compiles it and makes a
folder for it (`machine_code.py`).
"""

from .start import is_tried  # isort: skip  # before any of numba

from collections.abc import Callable
from functools import cached_property
from inspect import Parameter, Signature, signature
from typing import Any, TypeVar

import numba as nb
import numpy as np
from llvmlite import ir
from numba import extending, types
from numba.core import cgutils

from .calls import call_by_address
from .machine_code import keep_on_disk
from .pipeline import Pipeline, translate

F = TypeVar("F", bound=Callable[..., Any])

_LINE = 64  # bytes
intrinsic = extending.intrinsic
_OPTIONS = {
    "nogil": True,
    "error_model": "numpy",
    "_nrt": False,
    "no_cfunc_wrapper": True,  # C never calls a kernel
}


def kernel(function: F) -> F:
    """Declare a hot loop, to be compiled at its first call; it must not allocate."""
    return _declared(function)


def step(function: F) -> F:
    """Declare a hot loop that only kernels call: it is compiled into them, and LLVM decides whether it is a call."""
    return _part(function, {"forceinline": False})  # else numba takes the option of the caller that it compiles


def outlined(function: F) -> F:
    """Declare a rare branch of a hot loop: it stays a call.

    LLVM would move what such a branch computes out of the loop, to where every scene needs time and registers for it.
    """
    return _part(function, {"forceinline": False}, called=True)


def _part(function: F, options: dict[str, bool], *, called: bool = False) -> F:
    """Declare a function for kernels, which is typed and translated once, and compiled with each kernel."""
    if not is_tried():
        return _declared(function, **options)
    expected = signature(function)

    def typed(typingctx: Any, *given: Any, **named: Any) -> Any:
        if named or len(given) < len(expected.parameters):
            given = _folded(expected, given, named)
        made = translate(function, given, typingctx, {"nopython": True} | _OPTIONS | options, called=called)

        def call(context: Any, builder: Any, sig: Any, args: Any) -> Any:
            context.add_linking_libs([made.library])
            return context.call_internal(builder, made.fndesc, made.signature, args)

        return made.signature, call

    typed.__name__ = function.__name__
    first = Parameter("typingctx", Parameter.POSITIONAL_OR_KEYWORD)
    typed.__signature__ = Signature([first, *expected.parameters.values()])  # type: ignore[attr-defined]  # numba reads it
    part: Any = InlinedFunction(function, typed)
    part._register()
    return part


def _folded(expected: Signature, given: tuple[Any, ...], named: dict[str, Any]) -> tuple[Any, ...]:
    """The types of all arguments, given or by default."""
    bound = expected.bind(*given, **named)
    kinds = {name: types.Omitted(parameter.default) for name, parameter in expected.parameters.items()}
    return tuple((kinds | bound.arguments).values())


class InlinedFunction(extending._Intrinsic):
    """A function for kernels."""

    def __init__(self, function: Callable[..., Any], typed: Callable[..., Any]) -> None:
        super().__init__(function.__name__, typed)
        self.py_func = function

    @cached_property
    def _alone(self) -> Any:
        return kernel(self.py_func)

    def __call__(self, *args: Any) -> Any:
        """Call the function by itself; for tests."""
        return self._alone(*args)


def _declared(function: F, **more: bool) -> F:
    passes = {"pipeline_class": Pipeline} if is_tried() else {}
    declared: F = nb.njit(**_OPTIONS, **passes, **more)(function)
    compiled: Any = declared
    if hasattr(compiled, "get_call_template"):  # NUMBA_DISABLE_JIT leaves plain Python functions
        if is_tried():
            call_by_address(compiled)
        compiled.get_call_template = _without_literals(compiled.get_call_template)
    return keep_on_disk(declared)


def _without_literals(template: Callable[..., Any]) -> Callable[..., Any]:
    """Wrap a method of numba that chooses the machine code for arguments, so that True and False share theirs."""

    def of_types(args: Any, kws: Any) -> Any:
        return template(tuple(map(types.unliteral, args)), {name: types.unliteral(kind) for name, kind in kws.items()})

    return of_types


def inlined(function: F) -> F:
    """Declare a small function that kernels are written with: LLVM puts it into each of its callers."""
    return _part(function, {"forceinline": True})


@inlined
def index(i: int) -> int:
    """An index that is not negative: numba then does not ask whether it counts from the end of an array."""
    return np.uint64(i)  # type: ignore[return-value]  # an integer in kernels, and numpy takes it as one


@inlined
def has_rows(array: Any) -> bool:
    """Return True if an array of a feature has any rows: the job has the feature."""
    return len(array) > 0


@intrinsic
def prefetch(typingctx: Any, address: Any, n_bytes: Any) -> Any:
    """Prefetch n_bytes from an address on into the processor's cache, line by line, without waiting."""

    def codegen(context: Any, builder: Any, signature: Any, args: Any) -> Any:
        word, byte = ir.IntType(64), ir.IntType(8).as_pointer()
        kind = ir.FunctionType(ir.VoidType(), [byte, ir.IntType(32), ir.IntType(32), ir.IntType(32)])
        fetch = builder.module.declare_intrinsic("llvm.prefetch", [byte], kind)
        flags = [ir.Constant(ir.IntType(32), value) for value in (0, 3, 1)]  # to read, keep in all levels, data
        first_line, end = builder.and_(args[0], word(-_LINE)), builder.add(args[0], args[1])
        with cgutils.for_range_slice(builder, first_line, end, word(_LINE), word) as (line, _):
            builder.call(fetch, [builder.inttoptr(line, byte), *flags])
        return context.get_dummy_value()

    return types.void(types.intp, types.intp), codegen


def _number_at(dtype: Any, element: Any) -> Callable[..., Any]:
    """Load element i of an array of a dtype at an address."""

    def of(typingctx: Any, address: Any, i: Any) -> Any:
        def codegen(context: Any, builder: Any, signature: Any, args: Any) -> Any:
            return builder.load(builder.gep(builder.inttoptr(args[0], element.as_pointer()), [args[1]]))

        return dtype(types.intp, types.intp), codegen

    return of


# For kernels that take the addresses of many arrays: passing the arrays themselves would cost more than a short loop.
real_at: Any = intrinsic(_number_at(types.float32, ir.FloatType()))
integer_at: Any = intrinsic(_number_at(types.int32, ir.IntType(32)))
long_at: Any = intrinsic(_number_at(types.int64, ir.IntType(64)))
byte_at: Any = intrinsic(_number_at(types.uint8, ir.IntType(8)))
