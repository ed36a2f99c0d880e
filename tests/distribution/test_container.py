"""The container file without a container engine: what it names exists, and its `pip install` brings it."""

import re
import shlex
import subprocess
import sys
import tomllib
import venv
from pathlib import Path

import pytest
from packaging.specifiers import SpecifierSet
from packaging.version import Version
from support import ROOT

from framearray_cli.cli.main import app

FILE = ROOT / "Containerfile"
PAGE = ROOT / "docs" / "guide" / "farms.md"
PROJECT = tomllib.loads((ROOT / "pyproject.toml").read_text(encoding="utf-8"))["project"]
EXTRAS = re.compile(r'"/source\[([^\]]*)\]"')


def instructions() -> dict[str, list[str]]:
    """What follows each word of the file, comments left out."""
    found: dict[str, list[str]] = {}
    for line in FILE.read_text(encoding="utf-8").splitlines():
        if line and not line.startswith("#"):
            word, _, rest = line.partition(" ")
            found.setdefault(word, []).append(rest)
    return found


def install_line() -> str:
    (line,) = [line for line in instructions()["RUN"] if line.startswith("pip install")]
    return line


def commands() -> list[list[str]]:
    """The words behind the name of the image in all `podman run` of the file and of its page."""
    text = FILE.read_text(encoding="utf-8") + PAGE.read_text(encoding="utf-8")
    runs = [shlex.split(line) for line in re.findall(r"podman run (.*)$", text, re.MULTILINE)]
    return [words[words.index("framearray") + 1 :] for words in runs]


def test_its_python_and_its_extras_are_those_of_the_project() -> None:
    (base,) = instructions()["FROM"]
    version = re.fullmatch(r"docker\.io/library/python:(3\.\d+)-slim", base)
    assert version and Version(version[1]) in SpecifierSet(PROJECT["requires-python"])
    assert f"Python {version[1]}" in PAGE.read_text(encoding="utf-8")
    (extras,) = EXTRAS.findall(install_line())
    assert set(extras.split(",")) <= set(PROJECT["optional-dependencies"])
    for further in EXTRAS.findall(PAGE.read_text(encoding="utf-8")):
        assert set(further.split(",")) <= set(PROJECT["optional-dependencies"])


def test_what_is_copied_is_what_is_installed_and_removed() -> None:
    assert instructions()["COPY"] == [". /source"]
    assert install_line().endswith("&& rm -r /source")
    ignored = (ROOT / ".dockerignore").read_text(encoding="utf-8").splitlines()
    needed = {"pyproject.toml", PROJECT["readme"] if isinstance(PROJECT.get("readme"), str) else "README.md", "LICENSE"}
    assert not needed & {line.strip("/") for line in ignored}
    assert not {"framearray", "framearray_cli"} & {line.strip("/") for line in ignored}


def test_its_folders_agree() -> None:
    found = instructions()
    (made,) = [line.split()[3:] for line in found["RUN"] if line.startswith("mkdir")]
    variables = dict(pair.split("=") for pair in found["ENV"][0].split())
    assert set(found["WORKDIR"]) | set(found["VOLUME"]) | set(variables.values()) == set(made) == {"/cache", "/data"}
    mounted = re.findall(r"-v \S+?:(/\w+)", FILE.read_text(encoding="utf-8") + PAGE.read_text(encoding="utf-8"))
    assert set(mounted) == set(made)


def test_its_commands_exist() -> None:
    assert instructions()["ENTRYPOINT"] == ['["framearray"]'] and "framearray" in PROJECT["scripts"]
    known = {command.callback.__name__ for command in app.registered_commands if command.callback}
    given = commands()
    assert {words[0] for words in given} == {"render", "view"} <= known
    (port,) = instructions()["EXPOSE"]
    (view,) = [words for words in given if words[0] == "view"]
    assert view[view.index("--port") + 1] == port


@pytest.mark.slow
def test_its_pip_install_brings_what_it_names(tmp_path: Path) -> None:
    """In an empty environment, from this checkout in place of /source, and without the removal behind it."""
    venv.create(tmp_path / "env", with_pip=True)
    python = tmp_path / "env" / ("Scripts" if sys.platform == "win32" else "bin") / "python"
    words = shlex.split(install_line().partition("&&")[0].replace("/source", str(ROOT)))
    assert words[:2] == ["pip", "install"]
    clean = {"PATH": str(python.parent), "HOME": str(tmp_path), "XDG_CACHE_HOME": str(tmp_path / "cache")}
    subprocess.run([python, "-m", *words, "--quiet", "--disable-pip-version-check"], check=True, cwd=tmp_path)
    shown = subprocess.run(
        [python.with_name("framearray"), "doctor"], check=True, env=clean, cwd=tmp_path, capture_output=True, text=True
    ).stdout
    assert str(tmp_path / "cache") in shown, "kernels are kept where XDG_CACHE_HOME says"
    subprocess.run([python, "-c", "import av"], check=True, env=clean, cwd=tmp_path)
