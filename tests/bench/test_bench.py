"""The parts of tests/bench that compute without measuring: medians, resampled lights, pieces."""

import os
import pkgutil
from importlib import import_module

import numpy as np
import pytest
from support import ROOT

import bench
from bench.core.cases import BY_AREA, FRAME_ARRAY, SCRATCH, VARIANTS
from bench.core.results import load, median, save
from bench.core.steady import mean
from bench.speed.processes import environment
from bench.speed.recording import PIECE, cut
from bench.speed.scaling import resampled
from bench.speed.speed import FORMATS, WRITTEN
from framearray_cli.engine.inputs.lights import DIRECTIONAL, POINT, LightArrays
from framearray_cli.engine.inputs.profiles import NONE

WITH_WRITING = [variant for variant in VARIANTS if variant.writes]


def test_all_parts_can_be_imported():
    """No test runs them all; a name that moved must not wait for the next measurement."""
    for module in pkgutil.walk_packages(bench.__path__, "bench."):
        if "test_" in module.name:
            continue
        try:
            import_module(module.name)
        except ModuleNotFoundError as error:  # a package that only measurements need
            assert (error.name or "").split(".")[0] not in ("bench", "framearray_cli", "support"), module.name


def test_median_and_mean_of_tables():
    tables = [
        {"ms": a, "stages": {"x": b}, "hits": [a, b], "images": 2} for a, b in ((1.0, 5.0), (3.0, 4.0), (2.0, 9.0))
    ]
    assert median(tables) == {"ms": 2.0, "stages": {"x": 5.0}, "hits": [2.0, 5.0], "images": 2}
    assert mean(tables[:2]) == {"ms": 2.0, "stages": {"x": 4.5}, "hits": [2.0, 4.5], "images": 4}
    assert median([{"a": 1.0}, {}, {"a": 3.0}]) == {"a": 1.0}


def test_results_survive_the_disk(tmp_path):
    save(tmp_path / "new", "x", {"a": [1.5, 2]})
    assert load(tmp_path / "new", "x") == {"a": [1.5, 2]}
    assert load(tmp_path, "x") is None


def test_a_resampled_light_path_keeps_its_ends_and_directions_stay_unit():
    path = np.linspace([1, 0, 0], [0, 0, 1], 4, dtype=np.float32).T  # (3, 4)
    vector = np.stack([path, path / np.linalg.norm(path, axis=0)])
    ones = np.ones((2, 1, 4), np.float32)
    lights = LightArrays(
        span=np.array([0, 2], np.int32),
        kind=np.array([POINT, DIRECTIONAL], np.int32),
        vector=vector,
        strength=ones,
        lit=ones[:, 0],
        size=np.arange(8, dtype=np.float32).reshape(2, 4),
        cone=np.empty((0, 5, 4), np.float32),
        panel=np.empty((0, 12, 4), np.float32),
        colour=np.ones((4, 3), np.float32),
        profiles=NONE._replace(frame=np.empty((0, 9, 4), np.float32)),
    )
    found = resampled(lights, np.linspace(0, 3, 7))
    assert found.n_lights == 7 and found.cone.shape == (0, 5, 7)
    np.testing.assert_allclose(found.size[:, 1], [0.5, 4.5], atol=1e-6)
    np.testing.assert_allclose(found.vector[:, :, ::2], vector, atol=1e-6)
    np.testing.assert_allclose(np.linalg.norm(found.vector[1], axis=0), 1, atol=1e-6)
    np.testing.assert_allclose(found.vector[0, :, 1], (path[:, 0] + path[:, 1]) / 2, atol=1e-6)


@pytest.mark.parametrize("width", [8, 16])
def test_pieces_hold_one_kind_and_one_flag_each(width: int):
    n = PIECE // width
    flags = np.array([0] * 3 + [2] * (n + 5) + [1] * 4, np.uint8)
    found = cut([(3, "native"), (3, "obscurance"), (n + 8, "shadow"), (len(flags), "native")],
                ("native", "obscurance", "shadow"), flags, width)  # fmt: skip
    assert found.tolist() == [[0, 3, 0], [3, n + 3, 2], [n + 3, n + 8, 2], [n + 8, n + 12, 0]]
    mixed = cut([(len(flags), "native")], ("native",), flags, width)
    assert mixed.tolist() == [[0, 3, 0], [3, n + 3, 0], [n + 3, n + 8, 0], [n + 8, n + 12, 0]]


def test_programs_of_their_own_find_what_this_one_finds(monkeypatch: pytest.MonkeyPatch) -> None:
    """Mitsuba may lie in a folder of PYTHONPATH."""
    monkeypatch.setenv("PYTHONPATH", "/somewhere")
    places = environment()["PYTHONPATH"].split(os.pathsep)
    assert places == [str(ROOT), str(ROOT / "tests"), "/somewhere"]


def test_variants_are_written_in_known_containers() -> None:
    """Ratios between variants need one container that all of them are written in."""
    assert all(WRITTEN in variant.writes and set(variant.writes) <= set(FORMATS) for variant in WITH_WRITING)
    assert {FRAME_ARRAY, BY_AREA, SCRATCH} <= set(WITH_WRITING)
    assert all(variant.frames for variant in WITH_WRITING)
