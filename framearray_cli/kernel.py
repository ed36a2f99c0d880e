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

F = TypeVar("F", bound=Callable[..., Any])

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
