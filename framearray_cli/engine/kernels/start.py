"""A faster start of numba; import this module before any of numba's."""

import sys
from collections.abc import Iterator
from contextlib import contextmanager, suppress
from functools import cache
from pathlib import Path
from typing import Any

# Modules that numba imports only to learn if they are there: to measure the coverage of its own compiler by tests, to
# read a file of settings, and to check the version of SciPy.
_UNUSED = ("coverage", "yaml", "scipy")
_SETTINGS = Path(".numba_config.yaml")  # in the current folder


@contextmanager
def _hidden(names: tuple[str, ...]) -> Iterator[None]:
    """Let imports fail of modules that were not loaded before."""
    hidden = {name for name in names if name not in sys.modules}
    sys.modules.update(dict.fromkeys(hidden))  # type: ignore[arg-type]  # None: imports fail
    try:
        yield
    finally:
        for name in hidden:
            del sys.modules[name]


with _hidden(() if _SETTINGS.exists() else _UNUSED):
    import numba

TRIED = "0.68"  # version of numba whose own classes kernels know


def is_tried() -> bool:
    """Return True if kernels know numba's own classes; else it compiles and loads them as usual, which takes longer."""
    version: str = numba.__version__
    return version.startswith(f"{TRIED}.")


@cache
def load_numba() -> None:
    """Load what numba loads before it compiles its first function, except for SciPy's linear algebra.

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
