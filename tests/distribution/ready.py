"""The command: `python -m distribution.ready`, from the folder `tests`: compile all kernels for a wheel, and build it.

Its arguments are levels of x86-64, by default all that this processor has. The wheel is for this version of Python and
this system.
"""

import os
import shutil
import subprocess
import sys
from pathlib import Path

from framearray_cli.base.units import size
from framearray_cli.engine.kernels.cache import SUFFIX
from framearray_cli.engine.kernels.start import LEVELS, TARGET

ROOT = Path(__file__).resolve().parents[2]
DIST, BUILD = ROOT / "dist", ROOT / "build"  # git ignores both
# Settings for processors with less than this one: Embree then traces packets of 8 rays.
LIMITS = {"x86-64-v3": {"FRAMEARRAY_EMBREE": "isa=avx2"}}


def main() -> None:
    """Build a wheel with machine code for some levels, and for processors with fast and slow gather instructions."""
    levels = sys.argv[1:] or levels_here()
    code = compile_for(levels, ("fast", "slow"))
    wheel = build(["--wheel"], code)
    print(f"{wheel.name}: {size(wheel.stat().st_size)}, {size(bytes_in(code))} of machine code for {', '.join(levels)}")


def levels_here() -> list[str]:
    """Return the levels of x86-64 that this processor has, the highest first; of another its name."""
    names = list(LEVELS)
    return names[names.index(TARGET) :] if TARGET in LEVELS else [TARGET or ""]


def compile_for(levels: list[str], gathers: tuple[str, ...]) -> Path:
    """Compile all kernels for some levels; return the folder with the machine code alone."""
    cache, code = BUILD / "kernels", BUILD / "machine_code"
    for folder in (cache, code):
        shutil.rmtree(folder, ignore_errors=True)
    for level in levels:
        for speed in gathers:
            chosen = {"NUMBA_CPU_NAME": level} if level else {}
            limits = chosen | LIMITS.get(level, {}) | {"FRAMEARRAY_GATHERS": speed, "NUMBA_CACHE_DIR": str(cache)}
            subprocess.run([sys.executable, "-m", "framearray_cli", "compile"], check=True, env=os.environ | limits)
    for file in cache.rglob(f"*{SUFFIX}"):
        (code / file.parent.name).mkdir(parents=True, exist_ok=True)
        shutil.copyfile(file, code / file.parent.name / file.name)
    return code


def build(kinds: list[str], code: Path) -> Path:
    """Build distributions; return the wheel, with machine code from a folder."""
    environment = os.environ | {"FRAMEARRAY_MACHINE_CODE": str(code)}
    command = [sys.executable, "-m", "build", *kinds, "--outdir", str(DIST), str(ROOT)]
    subprocess.run(command, check=True, env=environment, cwd=ROOT, stdout=subprocess.DEVNULL)
    return max(DIST.glob("*.whl"), key=lambda wheel: wheel.stat().st_mtime)


def bytes_in(folder: Path) -> int:
    """Return the size of all files in a folder."""
    return sum(file.stat().st_size for file in folder.rglob("*") if file.is_file())


if __name__ == "__main__":
    main()
