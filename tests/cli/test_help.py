"""Help, version and schema; the page of the command line is generated, and conventions.md has every exit code."""

import inspect
import json
import re
import shlex

import pytest
import typer
from pages.commands import command_page
from support import ROOT
from support.program import run

from framearray_cli import __version__
from framearray_cli.base import errors
from framearray_cli.cli import help as help_screens
from framearray_cli.cli.help import PAGES, documentation
from framearray_cli.cli.main import app

PAGE, CONVENTIONS = (ROOT / "docs" / "reference" / name for name in ("command-line.md", "conventions.md"))
COMMANDS = [
    "assemble",
    "check",
    "doctor",
    "export",
    "init",
    "openjd",
    "render",
    "report",
    "schema",
    "sheet",
    "verify",
    "view",
]


# What a parser's own words look like in a help screen or a message.
PARSER = re.compile(r"\{[A-Z]|<\w+|Value error|Input should|<=x|x>=|INTEGER|TEXT\\b|Invalid value|range>")


def test_the_commands_are_these():
    assert sorted(command.callback.__name__ for command in app.registered_commands if command.callback) == COMMANDS


def test_the_page_of_the_command_line_is_made_by_make_docs():
    assert PAGE.read_text(encoding="utf-8") == command_page()


def test_every_exit_code_is_documented():
    listed = set(re.findall(r"^\| (\d+) \|", CONVENTIONS.read_text(encoding="utf-8"), re.MULTILINE))
    codes = {
        str(kind.exit_code) for _, kind in inspect.getmembers(errors, inspect.isclass) if hasattr(kind, "exit_code")
    }
    assert listed == codes | {"0", "129", "130", "143"}


@pytest.mark.parametrize("arguments", [[], ["--help"], ["-h"]])
def test_help_lists_the_commands_in_the_order_of_use(arguments, capsys):
    result = run(capsys, *arguments)
    assert (result.code, result.err) == (0, "")
    listed = result.out.split("Commands:\n")[1].split("\n\n")[0].splitlines()
    assert [line.split()[0] for line in listed] == list(PAGES) and sorted(PAGES) == COMMANDS
    assert all(len(line) < 80 and line.endswith(".") and not line.endswith("...") for line in listed)


@pytest.mark.parametrize("command", ["", *COMMANDS])
@pytest.mark.parametrize("columns", ["50", "80", "200"])
def test_help_is_in_our_words_and_fits(command, columns, capsys, monkeypatch):
    monkeypatch.setenv("COLUMNS", columns)
    text = run(capsys, *([command] if command else []), "-h").out
    assert not PARSER.search(text)
    assert text.startswith(f"Usage: framearray {command}".strip()) and "Example" in text
    assert f"Documentation: {ROOT / 'docs' / 'index.md'}" in text
    body = [line for line in text.splitlines() if not re.match(r"Usage|Documentation|  framearray", line)]
    assert max(map(len, body)) <= int(columns)


@pytest.mark.parametrize("command", COMMANDS)
def test_the_example_of_a_command_is_a_command_line(command):
    """The parser takes it; nothing runs."""
    words = shlex.split(PAGES[command].example.split(" > ")[0])
    assert words[:2] == ["framearray", command]
    group = typer.main.get_command(app)
    chosen = group.commands[command]
    chosen.make_context(command, words[2:])


@pytest.mark.parametrize("command", COMMANDS)
def test_each_option_with_a_value_names_it(command):
    """Typer would name it by a type."""
    for one in typer.main.get_command(app).commands[command].params:
        assert one.is_flag if one.param_type_name == "option" and not one.metavar else one.metavar, one.name
        assert one.help and one.help[0].isupper() and one.help.endswith("."), one.name


def test_the_documentation_is_found_in_a_checkout_and_beside_a_wheel(tmp_path, monkeypatch):
    assert documentation() == str(ROOT / "docs" / "index.md")
    monkeypatch.setattr(help_screens, "SOURCE", tmp_path)
    monkeypatch.setattr("sys.prefix", str(tmp_path / "env"))
    assert documentation() is None
    page = tmp_path / "env" / "share" / "doc" / "framearray" / "reference" / "command-line.md"
    page.parent.mkdir(parents=True)
    page.write_text("")
    assert documentation() == str(page.parents[1] / "index.md")


@pytest.mark.parametrize("command", COMMANDS)
def test_every_command_explains_itself(command, capsys):
    result = run(capsys, command, "--help")
    assert (result.code, result.err) == (0, "")
    assert result.out.startswith(f"Usage: framearray {command} [OPTIONS]")


def test_version(capsys):
    assert run(capsys, "-V").out == run(capsys, "--version").out == f"framearray {__version__}\n"


def test_schema_is_json(capsys):
    schema = json.loads(run(capsys, "schema").out)
    assert {"scene", "camera", "light"} <= set(schema["properties"])


@pytest.mark.parametrize("command", ["render", "export", "sheet", "report", "assemble"])
def test_options_that_take_places_name_the_page(command, capsys):
    text = " ".join(run(capsys, command, "--help").out.split())
    assert CONVENTIONS.is_file()
    assert "reference/conventions.md" in text
