"""Whole reports of small jobs."""

import json
import re
import tomllib
from pathlib import Path
from typing import Any

import jsonschema
import pytest
from support import tiny
from support.program import Result, run, write_job

from framearray_cli.cli import document

pytest.importorskip("jinja2")
pytest.importorskip("matplotlib")

SMALL = {
    "camera": tiny.WALK | {"resolution": [48, 36]},
    "light": {"frames": 3},
    "reuse": {"n_r": 1},
    "samples": {"hits": 1, "obscurance": 2},
}
FEW = (
    "--vary", "samples.hits=2", "--vary", "samples.obscurance=4", "--vary", "reuse.weights=average",
    "--vary", "reuse.n_r=0", "--no-truth",
)  # fmt: skip


@pytest.fixture(scope="module")
def made(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """Return a folder with a job; reports appear beside its images."""
    folder = tmp_path_factory.mktemp("report")
    write_job(folder, **SMALL)
    return folder


def report(capsys: pytest.CaptureFixture[str], folder: Path, *options: str) -> Result:
    return run(capsys, "report", folder / "job.toml", *options)


def read_table(place: Path) -> dict[str, Any]:
    return tomllib.loads((place / "table.toml").read_text(encoding="utf-8"))


def test_a_report_has_all_its_parts(made: Path, capsys: pytest.CaptureFixture[str]) -> None:
    result = report(capsys, made, *FEW)
    assert result.code == 0
    place = made / "out-report"
    assert f"report: {place / 'index.html'}" in result.out and "no other settings beat these" in result.out
    page = (place / "index.html").read_text()
    for name in re.findall(r'(?:src|href)="([^"]+)"', page):
        assert (place / name).is_file(), name
    assert (place / "error-and-time.svg").read_text().startswith("<?xml")
    rows = (table := read_table(place))["settings"]
    assert {"as the job says", "hits 2", "n_r 0", "obscurance 4"} <= {row["name"] for row in rows}
    assert table["reference"]["hits"] >= 100 * 3
    for row in rows:
        assert row["ms"] > 0 and 0 < row["rmse"] < 10
        assert row["name"] in page
    assert "truth" not in table and "true light: --no-truth" in page and "--no-truth" in result.out
    by_name = {row["name"]: row["rmse"] for row in rows}
    assert by_name["hits 2"] < by_name["as the job says"] < by_name["n_r 0"]
    assert by_name["from scratch, 3 hits"] == pytest.approx(by_name["light reuse only, 3 hits"], rel=1e-6)


def test_references_are_used_again(made: Path, capsys: pytest.CaptureFixture[str]) -> None:
    report(capsys, made, *FEW)
    kept = {file: file.stat().st_mtime_ns for file in (made / "out-report" / "references").iterdir()}
    assert len(kept) == 3
    assert report(capsys, made, *FEW, "--quiet").out == ""
    assert {file: file.stat().st_mtime_ns for file in (made / "out-report" / "references").iterdir()} == kept


def test_a_document(made: Path, capsys: pytest.CaptureFixture[str]) -> None:
    found = json.loads(report(capsys, made, *FEW, "--json").out)
    jsonschema.Draft202012Validator(document.results_schema()).validate(found)
    result, place = found["result"], made / "out-report"
    assert result["table"] == read_table(place) and Path(result["page"]).is_file()
    assert "truth" not in result["table"]


def test_true_light(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    """Methods stand next to the job's own; the first plot and the printed front are with respect to true light."""
    cells = {"method": "cells", "samples": 4096}
    write_job(tmp_path, **(SMALL | {"indirect": cells, "light": {"frames": 1, "sources": [tiny.SUN]}}))
    result = report(capsys, tmp_path, "--vary", "samples.hits=2", "--cameras", "2")
    place = tmp_path / "out-report"
    assert "with respect to true light" in result.out
    assert len(list((place / "references").iterdir())) == 2
    table = read_table(place)
    assert [row["name"] for row in table["truth"]["settings"]] == [
        row["name"] for row in table["settings"]
    ]  # no other method
    options = ("--vary", "indirect.method=obscurance,cells", "--cameras", "2")
    kept = {file: file.stat().st_mtime_ns for file in (place / "references").iterdir()}
    found = json.loads(report(capsys, tmp_path, *options, "--json").out)
    assert {file: file.stat().st_mtime_ns for file in (place / "references").iterdir()} == kept
    jsonschema.Draft202012Validator(document.results_schema()).validate(found)
    truth = found["result"]["table"]["truth"]
    rows = truth["settings"]
    assert [row["name"] for row in rows][-3:] == ["obscurance, hits 0.5", "obscurance", "obscurance, hits 2"]
    by_name = {row["name"]: row["rmse_of_squares"] for row in rows}
    assert by_name["as the job says"] < by_name["obscurance"]
    page = (place / "index.html").read_text()
    files = re.findall(r'(?:src|href)="([^"]+)"', page)
    assert all((place / name).is_file() for name in files) and "table.toml" in files
    plots = [name for name in files if name.endswith(".svg")]
    assert plots == ["true-light-and-time.svg", "error-and-time.svg"]
    assert (truth["cameras"], truth["lights"]) == ([2], [0]) and truth["reference"]["rmse"] > 0


def test_a_job_without_true_light(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    job = write_job(tmp_path, **SMALL)
    job.write_text(job.read_text().replace("paths = 512", "intensity = [0.1, 0.1, 0.1]"))
    result = report(capsys, tmp_path, *FEW[:2], "--cameras", "2", "--light", "0")
    assert result.code == 0 and "Nothing is compared with true light, because the job fixes" in result.out
    place = tmp_path / "out-report"
    assert "ambient.intensity" in (place / "index.html").read_text() and "truth" not in read_table(place)


@pytest.mark.parametrize(
    ("options", "words"),
    [
        (("--light", "-4"), "--light: expected one of 3 light positions (0 to 2, or -3 to -1), got -4"),
        (("--cameras", "noon"), "--cameras: expected places such as 5, 0-47, "),
        (("--vary", "samples.hit=2"), "--vary: expected one of"),
    ],
)
def test_wrong_options(made: Path, capsys: pytest.CaptureFixture[str], options: tuple[str, str], words: str) -> None:
    result = report(capsys, made, *options)
    assert result.code == 2 and words in result.err
    assert "Traceback" not in result.err


def test_one_camera_and_one_light(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    """Without a window no setting of reuse is tried."""
    still = {"resolution": [40, 30], "keys": tiny.WALK["keys"][:1]}
    write_job(tmp_path, **SMALL | {"camera": still, "light": {"frames": 1, "sources": [tiny.SUN]}})
    assert report(capsys, tmp_path, *FEW, "--output", str(tmp_path / "elsewhere")).code == 0
    table = read_table(tmp_path / "elsewhere")
    assert (table["cameras"], table["lights"]) == ([0], [0])
