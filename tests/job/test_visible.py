"""`visible` of sources: those that have a shape, and those that have none."""

from typing import Any

import pytest
from pydantic import ValidationError
from support import tiny

from framearray_cli.job.job import Job
from framearray_cli.job.read import job_table
from framearray_cli.scene.paths.paths import lights

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
    assert "visible" not in job_table(unseen)["light"]["sources"][0], "jobs without it keep their fingerprint"


@pytest.mark.parametrize(
    ("source", "text"),
    [
        ({"type": "point", "keys": [POINT]}, f"expected `radius` of at least one key above 0, {NO_SHAPE}"),
        ({"type": "directional", "keys": [WAY | {"angle": 0.0}]}, f"`angle` of at least one key above 0, {NO_SHAPE}"),
        (SUN, f"expected `angle` above 0, {NO_SHAPE}"),
        ({"type": "point", "ies": "a.ies", "keys": [POINT | {"radius": 1}]}, "expected none beside `ies`"),
        ({"type": "dome", "positions": 3, "irradiance": 1}, "Extra inputs are not permitted"),
    ],
)
def test_a_source_without_a_shape_is_not(source: dict[str, Any], text: str) -> None:
    with pytest.raises(ValidationError) as caught:
        job(source)
    (error,) = (error for error in caught.value.errors() if error["loc"][-1] == "visible")
    assert text in error["msg"]
