"""The range of obscurance of a job without one: half the free height at the cameras, or a share of a thing's size."""

import numpy as np
import pytest
from support import tiny

from framearray_cli.job.job import Job
from framearray_cli.render.prepare import free_heights, prepare, prepared_from
from framearray_cli.scene.paths.paths import eyes, lights

ROOM = np.concatenate([tiny.box((-3, 0, -4), (3, 2.4, 4)), tiny.box((-1, 0, -1), (1, 0.7, 1))])


@pytest.mark.parametrize("up", [0, 1, 2])
def test_free_height_is_measured_along_the_up_axis(up: int) -> None:
    """Floor to ceiling, table to ceiling, below the table's middle, outside, and above everything."""
    points = np.array([[2.0, 1.5, 2.0], [0.0, 1.5, 0.0], [0.2, 0.3, 0.1], [9.0, 1.0, 0.0], [0.0, 5.0, 0.0]])
    turned = np.roll(ROOM, up - 1, axis=2), np.roll(points, up - 1, axis=1)
    assert free_heights(turned[0], turned[1], up) == pytest.approx([2.4, 1.7, 0.7, np.inf, np.inf])


def job_without_range(**changes: object) -> Job:
    table = tiny.table(**changes)
    del table["obscurance"]
    return Job.model_validate(table)


@pytest.mark.parametrize("method", ["obscurance", "cells"])
def test_a_room_gives_half_its_height_and_obscurances_say_so(method: str) -> None:
    scene, plain = tiny.room(), tiny.prepared(tiny.job())
    found = tiny.prepared(job_without_range(indirect={"method": method}), scene)
    height = float(free_heights(scene.corners, found.eyes.world_from_camera[:1, :3, 3] - scene.centre, 1)[0])
    assert found.job.d_max == pytest.approx(height / 2, rel=0.05), "rounded to two digits"
    said = [note for note in found.scene.report.notes if note not in plain.scene.report.notes]
    wanted = f"obscurance.range: {found.job.d_max:g} scene units, half the free height of {height:.2g} at the cameras"
    assert said == ([wanted] if method == "obscurance" else [])


def test_a_thing_gives_a_fifth_of_its_size() -> None:
    job = job_without_range(camera={"keys": [{"frame": 0, "eye": [0, 20, 9], "target": [0, 0, 0]}]})
    scene = tiny.room()
    found = prepared_from(job, scene, eyes(job), lights(job))
    corners = scene.corners.reshape(-1, 3)
    assert found.job.d_max == pytest.approx(0.2 * (corners.max(axis=0) - corners.min(axis=0)).max(), rel=0.05)
    assert "a fifth of the scene's size" in found.scene.report.notes[-1]


def test_all_cameras_count_for_each_part(tmp_path) -> None:
    """A preview, a part or one camera have the range of the whole array."""
    walk = job_without_range(
        camera=tiny.WALK, scene={"file": str(tiny.save_glb(tiny.room_meshes(), tmp_path / "a.glb"))}
    )
    whole = prepare(walk)
    one = prepared_from(whole.job, whole.scene, whole.eyes.at([5]), whole.lights)
    assert one.job.d_max == whole.job.d_max
