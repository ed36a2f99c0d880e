"""A faster start of numba, and the processor that it compiles for; import this module before any of numba's."""

import sys
from collections.abc import Iterator, Mapping
from contextlib import contextmanager, suppress
from functools import cache
from pathlib import Path

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

from llvmlite import binding  # noqa: E402  # numba loads it
from numba.core import config  # noqa: E402

# Levels of x86-64, the highest first, and the instructions that a level adds to the one below, in LLVM's words.
LEVELS = {
    "x86-64-v4": ("avx512f", "avx512bw", "avx512cd", "avx512dq", "avx512vl"),
    "x86-64-v3": ("avx2", "bmi", "bmi2", "f16c", "fma", "lzcnt", "movbe"),
}


def instructions_of(level: str) -> tuple[str, ...]:
    """Return the instructions of a level of x86-64 and the levels below, as far as `LEVELS` lists them."""
    names = list(LEVELS)
    return tuple(feature for name in names[names.index(level) :] for feature in LEVELS[name])


def level_of(features: Mapping[str, bool]) -> str | None:
    """Return the highest level of x86-64 that a processor with these features of LLVM has, or None."""
    return next((level for level in LEVELS if all(features.get(name) for name in instructions_of(level))), None)


def _choose_target() -> str | None:
    """Let numba compile for a level of x86-64 instead of this very processor, unless a setting of numba's chooses.

    Machine code then fits all processors of the level, and computes the same bits on each of them. It is as fast:
    docs/decisions/rays.md has the figures.
    """
    name: str | None = config.CPU_NAME
    if name is None and config.CPU_FEATURES is None and config.ENABLE_AVX:
        name = level_of(binding.get_host_cpu_features())
    if name in LEVELS and config.CPU_FEATURES is None:
        config.CPU_NAME, config.CPU_FEATURES = name, ""  # the features of the level
    return name


# LLVM's name of the processor that kernels are compiled for; None: this machine's.
TARGET = _choose_target()
# Its features that numba hands to LLVM; None: this machine's.
FEATURES: str | None = config.CPU_FEATURES

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

        check, linalg.ensure_blas = linalg.ensure_blas, lambda: None
        try:
            from numba.np import arraymath
        finally:
            linalg.ensure_blas = check
        arraymath.ensure_blas = check
