"""Files of positions of spots, rectangles, discs and measured lamps."""

import json
from pathlib import Path
from typing import Any

import pytest
import tomli_w
from support import tiny

from framearray_cli.base.blackbody import black_body
from framearray_cli.base.errors import JobError
from framearray_cli.job.job import Job
from framearray_cli.job.read import job_table, read_job

LP = "3\ncup 1.jpg 0 0 2\ncup 2.jpg 1 0.5 2\ncup 3.jpg -1 0 1.5\n"
HERE = [(0.0, 0.0, 2.0), (1.0, 0.5, 2.0), (-1.0, 0.0, 1.5)]
LAMPS: dict[str, dict[str, Any]] = {
    "spot": {"target": [0, 0, 0], "intensity": 5, "inner": 10, "outer": 20, "radius": 0.1, "color": "3200 K"},
    "rect": {"direction": [0, 0, -1], "power": 5, "width": 0.3, "height": 0.2, "up": [0, 1, 0], "color": [1, 2, 3]},
    "disc": {"target": [0, 0, 0], "radiance": [1, 2, 3], "radius": 0.2},
}


def read(folder: Path, name: str, text: str, kind: str, source: dict[str, Any]) -> Job:
    (folder / name).write_text(text, encoding="utf-8")
    file = folder / "job.toml"
    light = {"sources": [{"type": kind, "file": name} | source]}
    file.write_text(tomli_w.dumps(tiny.table() | {"light": light, "scene": {"file": "a.glb"}}), encoding="utf-8")
    return read_job(file)


def problems(*args: Any) -> list[str]:
    with pytest.raises(JobError) as caught:
        read(*args)
    return [problem.removeprefix("light.sources[0].") for problem in caught.value.problems]


@pytest.mark.parametrize("kind", LAMPS)
def test_rows_are_keys(tmp_path: Path, kind: str) -> None:
    """A file gives the job that its rows give as keys; the job is complete without the file."""
    job = read(tmp_path, "a.lp", LP, kind, LAMPS[kind])
    keys = [{"frame": k, "position": list(at)} | LAMPS[kind] for k, at in enumerate(HERE)]
    written = {"light": {"sources": [{"type": kind, "keys": keys}]}, "scene": {"file": "a.glb"}}
    again = Job.model_validate(tiny.table() | written)
    assert job.light == again.light
    assert Job.model_validate(job_table(job)).light == job.light


def test_columns_of_a_spot(tmp_path: Path) -> None:
    text = "x,y,z,target_x,target_y,target_z,intensity,color,outer\n0,0,2,0,0,0,5,2700 K,30\n1,0,2,0,1,0,6,1,40\n"
    first, second = read(tmp_path, "a.csv", text, "spot", {"inner": 5}).light.sources[0].keys
    assert (first.target, first.intensity, first.outer, first.inner) == ((0, 0, 0), (5, 5, 5), 30, 5)
    assert first.color == black_body(2700.0)
    assert (second.target, second.color, second.outer) == ((0, 1, 0), (1, 1, 1), 40)


def test_columns_of_panels(tmp_path: Path) -> None:
    text = "position_x,position_y,position_z,width,height,power_r,power_g,power_b\n0,0,2,1,2,3,4,5\n"
    (key,) = read(tmp_path, "a.csv", text, "rect", {"direction": [0, 0, -1]}).light.sources[0].keys
    assert (key.sides, key.power) == ((1, 2), (3, 4, 5))
    rows = [{"position": [0, 0, 2], "radius": 0.1, "radiance": 4, "target": [0, 0, 0]}]
    (key,) = read(tmp_path, "a.json", json.dumps(rows), "disc", {}).light.sources[0].keys
    assert (key.radius, key.radiance) == (0.1, (4, 4, 4))


WRONG = [
    ("spot", {"target": [0, 0, 0]}, ["the file has no intensity; give it beside `file`, as in intensity = 10"]),
    ("disc", {"target": [0, 0, 0], "radius": 1},
     ["the file has no power or radiance; give it beside `file`, as in power = 10"]),
    ("rect", LAMPS["rect"] | {"radiance": 1},
     [f"row {k}: expected either `power` or `radiance`, got both" for k in (2, 3, 4)]),
    ("spot", LAMPS["spot"] | {"inner": 30},
     [f"row {k}: inner: expected at most 20, the angle `outer`, got 30" for k in (2, 3, 4)]),
    ("spot", {"intensity": 3},
     ["the file has no direction or target; give one beside `file`, as in target = [0, 1, 0]"]),
]  # fmt: skip


@pytest.mark.parametrize(("kind", "source", "texts"), WRONG)
def test_what_a_file_lacks(tmp_path: Path, kind: str, source: dict[str, Any], texts: list[str]) -> None:
    assert problems(tmp_path, "a.lp", LP, kind, source) == [f'file: "a.lp": {text}' for text in texts]


def test_a_target_in_some_rows(tmp_path: Path) -> None:
    rows = [{"position": [0, 0, 2], "target": [0, 0, 0]}, {"position": [0, 0, 2], "direction": [0, 0, -1]}]
    found = problems(tmp_path, "a.json", json.dumps(rows), "spot", {"intensity": 1})
    assert found == [f'file: "a.json": entry 2: {name}: expected in every row or in none' for name in
                     ("direction", "target")]  # fmt: skip


def test_wrong_columns_of_a_spot(tmp_path: Path) -> None:
    (found,) = problems(tmp_path, "a.csv", "x,y,z,target_x\n1,2,3,4\n", "spot", LAMPS["spot"])
    assert found == (
        'file: "a.csv": row 1: expected the column names x, y, z or position_x, position_y, position_z, and intensity '
        "or intensity_r, intensity_g, intensity_b, color, direction_x, ..., target_x, ..., up_x, ..., "
        "radius, inner, outer where wanted, got x, y, z, target_x"
    )


@pytest.mark.parametrize(("kind", "key"), [("spot", "target"), ("rect", "width"), ("disc", "radius")])
def test_values_beside_keys(tmp_path: Path, kind: str, key: str) -> None:
    lamp = LAMPS[kind]
    given = {"keys": [{"frame": 0, "position": [0, 0, 2]} | lamp], key: lamp[key]}
    file = tmp_path / "job.toml"
    table = tiny.table() | {"light": {"sources": [{"type": kind} | given]}, "scene": {"file": "a.glb"}}
    file.write_text(tomli_w.dumps(table), encoding="utf-8")
    with pytest.raises(JobError) as caught:
        read_job(file)
    text = f"light.sources[0].{key}: expected it only beside `file`, as `keys` have their own"
    assert list(caught.value.problems) == [text]
