"""Run the tests in environments of their own: with the lowest and the newest libraries, and with other Pythons.

`make test-bounds` installs uv, which makes the environments and looks for Pythons on the path before it downloads one.
`python -m bounds --python 3.12 --python 3.13 -- tests/base` chooses Pythons and tests. It prints a row of
docs/quality/robustness.md for each environment; those stay in build/bounds/ for the next time.
"""

import argparse
import os
import re
import shutil
import subprocess
import sys
import time
from pathlib import Path

UV = shutil.which("uv", path=os.pathsep.join([str(Path(sys.executable).parent), os.environ.get("PATH", "")])) or "uv"
ROOT = Path(__file__).resolve().parents[2]
FOLDER = ROOT / "build" / "bounds"
LOWEST, NEWEST = "lowest-direct", "highest"  # what uv calls them: the bounds of pyproject.toml, and what an index has
EXTRAS = ".[movie,dev]"


def environment(python: str, resolution: str) -> Path:
    """Make an environment, or bring it up to date, and return its Python."""
    place = FOLDER / f"{python}-{resolution}"
    if not place.exists():
        subprocess.run([UV, "venv", "--quiet", "--python", python, place], check=True)
    found = place / ("Scripts/python.exe" if (place / "Scripts").exists() else "bin/python")
    install = [UV, "pip", "install", "--quiet", "--python", found, "--resolution", resolution, "--editable", EXTRAS]
    subprocess.run(install, cwd=ROOT, check=True)
    return found


def run_tests(python: Path, arguments: list[str]) -> tuple[str, float]:
    """Run the tests; return pytest's last line and the minutes that they took."""
    began, last = time.monotonic(), ""
    command = [str(python), "-m", "pytest", *(arguments or ["-n", "auto", "--dist", "worksteal"])]
    with subprocess.Popen(command, cwd=ROOT, stdout=subprocess.PIPE, text=True) as process:
        for line in process.stdout or ():
            print(line, end="", flush=True)
            last = line.strip() or last
    return last, (time.monotonic() - began) / 60


def main() -> None:
    """Run all environments and print a table."""
    parser = argparse.ArgumentParser(prog="python -m bounds", description=__doc__)
    parser.add_argument("--python", action="append", help="also the newest libraries with this Python")
    parser.add_argument("--only", choices=[LOWEST, NEWEST], help="with this Python one of both")
    parser.add_argument("tests", nargs="*", help="arguments of pytest, after --")
    given = parser.parse_args()
    own = f"{sys.version_info.major}.{sys.version_info.minor}"
    wanted = [(own, resolution) for resolution in ([given.only] if given.only else [LOWEST, NEWEST])]
    wanted += [(python, NEWEST) for python in given.python or ()]
    rows, failed = [], False
    for python, resolution in wanted:
        result, minutes = run_tests(environment(python, resolution), given.tests)
        failed |= re.search(r"\b(failed|errors?)\b", result) is not None or "passed" not in result
        words = re.sub(r"=+|\x1b\[\d+m| in [\d.]+s.*", "", result).strip()
        rows.append(f"| {python} | {'lowest' if resolution == LOWEST else 'newest'} | {words} | {minutes:.0f} min |")
    print("\n".join(["", "| Python | libraries | tests | time |", "|---|---|---|---|", *rows]))
    sys.exit(failed)


if __name__ == "__main__":
    main()
