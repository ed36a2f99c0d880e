"""Lines about a scene and a render."""

from dataclasses import replace
from typing import Any

import pytest
from support import tiny

from framearray_cli.job.job import Job
from framearray_cli.render.messages import scene_lines, size_lines


@pytest.mark.parametrize(("lights", "sources", "noted"), [(0, 1, False), (1, 1, False), (2, 1, True), (2, 2, False)])
def test_lights_of_a_file_are_noted_where_the_job_has_fewer(lights: int, sources: int, noted: bool) -> None:
    """A job that `init` wrote has those of the file."""
    scene = tiny.room()
    scene = replace(scene, report=replace(scene.report, lights=lights))
    job = tiny.job(light={"frames": 1, "sources": [tiny.RED] * sources})
    found = [line for line in scene_lines(tiny.prepared(job, scene)) if line.startswith("note: the scene file has ")]
    assert bool(found) == noted
    if noted:
        assert "2 lights, the job 1 source of its own" in found[0]


def job_with(light: dict[str, Any]) -> Job:
    return Job.model_validate(tiny.table() | {"light": light})


def test_days_of_suns_are_listed() -> None:
    sun = {
        "type": "sun", "latitude": 41.9, "longitude": 12.5, "date": ["2026-06-21", "2026-12-21"],
        "timezone": "Europe/Rome", "start": "06:00", "stop": "20:00", "step": 15, "irradiance": 20.0,
    }  # fmt: skip
    assert size_lines(job_with({"sources": [sun]}))[1:] == [
        "sun: 2026-06-21 06:00 to 20:00: light positions 0-56",
        "sun: 2026-12-21 06:00 to 20:00: light positions 57-113",
    ]
    lamp = tiny.RED | {"group": "lamp"}
    year = sun | {"date": [f"2026-05-{day:02d}" for day in range(1, 15)], "group": "sun", "axis": "year", "step": 840}
    lines = size_lines(job_with({"frames": 1, "sources": [lamp, year]}))[1:]
    assert len(lines) == 13
    assert lines[11] == "sun: 2026-05-12 06:00 to 20:00: light positions 22-23 of year"
    assert lines[12] == "sun: 2 more days, the last 2026-05-14 06:00 to 20:00: light positions 26-27 of year"
    assert len(size_lines(tiny.job())) == 1
