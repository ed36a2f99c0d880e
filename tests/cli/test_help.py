"""Help, version, schemas and `doctor`; the page of the command line is generated."""

import importlib
import inspect
import json
import re
import shlex
import tomllib
from typing import Any

import jsonschema
import pytest
import typer
from packaging.requirements import Requirement
from pages.commands import command_page
from support import ROOT, handmade
from support.program import run, write_job

from framearray_cli import __version__
from framearray_cli.base import errors
from framearray_cli.base.memory import available_cores
from framearray_cli.cli.commands import doctor as machine
from framearray_cli.cli.commands.schemas import KINDS
from framearray_cli.cli.main import PAGES, app
from framearray_cli.engine.embree.library import embree_properties

PAGE, CONVENTIONS = (ROOT / "docs" / "reference" / name for name in ("command-line.md", "conventions.md"))
COMMANDS = [command.__name__ for command, _, _ in PAGES]


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
    assert [line.split()[0] for line in listed] == [command.__name__ for command, _, _ in PAGES]
    assert all(len(line) < 80 and line.endswith(".") and not line.endswith("...") for line in listed)


@pytest.mark.parametrize("page", PAGES)
def test_the_example_of_a_command_is_a_command_line(page):
    """The parser takes it; nothing runs."""
    run, _, example = page
    command, words = run.__name__, shlex.split(example.split(" > ")[0])
    assert words[:2] == ["framearray", command]
    typer.main.get_command(app).commands[command].make_context(command, words[2:])


@pytest.mark.parametrize("command", COMMANDS)
def test_each_option_with_a_value_names_it(command):
    """Typer would name it by a type."""
    for one in typer.main.get_command(app).commands[command].params:
        assert one.is_flag if one.param_type_name == "option" and not one.metavar else one.metavar, one.name
        assert one.help and one.help[0].isupper() and one.help.endswith("."), one.name


@pytest.mark.parametrize("command", COMMANDS)
def test_every_command_explains_itself(command, capsys):
    result = run(capsys, command, "--help")
    assert (result.code, result.err) == (0, "")
    assert result.out.startswith(f"Usage: framearray {command} [OPTIONS]")


def test_version(capsys):
    assert run(capsys, "-V").out == run(capsys, "--version").out == f"framearray {__version__}\n"


@pytest.mark.parametrize("command", ["render", "export", "sheet", "report", "assemble"])
def test_options_that_take_places_name_the_page(command, capsys):
    text = " ".join(run(capsys, command, "--help").out.split())
    assert CONVENTIONS.is_file()
    assert "reference/conventions.md" in text


def schema(capsys: pytest.CaptureFixture[str], *kind: str) -> dict[str, Any]:
    result = run(capsys, "schema", *kind)
    assert (result.code, result.err) == (0, "")
    found: dict[str, Any] = json.loads(result.out)
    jsonschema.Draft202012Validator.check_schema(found)
    return found


def fits(schema: dict[str, Any], document: object) -> bool:
    return jsonschema.Draft202012Validator(schema).is_valid(document)


@pytest.mark.parametrize("kind", KINDS)
def test_each_has_a_title(kind, capsys):
    assert schema(capsys, kind)["title"].startswith("framearray ")


def test_that_of_jobs_comes_without_a_word(capsys):
    found = schema(capsys)
    assert found == schema(capsys, "job") and {"scene", "camera", "light"} <= set(found["properties"])


def test_paths(capsys):
    found = schema(capsys, "path")
    right = {"fps": 24.0, "segments": [{"frames": 2, "camera": [0, 1], "light": 0}]}
    assert fits(found, right)
    assert not fits(found, right | {"segments": 3})
    assert not fits(found, right | {"fp": 24.0})
    assert not fits(found, {"fps": 24.0})


@pytest.mark.parametrize("kind", ["manifest", "results"])
def test_keys_are_described(kind, capsys):
    found = schema(capsys, kind)
    place = found if kind == "manifest" else found["$defs"]["RenderResult"]
    key = "fps" if kind == "manifest" else "finished"
    assert place["properties"][key]["description"]
    assert "Attributes" not in json.dumps(found)


@pytest.mark.parametrize("make", ["plain", "grouped"])
def test_manifests(make, tmp_path, capsys):
    getattr(handmade, make)(tmp_path)
    table = tomllib.loads((tmp_path / "manifest.toml").read_text())
    found = schema(capsys, "manifest")
    jsonschema.Draft202012Validator(found).validate(table)
    assert fits(found, table | {"later": 1}), "readers ignore unknown keys"
    assert not fits(found, table | {"format": 3})
    assert not fits(found, table | {"resolution": [3]})
    for key in ("fps", "cameras", "groups" if make == "grouped" else "lights"):
        assert not fits(found, {name: value for name, value in table.items() if name != key})


FOR_DEVELOPERS = {"bench", "dev", "docs", "fuzz", "peers"}  # extras that the program itself does not use
PROJECT = tomllib.loads((ROOT / "pyproject.toml").read_text())["project"]


def package(requirement: str) -> str:
    return re.split(r"[<>=; ]", requirement)[0].lower()


def is_for_this_python(requirement: str) -> bool:
    marker = Requirement(requirement).marker
    return marker is None or marker.evaluate()


def test_it_reports_the_machine(capsys):
    result = run(capsys, "doctor")
    assert (result.code, result.err) == (0, "")
    lines = dict(line.split(": ", 1) for line in result.out.splitlines()[1:])
    assert lines["cores"].startswith(f"{available_cores()} usable of ")
    assert re.search(r"\bnumba \d+\.\d+", lines["libraries"])
    assert re.fullmatch(r".*: \d+ kernels, .*", lines["compiled kernels"])
    assert [key for key in lines if key.startswith("extra ")] == [f"extra {name}" for name in machine.EXTRAS]


def test_every_dependency_is_looked_at():
    small = {"numpy", "tomli-w", "psutil", "xxhash", "filelock"}  # without them nothing gets this far
    assert {package(one) for one in PROJECT["dependencies"]} - small <= {name.lower() for name in machine.REQUIRED}


def test_every_extra_of_the_project_is_looked_at_and_has_a_row_in_the_guide():
    assert set(machine.EXTRAS) == set(PROJECT["optional-dependencies"]) - FOR_DEVELOPERS
    page = (ROOT / "docs/start/install.md").read_text(encoding="utf-8")
    assert set(machine.EXTRAS) <= set(re.findall(r"^\| `(\w+)` \|", page, re.MULTILINE))


@pytest.mark.parametrize("name", machine.EXTRAS)
def test_extras_are_those_of_the_project(name):
    modules = {"dracopy": "DracoPy", "usd-core": "pxr", "materialx": "MaterialX", "pycollada": "collada"}
    wanted = {package(one) for one in PROJECT["optional-dependencies"][name] if is_for_this_python(one)}
    assert {modules.get(one, one) for one in wanted} == set(machine.EXTRAS[name][1])


def test_a_missing_extra_and_a_broken_library_are_named(capsys, monkeypatch):
    monkeypatch.setitem(machine.EXTRAS, "movie", ("movies", ("no_such_module",)))
    load = importlib.import_module

    def refuse(name: str) -> object:
        if name == "trimesh":
            raise ImportError("libfoo.so.1: cannot open\x1b[2J")
        return load(name)

    monkeypatch.setattr(importlib, "import_module", refuse)
    result = run(capsys, "doctor")
    assert result.code == 5
    assert re.search(r"^extra movie: not installed \(movies\); install it with: .*\[movie\]", result.out, re.MULTILINE)
    assert result.err == "warning: trimesh cannot be loaded: ImportError: libfoo.so.1: cannot open\\x1b[2J\n"


def test_embree_traces_packets():
    found = embree_properties()
    assert found.version.startswith(("3.", "4.")) and 4 in found.packet_widths


def threads_of(capsys: pytest.CaptureFixture[str], monkeypatch: pytest.MonkeyPatch, *arguments: object) -> int:
    """Return the number of threads that a job is checked with."""
    seen = []
    monkeypatch.setattr(
        "framearray_cli.render.estimate.check", lambda job, *_: seen.append(job.render.threads) or 1 / 0
    )
    with pytest.raises(ZeroDivisionError):
        run(capsys, "check", *arguments)
    return seen[0]


def test_an_option_stands_above_the_environment_and_that_above_the_job(tmp_path, capsys, monkeypatch):
    job = write_job(tmp_path, render={"threads": 2})
    assert threads_of(capsys, monkeypatch, job) == 2
    monkeypatch.setenv("FRAMEARRAY_THREADS", "")
    assert threads_of(capsys, monkeypatch, job) == 2
    monkeypatch.setenv("FRAMEARRAY_THREADS", "3")
    assert threads_of(capsys, monkeypatch, job) == 3
    assert threads_of(capsys, monkeypatch, job, "--threads", "4") == 4
    assert "FRAMEARRAY_THREADS is 3" in run(capsys, "doctor").out


def test_a_wrong_number_in_the_environment_is_named(tmp_path, capsys, monkeypatch):
    handmade.plain(tmp_path, n_c=1, n_l=1)
    monkeypatch.setenv("FRAMEARRAY_THREADS", "many")
    result = run(capsys, "verify", tmp_path)
    assert result.code == 2 and "expected a whole number from 1 to 1024" in result.err
