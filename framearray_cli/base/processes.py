"""Further processes of this program: the same Python, which imports it from where this process did."""

import os
import sys
from collections.abc import Sequence
from pathlib import Path

PACKAGE_PARENT = Path(__file__).resolve().parents[2]


def python_command(code: str, arguments: Sequence[str] = ()) -> list[str]:
    """Return the command line of this Python that runs some code."""
    return [sys.executable, "-c", code, *arguments]


def python_environment(**more: str) -> dict[str, str]:
    """Return the environment of such a process: this one's, with the place of the program, and `more`."""
    paths = [str(PACKAGE_PARENT), *filter(None, [os.environ.get("PYTHONPATH")])]
    return os.environ | {"PYTHONPATH": os.pathsep.join(paths), "PYTHONSAFEPATH": "1"} | more
