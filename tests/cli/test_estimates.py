"""The estimates of `check` against the measurements of `render`."""

import os
import re
import tomllib
from pathlib import Path

import pytest
from support import tiny
from support.program import Result, finish, start, write_job

from framearray_cli.job.read import read_job
from framearray_cli.render.estimate import Estimate, check, planning_seconds

UNITS = {"bytes": 1, "KiB": 2**10, "MiB": 2**20, "GiB": 2**30}
SECONDS = {"s": 1, "min": 60, "h": 3600}
WALK = tiny.WALK | {"resolution": [200, 150], "frames": 8}
REST = {"keys": tiny.WALK["keys"][:1], "frames": 30, "resolution": [160, 120]}


def run(*arguments: str | Path) -> Result:
    result = finish(start(*arguments))
    assert result.code == 0
    return result


def bytes_after(label: str, result: Result) -> float:
    number, unit = re.search(rf"^{label}: about ([\d.]+) (\w+)", result.out, re.MULTILINE).groups()  # type: ignore[union-attr]
    return float(number) * UNITS[unit]


def seconds(result: Result) -> float:
    line = re.search("^time: about (.*) on this machine", result.out, re.MULTILINE).group(1)  # type: ignore[union-attr]
    return sum(float(number) * SECONDS[unit] for number, unit in re.findall(r"([\d.]+) (\w+)", line))


def job(folder: Path, **changes: object) -> Path:
    return write_job(folder, **({"light": {"frames": 16}, "output": {"format": "exr"}} | changes))


@pytest.mark.parametrize(
    "changes",
    [
        {"camera": WALK, "reuse": {"n_r": 2}},
        {"camera": REST, "reuse": {"n_r": 2}},
        pytest.param({"camera": WALK, "output": {"format": "png", "layers": False}}, marks=pytest.mark.slow),
    ],
    ids=["walk", "rest", "png"],
)
def test_memory_and_disk(changes, tmp_path):
    file = job(tmp_path, **changes)
    result = run("check", file)
    run("render", "-q", file)
    summary = tomllib.loads((tmp_path / "out" / "manifest.toml").read_text())["summary"]
    images = sum(entry.stat().st_size for entry in (tmp_path / "out").iterdir() if entry.suffix != ".toml")
    assert bytes_after("memory", result) == pytest.approx(summary["peak_memory"], rel=0.25)
    assert bytes_after("disk", result) == pytest.approx(images, rel=0.25)


@pytest.mark.slow
@pytest.mark.parametrize("camera", [WALK | {"frames": 24}, REST | {"frames": 120}], ids=["walk", "rest"])
def test_time(camera, tmp_path):
    """Take the best of five: others may use the machine during either of the two."""
    file = job(tmp_path, camera=camera, reuse={"n_r": 2})
    run("check", file)  # compiles
    ratios = []
    for _ in range(5):
        foretold = seconds(run("check", file))
        run("render", "-q", file)
        taken = tomllib.loads((tmp_path / "out" / "manifest.toml").read_text())["summary"]["seconds"]
        ratios.append(foretold / taken)
    assert min(max(ratio, 1 / ratio) for ratio in ratios) < 1.5, f"{ratios}, load {os.getloadavg()}"


def test_the_size_is_printed_before_the_scene_is_read(tmp_path):
    """A number of light positions that is a typing error is seen at once, even if the scene cannot be read."""
    file = job(tmp_path, light={"frames": 9999}, camera=WALK)
    (tmp_path / "tiny.glb").write_bytes(b"no scene")
    result = finish(start("check", file))
    assert result.code == 3
    assert re.fullmatch(r"array: 8 \S+.* x 9,999 .* = 79,992 images of 200 x 150\n", result.out)


def test_many_light_positions_cost_no_more_to_check_than_a_few(tmp_path):
    """By the number of shadow rays and walks that their ambient light takes."""
    few, many = (check_of(job(tmp_path, light={"frames": n}, camera=WALK)).ambient.rays for n in (36, 5000))
    assert many < 1.5 * few


@pytest.mark.slow
def test_the_time_of_many_light_positions_is_that_of_all(tmp_path):
    """Rays and images are nearly in proportion, beyond those that a check looks at.

    Take the least of three: others may use the machine meanwhile.
    """

    def least(n: int) -> float:
        file = job(tmp_path, light={"frames": n}, camera=WALK)
        return min(check_of(file).seconds for _ in range(3))

    few, many = (least(n) for n in (360, 3600))
    assert 5 < many / few < 20


def test_what_all_light_positions_share_is_prepared_once(tmp_path):
    assert planning_seconds(5.0, 3.0, 10.0) == 23.0
    cells = {"method": "cells", "samples": 2**16}
    plain, solved = (check_of(job(tmp_path, camera=WALK, indirect=keys)).ambient.shared_s for keys in ({}, cells))
    assert solved > 0 == plain


def check_of(file: Path) -> Estimate:
    return check(read_job(file))
