"""`--json`: one document on standard output, which the published schema describes, also where a command fails."""

import json
import os
import signal
import subprocess
import tomllib
import urllib.request
from pathlib import Path
from typing import Any

import jsonschema
import pytest
from support import handmade
from support.program import Result, finish, run, start, write_job

import framearray_cli
from framearray_cli.cli import document
from framearray_cli.cli.results import RESULTS


def parsed(capsys: pytest.CaptureFixture[str], *arguments: str | Path) -> tuple[Result, dict[str, Any]]:
    """Run a command with `--json`; return how it ended, and its document, once the schema has been compared."""
    result = run(capsys, *arguments, "--json")
    return result, valid(result, result.code)


def valid(result: Result, code: int) -> dict[str, Any]:
    """Return the document of a command, which the schema describes."""
    found = json.loads(result.out)
    jsonschema.Draft202012Validator(SCHEMA).validate(found)
    assert (found["framearray"], found["exit_code"]) == (framearray_cli.__version__, code)
    return found


SCHEMA = document.results_schema()


@pytest.fixture
def array(tmp_path: Path) -> Path:
    handmade.plain(tmp_path / "array", n_c=2, n_l=2)
    return tmp_path / "array"


def test_the_schema_is_one_and_refuses_other_documents():
    jsonschema.Draft202012Validator.check_schema(SCHEMA)
    document.outcome.begin([])  # forget the command that ran before
    right = json.loads(document.document_text("check", 0, []))
    validator = jsonschema.Draft202012Validator(SCHEMA)
    assert validator.is_valid(right)
    assert not validator.is_valid(right | {"command": "sheet", "result": {"file": "a.png"}})
    assert not validator.is_valid(right | {"exit_code": "0"})
    assert not validator.is_valid({key: value for key, value in right.items() if key != "problems"})


def test_check_and_render(tmp_path, capsys):
    job = write_job(tmp_path)
    result, found = parsed(capsys, "check", job)
    assert (result.code, found["command"], found["problems"], found["warnings"]) == (0, "check", [], [])
    estimate = found["result"]
    assert (estimate["array"]["cameras"], estimate["array"]["images"]) == (1, 3)
    assert estimate["array"]["resolution"] == [24, 18] and estimate["disk_bytes"] > 100
    assert estimate["rays_together"] in (16, 8, 4) and f"traces {estimate['rays_together']} rays together" in (
        run(capsys, "check", job).out
    )
    result, found = parsed(capsys, "render", job)
    assert result.code == 0 and "triangles" in result.err
    done = found["result"]
    assert (done["written"], done["there"], done["images"], done["finished"]) == (3, 3, 3, True)
    summary = tomllib.loads(Path(done["manifest"]).read_text())["summary"]
    assert (done["clipped"], done["black"]) == pytest.approx((summary["clipped"], summary["black"]), abs=1e-4)
    assert summary["rays_together"] == estimate["rays_together"]
    assert 0 <= done["compile_seconds"] < done["seconds"] and done["array_seconds"] > 0
    assert sum(done["stage_seconds"].values()) > 0
    assert done["directory"] == str(tmp_path / "out") and Path(done["manifest"]).is_file()
    other = write_job(tmp_path, "other.toml", seed=9)
    _, found = parsed(capsys, "check", other)
    assert len(found["warnings"]) == 1 and "holds another frame array" in found["warnings"][0]
    result, found = parsed(capsys, "render", "-q", other)
    assert (result.code, found["result"]) == (4, None)
    assert found["problems"] == result.err.splitlines()


def test_a_preview(tmp_path, capsys):
    _, found = parsed(capsys, "render", write_job(tmp_path), "--preview", "--light", "1")
    assert Path(found["result"]["preview"]).is_file()
    assert (found["result"]["camera"], found["result"]["lights"]) == (0, {"light": 1})


def test_warnings_are_listed_and_strict_ones_are_problems(tmp_path, capsys):
    job = write_job(tmp_path, camera={"fov": 1.047})  # radians
    _, found = parsed(capsys, "check", job)
    assert found["warnings"] and not found["problems"]
    result, strict = parsed(capsys, "check", job, "--strict")
    assert result.code == 2 and len(strict["problems"]) == len(found["warnings"]) and strict["result"]


def test_verify_and_repair(tmp_path, capsys):
    out = tmp_path / "out"
    assert run(capsys, "render", "-q", write_job(tmp_path)).code == 0
    result, found = parsed(capsys, "verify", out, "-q")
    assert result.err == "" and found["result"]["whole"] is True and found["result"]["files"] == 4
    (out / "tiny.c0000.l001.png").unlink()
    result, found = parsed(capsys, "verify", out, "-q")
    assert result.code == 5 and found["problems"] == []
    assert found["result"]["damaged"] == [{"file": "tiny.c0000.l001.png", "problem": "missing"}]
    result, found = parsed(capsys, "verify", out, "-q", "--repair")
    assert result.code == 0 and found["result"]["whole"] is False
    assert found["result"]["repaired"]["finished"] is True
    assert run(capsys, "verify", out).code == 0


def test_what_is_done_with_an_array(array, tmp_path, capsys):
    _, found = parsed(capsys, "sheet", array, "-o", tmp_path / "sheet.png")
    assert found["result"]["cameras"] == found["result"]["lights"] == [0, 1]
    _, found = parsed(capsys, "export", array, "-f", "colmap", "-o", tmp_path / "colmap")
    assert found["result"]["directory"].endswith("colmap") and found["result"]["lights"] == 1
    _, found = parsed(capsys, "assemble", array, "walk", "-o", tmp_path / "frame.####.png")
    assert (found["result"]["frames"], found["result"]["images"]) == (2, 2)


def test_an_exported_page(array, tmp_path, capsys):
    _, found = parsed(capsys, "view", array, "--export", tmp_path / "page")
    page = found["result"]
    assert (page["directory"], page["damaged"]) == (str(tmp_path / "page"), 0) and page["pictures"] >= 4
    assert page["size_bytes"] == sum(one.stat().st_size for one in (tmp_path / "page").rglob("*") if one.is_file())


@pytest.mark.skipif(os.name == "nt", reason="no such signal there")
def test_the_address_of_the_page_comes_at_once_and_ends_the_document(array):
    process = start("view", array, "--no-browser", "--json", stdout=subprocess.PIPE)
    assert process.stdout is not None
    text = ""
    while not text.endswith("\n}\n"):
        line = process.stdout.readline()
        assert line, text
        text += line
    address = valid(Result(code=0, out=text, err=""), 0)["result"]["url"]
    with urllib.request.urlopen(address, timeout=30) as page:
        assert b"<html" in page.read()
    process.send_signal(signal.SIGINT)
    assert finish(process).out == "", "one document"


@pytest.mark.parametrize(
    ("arguments", "code", "problem"),
    [
        (["check", "none.toml"], 2, "none.toml: no such file"),
        (["check"], 2, "Error: Missing argument 'JOB'."),
        (["chek", "a.toml"], 2, "Error: No such command 'chek'"),
        (["init", "none.glb"], 3, "none.glb: no such scene file"),
        (["verify", "none"], 4, "none: no such file"),
        (["schema"], 2, "Error: No such option: --json"),
    ],
)
def test_errors_are_documents_too(arguments, code, problem, tmp_path, capsys, monkeypatch):
    monkeypatch.chdir(tmp_path)
    result, found = parsed(capsys, *arguments)
    assert (result.code, found["result"], len(found["problems"])) == (code, None, 1)
    assert found["problems"][0].startswith(problem) and found["problems"][0] in result.err


def test_all_problems_of_a_job_are_listed(tmp_path, capsys):
    _, found = parsed(capsys, "check", write_job(tmp_path, camera={"fov": 500.0}, seed=-1))
    assert [problem.split(": ")[1] for problem in found["problems"]] == ["seed", "camera.fov"]


def test_each_command_with_the_option_has_a_result_in_the_schema():
    from framearray_cli.cli.main import app

    with_option = {
        command.callback.__name__ for command in app.registered_commands if "json" in command.callback.__annotations__
    }
    assert with_option == set(RESULTS)


def test_without_the_option_nothing_is_a_document(tmp_path, capsys):
    """Not even after a command that had it; behind `--` it is a name."""
    parsed(capsys, "verify", "none")
    assert run(capsys, "verify", "none").out == ""
    assert run(capsys, "verify", "--", "--json").out == ""


@pytest.mark.skipif(os.name == "nt", reason="no such pipes there")
@pytest.mark.parametrize(
    "arguments", [["check", "none.toml", "--json"], ["check", "job.toml"], ["--help"], ["-V"], ["schema"]]
)
def test_a_reader_that_has_gone_is_an_exit_code(arguments, tmp_path):
    """The code of a program which the signal SIGPIPE ends, as shells expect."""
    write_job(tmp_path)
    reading, writing = os.pipe()
    os.close(reading)
    process = start(*arguments, stdout=writing, cwd=tmp_path)
    os.close(writing)
    result = finish(process)
    assert "Traceback" not in result.err
    assert result.code == (2 if "none.toml" in arguments else 141)
