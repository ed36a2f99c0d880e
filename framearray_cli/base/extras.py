"""Optional libraries: the error where one is needed and missing."""

from collections.abc import Iterator
from contextlib import contextmanager

from .errors import MissingExtraError


@contextmanager
def extra(need: str, install: str, *, reason: bool = False) -> Iterator[None]:
    """Turn a failed import into an error that says how to install the library.

    Args:
        need: what needs the library: "movies need PyAV".
        install: argument of `pip install`.
        reason: include Python's own message; an installed library may still fail to load.

    Raises:
        MissingExtraError: an import in the block failed.
    """
    try:
        yield
    except ImportError as error:
        if reason:
            raise MissingExtraError(f"{need} ({error}); pip install {install}") from error
        raise not_installed(need, install) from error


def not_installed(need: str, install: str) -> MissingExtraError:
    """Make the error of a library that is not installed."""
    return MissingExtraError(f"{need}, which is not installed; install it with: pip install {install}")
