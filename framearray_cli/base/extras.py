"""Libraries that may be absent: what a user reads where one is needed."""

from collections.abc import Iterator
from contextlib import contextmanager

from .errors import MissingExtraError


@contextmanager
def extra(need: str, install: str, *, reason: bool = False) -> Iterator[None]:
    """Turn an import that fails into an error that says how to install what is missing.

    Args:
        need: what needs the library: "movies need PyAV".
        install: what `pip install` takes.
        reason: repeat what Python says; a library may be there and still not load.

    Raises:
        MissingExtraError: the import inside failed.
    """
    try:
        yield
    except ImportError as error:
        if reason:
            raise MissingExtraError(f"{need} ({error}); pip install {install}") from error
        raise not_installed(need, install) from error


def not_installed(need: str, install: str) -> MissingExtraError:
    """The error of a library that is not there."""
    return MissingExtraError(f"{need}, which is not installed; install it with: pip install {install}")
