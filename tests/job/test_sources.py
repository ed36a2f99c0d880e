"""Light sources: wrong keys, shapes that are visible, emitting surfaces; and the table `[indirect]`."""

from pathlib import Path
from typing import Any

import numpy as np
import pytest
from pydantic import ValidationError
from support import tiny
from support.lightjobs import problems

from framearray_cli.job.job import Job
from framearray_cli.job.read import job_of_table, job_table
from framearray_cli.scene.paths.lightpath import LightPath
from framearray_cli.scene.paths.paths import lights
from framearray_cli.scene.paths.placing import place_source

KEY = {"frame": 0, "position": [1, 2, 3], "intensity": 1}
DISC = {"frame": 0, "position": [1, 2, 3], "direction": [0, 0, 1], "radius": 1}
RECT = {"frame": 0, "position": [1, 2, 3], "width": 1, "height": 2, "power": 3}
EMITTER = {"type": "mesh", "material": "Lamp"}
ALONE = "expected it only next to `file`, as `keys` have their own"
WRONG = [
    ({"keys": [KEY], "file": "a.lp"}, ["keys: expected either `keys` or `file`, got both"]),
    ({"keys": [KEY], "intensity": 3}, [f"intensity: {ALONE}"]),
    ({"keys": [KEY | {"color": "100 K"}]}, ['keys[0].color: expected a temperature from 1000 to 40000 K, got "100 K"']),
    ({"keys": [KEY | {"color": "warm"}]},
     ['keys[0].color: expected a number, 3 numbers or a temperature such as "3200 K", got "warm"']),
    ({"keys": [KEY], "radius": 1}, [f"radius: {ALONE}"]),
    ({"keys": [KEY | {"radius": 1}, KEY | {"frame": 1}]},
     ["keys[1].radius: missing; keys[0] gives it, so every key of this list must"]),
    ({"keys": [KEY], "scale": 0}, ["scale: expected a number above 0, got 0"]),
    ({"keys": [KEY], "space": "world"}, ['space: expected "scene" or "camera", got "world"']),
    ({}, ["keys: expected a list of tables, at least 1, got 0; give `keys` or `file`"]),
    ({"type": "spot", "keys": [KEY]}, ["keys[0]: expected either `direction` or `target`, got neither"]),
    ({"type": "spot", "keys": [KEY | {"target": [1, 2, 3], "inner": 50}]},
     ["keys[0].target: expected a point away from `position`, got the same point",
      "keys[0].inner: expected at most 45, the angle `outer`, got 50"]),
    ({"type": "spot", "keys": [KEY | {"target": [1, 2, 0]}, KEY | {"frame": 1, "direction": [0, 0, 1]}]},
     ["keys[1].target: missing; keys[0] gives it, so every key of this list must"]),
    ({"type": "dome", "positions": 3}, ["irradiance: missing; expected a number or 3 numbers, without `radius`"]),
    ({"type": "dome", "positions": 3, "radius": 1, "irradiance": 1},
     ["intensity: missing; expected a number or 3 numbers, with `radius`",
      "irradiance: expected no value with `radius`; the strength is `intensity`"]),
    ({"type": "dome", "positions": 0, "irradiance": 1}, ["positions: expected a whole number from 1 to 100000, got 0"]),
    ({"type": "disc", "keys": [{"frame": 0, "position": [1, 2, 3], "target": [1, 2, 3], "radius": 0}]},
     ["keys[0].radius: expected a number above 0, got 0"]),
    ({"type": "rect", "keys": [RECT | {"target": [1, 2, 3], "radiance": 3}]},
     ["keys[0]: expected either `power` or `radiance`, got both",
      "keys[0].target: expected a point away from `position`, got the same point"]),
    ({"type": "rect", "keys": [RECT | {"target": [1, 2, 0]}, RECT | {"frame": 1, "direction": [0, 0, 1]},
                               {**RECT, "target": [1, 2, 0], "frame": 2, "up": [0, 1, 0]}]},
     ["keys[1].target: missing; keys[0] gives it, so every key of this list must",
      "keys[0].up: missing; keys[2] gives it, so every key of this list must"]),
    ({"type": "disc", "keys": [DISC | {"power": 1}, DISC | {"frame": 1, "radiance": 1}]},
     ["keys[1].power: missing; keys[0] gives it, so every key of this list must"]),
    ({"type": "disc", "units": "cd/m2", "keys": [DISC | {"power": 1}]},
     ['units: expected "W" or "lm" with `power`, got "cd/m2"']),
    ({"type": "disc", "units": "lm", "keys": [DISC | {"radiance": 1}]},
     ['units: expected "W/(m2 sr)" or "cd/m2" with `radiance`, got "lm"']),
    (EMITTER | {"material": ""}, ['material: expected a text, got ""']),
    (EMITTER | {"material": "  "}, ["material: expected the name of a material, got blanks"]),
    ({"type": "mesh"}, ["material: missing; expected a text"]),
    (EMITTER | {"keys": [{"frame": 0, "radiance": 1, "intensity": 2}]},
     ["keys[0]: expected either `intensity` or `radiance`, got both"]),
    (EMITTER | {"keys": [{"frame": 0, "radiance": 1}, {"frame": 0, "intensity": 1}]},
     ["keys[1].frame: expected more than 0, the frame of the key before, got 0",
      "keys[0].intensity: missing; keys[1] gives it, so every key of this list must",
      "keys[1].radiance: missing; keys[0] gives it, so every key of this list must"]),
    (EMITTER | {"units": "lm"}, ['units: expected "W/(m2 sr)" or "cd/m2", got "lm"']),
]  # fmt: skip


@pytest.mark.parametrize(("source", "texts"), WRONG)
def test_wrong_keys_of_sources(source: dict[str, Any], texts: list[str], tmp_path: Path) -> None:
    found = problems(tmp_path, {"type": "point"} | source)
    assert [problem.removeprefix("light.sources[0].") for problem in found] == texts


POINT = {"frame": 0, "position": [0, 2, 0], "intensity": 1}
AIM = {"frame": 0, "position": [0, 2, 0], "direction": [0, -1, 0]}
WAY = {"frame": 0, "direction": [0, -1, 0], "irradiance": 1}
DAY = {"latitude": 52, "longitude": 13, "date": "2026-06-21", "start": "06:00", "stop": "20:00"}
SUN = {"type": "sun", "timezone": 0.0, "irradiance": 1} | DAY
NO_SHAPE = "as a source without size has no shape"


def job(source: dict[str, Any]) -> Job:
    return Job.model_validate(tiny.table() | {"light": {"frames": 3, "sources": [source | {"visible": True}]}})


SHOWN = [
    {"type": "point", "keys": [POINT | {"radius": 0.1}]},
    {"type": "point", "keys": [POINT | {"radius": 0.0}, POINT | {"frame": 1, "radius": 0.1}]},
    {"type": "spot", "keys": [AIM | {"intensity": 1, "radius": 0.1}]},
    {"type": "directional", "keys": [WAY | {"angle": 1}]},
    {"type": "rect", "keys": [AIM | {"power": 1, "width": 1, "height": 1}]},
    {"type": "disc", "keys": [AIM | {"power": 1, "radius": 1}]},
]


@pytest.mark.parametrize("source", SHOWN, ids=[f"{source['type']}-{k}" for k, source in enumerate(SHOWN)])
def test_a_source_with_a_size_is_seen(source: dict[str, Any]) -> None:
    seen = job(source)
    assert [path.visible for path in lights(seen).sources] == [True]
    assert Job.model_validate(job_table(seen)) == seen
    unseen = Job.model_validate(tiny.table() | {"light": {"frames": 3, "sources": [source]}})
    assert not lights(unseen).sources[0].visible


@pytest.mark.parametrize(
    ("source", "text"),
    [
        ({"type": "point", "keys": [POINT]}, f"expected `radius` of at least one key above 0, {NO_SHAPE}"),
        ({"type": "directional", "keys": [WAY | {"angle": 0.0}]}, f"`angle` of at least one key above 0, {NO_SHAPE}"),
        (SUN, f"expected `angle` above 0, {NO_SHAPE}"),
        ({"type": "point", "ies": "a.ies", "keys": [POINT | {"radius": 1}]}, "expected none next to `ies`"),
        ({"type": "dome", "positions": 3, "irradiance": 1}, "Extra inputs are not permitted"),
    ],
)
def test_a_source_without_a_shape_is_not(source: dict[str, Any], text: str) -> None:
    with pytest.raises(ValidationError) as caught:
        job(source)
    (error,) = (error for error in caught.value.errors() if error["loc"][-1] == "visible")
    assert text in error["msg"]


def path(**source: Any) -> LightPath:
    light = {"frames": 3, "sources": [EMITTER | source]}
    return place_source(tiny.job() if not source else tiny.job(light=light), 0, 3, None)


def test_strength_and_colour_move_along_the_path() -> None:
    found = path(
        keys=[{"frame": 0, "radiance": 2, "color": [1, 0, 1]}, {"frame": 2, "radiance": 4, "color": [1, 1, 1]}]
    )
    np.testing.assert_allclose(found.intensity, [[2, 0, 2], [3, 1.5, 3], [4, 4, 4]])
    assert found.table(1) == {"type": "mesh", "material": "Lamp", "radiance": [3.0, 1.5, 3.0], "two_sided": True}
    assert found.at([2]).table(0)["radiance"] == [4.0] * 3


def test_candela_per_square_metre_are_watts_by_683() -> None:
    found = path(units="cd/m2", keys=[{"frame": 0, "radiance": 683.0}])
    np.testing.assert_allclose(found.intensity, np.ones((3, 3)))


def test_without_keys_the_emission_of_the_scene_counts_once() -> None:
    found = path(two_sided=False)
    np.testing.assert_array_equal(found.intensity, np.ones((3, 3)))
    assert found.emitter is not None and not found.emitter.absolute and not found.emitter.two_sided


CELLS = {"method": "cells"}


@pytest.mark.parametrize("more", [{"cell": 0.1}, {"samples": 2048}, {"filter": 1}, {"exact": True}])
def test_keys_of_cells_need_cells(more: dict[str, float]) -> None:
    with pytest.raises(ValidationError, match='method = "cells" next to it'):
        tiny.job(indirect={"method": "obscurance", **more})
    tiny.job(indirect={**CELLS, **more})


@pytest.mark.parametrize("more", [{"cell": 0.1}, {"samples": 2048}, {"filter": 0}])
def test_paths_take_no_keys_of_cells(more: dict[str, float]) -> None:
    with pytest.raises(ValidationError, match="expected no value, as exact = true builds no cells"):
        tiny.job(indirect={**CELLS, "exact": True, **more})


@pytest.mark.parametrize("indirect", [{"method": "obscurance"}, CELLS, {**CELLS, "exact": True}])
def test_a_job_reads_back(indirect: dict[str, Any]) -> None:
    job = tiny.job(indirect=indirect)
    table = job_table(job)
    assert ("samples" in table["indirect"]) == (indirect == CELLS)
    assert job_of_table(table, Path("job"), job.output.directory).indirect == job.indirect
