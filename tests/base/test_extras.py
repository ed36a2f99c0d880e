"""The error where an optional library is missing."""

import pytest

from framearray_cli.base.errors import MissingExtraError
from framearray_cli.base.extras import extra


def test_the_message_says_how_to_install_it() -> None:
    with pytest.raises(MissingExtraError) as error, extra("a sun needs pvlib", '"framearray[sun]"'):
        raise ModuleNotFoundError("No module named 'pvlib'")
    assert str(error.value) == (
        'a sun needs pvlib, which is not installed; install it with: pip install "framearray[sun]"'
    )
    assert isinstance(error.value.__cause__, ModuleNotFoundError)


def test_a_library_that_does_not_load_says_why() -> None:
    with pytest.raises(MissingExtraError) as error, extra("movies need PyAV", '"framearray[movie]"', reason=True):
        raise ImportError("libx.so: no such file")
    assert str(error.value) == 'movies need PyAV (libx.so: no such file); pip install "framearray[movie]"'


def test_other_errors_pass() -> None:
    with pytest.raises(ValueError, match="another"), extra("a sun needs pvlib", "x"):
        raise ValueError("another")
