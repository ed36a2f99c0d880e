"""A few of many light positions."""

from typing import Any

import numpy as np
import pytest
from support import tiny

from framearray_cli.engine.inputs.lights import light_arrays
from framearray_cli.scene.paths.paths import Lights, lights

SUN = {"type": "directional", "keys": [{"frame": 0, "direction": [0, -1, 0], "irradiance": [2, 2, 2]}]}


def lamp(n: int, **more: Any) -> dict[str, Any]:
    keys = [{"frame": k, "position": [0.1 * k, 1, 0], "intensity": [k + 1] * 3} for k in (0, n - 1)]
    return {"type": "point", "keys": keys, **more}


def path(n: int) -> Lights:
    return lights(tiny.job(light={"frames": n, "sources": [lamp(n), SUN]}))


def grouped(n: int, m: int) -> Lights:
    sources = [lamp(n, group="key"), lamp(m, group="fill", axis="side")]
    return lights(tiny.job(light={"frames": n, "axes": {"side": m}, "sources": sources}))


def test_all_are_taken_where_they_are_few() -> None:
    assert path(12).few(12) == list(range(12))
    many = grouped(5, 7)
    assert many.few(12) == list(range(many.n))


def test_they_lie_all_along_the_path_or_next_to_each_other() -> None:
    assert path(100).few(4) == [0, 33, 66, 99]
    assert path(100).few(4, consecutive=True) == [48, 49, 50, 51]


@pytest.mark.parametrize("most", [1, 10, 30])
def test_every_group_keeps_a_position_and_all_planes_without_light_stay(most: int) -> None:
    many = grouped(60, 40)
    planes = many.few(most)
    few = many.at(planes)
    assert planes == sorted(set(planes))
    assert few.unlit == many.unlit
    assert [len(group.positions) for group in few.groups] == [max(most * 60 // 100, 1), max(most * 40 // 100, 1)]
    for group, old in zip(few.groups, many.groups, strict=True):
        assert all(planes[p] in old.positions for p in group.positions)
    arrays = light_arrays(many, np.zeros(3))
    for name, a, b in zip(arrays._fields, light_arrays(few, np.zeros(3)), arrays.at(planes), strict=True):
        for one, other in zip(a, b, strict=True) if isinstance(a, tuple) else ((a, b),):
            assert np.array_equal(one, other), name
