"""How hot loops are compiled.

`kernel` leaves out two things that numba does by default and that cost more than the loops themselves here: counting
references to every array that is passed on (an atomic instruction each, for arrays that the caller holds anyway), and
a check for division by zero at every division. So a kernel must not allocate: it is given its scratch arrays. It
releases the GIL and is compiled once for all runs.

`inlined` is for the small functions that kernels are written with.
"""

from collections.abc import Callable
from typing import Any, TypeVar

import numba as nb
from llvmlite import ir
from numba import types
from numba.core import cgutils
from numba.extending import intrinsic

from .kernelcache import use_own_cache

use_own_cache()  # before the first kernel is declared

F = TypeVar("F", bound=Callable[..., Any])

_LINE = 64  # bytes
_njit: Any = nb.njit  # its stubs do not know `_nrt`
_OPTIONS = {"nogil": True, "cache": True, "error_model": "numpy", "_nrt": False}


def kernel(function: F) -> F:
    """Compile a hot loop; it must not allocate."""
    compiled: F = _njit(**_OPTIONS)(function)
    return compiled


def inlined(function: F) -> F:
    """Compile a function into every kernel that calls it."""
    compiled: F = _njit(inline="always", **_OPTIONS)(function)
    return compiled


def _prefetch_row_of(typingctx: Any, array: Any, i: Any) -> Any:
    """Ask for array[i] to be brought into the cache, a request a cache line; nothing waits for it."""

    def codegen(context: Any, builder: Any, signature: Any, args: Any) -> Any:
        view = context.make_array(signature.args[0])(context, builder, args[0])
        word, byte = ir.IntType(64), ir.IntType(8).as_pointer()
        row_bytes = builder.extract_value(view.strides, 0)
        index = context.cast(builder, args[1], signature.args[1], types.intp)
        row = builder.add(builder.ptrtoint(view.data, word), builder.mul(index, row_bytes))
        first_line = builder.and_(row, word(-_LINE))
        kind = ir.FunctionType(ir.VoidType(), [byte, ir.IntType(32), ir.IntType(32), ir.IntType(32)])
        fetch = builder.module.declare_intrinsic("llvm.prefetch", [byte], kind)
        flags = [ir.Constant(ir.IntType(32), value) for value in (0, 3, 1)]  # to read, keep in all levels, data
        with cgutils.for_range_slice(builder, first_line, builder.add(row, row_bytes), word(_LINE), word) as (line, _):
            builder.call(fetch, [builder.inttoptr(line, byte), *flags])
        return context.get_dummy_value()

    return types.void(array, i), codegen


prefetch_row: Any = intrinsic(_prefetch_row_of)
