"""How hot loops are compiled.

`kernel` leaves out two things that numba does by default and that cost more than the loops themselves here: counting
references to every array that is passed on (an atomic instruction each, for arrays that the caller holds anyway), and
a check for division by zero at every division. So a kernel must not allocate: it is given its scratch arrays. It
releases the GIL and is compiled once for all runs.

`inlined` is for the small functions that kernels are written with.
"""

import platform
from collections.abc import Callable
from typing import Any, TypeVar

import numba as nb
from llvmlite import ir
from numba import types
from numba.core import cgutils
from numba.extending import intrinsic

from .kernelcache import use_own_cache

CACHED = use_own_cache()  # before the first kernel is declared

F = TypeVar("F", bound=Callable[..., Any])

_LINE = 64  # bytes
_njit: Any = nb.njit  # its stubs do not know `_nrt`
_OPTIONS = {"nogil": True, "cache": CACHED, "error_model": "numpy", "_nrt": False}


def kernel(function: F) -> F:
    """Compile a hot loop; it must not allocate."""
    compiled: F = _njit(**_OPTIONS)(function)
    return compiled


def inlined(function: F) -> F:
    """Compile a function into every kernel that calls it."""
    compiled: F = _njit(inline="always", **_OPTIONS)(function)
    return compiled


def _prefetch_of(typingctx: Any, address: Any, n_bytes: Any) -> Any:
    """Ask for the bytes from an address on to be brought into the cache, a line at a time; nothing waits for it."""

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
    def of(typingctx: Any, address: Any, i: Any) -> Any:
        def codegen(context: Any, builder: Any, signature: Any, args: Any) -> Any:
            return builder.load(builder.gep(builder.inttoptr(args[0], element.as_pointer()), [args[1]]))

        return dtype(types.intp, types.intp), codegen

    return of


# For lists of arrays, of which a kernel takes the addresses: each array by itself would cost more than a short loop.
prefetch: Any = intrinsic(_prefetch_of)
real_at: Any = intrinsic(_number_at(types.float32, ir.FloatType()))
integer_at: Any = intrinsic(_number_at(types.int32, ir.IntType(32)))


def processor() -> str:
    """Name of this machine and of the processor that kernels are compiled for: those of others round differently."""
    from llvmlite import binding

    return f"{platform.system()} {platform.machine()} {binding.get_host_cpu_name()}"
