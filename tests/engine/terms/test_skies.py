"""Skies by the height of the sun: what surfaces receive and what eyes see at every light position."""

import re
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from numpy.typing import NDArray
from pydantic import ValidationError
from support.stages import make_job, quad, write_scene
from support.weather import write_weather

from framearray_cli.array.images import read_image
from framearray_cli.base.colour import LUMINANCE
from framearray_cli.base.errors import JobError
from framearray_cli.base.units import LUMENS_PER_WATT
from framearray_cli.job.job import Job
from framearray_cli.render.identity import job_fingerprint
from framearray_cli.render.prepare import prepare
from framearray_cli.render.render import render
from framearray_cli.scene.paths.paths import lights
from framearray_cli.scene.paths.sky import clear_sun

PLACE: dict[str, Any] = {
    "latitude": 48.1, "longitude": 11.6, "date": "2026-06-21", "timezone": 1, "start": "03:00", "stop": "19:00",
}  # fmt: skip
SKY = PLACE | {"type": "sky"}
N = 9  # light positions; at the first the sun is down
R = 0.5


def sky_job(folder: Path, *sources: dict[str, Any], **eye: Any) -> Job:
    """A level floor under some sources, seen from above."""
    scene = write_scene(folder, [quad("Floor", [-50, 0, 50], [100, 0, 0], [0, 0, -100])])
    keys = [{"frame": 0, "eye": [0, 5, 0.1], "target": [0, 0, 0]} | eye]
    return make_job(
        scene, folder / "out", materials={"Floor": R}, camera={"resolution": [48, 36], "fov": 60, "keys": keys},
        lights=list(sources), light_frames=N, ambient={"intensity": 0.0},
    )  # fmt: skip


def images(job: Job) -> NDArray[Any]:
    """(n_lights, h, w, 3) pictures of the only camera position."""
    render(job)
    return np.stack([read_image(file) for file in sorted(job.output.directory.glob("t.c0000.l*.exr"))])


PEREZ = {"sky": "perez", "irradiance": 20e3, "direct": 60e3, "units": "lux"}


@pytest.mark.parametrize("sky", [{"sky": "preetham"}, {"sky": 12}, {"sky": "overcast"}, PEREZ])
def test_a_level_floor_receives_the_irradiance_of_the_sky(sky: dict[str, Any], tmp_path: Path) -> None:
    """Within four standard errors of the mean over 1,728 hits, at every position; none while the sun is down."""
    job = sky_job(tmp_path, SKY | sky)
    (path,) = lights(job).sources
    assert path.environment is not None
    found = images(job).astype(np.float64) @ LUMINANCE
    right = R / np.pi * path.environment.horizontal
    error = found.reshape(N, -1).std(axis=1) / np.sqrt(found[0].size)
    assert (found[0] == 0).all() and right[0] == 0
    assert (np.abs(found.mean(axis=(1, 2)) - right)[1:] < 4 * error[1:]).all()
    assert (error[1:] < 0.05 * right[1:]).all()  # the test can fail


def test_the_sun_and_its_sky_add_up(tmp_path: Path) -> None:
    """Clear air and its sky give a level surface what each gives alone: no light is counted twice."""
    job = sky_job(tmp_path, SKY, PLACE | {"type": "sun"})
    sky, sun = lights(job).sources
    assert sky.environment is not None
    height = np.radians([note["elevation"] for note in sun.notes])
    right = R / np.pi * (sky.environment.horizontal + clear_sun(height) * np.maximum(np.sin(height), 0))
    found = images(job).astype(np.float64) @ LUMINANCE
    error = found.reshape(N, -1).std(axis=1) / np.sqrt(found[0].size)
    assert (np.abs(found.mean(axis=(1, 2)) - right)[1:] < 4 * error[1:]).all()


def test_eyes_see_the_sky_of_each_position(tmp_path: Path) -> None:
    """A camera that looks up sees the map of each light position, north at the top."""
    job = sky_job(tmp_path, SKY | {"sky": "clear"}, eye=[0, 5, 0], target=[0, 9, 0], up=[0, 0, -1])
    (path,) = lights(job).sources
    found = images(job) @ LUMINANCE
    assert path.environment is not None and path.environment.maps is not None
    zenith = path.environment.maps[:, 0].mean(axis=1) @ LUMINANCE
    np.testing.assert_allclose(found[1:, 17:19, 23:25].mean(axis=(1, 2)), zenith[1:], rtol=0.02)
    # in the morning the sun is east: to the right where north is at the top and the eye looks up, it is left
    morning, evening = found[2], found[-2]
    assert morning[:, :12].mean() > 1.3 * morning[:, -12:].mean()
    assert evening[:, -12:].mean() > 1.3 * evening[:, :12].mean()


def test_lux_are_lux(tmp_path: Path) -> None:
    """A strength in lux is one in watts times 683, and clear air is what it is in either unit."""
    watts = lights(sky_job(tmp_path, SKY | {"sky": 12, "irradiance": 20.0}, PLACE | {"type": "sun"})).sources
    given = {"irradiance": 20.0 * LUMENS_PER_WATT, "units": "lux"}
    lux = lights(sky_job(tmp_path, SKY | {"sky": 12} | given, PLACE | {"type": "sun", "units": "lux"})).sources
    for one, other in zip(watts, lux, strict=True):
        np.testing.assert_allclose(one.intensity, other.intensity, rtol=1e-6)
    assert watts[0].environment is not None
    np.testing.assert_allclose(watts[0].environment.horizontal[1:], 20.0, rtol=1e-6)


def test_weather_gives_the_sun_and_its_sky(tmp_path: Path) -> None:
    """At noon the sun has the file's direct and the sky its diffuse illuminance, in any year."""
    weather = {"weather": str(write_weather(tmp_path / "w.epw"))}
    sky, sun = lights(sky_job(tmp_path, SKY | weather, PLACE | {"type": "sun"} | weather)).sources
    assert sky.environment is not None
    np.testing.assert_allclose(sky.environment.horizontal[4] * LUMENS_PER_WATT, 20e3, rtol=1e-4)
    np.testing.assert_allclose(sun.intensity[4] * LUMENS_PER_WATT, 50e3, rtol=1e-4)


@pytest.mark.parametrize("kind", [{"type": "sun"}, {"type": "sky"}, {"type": "sky", "sky": "clear"}])
def test_another_weather_is_another_job(kind: dict[str, Any], tmp_path: Path) -> None:
    """A file of the same name with twice the light: images of both are never mixed."""
    file, found = tmp_path / "w.epw", []
    for light in ("50000,20000", "50000,20000", "100000,40000"):
        write_weather(file, **{"50000,20000": light})
        found.append(job_fingerprint(prepare(sky_job(tmp_path, PLACE | kind | {"weather": str(file)}))))
    assert found[0] == found[1] != found[2]


@pytest.mark.parametrize(
    ("keys", "problem"),
    [
        ({"sky": "perez"}, "irradiance\n  missing; expected it with sky"),
        ({"direct": 5.0}, "direct\n  expected it only with sky"),
        ({"irradiance": 5.0, "weather": "w.epw"}, "irradiance\n  expected none next to `weather`"),
        ({"sky": 16}, "less than or equal to 15"),
        ({"weather": "missing.epw"}, "missing.epw"),
    ],
)
def test_wrong_skies(keys: dict[str, Any], problem: str, tmp_path: Path) -> None:
    with pytest.raises((ValidationError, JobError), match=re.escape(problem)):
        lights(sky_job(tmp_path, SKY | keys))
