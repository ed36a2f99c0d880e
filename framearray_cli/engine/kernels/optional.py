"""Steps that only some jobs need: kernels of other jobs are compiled without them, in no more time.

`has_rows` lets LLVM remove a branch that numba has typed and compiled by then; here it does neither.
"""

from collections.abc import Callable
from typing import Any

from numba import types
from numba.extending import intrinsic

chosen_by_type: Any = intrinsic  # declares a function for kernels that `step_or_zero` makes


def step_or_zero(typingctx: Any, function: Callable[..., int], given: tuple[Any, ...], array: Any) -> Any:
    """Return what `chosen_by_type` needs to call a `@step` where an array has rows, and else to return 0.

    A job that needs no such step may also give () in place of the array.

    Args:
        function: returns an integer.
        given: types of its arguments.
        array: type of the array.
    """
    if (isinstance(array, types.BaseTuple) and not len(array)) or getattr(array, "ndim", 2) == 1:

        def nothing(context: Any, builder: Any, signature: Any, args: Any) -> Any:
            return context.get_constant(types.int64, 0)

        return types.int64(*given), nothing
    callee = typingctx.resolve_value_type(function)
    found = typingctx.resolve_function_type(callee, given, {})

    def call(context: Any, builder: Any, signature: Any, args: Any) -> Any:
        called = context.get_function(callee, found)
        context.add_linking_libs(getattr(called, "libs", ()))
        return called(builder, args)

    return found, call
