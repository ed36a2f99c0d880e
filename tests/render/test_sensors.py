"""Illuminance at sensors: closed forms, a published case of daylight, and the table of results with its renewal."""

import csv
from math import asin, atan, pi, sqrt, tan
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from support import tiny
from support.panoramas import write_overcast
from support.rooms import ball

from framearray_cli.array.manifest import SENSORS
from framearray_cli.base.units import LUMENS_PER_WATT
from framearray_cli.job.job import Job
from framearray_cli.render.prepare import open_embree
from framearray_cli.render.render import render
from framearray_cli.render.sensors import measure, sensors_of
from framearray_cli.scene.files import Material
from framearray_cli.scene.paths.placing import sky_patches
from framearray_cli.scene.scene import Scene

LAMP = {"type": "point", "keys": [{"frame": 0, "position": [0.0, 2.0, 0.0], "intensity": 1.0}]}
FLOOR = tiny.quad((-5, 0, 5), (5, 0, 5), (5, 0, -5), (-5, 0, -5))
PLACES = [[0.1, 0.8, 0.2], [-0.8, 1.0, -0.3]]


def sensors(points: Any = PLACES, **more: Any) -> list[dict[str, Any]]:
    return [{"name": "desks", "points": [list(point) for point in points], **more}]


def lux(job: Job, scene: Scene) -> Any:
    """(n_sensors, 3, n_planes) direct and indirect light and standard error."""
    inputs = tiny.prepared(job, scene)
    with open_embree(inputs) as embree:
        return measure(inputs, embree, sensors_of(inputs))


def table(folder: Path) -> list[dict[str, str]]:
    with (folder / SENSORS).open(newline="") as file:
        return list(csv.DictReader(file))


def test_a_lamp_lights_by_cosine_over_squared_distance() -> None:
    """Sensors that face up, and that face the lamp."""
    points = [(0.0, 0.5, 0.0), (1.0, 0.5, 2.0)]
    tilted = {"name": "tilted", "points": [points[1]], "normal": [-1.0, 1.5, -2.0]}
    job = tiny.job(light={"frames": 1, "sources": [LAMP]}, sensors=[*sensors(points), tilted], ambient=tiny.DARK)
    found = lux(job, tiny.scene_of(FLOOR, Material(name="Black", reflectivity=(0.0, 0.0, 0.0))))
    squares = np.array([1.5**2, 1.5**2 + 5, 1.5**2 + 5])
    cosines = np.array([1.0, 1.5 / sqrt(1.5**2 + 5), 1.0])
    np.testing.assert_allclose(found[:, 0, 0], LUMENS_PER_WATT * cosines / squares, rtol=1e-5)
    assert (found[:, 1] == 0).all() and (found[:, 2] < 1e-3).all()


def test_a_ball_lit_from_its_middle_has_the_light_of_a_furnace() -> None:
    """All of its wall has the irradiance I / r^2 / (1 - R), so that R of it arrives at any place within, any way up."""
    grey, at = 0.5, (0.3, 0.2, -0.4)
    lamp = LAMP | {"keys": [{"frame": 0, "position": [0.0, 0.0, 0.0], "intensity": 1.0}]}
    job = tiny.job(
        camera={"keys": [{"frame": 0, "eye": [0.4, 0.0, 0.0], "target": [0.0, 0.1, 0.0]}]},
        light={"frames": 1, "sources": [lamp]},
        sensors=sensors([at], normal=[0.3, -1.0, 0.2]),
    )
    (direct, indirect, error) = lux(job, tiny.scene_of(ball(), Material(name="Grey", reflectivity=(grey,) * 3)))[0]
    normal, way = np.array([0.3, -1.0, 0.2]) / np.linalg.norm([0.3, -1.0, 0.2]), -np.array(at)
    assert direct[0] == pytest.approx(LUMENS_PER_WATT * (way @ normal) / np.linalg.norm(way) ** 3, rel=1e-4)
    assert indirect[0] == pytest.approx(LUMENS_PER_WATT * grey / (1 - grey), rel=0.02)
    assert error[0] <= 0.01 * (direct[0] + indirect[0])


def test_open_sky_has_the_illuminance_of_its_sky(tmp_path: Path) -> None:
    """Far above the ground: 7/9 pi L_z under the overcast sky of the CIE, which is a daylight factor of 100 %."""
    sky = {"type": "environment", "file": str(write_overcast(tmp_path / "sky.exr")), "keys": [{"frame": 0}]}
    job = tiny.job(light={"frames": 1, "sources": [sky]}, sensors=sensors([(0.0, 3.0, 0.0)], error=0.002))
    inputs = tiny.prepared(job, tiny.scene_of(FLOOR))
    (found,) = lux(job, tiny.scene_of(FLOOR))
    (outdoors,) = inputs.lights.sources[0].horizontal(np.array([0.0, 1.0, 0.0]))
    assert outdoors == pytest.approx(7 / 9 * pi, rel=1e-3)
    assert found[0, 0] == pytest.approx(LUMENS_PER_WATT * outdoors, abs=4 * found[2, 0])
    assert found[2, 0] <= 0.002 * found[0, 0]


def sky_component(height: float, width: float) -> float:
    """Share of the overcast sky through an opening that begins straight ahead at eye level [Walsh61].

    With tan e = h cos(azimuth) at its upper edge, the illuminance at an azimuth is L_z (sin^2 e / 6 + 2 sin^3 e / 9);
    the whole sky gives 7/9 pi L_z.

    Args:
        height, width: of the opening over its distance.
    """
    azimuth, q = atan(width), sqrt(1 + height**2)
    sine = height * tan(azimuth) / sqrt(1 + tan(azimuth) ** 2)
    squares = azimuth - atan(tan(azimuth) / q) / q
    cubes = asin(sine / q) - sine / q**2 / sqrt(q**2 - sine**2)
    return 3 / (14 * pi) * squares + 2 / (7 * pi) * cubes


def test_the_daylight_factor_of_a_black_room_is_its_sky_component(tmp_path: Path) -> None:
    """Test case: an opening of 2 x 1.5 m without glass, at desk height, 1 to 5 m away."""
    low, high, half, z = 0.8, 2.3, 1.0, -3.0
    front = [
        tiny.quad((-4, 0, z), (4, 0, z), (4, low, z), (-4, low, z)),
        tiny.quad((-4, high, z), (4, high, z), (4, 3, z), (-4, 3, z)),
        tiny.quad((-4, low, z), (-half, low, z), (-half, high, z), (-4, high, z)),
        tiny.quad((half, low, z), (4, low, z), (4, high, z), (half, high, z)),
    ]
    room = tiny.box((-4, 0, z), (4, 3, 3))
    room = room[~(room[:, :, 2] == z).all(axis=1)]
    scene = tiny.scene_of(np.concatenate([room, *front]), Material(name="Black", reflectivity=(0.0, 0.0, 0.0)))
    sky = {"type": "environment", "file": str(write_overcast(tmp_path / "sky.exr")), "keys": [{"frame": 0}]}
    away = [1.0, 2.0, 3.5, 5.0]
    points = [(0.0, low, z + d) for d in away]
    job = tiny.job(light={"frames": 1, "sources": [sky]}, sensors=sensors(points), ambient=tiny.DARK)
    found = lux(job, scene)
    wanted = [2 * sky_component((high - low) / d, half / d) for d in away]
    share = found[:, 0, 0] / (LUMENS_PER_WATT * 7 / 9 * pi)
    errors = found[:, 2, 0] / (LUMENS_PER_WATT * 7 / 9 * pi)
    assert (abs(share - wanted) < 4 * errors + 0.002 * np.array(wanted)).all(), (share, wanted, errors)
    assert share == pytest.approx(np.array(wanted), rel=0.05)


@pytest.mark.parametrize(("shape", "parts", "n"), [("tregenza", 1, 145), ("reinhart", 2, 577)])
def test_the_patches_of_a_sky_add_up_to_it(shape: str, parts: int, n: int, tmp_path: Path) -> None:
    """Coefficients of patches times their luminance under the overcast sky, against the sky itself, in a room."""
    _, elevation, size_deg = sky_patches(parts)
    sine = np.sin(np.radians(size_deg) / 2)
    assert len(elevation) == n
    assert (2 * pi * (1 - np.sqrt(1 - sine**2))).sum() == pytest.approx(2 * pi, rel=1e-9)
    assert (pi * sine**2 * np.sin(elevation)).sum() == pytest.approx(pi, rel=0.005)
    sky = {"type": "environment", "file": str(write_overcast(tmp_path / "sky.exr")), "keys": [{"frame": 0}]}
    dome = {"type": "dome", "shape": shape, "irradiance": 1.0}
    room = tiny.room(mirrors=False)
    each = lux(tiny.job(light={"frames": n, "sources": [dome]}, sensors=sensors()), room)
    whole = lux(tiny.job(light={"frames": 1, "sources": [sky]}, sensors=sensors()), room)[:, :2, 0].sum(axis=1)
    weights = pi * sine**2 * (1 + 2 * np.sin(elevation)) / 3  # radiance 1 is an irradiance of pi sin^2 across a disc
    assert each[:, :2].sum(axis=1) @ weights == pytest.approx(whole, rel=0.03)


def test_groups_of_sources_add_up() -> None:
    """With the background, in which sensors of a job without groups are lit, too."""
    together = [tiny.RED, tiny.SUN]
    apart = [source | {"group": f"g{k}"} for k, source in enumerate(together)]
    whole, parts = (
        lux(
            tiny.job(light={"frames": 1, "sources": each}, scene={"background": 0.2}, sensors=sensors()),
            tiny.room(mirrors=False),
        )
        for each in (together, apart)
    )
    noise = np.hypot(whole[:, 2, 0], np.linalg.norm(parts[:, 2], axis=1))
    assert (abs(whole[:, :2, 0].sum(axis=1) - parts[:, :2].sum(axis=(1, 2))) < 4 * noise).all()


def test_the_table_is_the_same_for_any_number_of_threads_and_is_written_anew_for_other_sensors(tmp_path: Path) -> None:
    file = tiny.save_glb(tiny.room_meshes(mirrors=False), tmp_path / "room.glb")

    def rendered(name: str, threads: int, wanted: Any, **options: Any) -> bytes:
        job = tiny.job_of_file(file, tmp_path / name, sensors=wanted, render={"threads": threads})
        render(job, pilots=False, **options)
        path = tmp_path / name / SENSORS
        return path.read_bytes() if path.exists() else b""

    first = rendered("a", 1, sensors())
    assert rendered("b", 2, sensors()) == first
    rows = table(tmp_path / "a")
    assert list(rows[0]) == ["sensor", "point", "x", "y", "z", "light", "direct", "indirect", "total", "error"]
    assert [(row["point"], row["light"]) for row in rows] == [(str(k), str(l)) for k in range(2) for l in range(3)]
    images = {path: path.stat().st_mtime_ns for path in (tmp_path / "a").glob("*.exr")}
    (tmp_path / "a" / SENSORS).unlink()
    assert rendered("a", 2, sensors()) == first, "a table that is missing"
    other = rendered("a", 2, sensors([PLACES[1]]))
    assert other.count(b"\n") == 1 + 3 and other != first
    assert rendered("a", 1, []) == b"", "a table of other sensors does not stay"
    assert images == {path: path.stat().st_mtime_ns for path in (tmp_path / "a").glob("*.exr")}
    rendered("b", 1, sensors(), restart=True)
    assert rendered("b", 1, [], restart=True) == b""


def test_rows_of_groups_name_them_and_a_sun_adds_times(tmp_path: Path) -> None:
    file = tiny.save_glb(tiny.room_meshes(mirrors=False), tmp_path / "room.glb")
    study = tiny.STUDY | {"date": "2026-06-21", "step": 360.0}
    light = {"frames": 3, "sources": [study | {"group": "sun"}, tiny.RED | {"group": "lamp"}]}
    render(tiny.job_of_file(file, tmp_path / "a", light=light, sensors=sensors([PLACES[0]])), pilots=False)
    rows = table(tmp_path / "a")
    assert [(row["group"], row["light"]) for row in rows] == [(g, str(l)) for g in ("sun", "lamp") for l in range(3)]
    assert rows[1]["time"] == "2026-06-21T12:00:00+01:00"
    assert "daylight_factor" not in rows[0]
    alone = {"frames": 3, "sources": [study]}
    render(tiny.job_of_file(file, tmp_path / "b", light=alone, sensors=sensors([PLACES[0]])), pilots=False)
    assert "daylight_factor" in table(tmp_path / "b")[0]
