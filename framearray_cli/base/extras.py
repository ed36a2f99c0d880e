"""Optional libraries: the error where one is missing, and the command that installs it into this Python.

The command depends on how the program was installed, which pip records in `direct_url.json` (PEP 610).
"""

import json
import re
import shlex
import sys
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import TYPE_CHECKING, Any

from .errors import MissingExtraError
from .platform import WINDOWS

if TYPE_CHECKING:
    from importlib.metadata import Distribution

NAME = "framearray"
SOURCE = Path(__file__).resolve().parents[2]  # the folder of the package: a checkout, or site-packages
UNSAFE_IN_QUOTES = set('"$`\\!')  # what shells change between double quotes


@contextmanager
def extra(need: str, install: str, *, reason: bool = False) -> Iterator[None]:
    """Turn a failed import into an error that says how to install the library.

    Args:
        need: what needs the library: "movies need PyAV".
        install: an extra of this program, "[movie]", or arguments of `pip install`, "OpenImageIO".
        reason: include Python's own message; an installed library may still fail to load.

    Raises:
        MissingExtraError: an import in the block failed.
    """
    try:
        yield
    except ImportError as error:
        if reason:
            raise MissingExtraError(f"{need} ({error}); install it with: {install_command(install)}") from error
        raise not_installed(need, install) from error


def not_installed(need: str, install: str) -> MissingExtraError:
    """Make the error of a library that is not installed; `install` as for `extra`."""
    return MissingExtraError(f"{need}, which is not installed; install it with: {install_command(install)}")


def install_command(install: str) -> str:
    """Write the command that installs a library into the Python that runs this program.

    Args:
        install: an extra of this program, "[movie]", or arguments of `pip install`, "OpenImageIO".
    """
    found = _own_distribution()
    arguments = _own_arguments(found, install) if install.startswith("[") else install
    python = _in_quotes(sys.executable or "python")
    if found is not None and (found.read_text("INSTALLER") or "").strip() == "uv":  # its environments have no pip
        return f"uv pip install --python {python} {arguments}"
    return f"{python} -m pip install {arguments}"


def _own_distribution() -> "Distribution | None":
    from importlib.metadata import PackageNotFoundError, distribution  # takes long to import

    try:
        return distribution(NAME)
    except PackageNotFoundError:  # run from its source
        return None


def _own_arguments(found: "Distribution | None", name: str) -> str:
    """Return the arguments that install this program again with an extra, from where it came.

    Args:
        name: of the extra, in brackets.
    """
    if _is_checkout(SOURCE):  # its code runs where it lies
        return f"-e {_in_quotes(f'{SOURCE}{name}', always=True)}"
    from urllib.parse import urlsplit
    from urllib.request import url2pathname

    origin = _read_origin(found)
    url = str(origin.get("url", ""))
    if url.startswith("file:"):
        place = Path(url2pathname(urlsplit(url).path))
        if place.exists():  # a folder or a wheel
            return _in_quotes(f"{place}{name}", always=True)
        return " ".join(_in_quotes(one, always=True) for one in _requirements(found, name[1:-1])) or place.name
    if not url:
        return _in_quotes(f"{NAME}{name}", always=True)
    if version := origin.get("vcs_info"):
        url = f"{version['vcs']}+{url}@{version.get('requested_revision') or version['commit_id']}"
    if folder := origin.get("subdirectory"):
        url += f"#subdirectory={folder}"
    return _in_quotes(f"{NAME}{name} @ {url}", always=True)


def _is_checkout(folder: Path) -> bool:
    """Return True for a checkout of this program; site-packages may hold another project's file by mistake."""
    try:
        return f'name = "{NAME}"' in (folder / "pyproject.toml").read_text("utf-8", "replace")
    except OSError:
        return False


def _requirements(found: "Distribution | None", name: str) -> list[str]:
    """List what an extra needs: "av>=13.1"."""
    wanted = re.compile(rf"""\s*(?:\band\s+)?\bextra\s*==\s*["']{name}["']""")
    needs = [line for line in (found and found.requires) or () if wanted.search(line)]
    return [wanted.sub("", line).rstrip(" ;") for line in needs]


def _read_origin(found: "Distribution | None") -> dict[str, Any]:
    """Read where pip took this program from; empty if from an index."""
    try:
        origin = json.loads((found and found.read_text("direct_url.json")) or "{}")
    except ValueError:
        return {}
    return origin if isinstance(origin, dict) else {}


def _in_quotes(text: str, *, always: bool = False) -> str:
    """Quote an argument for a shell, if it needs that; double quotes serve Windows too."""
    if not always and shlex.quote(text) == text:
        return text
    if not WINDOWS and UNSAFE_IN_QUOTES & set(text):
        return shlex.quote(text)
    return f'"{text}"'
