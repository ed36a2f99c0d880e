"""Automatic settings: the cheapest that are exact enough, computed only from the job, and the same every time."""

from collections.abc import Callable

import numpy as np
import pytest
from support import tiny

from framearray_cli.job.read import job_table
from framearray_cli.render.automatic import (
    DEFAULT,
    HITS,
    Acceptance,
    Model,
    Reuse,
    accuracy_test,
    apply_reuse,
    auto_keys,
    candidates,
    choose,
    evenly_spaced,
    probe,
    resolve_auto,
    wanted_variance,
)
from framearray_cli.render.identity import job_fingerprint
from framearray_cli.render.prepare import open_embree

AUTO = {"reuse": {"n_r": "auto"}, "samples": {"hits": "auto"}}
REACH = 16


def made_up(share: Callable[[int], float], n_frames: int = 200, n: int = 400) -> Acceptance:
    """Return hits in the middle of a path, of which share(k) is seen k frames away; lost places stay lost."""
    lot = (np.arange(n) + 0.5) / n
    offsets = np.arange(-REACH, REACH + 1)
    frame = np.full(n, n_frames // 2, np.int32)
    there = (frame[:, None] + offsets >= 0) & (frame[:, None] + offsets < n_frames)
    seen = np.stack([lot < share(abs(int(k))) for k in offsets], axis=1)
    return Acceptance(
        n_frames=n_frames, frame=frame, density=(seen & there).astype(float), reflecting=0.9, shadow_rays=30.0
    )


def model(found: Acceptance, **changes: object) -> Model:
    return Model(**({"found": found, "n_lights": 48, "obscurance": 5} | changes))  # type: ignore[arg-type]


STILL = made_up(lambda k: 1.0, n_frames=1)
SLOW = made_up(lambda k: 0.995**k)
USUAL = made_up(lambda k: 0.97**k)
FAST = made_up(lambda k: max(1.0 - 0.3 * k, 0.0))
JUMP = made_up(lambda k: float(k == 0))
PATHS = {"still": STILL, "slow": SLOW, "usual": USUAL, "fast": FAST, "jump": JUMP}


def cheapest(enough: Callable[[Reuse], bool], of: Model, n_r: list[int], hits: list[float]) -> Reuse:
    """Search all settings."""
    tried = [Reuse(n_r=k, hits=h) for k in n_r for h in hits]
    good = [reuse for reuse in tried if enough(reuse)]
    return min(good, key=of.time)


@pytest.mark.parametrize("path", PATHS)
@pytest.mark.parametrize("changes", [{}, {"balance": False}, {"n_lights": 1}, {"obscurance": 50}])
def test_the_choice_is_the_cheapest_of_all(path: str, changes: dict[str, object]) -> None:
    found, job = model(PATHS[path], **changes), tiny.job(**AUTO)
    chosen = choose(found, accuracy_test(found, job), candidates(job, PATHS[path].n_frames))
    longest = min(16, PATHS[path].n_frames - 1)
    assert chosen == cheapest(accuracy_test(found, job), found, list(range(longest + 1)), list(HITS))


@pytest.mark.parametrize("path", PATHS)
@pytest.mark.parametrize("n_r", [0, 3, 9])
def test_with_a_given_window_there_are_just_enough_hits(path: str, n_r: int) -> None:
    found, job = model(PATHS[path]), tiny.job(reuse={"n_r": n_r}, samples={"hits": "auto"})
    chosen = choose(found, accuracy_test(found, job), candidates(job, 200))
    fewer = HITS[HITS.index(chosen.hits) - 1]
    assert chosen.n_r == n_r
    enough = accuracy_test(found, job)
    assert enough(chosen) and not enough(Reuse(n_r=n_r, hits=fewer))


def test_with_given_hits_the_window_is_just_long_enough() -> None:
    job = tiny.job(reuse={"n_r": "auto"}, samples={"hits": 4})
    found = model(SLOW)
    chosen = choose(found, accuracy_test(found, job), candidates(job, 200))
    assert (chosen.n_r, chosen.hits) == (3, 4)
    assert found.variance(Reuse(n_r=2, hits=4)) > wanted_variance(job) == pytest.approx(1 / (0.9 * 7 * 4**1.3))


def test_the_faster_the_camera_the_shorter_the_window() -> None:
    job = tiny.job(**AUTO)
    chosen = [
        choose(model(PATHS[name]), accuracy_test(model(PATHS[name]), job), candidates(job, 200))
        for name in ("slow", "fast", "jump")
    ]
    windows = [one.n_r for one in chosen]
    assert windows[0] > windows[1] > windows[2] == 0
    assert chosen[0].hits < chosen[1].hits <= chosen[2].hits


def test_where_nothing_reaches_the_error_the_window_ends_where_hits_are_lost() -> None:
    """More frames cost rays and bring no hits; fewer leave out hits that are nearly free."""
    job = tiny.job(reuse={"n_r": "auto"}, samples={"hits": 2})
    for found, n_r in ((JUMP, 0), (made_up(lambda k: float(k <= 2)), 2)):
        assert choose(model(found), accuracy_test(model(found), job), candidates(job, 200)).n_r == n_r


def test_an_average_of_all_hits_has_no_longer_window_than_the_default() -> None:
    job = tiny.job(**(AUTO | {"reuse": {"n_r": "auto", "weights": "average"}}))
    assert [row[0].n_r for row in candidates(job, 200)] == [0, 1, 2, 3]


def test_no_window_is_longer_than_the_path() -> None:
    assert [row[0].n_r for row in candidates(tiny.job(**AUTO), 3)] == [0, 1, 2]


def test_places_that_were_just_revealed_are_no_worse_than_by_default() -> None:
    """In 3 of 100 pixels only the eye itself sees the place: few frames of many hits serve them better."""
    job, found = tiny.job(**AUTO), model(made_up(lambda k: 1.0 if k == 0 else 0.97))
    chosen = choose(found, accuracy_test(found, job), candidates(job, 200))
    assert found.least(chosen) >= found.least(DEFAULT) == 2
    by_variance = choose(found, lambda reuse: found.variance(reuse) <= wanted_variance(job), candidates(job, 200))
    assert found.least(by_variance) < 2 and found.time(by_variance) < found.time(chosen)


def test_strips_make_long_windows_expensive() -> None:
    """Settings that need much memory find hits more than once."""
    job, found = tiny.job(**AUTO), model(SLOW)
    free = choose(found, accuracy_test(found, job), candidates(job, 200))
    tight = choose(
        found, accuracy_test(found, job), candidates(job, 200), lambda reuse: 1.0 if reuse.n_r < free.n_r else 8
    )
    assert tight.n_r < free.n_r


def test_a_still_camera_has_as_many_hits_as_by_default() -> None:
    job = tiny.job(**AUTO)
    chosen = choose(model(STILL), accuracy_test(model(STILL), job), candidates(job, 1))
    assert (chosen.n_r, chosen.hits) == (0, 14)


def test_time_by_hand() -> None:
    """Compute every term of the sum by hand, on a path where every eye sees every hit and all reflect."""
    found = Acceptance(
        n_frames=1000, frame=np.array([500], np.int32), density=np.ones((1, 5)), reflecting=1.0, shadow_rays=10.0
    )
    from framearray_cli.render import automatic as e

    one = Model(found=found, n_lights=20, obscurance=3, balance=False)
    native = 2 * 1002 / 1000
    rays = 2 * e.VISIBILITY_RAY
    right = native * (e.EYE_RAY + 3 * e.OBSCURANCE_RAY + rays + 3 * e.SORT + 10 * e.SHADOW_RAY)
    right += 3 * e.LOOK_UP + 20 * (3 * native * e.ADD + e.STORE)
    assert one.time(Reuse(n_r=1, hits=2)) == pytest.approx(right)
    balanced = Model(found=found, n_lights=20, obscurance=3, balance=True).time(Reuse(n_r=1, hits=2))
    assert balanced == pytest.approx(right + native * (rays + 9 * e.WEIGH))
    by_area = Model(found=found, n_lights=20, obscurance=3, balance=True, area=True).time(Reuse(n_r=1, hits=2))
    assert by_area == pytest.approx(balanced + 3 * native * e.AREA)


def test_path_ends_count_as_they_are_rendered() -> None:
    """Frame 0 of a path has no eyes before it, and its neighbours find more hits."""
    found = Acceptance(
        n_frames=12, frame=np.zeros(1, np.int32), density=np.array([[0, 0, 0, 1, 1, 1, 1]], float), reflecting=1.0,
        shadow_rays=1.0,
    )  # fmt: skip
    assert model(found).counts(Reuse(n_r=3, hits=2)).tolist() == [14]  # 4, 4, 4 and 2


def test_evenly_spaced_numbers_lie_in_the_middle() -> None:
    assert evenly_spaced(5, 16) == [0, 1, 2, 3, 4] and evenly_spaced(12, 3) == [2, 6, 10] and evenly_spaced(1, 8) == [0]


def test_expected_hits_are_those_of_a_render() -> None:
    """A probe of every frame predicts the number of hits per pixel, native and outer, path ends included."""
    job = tiny.job(camera=tiny.WALK, reuse={"n_r": 2}, samples={"hits": 2})
    inputs = tiny.prepared(job)
    with open_embree(inputs) as embree:
        found = probe(inputs, embree, 3)
    assert found.frame.tolist() == sorted(found.frame) and set(found.frame.tolist()) == set(range(6))
    predicted = model(found).counts(Reuse(n_r=2, hits=2))
    rendered = np.stack([frame.hits for frame in tiny.render_frames(inputs).composed])
    error_of_mean = np.std(predicted) / len(predicted) ** 0.5
    # escaped rays and mirrors are not predicted: they are few, and neighbours see them as they see other hits
    assert abs(float(predicted.mean()) - float(rendered.mean())) < 4 * error_of_mean
    assert abs(float(model(found).counts(Reuse(n_r=1, hits=2)).mean()) - float(rendered.mean())) > 4 * error_of_mean


def test_the_choice_is_a_job_of_numbers() -> None:
    inputs = tiny.prepared(tiny.job(camera=tiny.WALK, **AUTO))
    with open_embree(inputs) as embree:
        first, why = resolve_auto(inputs, embree)
        again, _ = resolve_auto(inputs, embree)
    assert why is not None and why.keys == ("reuse.n_r", "samples.hits") == auto_keys(inputs.job)
    assert (first.job.n_r, first.job.hits) == (why.reuse.n_r, why.reuse.hits)
    assert first.job.specular.hits == 14
    assert (
        why.enough
        and why.error <= 1
        and sorted(why.seen) == [1, 2, 4]
        and all(0.5 < share <= 1 for share in why.seen.values())
    )
    table = job_table(first.job)
    assert (table["reuse"]["n_r"], table["samples"]["hits"]) == (why.reuse.n_r, why.reuse.hits)
    assert job_fingerprint(first) == job_fingerprint(again)
    assert job_fingerprint(first) == job_fingerprint(apply_reuse(inputs, why.reuse))
    assert type(first.job).model_validate(table) == first.job


def test_a_job_of_numbers_stays_as_it_is() -> None:
    inputs = tiny.prepared(tiny.job())
    with open_embree(inputs) as embree:
        assert resolve_auto(inputs, embree) == (inputs, None)


@pytest.mark.parametrize("empty", ["nothing reflects", "nothing is hit"])
def test_a_scene_without_noise_gets_settings_too(empty: str) -> None:
    black = tiny.Material(name="Black", reflectivity=(0.0, 0.0, 0.0))
    away = [key | {"target": [9.0, 1.0, 99.0]} for key in tiny.WALK["keys"]]
    scene = tiny.scene_of(tiny.box((-1, 0, -1), (1, 2, 1)), black)
    camera = tiny.WALK | ({"keys": away} if empty == "nothing is hit" else {})
    inputs = tiny.prepared(tiny.job(camera=camera, **AUTO), scene)
    with open_embree(inputs) as embree:
        result, why = resolve_auto(inputs, embree)
    assert result.job.hits >= 1 and why is not None and 0.5 < why.error <= 1
