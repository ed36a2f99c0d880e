"""A faster start of numba."""

from contextlib import suppress
from functools import cache
from typing import Any


@cache
def load_numba() -> None:
    """Load what numba loads before its first function, except for SciPy's linear algebra.

    numba imports that only to learn whether it is there, which takes 0.2 s. Here it learns that it is, as SciPy is a
    requirement of the program; functions with linear algebra, if any, import it when they are compiled.
    """
    with suppress(ImportError, AttributeError):  # of another version of numba, which then starts as usual
        from numba.np import linalg

        module: Any = linalg
        check, module.ensure_blas = module.ensure_blas, lambda: None
        try:
            from numba.np import arraymath
        finally:
            module.ensure_blas = check
        loaded: Any = arraymath
        loaded.ensure_blas = check
