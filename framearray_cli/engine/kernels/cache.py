"""The folder of compiled kernels, which are kept between runs.

numba reuses the machine code of a function until the function's own source file changes. Kernels here call small
functions of other files; after an edit of these, or an update by git, old machine code would run on. This module
therefore keeps kernels in a folder named by a digest of all source files that kernels can see, and of what else the
machine code depends on. A wheel may contain such a folder, with kernels that are compiled already. The user's folder is
touched only when a kernel is needed that is not ready-made.
"""

import hashlib
import importlib
import os
import shutil
import sys
import tempfile
from collections.abc import Iterator
from contextlib import contextmanager, suppress
from functools import cache
from pathlib import Path
from typing import Any

from framearray_cli.base.errors import OutputError
from framearray_cli.base.files import reason

from .processor import machine, slow_gathers

# Files that kernels can see: the engine, and modules with constants of kernels. Other edits compile no kernel.
SEEN = (
    "engine/**/*.py",
    "base/lens.py",
    "scene/panes.py",
    "scene/paths/lightpath.py",
    "scene/files/model.py",
    "scene/scene.py",
)
# Folder inside the package for kernels that are compiled already, and the ending of their files.
READY, SUFFIX = "machine_code", ".kernel"
# Folders of earlier states of the source to keep: enough to switch between a few branches.
KEPT = 3

_problems: list[str] = []


def package_folder() -> Path:
    """The folder of the whole package, wherever in it this module lies."""
    package: Any = importlib.import_module(__name__.partition(".")[0])
    return Path(package.__path__[0])


def source_digest(package: Path) -> str:
    """Digest the source files that kernels can see, and whatever else of this machine their code depends on."""
    import numba

    from ..embree.library import packet_width  # loads ctypes

    python = f"{sys.implementation.cache_tag}{getattr(sys, 'abiflags', '')}"
    gathers = "slow" if slow_gathers() else "fast"
    depends = (numba.__version__, python, machine(), f"packets of {packet_width()}", f"{gathers} gathers")
    total = hashlib.sha256("\0".join(depends).encode())
    for file in sorted(file for seen in SEEN for file in package.glob(seen)):
        total.update(str(file.relative_to(package)).encode() + b"\0" + file.read_bytes())
    return total.hexdigest()[:16]


_digest = cache(source_digest)  # the source stays as it is while the program runs


@cache
def kernel_folder() -> Path | None:
    """Find or make the folder for kernels of this state of the source, and remove the folders of old states.

    It lies in NUMBA_CACHE_DIR if that is set, else in the user's cache folder, else next to the source.

    Returns:
        None if no folder can be written: each run then compiles its kernels, and `problem` says why.
    """
    from numba.misc import appdirs

    package = package_folder()
    digest = _digest(package)
    chosen = os.environ.get("NUMBA_CACHE_DIR")
    bases = [Path(chosen, "framearray")] if chosen else []
    user = appdirs.AppDirs("framearray", appauthor=False).user_cache_dir
    bases += [Path(user), package / "__pycache__" / "framearray"]
    for base in bases:
        if _usable(base / digest):
            _drop_old(base, digest)
            if not chosen:
                _problems.clear()  # a second choice that works needs no report
            return base / digest
    return None


@cache
def ready_folder() -> Path | None:
    """Find the folder of ready-made kernels for this state of the source and this machine, if the package has one."""
    package = package_folder()
    if not (package / READY).is_dir():  # a checkout, most likely
        return None
    folder = package / READY / _digest(package)
    return folder if folder.is_dir() else None


def kept_kernels() -> int:
    """Return the number of kernels that are on disk for this state of the source, whatever types they are for."""
    files = [file for folder in (ready_folder(), kernel_folder()) for file in kernels_in(folder)]
    return len({file.name.rpartition("-")[0] for file in files})


def kernels_in(folder: Path | None) -> list[Path]:
    """Return the files of the kernels in a folder."""
    return sorted(folder.glob(f"*{SUFFIX}")) if folder else []


def problem() -> str:
    """Return the reason why kernels could not be read or written; empty if they could."""
    return _problems[0] if _problems else ""


@contextmanager
def forgive(file: Path) -> Iterator[None]:
    """Ignore errors of reading or writing a kernel: numba then compiles it, as if it were not on disk.

    A disk may be full. Reading a damaged file may raise any exception.
    """
    try:
        yield
    except Exception as error:
        why = f"{file}: {reason(error) if isinstance(error, OSError) else f'damaged: {error}'}"
        _problems.append(str(error) if isinstance(error, OutputError) else why)
        with suppress(OSError):
            file.unlink(missing_ok=True)  # a damaged file would stay forever


def _usable(folder: Path) -> bool:
    """Make a folder if needed; return True if files can be written there."""
    try:
        folder.mkdir(parents=True, exist_ok=True)
        with tempfile.TemporaryFile(dir=folder):
            os.utime(folder)
    except OSError as error:
        _problems.append(f"{folder}: {reason(error)}")
        return False
    return True


def _drop_old(base: Path, digest: str) -> None:
    """Remove the least recently used folders of other states of the source, all but KEPT."""
    with suppress(OSError):  # another process may do the same
        others = sorted((f for f in base.iterdir() if f.name != digest), key=lambda f: f.stat().st_mtime)
        for old in others[: -KEPT or None]:
            shutil.rmtree(old, ignore_errors=True)
