"""Optional libraries: the error where one is missing, and the command that installs it into this Python.

The command depends on how the program was installed, which pip records in `direct_url.json` (PEP 610).
"""

import json
import shlex
import sys
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import TYPE_CHECKING

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
    origin = json.loads((found and found.read_text("direct_url.json")) or "{}")
    if found is None or origin.get("dir_info", {}).get("editable"):  # its code runs where it lies
        return f"-e {_in_quotes(f'{SOURCE}{name}', always=True)}"
    url = origin.get("url", "")
    if version := origin.get("vcs_info"):
        url = f"{version['vcs']}+{url}@{version.get('requested_revision') or version['commit_id']}"
    return _in_quotes(f"{NAME}{name} @ {url}" if url else f"{NAME}{name}", always=True)


def _in_quotes(text: str, *, always: bool = False) -> str:
    """Quote an argument for a shell, if it needs that; double quotes serve Windows too."""
    if not always and shlex.quote(text) == text:
        return text
    if not WINDOWS and UNSAFE_IN_QUOTES & set(text):
        return shlex.quote(text)
    return f'"{text}"'
