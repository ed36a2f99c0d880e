"""The parts of tests/bench that compute or write without measuring: metrics, tables, resampled lights, pieces."""

import os
import pkgutil
from importlib import import_module

import numpy as np
import pytest
from support import ROOT

import bench
from bench.core.cases import BY_AREA, FRAME_ARRAY, SCRATCH, VARIANTS, open_case
from bench.core.markdown import grid, number, percent
from bench.core.results import DOCS, load, median, save, site_for, site_in
from bench.core.steady import mean
from bench.error import reports
from bench.error.bias_page import at_most, at_time
from bench.speed.processes import environment
from bench.speed.recording import (
    COHERENT,
    KEPT_ROWS,
    OCCLUDED,
    PIECE,
    WALKS,
    Recording,
    cut,
    record,
    record_ambient,
    regroup,
)
from bench.speed.scaling import resampled
from bench.speed.speed import FORMATS, WRITTEN
from framearray_cli.engine.inputs.lights import DIRECTIONAL, POINT, LightArrays
from framearray_cli.job.read import read_job
from framearray_cli.report.metrics import block_mean, errors, relmse, rmse, shadow_edges, squared_bias

WITH_WRITING = [variant for variant in VARIANTS if variant.writes]
SETTINGS = [
    {"name": "as the job says", "one_light": False, "ms": 5.0, "rmse": 0.1, "bias": 0.01, "noise": 0.09, "flip": 0.05,
     "flicker_camera": 0.02, "accepted_hits": 13.0, "times_faster_than_scratch": 40.0, "on_the_front": True},
    {"name": "hits 8", "one_light": False, "ms": 20.0, "rmse": 0.04, "bias": 0.0, "noise": 0.04, "flip": 0.02,
     "flicker_camera": 0.01, "flicker_light": 0.03, "accepted_hits": 52.0, "times_faster_than_scratch": 55.0,
     "on_the_front": False},
    {"name": "from scratch, 14 hits", "one_light": True, "ms": 300.0, "rmse": 0.1, "bias": 0.0, "noise": 0.1,
     "flip": 0.05, "accepted_hits": 14.0, "times_faster_than_scratch": 1.0, "on_the_front": False},
]  # fmt: skip


def test_all_parts_can_be_imported():
    """No test runs them all; a name that moved must not wait for the next measurement."""
    for module in pkgutil.walk_packages(bench.__path__, "bench."):
        if "test_" in module.name:
            continue
        try:
            import_module(module.name)
        except ModuleNotFoundError as error:  # a package that only measurements need
            assert (error.name or "").split(".")[0] not in ("bench", "framearray_cli", "support"), module.name


def test_a_report_as_a_page():
    table = {"settings": SETTINGS, "advice": [
        {"error": 0.1, "settings": "hits 8", "ms": 20.0, "rmse": 0.04, "lines": ["[samples]", "hits = 8"]},
        {"error": 0.01},
    ]}  # fmt: skip
    text = reports.summary(table)
    assert "5 ms per image with an error of 10 %" in text and "**40x**" in text and "55x, `hits 8`" in text
    lines = reports.rows(table).splitlines()
    assert lines[2].startswith("| **as the job says** | 5 | 10 % | 1 % | 9 % | 0.05 | 2 % | 13 | 40x |")
    assert "| hits 8 | 20 | 4 % | 0 % | 4 % | 0.02 | 1 %, 3 % | 52 | 55x |" in lines
    said = reports.advice(table)
    assert "```toml\n[samples]\nhits = 8\n```" in said and "no tried setting reaches it" in said


def flat(value: float, shape: tuple[int, int] = (40, 60)) -> np.ndarray:
    return np.full((*shape, 3), value, np.float32)


def test_rmse_and_relmse_of_constants():
    assert rmse(flat(1.5), flat(1.0)) == pytest.approx(0.5)
    assert relmse(flat(1.5), flat(1.0)) == pytest.approx(0.25 / 1.01)
    assert relmse(flat(0.0), flat(0.0)) == 0


def test_errors_are_relative_to_the_mean():
    image, reference = flat(2.0), flat(2.0)
    image[0, 0] = 5.0
    edges = np.zeros((40, 60), bool)
    edges[0, :2] = True
    found = errors(image, reference, edges)
    assert found.edge_max == pytest.approx(1.5)
    assert found.edge_rmse == pytest.approx(1.5 / np.sqrt(2))
    assert found.bias == pytest.approx(1.5 / 2400)
    assert found.rmse == pytest.approx(1.5 / np.sqrt(2400))
    assert errors(image, reference, ~edges & False).edge_max == 0


def test_squared_bias_is_free_of_noise():
    rng = np.random.default_rng(1)
    noise = [rng.normal(0, 1, (200, 200, 3)).astype(np.float32) for _ in range(4)]
    square, spread = squared_bias((1.3 + noise[0], 1.3 + noise[1]), (1 + noise[2], 1 + noise[3]))
    assert abs(square - 0.09) < 4 * spread
    # each pixel's product has a variance of 2 * 2 + 2 * 0.09 * 2, and there are 120,000 values
    assert spread == pytest.approx(np.sqrt(4.36 / 120_000), rel=0.3)
    square, spread = squared_bias((noise[0], noise[1]), (noise[2], noise[3]))
    assert abs(square) < 4 * spread


def test_errors_that_go_together_in_blocks_count_as_one():
    rng = np.random.default_rng(2)
    blocks = np.repeat(np.repeat(rng.normal(0, 1, (10, 10)), 20, 0), 20, 1)
    assert block_mean(blocks)[1] == pytest.approx(0.1, rel=0.25)
    assert block_mean(np.ones((5, 5)))[1] == np.inf


def test_shadow_edges_are_where_only_irradiance_jumps():
    irradiance, depth = np.ones((20, 30), np.float32), np.full((20, 30), 4.0, np.float32)
    normal = np.tile(np.array([0, 0, 1], np.float32), (20, 30, 1))
    irradiance[:, :10] = 0  # a shadow
    irradiance[:, 20:], normal[:, 20:] = 0, [1, 0, 0]  # a corner
    edges = shadow_edges(irradiance, normal, depth)
    assert set(np.flatnonzero(edges.any(0))) == {9, 10}
    assert edges[1:-1, 9:11].all()
    depth[:, 10:] = 5.0  # now it is the outline of something
    assert not shadow_edges(irradiance, normal, depth).any()


def test_tables():
    assert grid(["a", "b"], [["1", "2"]]) == "| a | b |\n| --- | ---: |\n| 1 | 2 |"
    shown = [number(value) for value in (0, 0.01234, 1.5, 12.345, 123.4, 1234.4, 1234567)]
    assert shown == ["0", "0.0123", "1.5", "12.3", "123", "1,234", "1,234,567"]
    assert [number(0.00001234), number(999.6), number(123.4, 2)] == ["0.0000123", "1,000", "123"]
    assert percent(0.01234, 2) == "1.2 %"


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
        kind=np.array([POINT, DIRECTIONAL], np.int32),
        vector=vector,
        strength=ones,
        lit=ones[:, 0],
        size=np.arange(8, dtype=np.float32).reshape(2, 4),
        cone=np.empty(0, np.float32),
        panel=np.empty(0, np.float32),
        colour=np.ones((4, 3), np.float32),
    )
    found = resampled(lights, np.linspace(0, 3, 7))
    assert found.n_lights == 7 and found.cone.shape == (0,)
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


@pytest.mark.parametrize("width", [1, 4, 8, 16])
def test_rays_keep_their_order_in_packets_of_another_width(width: int):
    lanes = np.arange(KEPT_ROWS * 5 * 8, dtype=np.float32).reshape(KEPT_ROWS, 40)
    lanes[8, 13:16] = lanes[8, 35:] = -1.0  # idle at the end of each run
    packets = np.ascontiguousarray(lanes.reshape(KEPT_ROWS, 5, 8).transpose(1, 0, 2))
    flags = np.array([OCCLUDED | COHERENT] * 2 + [0] * 3, np.uint8)
    pieces = np.array([[0, 2, 0], [2, 5, 1]])
    recording = Recording(
        rays=packets, flags=flags, kinds=("shadow", "obscurance"), pieces=pieces, n_rays={}, n_pixels=1
    )
    found = regroup(recording, width)
    assert found.width == width
    for (start, stop, kind), live in zip(found.pieces, (slice(0, 13), slice(16, 35)), strict=True):
        again = found.rays[start:stop].transpose(1, 0, 2).reshape(KEPT_ROWS, -1)
        np.testing.assert_array_equal(again[:, again[8] >= 0], lanes[:, live])
        assert stop - start == -(-(live.stop - live.start) // width)
        assert (found.flags[start:stop] == recording.flags[pieces[kind, 0]]).all()


def test_an_error_at_another_time_lies_on_the_line_of_logarithms():
    curve = [(4.0, 0.5), (1.0, 1.0), (16.0, 0.125)]
    assert at_time(curve, 2.0, 1) == pytest.approx(0.5**0.5)
    assert at_time(curve, 4.0, 1) == pytest.approx(0.5)
    assert at_time(curve, 64.0, 1) == pytest.approx(0.125 / 4)  # as noise falls from the second to the third


def test_a_bound_counts_noise_against_balance():
    average = {"bias": 10.0, "error": 0.1}
    assert at_most({"bias": -1.0, "error": 0.2}, average) == pytest.approx(0.06)
    assert at_most({"bias": 0.5, "error": 0.2}, average) == pytest.approx(0.11)


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


def test_pages_find_their_plots(tmp_path):
    """A page of docs/ looks into the folder beside its own; a quick one beside itself."""
    for site, link in ((DOCS, "../plots/bias.svg"), (site_in(tmp_path), "plots/bias.svg")):
        assert site.link(site.plots / "bias.svg") == link
        assert (site.pages / link).resolve() == site.plots / "bias.svg"
    assert site_for(False) == DOCS and site_for(True).pages.name == "quick"


def test_rays_of_a_frame_and_of_ambient_light_can_be_recorded():
    """The recorder counts what the program counts, or fails."""
    with open_case(read_job(ROOT / "jobs" / "smoke.toml")) as case:
        frame, ambient = record(case, 0, 4 * case.setup.n_pixels * case.setup.lights.n_lights), record_ambient(case)
    assert frame.n_rays["native"] == case.setup.n_pixels * case.setup.per_pixel[0]
    assert ambient.n_rays["ambient walk"] > WALKS
