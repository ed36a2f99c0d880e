"""Arrays of a sun study: date and time in sheets, movies, exports and the page, and places written as times."""

import csv
from dataclasses import replace
from pathlib import Path
from typing import Any

import pytest
from support.movies import path_file, plain
from typer.testing import CliRunner

from framearray_cli.array.manifest import Manifest, ManifestLight
from framearray_cli.array.manifest_toml import write_manifest
from framearray_cli.array.mixtures import Mixture
from framearray_cli.base.errors import JobError
from framearray_cli.cli.main import app
from framearray_cli.tools.export import export_array
from framearray_cli.tools.movie.look import shot_label
from framearray_cli.tools.movie.pathfile import load_movie_path
from framearray_cli.tools.movie.sweep import Sweep, sweep_path
from framearray_cli.tools.movie.timeline import Shot, make_timeline
from framearray_cli.tools.sheet import make_sheet
from framearray_cli.tools.view.index import index_table, sheet_layout

DAYS = (("06-21", 2), ("12-21", 1))
TIMES = [f"2026-{day}T{hour:02d}:00:00+0{zone}:00" for day, zone in DAYS for hour in (8, 12, 16)]


def sun(time: str) -> ManifestLight:
    source = {"type": "directional", "direction": [0.0, -1.0, 0.0], "irradiance": [3.0] * 3, "time": time}
    return ManifestLight(ambient=(0.0,) * 3, ambient_error=(0.0,) * 3, sources=(source,))


@pytest.fixture
def study(tmp_path: Path) -> Manifest:
    manifest = replace(plain(tmp_path / "out", 2, 6, "png"), lights=tuple(sun(time) for time in TIMES))
    write_manifest(manifest.directory, manifest)
    return manifest


def test_labels_say_when(study: Manifest) -> None:
    assert shot_label(study, Shot(1, (4.0,))) == "c 1  l 4  2026-12-21 12:00"
    assert shot_label(study, Shot(1, (0.4,))) == "c 1  l 0.4  2026-06-21 08:00"
    mixture = Mixture(weights=tuple((l, (1.0, 1.0, 1.0)) for l in range(6)))
    assert shot_label(study, Shot(1, (mixture,))) == "c 1  l sum of 6"


def test_rows_of_a_sheet_by_date(study: Manifest, tmp_path: Path) -> None:
    made = make_sheet(study.directory, tmp_path / "a.png", light="2026-12-21,2026-06-21T12:00")
    assert made.lights == (3, 4, 5, 1)
    bare = replace(study, lights=(sun("soon"),) * 6)
    write_manifest(study.directory, bare)
    plain_sheet = make_sheet(study.directory, tmp_path / "b.png", light="3-5,1")
    assert plain_sheet.size[0] < made.size[0], "labels without times are narrower"


@pytest.mark.parametrize("format_", ["cinema", "rti"])
def test_exports_by_date(study: Manifest, tmp_path: Path, format_: Any) -> None:
    target = tmp_path / ("x.cdb" if format_ == "cinema" else "x")
    export_array(study.directory, target, format_, light="2026-12-21T12:00-last")
    if format_ == "cinema":
        with (target / "data.csv").open(encoding="utf-8") as file:
            rows = list(csv.DictReader(file))
        assert {(row["light"], row["source_time"]) for row in rows} == {("4", TIMES[4]), ("5", TIMES[5])}
    else:
        assert len(list((target / "images").glob("*.png"))) == 4


def test_the_page_knows_the_times(study: Manifest) -> None:
    (axis,) = index_table(study, [], sheet_layout(study.resolution, 6))["axes"]
    assert axis == {"name": "light", "n": 6, "times": [time[:16].replace("T", " ") for time in TIMES]}
    (axis,) = index_table(replace(study, lights=(sun(""),) * 6), [], sheet_layout(study.resolution, 6))["axes"]
    assert axis == {"name": "light", "n": 6}


def shown(study: Manifest, text: str, folder: Path) -> list[float]:
    file = path_file(folder, f"[[segments]]\nframes = 3\nlight = {text}\n")
    return [float(shot.positions[0]) for shot in make_timeline(file, load_movie_path(file), study).shots]


@pytest.mark.parametrize(
    ("text", "wanted"),
    [
        ('"2026-12-21"', [3, 4, 5]),
        ("2026-12-21", [3, 4, 5]),
        ("2026-12-21T12:00:00", [4, 4, 4]),
        ('["2026-06-21T08:00", "2026-06-21 16:00"]', [0, 1, 2]),
        ("[2026-06-21T16:00:00, 0]", [2, 1, 0]),
    ],
)
def test_path_files_by_date(study: Manifest, tmp_path: Path, text: str, wanted: list[float]) -> None:
    assert shown(study, text, tmp_path) == wanted


def test_path_files_with_days_that_are_not_there(study: Manifest, tmp_path: Path) -> None:
    with pytest.raises(JobError) as caught:
        shown(study, '"2026-09-23"', tmp_path)
    assert list(caught.value.problems) == [
        "segments[0].light: expected a time within 2026-06-21 08:00 to 16:00, 2026-12-21 08:00 to 16:00, got "
        '"2026-09-23"'
    ]
    with pytest.raises(JobError, match="these positions have no date and time"):
        shown(replace(study, lights=(sun(""),) * 6), "2026-06-21", tmp_path)


def test_movements_by_date(study: Manifest) -> None:
    path = sweep_path(Sweep(light="2026-12-21"), study)
    assert [shot.positions for shot in make_timeline("x", path, study).shots] == [(3.0,), (4.0,), (5.0,)]
    path = sweep_path(Sweep(kind="walk", at=("light=2026-06-21T12:00",)), study)
    assert {shot.positions for shot in make_timeline("x", path, study).shots} == {(1.0,)}


def test_commands_by_date(study: Manifest, tmp_path: Path) -> None:
    run = CliRunner()
    movie = ["assemble", str(study.directory), "--light", "2026-12-21", "-o", str(tmp_path / "m.gif")]
    assert "3 frames from 3 images" in run.invoke(app, movie).output
    found = run.invoke(app, ["sheet", str(study.directory), "--at", "light=2026-12-24", "-o", str(tmp_path / "x.png")])
    assert isinstance(found.exception, JobError)
    assert "--at light: expected a time within 2026-06-21 08:00 to 16:00, " in str(found.exception)
    assert not (tmp_path / "x.png").exists()
