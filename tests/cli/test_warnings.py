"""Warnings of pilots on the command line: where they go, what --strict does, and when they are rendered."""

import re
import tomllib

import pytest
from support import tiny
from support.handed import contents
from support.program import names, run, write_job

from framearray_cli.cli.main import OUTCOMES
from framearray_cli.render.pilots import warn

RADIANS = {"camera": {"fov": 1.047}}


def warnings_of(text: str) -> list[str]:
    return [line for line in text.splitlines() if line.startswith("warning: ")]


@pytest.mark.parametrize("command", ["check", "render"])
def test_warnings_are_printed(command, tmp_path, capsys):
    result = run(capsys, command, write_job(tmp_path, **RADIANS))
    assert result.code == 0
    assert warnings_of(result.out + result.err) == [
        "warning: camera.fov: 1.047 degrees is the view of a telescope; if radians were meant, they are 60 degrees: "
        "set fov = 60"
    ]


@pytest.mark.parametrize("command", [("check",), ("render",), ("render", "--strict")], ids=" ".join)
def test_a_good_job_has_none(command, tmp_path, capsys):
    result = run(capsys, *command, write_job(tmp_path))
    assert result.code == 0
    assert warnings_of(result.out + result.err) == []


@pytest.mark.parametrize("command", ["check", "render"])
def test_strict_ends_before_the_first_image(command, tmp_path, capsys):
    job = write_job(tmp_path, **RADIANS)
    result = run(capsys, command, "--strict", job)
    assert result.code == 2
    assert result.err.splitlines()[-2].startswith(f"{job}: camera.fov: 1.047 degrees")
    assert result.err.splitlines()[-1] == f"1 problem; {OUTCOMES[command]}."
    assert not [name for name in names(tmp_path) if name.endswith((".png", ".exr"))]
    assert not (tmp_path / "out" / "manifest.toml").exists()


def test_warnings_are_in_the_manifest(tmp_path, capsys):
    run(capsys, "render", "-q", write_job(tmp_path, **RADIANS))
    found = tomllib.loads((tmp_path / "out" / "manifest.toml").read_text())["summary"]["warnings"]
    assert [text.split(":")[0] for text in found] == ["camera.fov"]
    run(capsys, "render", "-q", write_job(tmp_path), "--restart")
    assert "warnings" not in tomllib.loads((tmp_path / "out" / "manifest.toml").read_text())["summary"]


def counted_pilots(monkeypatch: pytest.MonkeyPatch) -> list[int]:
    """Return a list that grows with every look through pilots."""
    looks: list[int] = []
    render_views = warn.render_views

    def count(prepared, setup, ambient):
        looks.append(1)
        return render_views(prepared, setup, ambient)

    monkeypatch.setattr(warn, "render_views", count)
    return looks


def test_a_finished_array_needs_no_pilots(tmp_path, capsys, monkeypatch):
    looks, job = counted_pilots(monkeypatch), write_job(tmp_path)
    for _ in range(2):
        assert run(capsys, "render", "-q", job).code == 0
    assert len(looks) == 1


def test_parts_have_the_pilots_of_the_first(tmp_path, capsys, monkeypatch):
    looks, job = counted_pilots(monkeypatch), write_job(tmp_path, camera=tiny.WALK | RADIANS["camera"])
    for cameras in ("2-3", "4-5", "0-1"):  # nothing is there before the first; the last has the first camera
        assert run(capsys, "render", "-q", "--cameras", cameras, job).code == 0
    assert len(looks) == 2
    found = tomllib.loads((tmp_path / "out" / "manifest.toml").read_text())["summary"]["warnings"]
    assert len(found) == 1


def test_workers_are_not_started_for_a_ruined_job(tmp_path, capsys, monkeypatch):
    looks, job = counted_pilots(monkeypatch), write_job(tmp_path, **RADIANS)
    monkeypatch.setattr("framearray_cli.render.parts.run.start_local", lambda workers: pytest.fail("was started"))
    result = run(capsys, "render", "--workers", "2", "--strict", job)
    assert (result.code, len(looks)) == (2, 1)
    assert "camera.fov: 1.047 degrees" in result.err


def test_pilots_change_no_image(tmp_path, capsys, monkeypatch):
    job = write_job(tmp_path)
    run(capsys, "render", "-q", job)
    with_pilots = contents(tmp_path / "out")
    monkeypatch.setattr("framearray_cli.render.render.find_warnings", lambda *inputs: ())
    run(capsys, "render", "-q", "--restart", job)
    assert contents(tmp_path / "out") == with_pilots


@pytest.mark.parametrize(
    ("output", "line"),
    [
        ({"exposure": 20.0}, r"(9\d|100)\.\d% of the pixels are clipped; \d\.\d% are black"),
        ({"exposure": -20.0}, r"0\.0% of the pixels are clipped; 100\.0% are black"),
        ({"format": "exr"}, r"\d\.\d% of the pixels are above 1, which a screen clips; \d\.\d% are black"),
    ],
)
def test_the_summary_says_what_is_clipped_and_black(output, line, tmp_path, capsys):
    result = run(capsys, "render", write_job(tmp_path, output=output))
    assert re.search(f"^{line}$", result.err + result.out, re.MULTILINE)
    summary = tomllib.loads((tmp_path / "out" / "manifest.toml").read_text())["summary"]
    assert {"clipped", "black"} <= summary.keys()


def test_the_summary_counts_the_pixels_of_all_runs(tmp_path, capsys):
    job = write_job(tmp_path, camera=tiny.WALK)
    shares = []
    for cameras in ("0-2", "3-5"):
        run(capsys, "render", "-q", "--cameras", cameras, job)
        shares.append(tomllib.loads((tmp_path / "out" / "manifest.toml").read_text())["summary"])
    run(capsys, "render", "-q", "--restart", job)
    whole = tomllib.loads((tmp_path / "out" / "manifest.toml").read_text())["summary"]
    assert shares[1]["clipped"] == whole["clipped"] != shares[0]["clipped"]
