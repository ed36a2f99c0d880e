"""Lines about a scene and a render, what `scene.surfaces` changes, and the default range of obscurance."""

from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from support import tiny
from support.scenes import QUAD_UVS, Glb, png

from framearray_cli.job.job import Job
from framearray_cli.render.identity import job_fingerprint, scene_fingerprint
from framearray_cli.render.messages import scene_lines, size_lines
from framearray_cli.render.prepare import free_heights, prepare, prepared_from
from framearray_cli.scene.paths.paths import eyes, lights


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


def test_days_of_suns_are_listed() -> None:
    sun = tiny.STUDY | {"timezone": "Europe/Rome", "stop": "20:00", "step": 15}
    assert size_lines(tiny.job(light={"frames": None, "sources": [sun]}))[1:] == [
        "sun: 2026-06-21 06:00 to 20:00: light positions 0-56",
        "sun: 2026-12-21 06:00 to 20:00: light positions 57-113",
    ]
    lamp = tiny.RED | {"group": "lamp"}
    year = sun | {"date": [f"2026-05-{day:02d}" for day in range(1, 15)], "group": "sun", "axis": "year", "step": 840}
    lines = size_lines(tiny.job(light={"frames": 1, "sources": [lamp, year]}))[1:]
    assert len(lines) == 13
    assert lines[11] == "sun: 2026-05-12 06:00 to 20:00: light positions 22-23 of year"
    assert lines[12] == "sun: 2 more days, the last 2026-05-14 06:00 to 20:00: light positions 26-27 of year"
    assert len(size_lines(tiny.job())) == 1


@pytest.fixture
def scene(tmp_path: Path) -> Path:
    glb = Glb()
    image = {"index": glb.texture(png(tiny.bumps()[..., :3]))}
    glb.node(glb.mesh(glb.material("Wall", normalTexture=image), TEXCOORD_0=glb.accessor(QUAD_UVS)))
    return glb.save(tmp_path / "wall.glb")


def job(scene: Path, surfaces: Any = None) -> Job:
    return tiny.job(scene={"file": str(scene), "surfaces": surfaces})


def test_an_array_of_other_surfaces_is_another_array(scene: Path) -> None:
    plain, diffuse, by_file = (prepare(job(scene, kind)) for kind in (None, "diffuse", "file"))
    assert job_fingerprint(plain) == job_fingerprint(diffuse) != job_fingerprint(by_file)
    assert scene_fingerprint(plain) != scene_fingerprint(by_file)
    by_file.scene.tangents[0, 0, 0] += np.float32(0.5)
    changed = prepare(job(scene, "file"))
    assert scene_fingerprint(by_file) != scene_fingerprint(changed)


def test_diffuse_surfaces_have_no_normal_maps(scene: Path) -> None:
    assert len(prepare(job(scene)).relief.tangents) == 0
    assert len(prepare(job(scene, "file")).relief.tangents) == 2


def test_another_word_is_refused() -> None:
    with pytest.raises(ValueError, match="'diffuse' or 'file'"):
        tiny.job(scene={"surfaces": "glossy"})


ROOM = np.concatenate([tiny.box((-3, 0, -4), (3, 2.4, 4)), tiny.box((-1, 0, -1), (1, 0.7, 1))])


@pytest.mark.parametrize("up", [0, 1, 2])
def test_free_height_is_measured_along_the_up_axis(up: int) -> None:
    """Floor to ceiling, table to ceiling, below the table's middle, outside, and above everything."""
    points = np.array([[2.0, 1.5, 2.0], [0.0, 1.5, 0.0], [0.2, 0.3, 0.1], [9.0, 1.0, 0.0], [0.0, 5.0, 0.0]])
    turned = np.roll(ROOM, up - 1, axis=2), np.roll(points, up - 1, axis=1)
    assert free_heights(turned[0], turned[1], up) == pytest.approx([2.4, 1.7, 0.7, np.inf, np.inf])


NO_RANGE = {"range": None}  # of obscurances


@pytest.mark.parametrize("method", ["obscurance", "cells"])
def test_a_room_gives_half_its_height_and_obscurances_say_so(method: str) -> None:
    scene, plain = tiny.room(), tiny.prepared(tiny.job())
    found = tiny.prepared(tiny.job(obscurance=NO_RANGE, indirect={"method": method}), scene)
    height = float(free_heights(scene.corners, found.eyes.world_from_camera[:1, :3, 3] - scene.centre, 1)[0])
    assert found.job.d_max == pytest.approx(height / 2, rel=0.05), "rounded to two digits"
    said = [note for note in found.scene.report.notes if note not in plain.scene.report.notes]
    wanted = f"obscurance.range: {found.job.d_max:g} scene units, half the free height of {height:.2g} at the cameras"
    assert said == ([wanted] if method == "obscurance" else [])


def test_a_thing_gives_a_fifth_of_its_size() -> None:
    key = {"frame": 0, "eye": [0, 20, 9], "target": [0, 0, 0]}
    job = tiny.job(obscurance=NO_RANGE, camera={"keys": [key]})
    scene = tiny.room()
    found = prepared_from(job, scene, eyes(job), lights(job))
    corners = scene.corners.reshape(-1, 3)
    assert found.job.d_max == pytest.approx(0.2 * (corners.max(axis=0) - corners.min(axis=0)).max(), rel=0.05)
    assert "a fifth of the scene's size" in found.scene.report.notes[-1]


def test_all_cameras_count_for_each_part(tmp_path) -> None:
    """A preview, a part or one camera have the range of the whole array."""
    scene = tiny.save_glb(tiny.room_meshes(), tmp_path / "a.glb")
    whole = prepare(tiny.job_of_file(scene, tmp_path, obscurance=NO_RANGE, camera=tiny.WALK))
    one = prepared_from(whole.job, whole.scene, whole.eyes.at([5]), whole.lights)
    assert one.job.d_max == whole.job.d_max
