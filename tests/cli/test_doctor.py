"""`framearray doctor`, and FRAMEARRAY_THREADS."""

import importlib
import json
import re
import tomllib

import pytest
from packaging.requirements import Requirement
from support import ROOT, handmade
from support.program import run, write_job

from framearray_cli.base.memory import available_cores
from framearray_cli.cli.commands import doctor as machine
from framearray_cli.engine.embree.library import embree_properties

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


def test_it_is_a_document(capsys):
    found = json.loads(run(capsys, "doctor", "--json").out)["result"]
    assert {library["name"] for library in found["libraries"]} == set(machine.REQUIRED)
    assert found["memory"]["machine_bytes"] >= found["memory"]["free_bytes"] // 2 > 0
    assert found["cores"]["usable"] <= found["cores"]["machine"]


def test_every_dependency_is_looked_at():
    small = {"numpy", "tomli-w", "psutil", "xxhash", "filelock"}  # without them nothing gets this far
    assert {package(one) for one in PROJECT["dependencies"]} - small <= {name.lower() for name in machine.REQUIRED}


def test_every_extra_of_the_project_is_looked_at_and_has_a_row_in_the_guide():
    assert set(machine.EXTRAS) == set(PROJECT["optional-dependencies"]) - FOR_DEVELOPERS
    page = (ROOT / "docs/start/install.md").read_text(encoding="utf-8")
    assert set(machine.EXTRAS) <= set(re.findall(r"^\| `(\w+)` \|", page, re.MULTILINE))


@pytest.mark.parametrize("name", machine.EXTRAS)
def test_extras_are_those_of_the_project(name):
    modules = {"dracopy": "DracoPy", "flip-evaluator": "flip_evaluator", "usd-core": "pxr"}
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
    assert result.code == 2
    assert "environment variable FRAMEARRAY_THREADS: expected a whole number from 1 to 1024" in result.err
