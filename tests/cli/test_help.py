"""Help, version and schema; docs/reference/command-line.md documents every command, option and exit code."""

import inspect
import json
import re
import shlex

import pytest
import typer
from support import ROOT
from support.program import run

from framearray_cli import __version__
from framearray_cli.base import errors
from framearray_cli.cli import help as help_screens
from framearray_cli.cli.help import PAGES, documentation
from framearray_cli.cli.main import app

PAGE = ROOT / "docs" / "reference" / "command-line.md"
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


def section(page: str, command: str) -> str:
    """Return the section of a page about a command: from its heading to the next."""
    return page.split(f"\n## framearray {command}\n")[1].split("\n## ")[0]


def options(capsys: pytest.CaptureFixture[str], command: str) -> set[str]:
    """Return all options of a command, as its help lists them."""
    shown = run(capsys, command, "--help").out
    return set(re.findall(r"(?<![\w-])--?[a-z][\w-]*", shown.split("Options:")[1])) - {"--help", "-h"}


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


@pytest.mark.parametrize("command", COMMANDS)
def test_an_option_has_one_row_and_common_ones_stand_in_the_synopsis(command, capsys):
    text = section(PAGE.read_text(), command)
    for table in re.findall(r"(?:^\|.*\n)+", text, re.MULTILINE):  # render has one for --preview, too
        rows = re.findall(r"^\| `(--[a-z-]+)", table, re.MULTILINE)
        assert len(rows) == len(set(rows)), rows
    synopsis = "".join(re.findall(r"^    .*\n", text, re.MULTILINE))
    common = {"--dry-run", "--force", "--json", "--quiet"} & options(capsys, command)
    assert "[options]" in synopsis or not [option for option in common if f"[{option}]" not in synopsis]


def test_a_missing_option_is_found(capsys):
    assert "--restart" in options(capsys, "render")
    assert "--restart" not in section(PAGE.read_text().replace("--restart", ""), "render")


def test_every_exit_code_is_documented():
    listed = set(re.findall(r"^\| (\d+) \|", PAGE.read_text(), re.MULTILINE))
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
    assert max(map(len, body)) < max(int(columns), 50)


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
    assert (ROOT / "docs" / "reference" / "places.md").is_file()
    assert "reference/places.md" in text
