"""The parts of the ambient measurement that need no Mitsuba: statistics, comparisons, scenes, page; one needs it."""

import sys
from pathlib import Path

import numpy as np
import pytest

from bench.core.results import save, site_in
from framearray_cli.render.prepare import open_embree

from . import page as ambient_page
from . import pathtraced
from .levels import METHODS, Runs, _estimate
from .pictures import OWN_LEVEL, Wanted, against, around, own_level
from .plots import signed, strip
from .scenes import FURNACE, FURNACE_LEVEL, probe_named, probes, under_one

SHAPE = (120, 160, 3)


def runs(error: float, reported: float, n: int = 400) -> Runs:
    found = np.random.default_rng(3).normal(2.0, error, n)
    return Runs(found=found, errors=np.full(n, reported))


def test_right_errors_are_distinguished_from_others():
    for reported, honest in ((0.1, True), (0.07, False), (0.14, False)):
        made = runs(0.1, reported)
        low, high = ambient_page.honest_range(len(made.found) - 1, 0.003)
        ratio = np.sqrt(made.squares / (len(made.found) - 1))
        assert ratio == pytest.approx(made.spread / made.reported)
        assert bool(low < ratio < high) is honest


def test_the_range_of_honest_errors_narrows():
    assert ambient_page.honest_range(15, 0.003)[1] > ambient_page.honest_range(75, 0.003)[1] > 1


def noisy(image: np.ndarray, noise: float, seed: int = 1) -> Wanted:
    rng = np.random.default_rng(seed)
    return Wanted(halves=np.stack([image + rng.normal(0, noise, SHAPE) for _ in range(2)]), error=0.02)


def test_the_noise_of_a_reference_is_no_part_of_an_error():
    right = np.tile(np.linspace(0.5, 1.5, SHAPE[1])[:, None], (SHAPE[0], 1, 3))
    wanted = noisy(right, 0.4)
    n = right.size
    found = against(np.asarray(1.2 * right), wanted)
    square = np.mean((0.2 * right) ** 2)
    # each value's product has variance 0.4^4 + 2 * 0.4^2 * (0.2 R)^2
    spread = np.sqrt((0.4**4 + 2 * 0.4**2 * square) / n)
    assert abs((found["rmse"] * wanted.mean) ** 2 - square) < 4 * spread
    assert np.mean((1.2 * right - wanted.image) ** 2) - square > 40 * spread  # the test would fail
    assert found["ratio"] == pytest.approx(1.2, abs=4 * 1.2 * 0.4 / np.sqrt(2 * n))
    assert found["ratio_error"] == pytest.approx(1.2 * 0.02, rel=0.01)
    weight = 1 / (right**2 + 0.01)
    spread = np.sqrt(((0.4**4 + 2 * 0.4**2 * (0.2 * right) ** 2) * weight**2).sum()) / n
    assert abs(found["relmse"] - np.mean((0.2 * right) ** 2 * weight)) < 4 * spread
    assert wanted.noise == pytest.approx(0.4 / np.sqrt(2), rel=0.02)


def test_the_level_of_one_picture():
    one = np.random.default_rng(2).uniform(0, 1, SHAPE)
    level = np.array([0.5, 1.0, 2.0])
    assert own_level(one, noisy(level * one, 0.0)) == pytest.approx(level)


def test_means_of_the_pixels_around():
    image = np.random.default_rng(4).uniform(0, 1, SHAPE)
    others = (image[58:63, 78:83].sum(axis=(0, 1)) - image[60, 80]) / 24
    assert around(image)[60, 80] == pytest.approx(others)
    assert around(np.ones(SHAPE)) == pytest.approx(1.0)


def test_differences_in_colour():
    difference = np.zeros((1, 4, 3), np.float32)
    difference[0, 1:] = [[0.5], [-0.5], [9.0]]
    assert signed(difference, 1.0)[0].tolist() == [[255, 255, 255], [255, 128, 128], [128, 128, 255], [255, 0, 0]]
    image = np.full(SHAPE, 0.5, np.float32)
    assert strip(image, image, image).size == (5 * 240 + 4 * 4, 180)


@pytest.mark.parametrize("method", METHODS)
def test_every_method_finds_the_furnace(method: str):
    probe = probe_named(FURNACE)
    prepared = under_one(probe.prepared(), probe.l)
    assert prepared.light_arrays.n_lights == prepared.n_lights == 1
    with open_embree(prepared) as embree:
        mean, error = _estimate(prepared, embree, method, 4096, 7)
        assert abs(mean - FURNACE_LEVEL) < 4 * error
        assert error < 0.05 * mean
        assert (mean, error) != _estimate(prepared, embree, method, 4096, 8)


def test_scenes_are_what_their_names_say():
    for name, escapes in (("closed", False), ("window", True), ("open", True)):
        prepared = probe_named(name).prepared()
        corners = prepared.scene.corners.reshape(-1, 3) + prepared.scene.centre
        assert prepared.still
        assert (corners.min(axis=0) < prepared.eyes.position[0]).all()
        assert (max(prepared.job.scene.background) > 0) is escapes
        assert not pathtraced.unknown(prepared.scene)
        with open_embree(prepared) as embree:
            assert _estimate(prepared, embree, "eye", 256, 1)[0] > 0  # the lamp is in no ball, the sun gets in
    assert probe_named("open-sky").traced == "open"
    assert len({probe.name for probe in probes()}) == len(probes())


def distances(ratio: float) -> dict[str, object]:
    part = {"rmse": 0.1, "relmse": 0.02, "ratio": ratio, "ratio_error": 0.001}
    return {"whole": part, "indirect": part, "level": [0.1, 0.2, 0.3], "error": 0.01}


def test_the_page_shows_what_there_is(tmp_path: Path):
    row = {"paths": 256, "mean": 0.5, "spread": 0.02, "reported": 0.01, "squares": 60.0, "freedom": 15, "cpu_s": 0.1}
    honest = row | {"spread": 0.01, "squares": 15.0}
    many = {"paths": 4096, "mean": 0.5, "error": 0.001}
    methods = {method: {"rows": [honest], "many": many} for method in METHODS}
    methods["fit"] = {"rows": [row], "many": many}
    save(tmp_path, "ambient-levels-window", {"words": "room with a window", "light": 0, "methods": methods})
    compared = {method: distances(ratio) for method, ratio in zip(METHODS, (0.8, 1.01), strict=True)}
    picture = {
        "words": "`jobs/kitchen.toml`", "camera": 3, "light": 5, "epsilon": 0.01, "mean": 0.3, "share": 0.6,
        "traced": {"version": "3", "samples": 1024}, "noise": {"whole": 0.1, "indirect": 0.2},
        "model": {**compared, OWN_LEVEL: distances(1.0)}, "own": compared, "direct": {**distances(1.0)["whole"]},
    }  # fmt: skip
    save(tmp_path, "ambient-pictures-kitchen", picture)
    ratios = {method: {"ratio": 0.9, "ratios": [0.75, 1.5]} for method in METHODS}
    along = {"cameras": [1, 2], "indirect": [0.2, 0.3], "error": [0.003, 0.004], "methods": ratios}
    save(tmp_path, "ambient-along-kitchen", along)
    save(tmp_path, "ambient-pictures-cabin", {"skipped": "Mitsuba is not installed"})
    image = np.full(SHAPE, 0.3, np.float32)
    np.savez(tmp_path / "ambient-shown-kitchen.npz", eye=image, fit=image, traced=image)
    page = ambient_page.render(tmp_path, site_in(tmp_path))
    assert "2 *" in page and "1 *" not in page  # only the wrong errors are marked
    assert "| kitchen | 60 % | 0.8 | 1.01 | 0.010 |  |" in page
    assert "| kitchen | 0.9 | 0.75 to 1.50 | 0.9 | 0.75 to 1.50 | 1 % |" in page
    assert "cabin: Mitsuba is not installed" in page
    for file in ("plots/ambient-walks.svg", "plots/ambient-levels.svg", "pictures/ambient-kitchen.jpg"):
        assert file in page
        assert (tmp_path / file).stat().st_size > 1000


def test_without_mitsuba_nothing_is_traced(tmp_path: Path, monkeypatch: pytest.MonkeyPatch):
    monkeypatch.setitem(sys.modules, "mitsuba", None)
    assert "not installed" in pathtraced.trace("window", True, tmp_path)["skipped"]
    assert "not installed" in pathtraced.trace_means("kitchen", True)["skipped"]
    assert not list(tmp_path.iterdir())


@pytest.mark.slow
def test_mitsuba_sees_the_same_scene(tmp_path: Path):
    """Light straight from the sun through a window, and from the sky: every pixel but for noise."""
    from bench.core.results import folder

    from .pictures import measure

    table = pathtraced.measure("trace", "window", True)
    if "skipped" in table:
        pytest.skip(table["skipped"])
    save(tmp_path, "traced-window", {**table, "file": str(folder(True) / table["file"])})
    found = measure(probe_named("window"), True, tmp_path)
    direct, fit = found["direct"], found["model"]["fit"]
    assert abs(direct["ratio"] - 1) < 4 * direct["ratio_error"] + 1e-3
    assert direct["rmse"] < 0.05
    off = fit["indirect"]["ratio"] - 1
    assert abs(off) < 4 * np.hypot(fit["error"], fit["indirect"]["ratio_error"])
    assert abs(found["model"]["eye"]["indirect"]["ratio"] - 1) > 0.03  # the test can fail
