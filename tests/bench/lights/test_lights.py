"""The parts of the measurement of lights that trace nothing: statistics, panoramas, sources, tables."""

from pathlib import Path

import numpy as np
import pytest

from bench.core.cases import job_named
from bench.core.results import Site, save
from framearray_cli.base.colour import LUMINANCE
from framearray_cli.scene.paths.panorama import Panorama
from framearray_cli.scene.paths.paths import lights

from . import against, cost, noise, run
from .sources import DIRECT, SHARE_OF_SUN, job_with, sky, sources_of

SHAPE = (40, 6, 20, 30, 3)  # seeds, light positions, height, width, channels


def test_noise_that_starts_anew_flickers_and_noise_that_stays_does_not() -> None:
    rng = np.random.default_rng(1)
    light = np.linspace(1, 2, SHAPE[1])[:, None, None, None]
    half = np.zeros(SHAPE[1:4], bool)
    half[:, :5] = True
    anew = noise.figures(light + rng.normal(0, 0.3, SHAPE), half)
    stays = noise.figures(light + np.broadcast_to(rng.normal(0, 0.3, (40, 1, 20, 30, 3)), SHAPE), half)
    for found, flicker in ((anew, 1.0), (stays, 0.0)):
        assert found["noise"] == pytest.approx(0.2, rel=0.02) and found["half_noise"] == pytest.approx(0.2, rel=0.05)
        assert run.flicker(found["noise"], found["change"]) == pytest.approx(flicker, abs=0.02)
        assert run.flicker(found["half_noise"], found["half_change"]) == pytest.approx(flicker, abs=0.05)
        assert found["true"] == pytest.approx(0.2 / 1.5, rel=0.03)


def test_equal_pictures_differ_by_their_noise_and_brighter_ones_by_more() -> None:
    rng = np.random.default_rng(2)
    clear = np.ones((40, 60), bool)
    clear[:4] = False  # blocks that are left out may hold anything
    ours, theirs = (rng.normal(2, 0.5, (8, 40, 60, 3)).astype(np.float32) for _ in range(2))
    ours[:, :4] = 1e6
    found = against.compare(ours, theirs, clear)
    assert abs(found["mean"]) < 4 * found["error"] and found["chi"] == pytest.approx(1, abs=0.15)
    assert found["error"] == pytest.approx(0.25 / (36 * 60 * 3 * 8 / 2) ** 0.5, rel=0.6)
    assert found["share"] == pytest.approx(0.9)
    brighter = against.compare(1.1 * ours, theirs, clear)
    assert brighter["mean"] == pytest.approx(0.1, abs=0.01) and brighter["chi"] > 2


def test_the_sun_of_a_map_holds_its_share_and_is_cut_from_it() -> None:
    plain, sunny = (Panorama(file="sky.exr", pixels=sky(with_sun=one)) for one in (False, True))
    assert not plain.has_suns and sunny.has_suns
    assert int(sunny.is_sun.sum()) == 1
    ratio = plain.flux / sunny.flux
    assert ratio == pytest.approx(1 - SHARE_OF_SUN, abs=0.05)
    row, column = np.argwhere(sunny.is_sun)[0]
    assert (0.5 - (row + 0.5) / len(sky(with_sun=True))) * 180 == pytest.approx(18, abs=3)
    assert (sunny.texels[row, column] @ LUMINANCE) > 1000


@pytest.mark.parametrize("name", ["kitchen", "cabin"])
def test_jobs_accept_the_sources_and_keep_the_way_and_the_strength_of_their_light(name: str, tmp_path: Path) -> None:
    job = job_named(name, False)
    own = lights(job).sources[0]
    for sources in sources_of(name, tmp_path).values():
        found = lights(job_with(job, sources, DIRECT)).sources[0]
        if found.environment is None and found.emitter is None:
            np.testing.assert_allclose(found.vector, own.vector)
            if found.profile is None:
                np.testing.assert_allclose(found.intensity, own.intensity, rtol=1e-6)


def test_parts_are_found_by_how_their_names_begin() -> None:
    assert run.parts_named(()) == [*run.PARTS]
    assert run.parts_named(("cost",)) == [*cost.PARTS]
    assert run.parts_named(("page",)) == []
    assert run.parts_named(("noise-cabin", "against-modern_hall-spot")) == ["noise-cabin", "against-modern_hall-spot"]
    with pytest.raises(ValueError, match=r"no part of `lights` begins with costs"):
        run.parts_named(("costs",))


def test_tables_show_what_there_is(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(run, "folder", lambda quick: tmp_path)
    monkeypatch.setattr(run, "site_for", lambda quick: Site(tmp_path, tmp_path, tmp_path))
    run.run(["page"], False)
    assert (tmp_path / "lights.csv").read_text() == ""
    one = {"frames": [2.0, 2.2], "ms": 2.1, "ratio": 1.05, "rays": {"shadow": 1.5}}
    machine = {"processor": "some", "cores": "2"}
    save(tmp_path, "lights-cost-sun", {
        "machine": machine, "job": "kitchen", "resolution": [100, 50], "hits": 2,
        "sources": {"direction": one, "sun": one},
    })  # fmt: skip
    found = {"noise": 0.1, "change": 0.05, "true": 0.3, "half_noise": 0.2, "half_change": 0.1}
    save(tmp_path, "lights-noise-kitchen", {
        "job": "kitchen", "seeds": 8, "positions": 24,
        "sources": {"sun": {"share": 0.1, "without": "direction", "hard": found, "soft": {**found, "change": 0.1}}},
    })  # fmt: skip
    save(tmp_path, "lights-against-modern_hall-disc", {"skipped": "no Mitsuba"})
    run.run(["page"], False)
    lines = (tmp_path / "lights.csv").read_text().splitlines()
    assert "sun,2.1,1.05x,1.5" in lines
    assert '"kitchen, sun: with a size",10 %,10 %,0.707,20 %,10 %,0.354' in lines
    assert "# Against Mitsuba" not in lines
