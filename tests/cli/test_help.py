"""Help, version and schema; docs/guide/cli.md documents every command, option and exit code."""

import inspect
import json
import re

import pytest
from support import ROOT
from support.program import run

from framearray_cli import __version__
from framearray_cli.base import errors
from framearray_cli.cli.main import app

PAGE = ROOT / "docs" / "guide" / "cli.md"
COMMANDS = ["assemble", "check", "export", "init", "openjd", "render", "report", "schema", "sheet", "verify", "view"]


def section(page: str, command: str) -> str:
    """Return the section of a page about a command: from its heading to the next."""
    return page.split(f"\n## framearray {command}\n")[1].split("\n## ")[0]


def options(capsys: pytest.CaptureFixture[str], command: str) -> set[str]:
    """Return all options of a command, as its help lists them."""
    shown = run(capsys, command, "--help").out
    return set(re.findall(r"(?<![\w-])--?[a-z][\w-]*", shown.split("Options:")[1])) - {"--help"}


def test_the_commands_are_these():
    assert sorted(command.callback.__name__ for command in app.registered_commands if command.callback) == COMMANDS


@pytest.mark.parametrize("command", COMMANDS)
def test_every_option_is_documented(command, capsys):
    text = section(PAGE.read_text(), command)
    missing = [option for option in options(capsys, command) if not re.search(rf"`{option}[ `]", text)]
    assert not missing


@pytest.mark.parametrize("command", COMMANDS)
def test_no_option_is_documented_that_does_not_exist(command, capsys):
    found = set(re.findall(r"(?<![\w-])--?[a-z][\w-]*", section(PAGE.read_text(), command)))
    assert found <= options(capsys, command)


def test_a_missing_option_is_found(capsys):
    assert "--restart" in options(capsys, "render")
    assert "--restart" not in section(PAGE.read_text().replace("--restart", ""), "render")


def test_every_exit_code_is_documented():
    listed = set(re.findall(r"^\| (\d+) \|", PAGE.read_text(), re.MULTILINE))
    codes = {
        str(kind.exit_code) for _, kind in inspect.getmembers(errors, inspect.isclass) if hasattr(kind, "exit_code")
    }
    assert listed == codes | {"0", "129", "130", "143"}


@pytest.mark.parametrize("arguments", [[], ["--help"]])
def test_help_lists_the_commands(arguments, capsys):
    result = run(capsys, *arguments)
    assert (result.code, result.err) == (0, "")
    assert all(re.search(rf"^  {command} ", result.out, re.MULTILINE) for command in COMMANDS)


@pytest.mark.parametrize("command", COMMANDS)
def test_every_command_explains_itself(command, capsys):
    result = run(capsys, command, "--help")
    assert (result.code, result.err) == (0, "")
    assert result.out.startswith(f"Usage: framearray {command} [OPTIONS]")


def test_version(capsys):
    assert run(capsys, "--version").out == f"framearray {__version__}\n"


def test_schema_is_json(capsys):
    schema = json.loads(run(capsys, "schema").out)
    assert {"scene", "camera", "light"} <= set(schema["properties"])
