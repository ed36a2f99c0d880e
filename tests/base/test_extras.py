"""The error where an optional library is missing, and the command that installs it, for each way of installation."""

import json
import shlex
import sys
from importlib.metadata import PackageNotFoundError

import pytest
from packaging.requirements import Requirement

from framearray_cli.base import extras
from framearray_cli.base.errors import MissingExtraError
from framearray_cli.base.extras import extra, install_command


class Installed:
    """What pip leaves beside an installed program."""

    def __init__(self, origin: object = None, installer: str = "pip\n") -> None:
        self._files = {"direct_url.json": None if origin is None else json.dumps(origin), "INSTALLER": installer}

    def read_text(self, name: str) -> str | None:
        return self._files[name]


@pytest.fixture
def away(monkeypatch, tmp_path):
    """The program lies in site-packages, not in a checkout; return a function that says how it got there."""
    monkeypatch.setattr(extras, "SOURCE", tmp_path / "site-packages")
    monkeypatch.setattr(sys, "executable", "/opt/env/bin/python")

    def install(*origin: object, **more: str) -> None:
        monkeypatch.setattr("importlib.metadata.distribution", lambda name: Installed(*origin, **more))

    return install


def test_the_message_says_how_to_install_it() -> None:
    with pytest.raises(MissingExtraError) as error, extra("a movie needs av", "[movie]"):
        raise ModuleNotFoundError("No module named 'av'")
    command = install_command("[movie]")
    assert str(error.value) == f"a movie needs av, which is not installed; install it with: {command}"
    assert isinstance(error.value.__cause__, ModuleNotFoundError)


def test_a_library_that_does_not_load_says_why() -> None:
    with pytest.raises(MissingExtraError) as error, extra("movies need PyAV", "[movie]", reason=True):
        raise ImportError("libx.so: no such file")
    command = install_command("[movie]")
    assert str(error.value) == f"movies need PyAV (libx.so: no such file); install it with: {command}"


def test_other_errors_pass() -> None:
    with pytest.raises(ValueError, match="another"), extra("a movie needs av", "x"):
        raise ValueError("another")


def test_from_a_checkout(away, monkeypatch, tmp_path) -> None:
    away({"url": tmp_path.as_uri(), "dir_info": {"editable": True}})
    monkeypatch.setattr(extras, "SOURCE", tmp_path / "my checkout")
    expected = f'/opt/env/bin/python -m pip install -e "{tmp_path}/my checkout[movie]"'
    assert install_command("[movie]") == expected

    def missing(name: str) -> None:
        raise PackageNotFoundError

    monkeypatch.setattr("importlib.metadata.distribution", missing)  # run from its source
    assert install_command("[movie]") == expected


VCS = {"vcs": "git", "commit_id": "1f2e"}


@pytest.mark.parametrize(
    ("origin", "source"),
    [
        (None, ""),
        ({}, ""),
        ({"url": "https://host/x-0.1.0.tar.gz", "archive_info": {}}, " @ https://host/x-0.1.0.tar.gz"),
        (
            {"url": "file:///wheels/x-0.1.0-py3-none-any.whl", "archive_info": {}},
            " @ file:///wheels/x-0.1.0-py3-none-any.whl",
        ),
        ({"url": "https://host/x.git", "vcs_info": VCS}, " @ git+https://host/x.git@1f2e"),
        (
            {"url": "https://host/x.git", "vcs_info": VCS | {"requested_revision": "main"}},
            " @ git+https://host/x.git@main",
        ),
    ],
)
def test_from_an_index_a_url_or_a_repository(away, origin, source) -> None:
    """A shell and pip read the command, too."""
    away(origin)
    command = install_command("[movie]")
    assert command == f'/opt/env/bin/python -m pip install "framearray[movie]{source}"'
    *program, requirement = shlex.split(command)
    assert program == ["/opt/env/bin/python", "-m", "pip", "install"]
    assert (Requirement(requirement).name, Requirement(requirement).extras) == ("framearray", {"movie"})


def test_environments_of_uv_have_no_pip(away) -> None:
    away(installer="uv\n")
    assert install_command("[movie]") == 'uv pip install --python /opt/env/bin/python "framearray[movie]"'


def test_names_are_quoted(away, monkeypatch, tmp_path) -> None:
    odd = tmp_path / 'a "b" $c'
    away({"url": odd.as_uri(), "dir_info": {"editable": True}})
    monkeypatch.setattr(extras, "SOURCE", odd)
    monkeypatch.setattr(sys, "executable", "/opt/my env/bin/python")
    assert install_command("DracoPy") == '"/opt/my env/bin/python" -m pip install DracoPy'
    assert install_command("[movie]") == f"\"/opt/my env/bin/python\" -m pip install -e '{odd}[movie]'"
