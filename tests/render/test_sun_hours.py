"""Hours of direct sun as a layer, against shadows that are known."""

from collections.abc import Mapping
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from support import tiny
from support.tiny import STUDY as SUN

from framearray_cli.array.images import read_layers
from framearray_cli.array.manifest import layers_path
from framearray_cli.array.manifest_toml import read_manifest
from framearray_cli.base.sundays import sun_days
from framearray_cli.render.memory import window_memory
from framearray_cli.render.render import render
from framearray_cli.scene.files import Material
from framearray_cli.scene.paths.paths import eyes, lights
from framearray_cli.scene.scene import Scene

LAMP = {"type": "point", "keys": [{"frame": 0, "position": [1.0, 2.0, 1.0], "intensity": [4.0, 2.0, 1.0]}]}
DAYS, POSITIONS, STEP_H = ("2026-06-21", "2026-12-21"), 9, 1.5
FROM_ABOVE = {
    "resolution": [48, 36],
    "fov": 60.0,
    "frames": 1,
    "keys": [{"frame": 0, "eye": [0.0, 9.0, 0.0], "target": [0.0, 0.0, 0.0], "up": [0.0, 0.0, -1.0]}],
}


def yard(reflectivity: tuple[float, float, float] = (0.5, 0.5, 0.5)) -> Scene:
    """A floor of 6 x 12 with a wall of 2 x 1.5 across its middle: nothing is left and right of it."""
    floor = tiny.quad((-3, 0, 6), (3, 0, 6), (3, 0, -6), (-3, 0, -6))
    wall = tiny.quad((0, 0, -1), (0, 0, 1), (0, 1.5, 1), (0, 1.5, -1))
    return tiny.scene_of(np.concatenate([floor, wall]), Material(name="Only", reflectivity=reflectivity))


def study(*more: Any, **changes: Any) -> tiny.Job:
    tables = {"camera": FROM_ABOVE, "light": {"frames": 18, "sources": [SUN, *more]}, "output": {"sun_hours": True}}
    return tiny.job(**tables | changes)


def hours_of(job: tiny.Job, scene: Scene, threads: int = 2) -> Mapping[str, Any]:
    layers = tiny.render_frames(tiny.prepared(job, scene), threads).composed[0].layers
    return {name.removeprefix("sun_hours."): hours for name, hours in layers.items() if "sun_hours" in name}


def known_hours(job: tiny.Job, x: Any, z: Any, day: int) -> Any:
    """Hours of places of the floor, by rays against the wall."""
    found = np.zeros(np.broadcast(x, z).shape)
    path = lights(job).sources[0]
    for l in range(day * POSITIONS, (day + 1) * POSITIONS):
        to_x, to_y, to_z = -path.vector[l]
        if not path.intensity[l].any():
            continue
        with np.errstate(divide="ignore"):
            t = -x / to_x  # where the ray meets the plane of the wall
        blocked = (t > 0) & (t * to_y < 1.5) & (np.abs(z + t * to_z) < 1)
        found += STEP_H * ~blocked
    return found


def on_floor(job: tiny.Job, column: Any, row: Any) -> tuple[Any, Any]:
    """The places (x, z) of the floor that points of the picture show."""
    width, height = job.camera.resolution
    scale = 9.0 * 2 * np.tan(np.radians(job.camera.fov) / 2) / height
    assert eyes(job).world_from_camera[0, 0, 0] == pytest.approx(1.0)  # x to the right, so that z points down
    return (column - width / 2) * scale, (row - height / 2) * scale


def test_hours_are_those_of_known_shadows() -> None:
    job = study()
    found = hours_of(job, yard())
    assert tuple(found) == ("total", *DAYS)
    rows, columns = np.mgrid[:36, :48]
    corners = [on_floor(job, columns + x, rows + y) for x in (0, 0.5, 1) for y in (0, 0.5, 1)]
    outside = np.all([np.abs(x) > 3 for x, _ in corners], axis=0)
    wall = np.any([np.abs(x) < 0.6 for x, _ in corners], axis=0)  # the wall itself hides what lies behind it
    for k, day in enumerate(DAYS):
        known = np.stack([known_hours(job, x, z, k) for x, z in corners])
        even = (np.ptp(known, axis=0) == 0) & np.all([np.abs(x) < 3 for x, _ in corners], axis=0) & ~wall
        assert even.sum() > 300 and len(np.unique(known[0][even])) > 2, "the shadows differ"
        np.testing.assert_allclose(found[day][even], known[0][even], rtol=1e-6)
        assert not found[day][outside].any()
    np.testing.assert_allclose(found["total"], found[DAYS[0]] + found[DAYS[1]], rtol=1e-6)


def test_edges_of_surfaces_and_of_shadows() -> None:
    """A pixel that shows the sky beside the floor has the hours of the floor; one across a shadow, a mean."""
    job = study(samples={"hits": 64})
    found = hours_of(job, yard())["2026-06-21"]
    x, _ = on_floor(job, np.arange(48), 0)
    (edge,) = np.flatnonzero((x < 3) & (np.append(x[1:], 99.0) > 3))
    assert found[0, edge] == pytest.approx(known_hours(job, np.float64(2.99), np.float64(-5.1), 0), rel=1e-5)
    assert found[0, edge + 1] == 0.0
    assert (np.abs(found / STEP_H % 1 - 0.5) < 0.4).any()


def test_no_other_light_and_no_colour_plays_a_part() -> None:
    plain, black = hours_of(study(), yard()), hours_of(study(), yard((0.0, 0.0, 0.0)))
    sky = {"scene": {"background": [0.3, 0.4, 0.5]}}
    lamps = hours_of(study(LAMP, **sky), yard())
    groups = hours_of(tiny.job(
        camera=FROM_ABOVE, output={"sun_hours": True}, **sky,
        light={"frames": 18, "sources": [LAMP | {"group": "lamp", "axis": "lamps"}, SUN | {"group": "sun"}]},
    ), yard())  # fmt: skip
    for day in ("total", *DAYS):
        for other in (black, lamps, groups):
            np.testing.assert_array_equal(other[day], plain[day])


def test_a_sun_with_a_size_shines_with_a_part_of_its_disc() -> None:
    hard = hours_of(study(), yard())
    soft = hours_of(study(light={"frames": 18, "sources": [SUN | {"angle": 3.0}]}), yard())
    for day in DAYS:
        same = np.isclose(hard[day], soft[day], rtol=1e-6)
        assert 0.5 < same.mean() < 1.0, "penumbras are a part of the picture"
        assert abs(hard[day].mean() - soft[day].mean()) < 0.02 * hard[day].mean()


def test_files_hold_the_hours(tmp_path: Path) -> None:
    scene = tiny.save_glb(tiny.room_meshes(), tmp_path / "room.glb")
    tables = {"camera": {"resolution": [16, 12]}, "light": {"frames": 18, "sources": [SUN]}}
    for name in ("with", "without"):
        render(tiny.job_of_file(scene, tmp_path / name, output={"sun_hours": name == "with"}, **tables))
    found = {name: read_layers(layers_path(read_manifest(tmp_path / name), 0)) for name in ("with", "without")}
    hours = {name for name in found["with"] if name.startswith("sun_hours.")}
    assert hours == {f"sun_hours.{name}" for name in ("total", *DAYS)}
    assert set(found["with"]) - hours == set(found["without"])
    for name, layer in found["without"].items():
        np.testing.assert_array_equal(found["with"][name], layer)
    assert 0 < found["with"]["sun_hours.total"].max() <= 2 * POSITIONS * STEP_H
    manifests = [read_manifest(tmp_path / name) for name in found]
    assert [manifest.has_sun_hours for manifest in manifests] == [True, False]


def test_memory_estimates_know_the_hours() -> None:
    """Two days per hit, and these and their sum per pixel, twice."""
    with_hours, without = study(), study(output={"sun_hours": False})
    more = [window_memory(tiny.prepared(job, yard()), 18) for job in (with_hours, without)]
    assert more[0] - more[1] == 48 * 36 * (2 * 2 * 4 + 2 * 3 * 4)


@pytest.mark.parametrize(
    ("changes", "text"),
    [
        (
            {"light": {"frames": 18, "sources": [LAMP]}},
            'expected one source of type "sun", whose hours are counted, got none',
        ),
        (
            {"light": {"frames": 18, "sources": [SUN, SUN]}},
            'expected one source of type "sun", whose hours are counted, got 2',
        ),
        ({"output": {"sun_hours": True, "layers": False}}, "expected layers = true next to it, as hours are a layer"),
        (
            {"light": {"frames": 2, "sources": [SUN | {"step": 1440.0}]}},
            "expected at least 2 light positions per day, got 1 on 2026-06-21; a position counts for the time to",
        ),
    ],
)
def test_what_hours_need_is_named(changes: Any, text: str) -> None:
    with pytest.raises(ValueError, match=r"output\.sun_hours") as caught:
        study(**changes)
    assert text in str(caught.value)


def test_days_of_positions() -> None:
    days = sun_days(next(iter(study().light.moments.values())))
    assert [(day.date, day.lights, day.step_h, day.most_h) for day in days] == [
        (DAYS[0], range(0, 9), 1.5, 13.5),
        (DAYS[1], range(9, 18), 1.5, 13.5),
    ]
    assert sun_days(()) == ()
