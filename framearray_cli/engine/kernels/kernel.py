"""Compile hot loops, and keep them on disk.

`kernel` turns off two defaults of numba that would cost more than the loops themselves: reference counts of every array
passed on (an atomic instruction each, for arrays that the caller holds anyway), and the check of every division for
zero. Without reference counts a kernel must not allocate; its caller passes scratch arrays. A kernel releases the GIL,
and is compiled once for all runs.

`step` is for parts of a kernel that only kernels call, `optional_step` for parts that only some jobs need, `inlined`
for the small functions that kernels are written with.

Decorating a function only declares it. The first call loads its machine code from disk, or compiles it and makes a
folder for it (`machine_code.py`). numba's own settings stay untouched.
"""

from . import start  # noqa: F401  # isort: skip  # before any of numba

from collections.abc import Callable
from inspect import Parameter, Signature, signature
from typing import Any, TypeVar

import numba as nb
import numpy as np
from llvmlite import ir
from numba import types
from numba.core import cgutils, compiler
from numba.extending import intrinsic

from .machine_code import keep_on_disk

F = TypeVar("F", bound=Callable[..., Any])

_LINE = 64  # bytes
# Parts of numba without type annotations.
_njit: Any = nb.njit
_unliteral: Any = types.unliteral
_Compiler: Any = compiler.CompilerBase


class _KernelCompiler(_Compiler):  # type: ignore[misc]  # numba has no annotations
    """Compiles by the passes in `pipeline.py`, which need half as long to load as all the rest of numba."""

    def define_pipelines(self) -> list[Any]:
        from .pipeline import kernel_pipeline

        return [kernel_pipeline(self.state)]


_OPTIONS = {
    "nogil": True,
    "error_model": "numpy",
    "_nrt": False,
    "no_cfunc_wrapper": True,  # C never calls a kernel
    "pipeline_class": _KernelCompiler,
}


def kernel(function: F) -> F:
    """Declare a hot loop, to be compiled at its first call; it must not allocate."""
    return _declared(function)


def step(function: F) -> F:
    """Declare a hot loop that only kernels call; compiling it takes less time."""
    return _declared(function, no_cpython_wrapper=True)


def optional_step(array: str) -> Callable[[F], F]:
    """Declare a `step` that runs only if an array has rows; else it is not even compiled, and returns 0.

    `has_rows` lets LLVM remove a branch that numba has typed and compiled by then. Kernels of jobs that give an empty
    array, or () instead of it, contain nothing of an optional step, and compile in no more time.

    Args:
        array: the argument that is the array, or a field of an argument, such as "lights.maps.tint".
    """
    name, *fields = array.split(".")

    def declare(function: F) -> F:
        arguments, callee = signature(function).parameters, step(function)
        place = list(arguments).index(name)

        def typed(typingctx: Any, *given: Any) -> Any:
            found = given[place]
            for field in fields:
                found = found[found.fields.index(field)] if len(found) else found
            if (isinstance(found, types.BaseTuple) and not len(found)) or getattr(found, "ndim", 2) == 1:
                return types.int64(*given), lambda context, *_: context.get_constant(types.int64, 0)
            dispatcher = typingctx.resolve_value_type(callee)
            called = typingctx.resolve_function_type(dispatcher, given, {})

            def call(context: Any, builder: Any, sig: Any, args: Any) -> Any:
                code = context.get_function(dispatcher, called)
                context.add_linking_libs(getattr(code, "libs", ()))
                return code(builder, args)

            return called, call

        typed.__name__ = function.__name__
        first = Parameter("typingctx", Parameter.POSITIONAL_OR_KEYWORD)
        typed.__signature__ = Signature([first, *arguments.values()])  # type: ignore[attr-defined]  # numba reads it
        declared: Any = intrinsic(typed)
        return declared  # type: ignore[no-any-return]

    return declare


def _declared(function: F, **more: bool) -> F:
    declared: F = _njit(**_OPTIONS, **more)(function)
    compiled: Any = declared
    if hasattr(compiled, "get_call_template"):  # NUMBA_DISABLE_JIT leaves plain Python functions
        compiled.get_call_template = _without_literals(compiled.get_call_template)
    return keep_on_disk(declared)


def _without_literals(template: Callable[..., Any]) -> Callable[..., Any]:
    """Wrap a method of numba that chooses the machine code for arguments, so that True and False share theirs."""

    def of_types(args: Any, kws: Any) -> Any:
        return template(tuple(map(_unliteral, args)), {name: _unliteral(kind) for name, kind in kws.items()})

    return of_types


def inlined(function: F) -> F:
    """Declare a function, to be compiled into every kernel that calls it."""
    declared: F = _njit(inline="always", **_OPTIONS)(function)
    return keep_on_disk(declared)


@inlined
def index(i: int) -> int:
    """An index that is not negative: numba then does not ask whether it counts from the end of an array."""
    return np.uint64(i)  # type: ignore[return-value]  # an integer in kernels, and numpy takes it as one


def _prefetch_of(typingctx: Any, address: Any, n_bytes: Any) -> Any:
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


def _has_rows_of(typingctx: Any, array: Any) -> Any:
    """True if an array has more than one dimension: a constant, so that LLVM removes the branch not taken."""

    def codegen(context: Any, builder: Any, signature: Any, args: Any) -> Any:
        return context.get_constant(types.boolean, array.ndim > 1)

    return types.boolean(array), codegen


has_rows: Any = intrinsic(_has_rows_of)
# For kernels that take the addresses of many arrays: passing the arrays themselves would cost more than a short loop.
prefetch: Any = intrinsic(_prefetch_of)
real_at: Any = intrinsic(_number_at(types.float32, ir.FloatType()))
integer_at: Any = intrinsic(_number_at(types.int32, ir.IntType(32)))
byte_at: Any = intrinsic(_number_at(types.uint8, ir.IntType(8)))
