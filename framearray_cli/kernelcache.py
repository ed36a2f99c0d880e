"""Where compiled kernels are kept between runs.

numba keeps a compiled function for as long as its own source file does not change. Kernels here are written with small
functions of other files, so that is not enough: after an edit, or an update by git, old machine code would run on. So
kernels are kept in a folder whose name is a digest of all source files.
"""

import hashlib
import os
import shutil
import tempfile
from collections.abc import Iterator
from contextlib import contextmanager, suppress
from pathlib import Path
from typing import Any

from .files import reason

# Folders of earlier states of the source that are kept: enough to change between a few branches.
KEPT = 3

_problems: list[str] = []


def source_digest(package: Path) -> str:
    """A short digest of every source file of the package."""
    total = hashlib.sha256()
    for file in sorted(package.rglob("*.py")):
        total.update(str(file.relative_to(package)).encode() + b"\0" + file.read_bytes())
    return total.hexdigest()[:16]


def use_own_cache() -> bool:
    """Point numba at a folder for kernels: the user's choice (NUMBA_CACHE_DIR), else one of this state of the source.

    Returns:
        Whether there is one; without, kernels are compiled in each run, and `problem` tells why.
    """
    from numba import config
    from numba.core import caching
    from numba.misc import appdirs

    settings: Any = config
    cache_class: Any = caching.FunctionCache
    cache_class._guard_against_spurious_io_errors = _forgiving
    chosen = os.environ.get("NUMBA_CACHE_DIR")
    if chosen and _usable(Path(chosen)):
        return True
    place: Any = appdirs.AppDirs  # untyped
    package = Path(__file__).parent
    digest = source_digest(package)
    bases = (Path(place("framearray", appauthor=False).user_cache_dir), package / "__pycache__" / "framearray")
    for base in bases:
        if _usable(base / digest):
            _drop_old(base, digest)
            settings.CACHE_DIR = str(base / digest)
            if not chosen:
                _problems.clear()
            return True
    settings.CACHE_DIR = ""
    return False


def problem() -> str:
    """Why kernels could not be read or kept; nothing where they could."""
    return _problems[0] if _problems else ""


def _usable(folder: Path) -> bool:
    """Make a folder, if need be, and say whether files can be written there."""
    try:
        folder.mkdir(parents=True, exist_ok=True)
        with tempfile.TemporaryFile(dir=folder):
            os.utime(folder)
    except OSError as error:
        _problems.append(f"{folder}: {reason(error)}")
        return False
    return True


def _drop_old(base: Path, digest: str) -> None:
    """Remove the folders of states of the source that were not used for the longest time."""
    with suppress(OSError):  # another process does the same
        others = sorted((f for f in base.iterdir() if f.name != digest), key=lambda f: f.stat().st_mtime)
        for old in others[: -KEPT or None]:
            shutil.rmtree(old, ignore_errors=True)


@contextmanager
def _forgiving(cache: Any) -> Iterator[None]:
    """Around reading and writing a kernel: where that fails it is compiled, as if there were no cache.

    A disk may be full, and a file damaged: then reading it may raise anything.
    """
    try:
        yield
    except Exception as error:
        why = reason(error) if isinstance(error, OSError) else f"damaged: {error}"
        _problems.append(f"{cache.cache_path}: {why}")
        with suppress(OSError):
            cache.flush()  # what is damaged would stay for ever
