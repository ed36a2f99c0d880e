"""The examples of docs/guide/lights.md, as they are: every source is placed, every command of a sun study runs."""

import re
import shlex
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
import tomli_w
from support import tiny
from support.guide import DOCS, blocks, job_file
from support.iesfiles import ies
from support.movies import plain
from typer.testing import CliRunner

from framearray_cli.array.images import ImageFormat, write_image
from framearray_cli.array.manifest import ManifestLight
from framearray_cli.array.manifest_toml import write_manifest
from framearray_cli.cli.main import app
from framearray_cli.job.job import Job
from framearray_cli.job.read import read_job
from framearray_cli.job.sources import DomeSource
from framearray_cli.scene.paths.paths import lights
from framearray_cli.scene.paths.placing import dome_directions

SOURCES = [block for block in blocks("guide/lights.md", "toml") if "[[light.sources]]" in block]
COMMANDS = [line for block in blocks("guide/lights.md", "sh") for line in block.splitlines()]
STUDY = [line for line in COMMANDS if " OUT --light " in line]


def job_with(folder: Path, text: str) -> Job:
    """Read a job with the sources of an example, and the files that they name."""
    ways = dome_directions(6, np.array([0.0, 1.0, 0.0]), whole=False).tolist()
    for name in ("lamps.csv", "coin.csv"):
        (folder / name).write_text("\n".join(["x,y,z", *(",".join(map(repr, way)) for way in ways), ""]))
    (folder / "stations.csv").write_text("x,y,z,color\n0,2,0,3200 K\n1,2,0,4000 K\n")
    (folder / "floodlight.ies").write_text(ies())
    write_image(folder / "sky.exr", np.ones((4, 8, 3), np.float32), ImageFormat())
    rest = {key: value for key, value in tiny.table().items() if key != "light"} | {"scene": {"file": "a.glb"}}
    return read_job(job_file(folder, tomli_w.dumps(rest), text))


def example(start: str) -> str:
    (found,) = [block for block in SOURCES if re.search(start, block)]
    return found


@pytest.mark.parametrize("text", SOURCES, ids=[re.findall(r'type = "(\w+)"', block)[0] for block in SOURCES])
def test_every_example_is_a_light_path(text: str, tmp_path: Path) -> None:
    job = job_with(tmp_path, text)
    placed = lights(job).sources
    assert len(placed) == text.count("[[light.sources]]")
    assert all(len(path.vector) == job.light.frames and np.isfinite(path.vector).all() for path in placed)


def test_a_dome_of_96_lamps_is_one_source(tmp_path: Path) -> None:
    job = job_with(tmp_path, example('type = "dome"'))
    (dome,) = lights(job).sources
    assert (job.light.frames, len(dome.vector)) == (96, 96)
    source = job.light.sources[0]
    assert isinstance(source, DomeSource)
    np.testing.assert_allclose(np.linalg.norm(dome.vector - source.target, axis=1), 2.0)
    lines = '[[light.sources]]\ntype = "dome"\npositions = 96\nirradiance = 3.0\n'
    assert job_with(tmp_path, lines).light.frames == 96, "a table with three keys"


def test_a_sun_study_has_the_positions_that_the_page_says(tmp_path: Path) -> None:
    job = job_with(tmp_path, example('type = "sun"'))
    assert "three days of 57 positions" in (DOCS / "guide/lights.md").read_text(encoding="utf-8")
    assert job.light.frames == 3 * 57
    times = [path["time"] for l in range(171) for path in [lights(job).sources[0].table(l)]][::57]
    assert [time[:16] for time in times] == ["2026-03-20T06:00", "2026-06-21T06:00", "2026-12-21T06:00"]


@pytest.mark.parametrize("command", STUDY)
def test_commands_of_a_sun_study_run(command: str, tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.chdir(tmp_path)
    path = lights(job_with(tmp_path, example('type = "sun"'))).sources[0]
    dark = (0.0, 0.0, 0.0)
    at = [ManifestLight(ambient=dark, ambient_error=dark, sources=(path.table(l),)) for l in range(len(path.vector))]
    write_manifest(tmp_path / "OUT", replace(plain(tmp_path / "OUT", 2, len(at)), lights=tuple(at)))
    words = shlex.split(command)
    result = CliRunner().invoke(app, words[1:], catch_exceptions=False)
    assert result.exit_code == 0, result.output
    assert (tmp_path / words[words.index("-o") + 1]).stat().st_size > 0


def test_the_page_has_examples_of_both() -> None:
    assert len(SOURCES) >= 5
    assert {line.split()[1] for line in STUDY} == {"assemble", "sheet"}
