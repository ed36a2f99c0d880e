"""Jobs with an error instead of hits: output, manifest, refused values, and the same result every time."""

import re
import tomllib
from pathlib import Path
from typing import Any

import tomli_w
from support import tiny
from support.program import run, write_job

LINE = r"^error: 0\.2 of the mean radiance is wanted; ([\d.]+) native hits per pixel \(([\d.]+) to ([\d.]+) by frame\) "
LINE += r"are expected to give ([\d.]+)$"


def wanting(folder: Path, name: str = "job.toml", **samples: Any) -> Path:
    """Write a job file with some [samples] in place of a number of hits."""
    file = write_job(folder, name, camera=tiny.WALK, reuse={"n_r": 2})
    table = tomllib.loads(file.read_text())
    table["samples"] = {"obscurance": table["samples"]["obscurance"], **samples}
    table["output"]["format"] = "exr"
    file.write_text(tomli_w.dumps(table))
    return file


def stored(folder: Path) -> dict[str, Any]:
    return tomllib.loads((folder / "manifest.toml").read_text())


def images(folder: Path) -> dict[str, bytes]:
    return {file.name: file.read_bytes() for file in folder.glob("*.*") if file.suffix != ".toml"}


def test_the_allotted_hits_are_printed_and_stored(tmp_path, capsys):
    job = wanting(tmp_path, error=0.2, halves=True)
    result = run(capsys, "render", job)
    assert result.code == 0
    hits, least, most, expected = map(float, re.search(LINE, result.err, re.MULTILINE).groups())
    assert least <= hits <= most
    summary = stored(tmp_path / "out")["summary"]
    assert summary["finished"] is True
    target = summary["target"]
    assert (target["error"], round(target["hits"], 1)) == (0.2, hits)
    assert float(f"{target['expected']:.3g}") == expected
    assert summary["rays"]["target"] == target["pilot_rays"] > 0
    # an image of 24 x 18 pixels has only 9 blocks, so the bounds are wide
    assert 0.5 < summary["standard_error"]["relative"] / 0.2 < 1.5
    checked = run(capsys, "check", job)
    assert checked.code == 0
    assert re.search(LINE, checked.out, re.MULTILINE).group() == re.search(LINE, result.err, re.MULTILINE).group()


def test_the_array_does_not_depend_on_threads(tmp_path, capsys):
    job = wanting(tmp_path, error=0.3)
    assert run(capsys, "render", "-q", job).code == 0
    first = images(tmp_path / "out")
    assert run(capsys, "render", "-q", job, "--threads", "1", "--restart").code == 0
    assert images(tmp_path / "out") == first


def test_another_error_is_another_array(tmp_path, capsys):
    assert run(capsys, "render", "-q", wanting(tmp_path, error=0.3)).code == 0
    assert run(capsys, "render", "-q", wanting(tmp_path, error=0.4)).code == 4


def test_too_few_hits_are_reported(tmp_path, capsys):
    result = run(capsys, "render", wanting(tmp_path, error=0.001, most_hits=2))
    assert result.code == 0
    note = "note: 100.0% of all places have as many hits as samples.most_hits allows, too few for this error"
    assert note in result.err.splitlines()


def test_hits_and_error_together_are_refused(tmp_path, capsys):
    result = run(capsys, "render", wanting(tmp_path, hits=2, error=0.1))
    assert result.code == 2
    assert "samples.error: expected either hits or error" in result.err
