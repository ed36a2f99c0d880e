"""The fuzz run itself: each way to end badly is noticed, and what is kept of it."""

import os
import random
import signal
import sys
import time
import warnings
from pathlib import Path

import numpy as np
import pytest

from fuzz import jobfiles, outcome, page, rendered, texts
from fuzz.case import Case
from fuzz.run import run

pytestmark = pytest.mark.skipif(not hasattr(os, "fork"), reason="processes are copied")


def refuse(text: str) -> None:
    """End as a command ends that refuses its input."""
    print(text, file=sys.stderr)
    sys.exit(2)


def warn() -> None:
    """As Python does where pytest does not catch it."""
    sys.stderr.write(warnings.formatwarning("odd", RuntimeWarning, "x.py", 1))
    sys.exit(0)


def spin() -> None:
    while True:
        pass


WAYS = {
    "accepted": (lambda: sys.exit(0), "accepted"),
    "refused": (lambda: refuse("x.toml: what is wrong"), "refused"),
    "traceback": (lambda: 1 / 0, "traceback"),
    "warning": (warn, "warning of a library"),
    "code": (lambda: os._exit(7), "exit code 7"),
    "abort": (lambda: os.kill(os.getpid(), signal.SIGKILL), "crash (SIGKILL)"),
    "silence": (lambda: sys.exit(2), "no message"),
    "lines": (lambda: refuse("x\n" * 100), "endless message"),
    "width": (lambda: refuse("x" * 2000), "endless message"),
    "sleep": (lambda: time.sleep(60), "hang"),
    "spin": (spin, "hang"),
    "memory": (lambda: bytearray(outcome.MEMORY * 2), "traceback"),
}


@pytest.mark.parametrize("name", WAYS)
def test_each_way_to_end_is_told(name, tmp_path, monkeypatch):
    monkeypatch.setattr(outcome, "PATIENCE", 0.5)
    before, verdict = WAYS[name]
    assert outcome.outcome_of(["schema"], tmp_path / "log.txt", before=before).verdict == verdict


def cases_of(folder: Path, ways: list[str], *, isolated: bool) -> list[Case]:
    found = []
    for k, way in enumerate(ways):
        (folder / str(k)).mkdir(parents=True)
        found.append(
            Case(arguments=("schema",), mutation=way, folder=folder / str(k), before=WAYS[way][0], isolated=isolated)
        )
    return found


@pytest.mark.parametrize("isolated", [True, False])
def test_cases_that_share_a_process_end_as_isolated_ones_do(isolated, tmp_path, monkeypatch):
    monkeypatch.setattr("fuzz.run.TOGETHER", 3)
    ways = ["accepted", "refused", "refused", "traceback", "accepted", "code", "refused", "silence", "refused"]
    cases = cases_of(tmp_path / "cases", ways, isolated=isolated)
    table = run(cases, len(ways), 60.0, tmp_path / "kept", tmp_path)
    assert table["cases"] == len(ways)
    assert table["mutations"] == {
        "accepted": {"accepted": 2},
        "code": {"exit code 7": 1},
        "refused": {"exit code 2": 4},
        "silence": {"no message": 1},
        "traceback": {"traceback": 1},
    }
    assert [bad["mutation"] for bad in table["bad"]] == ["traceback", "code", "silence"]
    assert all((Path(bad["folder"]) / "case.txt").is_file() for bad in table["bad"])
    assert not list((tmp_path / "cases").iterdir()), "those that ended well are removed, the others moved"


def test_what_else_is_wrong_counts(tmp_path):
    [case] = cases_of(tmp_path, ["accepted"], isolated=True)
    wrong = Case(**{**case.__dict__, "wrong": lambda outcome: "lost a file"})
    table = run([wrong], 1, 60.0, tmp_path / "kept", tmp_path)
    assert table["mutations"] == {"accepted": {"lost a file": 1}}
    assert len(table["bad"]) == 1


def test_a_rendered_value_that_is_not_finite_is_found(tmp_path, monkeypatch):
    from support import movies

    from framearray_cli.array.images import ImageFormat, write_image

    manifest = movies.plain(tmp_path, 1, 1, "tif")
    job = type("Job", (), {"output": type("Output", (), {"directory": tmp_path})})
    with pytest.raises(AssertionError, match="unknown=1"):  # no record contains it
        rendered.look_at(job)
    monkeypatch.setattr("framearray_cli.array.images._largest", lambda label, values: 1.0)
    file = tmp_path / manifest.images.format(camera=0, light=0)
    write_image(file, np.full((48, 64, 3), np.nan, np.float32), ImageFormat(format="tif"))
    with pytest.raises(AssertionError, match="not finite"):
        rendered.look_at(job)


def test_cases_are_those_of_the_seed(tmp_path):
    def made(seed: int, folder: Path) -> list[str]:
        folder.mkdir()
        cases = [case for _, case in zip(range(12), jobfiles.cases(random.Random(seed), folder), strict=False)]
        return [case.mutation for case in cases]

    assert made(1, tmp_path / "a") == made(1, tmp_path / "b") != made(2, tmp_path / "c")


@pytest.mark.parametrize("name", texts.TEXT)
def test_mutations_change_bytes_and_take_any(name):
    rng = random.Random(name)
    for data in (b"", b"\n", b'a = 1\nb = "x"\n' * 20):
        results = {texts.TEXT[name](rng, data) for _ in range(30)}
        assert all(isinstance(result, bytes) for result in results)
    assert results != {data}


def test_the_page_adds_up(tmp_path, monkeypatch):
    from bench.core.results import save

    monkeypatch.setattr(page, "PAGE", tmp_path / "page.csv")
    for seed, n in ((1, 1200), (2, 34)):
        ends = {"text: a": {"rendered": n, "exit code 2": 5}, "text: b": {"exit code 4": 1}}
        table = {"cases": n + 6, "seconds": 90.0, "mutations": ends, "slowest": [[1.25 * seed, "text: a"]], "bad": []}
        save(tmp_path / "results", f"jobs-{seed}", {"kind": "jobs", "seed": seed, **table})
    page.write(tmp_path / "results")
    text = (tmp_path / "page.csv").read_text()
    assert "jobs,1246,1234,10,0,2,0,0,2.5,3\n" in text
    assert "text: a,1244,1234,10," in text
    assert "text: b,2,,,2" in text
