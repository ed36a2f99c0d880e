"""Where compiled kernels are kept between runs.

numba keeps a compiled function for as long as its own source file does not change. Kernels here are written with small
functions of other files, so that is not enough: after an edit, or an update by git, old machine code would run on. So
kernels are kept in a folder whose name is a digest of all source files.
"""

import hashlib
import os
import shutil
from pathlib import Path
from typing import Any

# Folders of earlier states of the source that are kept: enough to change between a few branches.
KEPT = 3


def source_digest(package: Path) -> str:
    """A short digest of every source file of the package."""
    total = hashlib.sha256()
    for file in sorted(package.rglob("*.py")):
        total.update(str(file.relative_to(package)).encode() + b"\0" + file.read_bytes())
    return total.hexdigest()[:16]


def use_own_cache() -> None:
    """Point numba at this state's folder, unless the user chose one (NUMBA_CACHE_DIR) or no folder can be made."""
    from numba import config
    from numba.misc import appdirs

    if os.environ.get("NUMBA_CACHE_DIR"):
        return
    place: Any = appdirs.AppDirs  # untyped
    base = Path(place("framearray", appauthor=False).user_cache_dir)
    folder = base / source_digest(Path(__file__).parent)
    try:
        folder.mkdir(parents=True, exist_ok=True)
        os.utime(folder)
        if not os.access(folder, os.W_OK):
            return
        others = sorted((f for f in base.iterdir() if f != folder), key=lambda f: f.stat().st_mtime)
        for old in others[: -KEPT or None]:
            shutil.rmtree(old, ignore_errors=True)
    except OSError:
        return  # numba's own places serve then
    settings: Any = config
    settings.CACHE_DIR = str(folder)
