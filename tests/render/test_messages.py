"""Lines about a scene and a render."""

from dataclasses import replace

import pytest
from support import tiny

from framearray_cli.render.messages import scene_lines


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
