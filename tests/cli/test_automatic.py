"""Jobs with automatic n_r and hits, or with an error instead of hits: what is chosen, printed and made again."""

import re
from pathlib import Path
from typing import Any

import pytest
from support import tiny
from support.handed import contents
from support.program import run, write_job

from framearray_cli.array.manifest_toml import read_manifest

BOTH = {"camera": tiny.WALK, "reuse": {"n_r": "auto"}, "samples": {"hits": "auto"}}
LINE = r"^automatic: n_r = (\d+), hits = ([\d.]+); expected: [\d.]+ hits per pixel \(1st percentile [\d.]+\), "
LINE += r"[\d.]+ times the error that is wanted, [\d.]+ times the time of n_r = 3, hits = 2$"
SEEN = r"^  hits that are seen that many frames away: \d+% \(1\), \d+% \(2\), \d+% \(4\)$"


def test_a_choice_is_printed_and_stored(tmp_path, capsys):
    result = run(capsys, "render", write_job(tmp_path, **BOTH))
    assert result.code == 0
    n_r, hits = re.search(LINE, result.err, re.MULTILINE).groups()
    assert re.search(SEEN, result.err, re.MULTILINE)
    stored = read_manifest(tmp_path / "out")
    assert stored.summary["finished"] is True
    assert stored.summary["automatic"]["keys"] == ["reuse.n_r", "samples.hits"]
    assert set(stored.summary["automatic"]["seen"]) == {"1", "2", "4"}
    assert (stored.job["reuse"]["n_r"], stored.job["samples"]["hits"]) == (int(n_r), float(hits))
    assert stored.job["specular"]["hits"] == 14
    checked = run(capsys, "check", write_job(tmp_path, **BOTH))
    assert checked.code == 0
    assert re.search(LINE, checked.out, re.MULTILINE).group() == re.search(LINE, result.err, re.MULTILINE).group()
    assert "warning" not in checked.err, "the array that lies there is the same one"


def test_the_numbers_that_were_chosen_give_the_same_array(tmp_path, capsys):
    """With any number of threads; a job with these numbers recognises its own array in the folder."""
    assert run(capsys, "render", "-q", write_job(tmp_path, **BOTH)).code == 0
    stored, first = read_manifest(tmp_path / "out"), contents(tmp_path / "out")
    numbers = {"reuse": {"n_r": stored.job["reuse"]["n_r"]}, "samples": {"hits": stored.job["samples"]["hits"]}}
    same = write_job(tmp_path, "same.toml", **(BOTH | numbers | {"specular": {"hits": 14}}))
    assert run(capsys, "render", "-q", write_job(tmp_path, **BOTH), "--threads", "1", "--restart").code == 0
    assert (read_manifest(tmp_path / "out").fingerprint, contents(tmp_path / "out")) == (stored.fingerprint, first)
    result = run(capsys, "render", same)
    assert "nothing is left to do" in result.err
    result = run(capsys, "render", same, "--restart")
    assert (result.code, "automatic" in result.err) == (0, False)
    assert (read_manifest(tmp_path / "out").fingerprint, contents(tmp_path / "out")) == (stored.fingerprint, first)
    assert "automatic" not in read_manifest(tmp_path / "out").summary


@pytest.mark.parametrize(
    ("changes", "key"), [({"reuse": {"n_r": "auto"}}, "n_r = "), ({"samples": {"hits": "auto"}}, "hits = ")]
)
def test_one_of_the_two(changes, key, tmp_path, capsys):
    result = run(capsys, "check", write_job(tmp_path, camera=tiny.WALK, **changes))
    assert result.code == 0
    assert re.search(rf"^automatic: {key}[\d.]+; expected", result.out, re.MULTILINE)


def test_another_word_is_a_problem(tmp_path, capsys):
    result = run(capsys, "render", write_job(tmp_path, reuse={"n_r": "Auto"}, samples={"hits": "best"}))
    assert result.code == 2
    assert result.err.splitlines() == [
        f'{tmp_path / "job.toml"}: samples.hits: expected a whole number from 1 to 65000, 1/2, 1/3, ... 1/8 or "auto", '
        'got "best"',
        f'{tmp_path / "job.toml"}: reuse.n_r: expected a whole number from 0 to 64 or "auto", got "Auto"',
        "2 problems; nothing was rendered.",
    ]


def test_a_job_beyond_memory_is_refused_before_anything_is_chosen(tmp_path, capsys, monkeypatch):
    monkeypatch.setattr("framearray_cli.render.memory.free_memory", lambda: 2**20)
    monkeypatch.setattr("framearray_cli.render.automatic", None)
    result = run(capsys, "render", "-q", write_job(tmp_path, **BOTH))
    assert result.code == 2
    assert re.search(r"rendering needs at least [\d.]+ GiB of memory", result.err)


ERROR_LINE = (
    r"^error: 0\.2 of the mean radiance is wanted; ([\d.]+) native hits per pixel \(([\d.]+) to ([\d.]+) by frame\) "
)
ERROR_LINE += r"are expected to give ([\d.]+)$"


def wanting(folder: Path, **samples: Any) -> Path:
    """Write a job file with some [samples] instead of a number of hits."""
    more = {"samples": {"hits": None} | samples, "output": {"format": "exr"}}
    return write_job(folder, camera=tiny.WALK, reuse={"n_r": 2}, **more)


def test_the_allotted_hits_are_printed_and_stored(tmp_path, capsys):
    job = wanting(tmp_path, error=0.2, halves=True)
    result = run(capsys, "render", job)
    assert result.code == 0
    hits, least, most, expected = map(float, re.search(ERROR_LINE, result.err, re.MULTILINE).groups())
    assert least <= hits <= most
    summary = read_manifest(tmp_path / "out").summary
    assert summary["finished"] is True
    target = summary["target"]
    assert (target["error"], round(target["hits"], 1)) == (0.2, hits)
    assert float(f"{target['expected']:.3g}") == expected
    assert summary["rays"]["target"] == target["pilot_rays"] > 0
    # an image of 24 x 18 pixels has only 9 blocks, so the bounds are wide
    assert 0.5 < summary["standard_error"]["relative"] / 0.2 < 1.5
    checked = run(capsys, "check", job)
    assert checked.code == 0
    lines = [re.search(ERROR_LINE, text, re.MULTILINE).group() for text in (checked.out, result.err)]
    assert lines[0] == lines[1]


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
