"""What `init` chooses for models, scored by hand-made labels; and what it takes them for."""

from pathlib import Path

import numpy as np
import pytest
from support.models import rooms, things
from support.models.cases import MODELS, OTHERS, OWN, Case
from support.models.score import judge
from support.models.shapes import Model, block
from support.scenes import Glb

from framearray_cli.starter import StartOptions, init

LEAST, MEAN = 85.0, 96.0  # of 100, of every scene and of all
QUICK = ("dining-inch", "mug", "street", "table-scene")
EVERY = (*MODELS, *OWN, *OTHERS)


@pytest.mark.parametrize("case", [case for case in MODELS if case.name in QUICK], ids=lambda case: case.name)
def test_a_model_is_shown_as_its_labels_ask_for(case: Case, tmp_path: Path) -> None:
    verdict = judge(case, tmp_path, frames=5, lights=2)
    assert verdict.score >= 95, verdict.missed


@pytest.mark.slow
def test_first_pictures_of_all_scenes(tmp_path: Path) -> None:
    cases = [case for case in EVERY if case.file is None or case.file.exists()]
    found = {case.name: judge(case, tmp_path) for case in cases}
    bad = {name: f"{verdict.score:.0f}: {verdict.missed}" for name, verdict in found.items() if verdict.score < LEAST}
    assert not bad
    assert sum(verdict.score for verdict in found.values()) / len(found) >= MEAN


def about(model: Model | Glb, file: Path, **options: object) -> str:
    """What `init` reports of a model."""
    start = init(model.save(file), file.with_suffix(".toml"), StartOptions(frames=2, lights=1, **options))  # type: ignore[arg-type]
    return "\n".join(start.about)


def test_the_report_says_what_a_scene_is_taken_for(tmp_path: Path) -> None:
    vessel = about(things.bottle(), tmp_path / "bottle.glb")
    assert "It is round and nothing is in it, so it is taken for a vessel; --inside says otherwise." in vessel
    assert "It has no place to stand in" in about(things.car(), tmp_path / "car.glb")
    outside = about(things.car(), tmp_path / "again.glb", inside=False)
    assert "It is seen from outside, because of --outside." in outside
    assert "There is no room in it" not in outside
    assert "It is taken for a room, as --inside asks for." in about(things.car(), tmp_path / "in.glb", inside=True)


def test_parts_of_machines_and_houses_are_seen_from_outside(tmp_path: Path) -> None:
    part = Model()  # a block with a pocket
    part.add("Steel", (0.5, 0.5, 0.5), block((0, 0, 0), (10, 10, 10)), block((3, 3, 3), (7, 7, 7), inwards=True))
    assert "its unit of length is not known, so it counts as a thing" in about(part, tmp_path / "part.stl")
    house = Model()
    house.add("Brick", (0.6, 0.4, 0.3), block((-0.2, -0.2, -0.2), (8.4, 2.7, 8.4)))
    for x, z in ((0, 0), (4.2, 0), (0, 4.2), (4.2, 4.2)):
        house.add("Plaster", (0.8, 0.8, 0.8), block((x, 0, z), (x + 4, 2.5, z + 4), inwards=True))
    assert "It has several rooms and an outside, so it is seen from outside" in about(house, tmp_path / "house.glb")
    assert "so it is taken for a room" in about(rooms.dining_room(), tmp_path / "dining.glb")


def test_what_has_no_opening_or_no_place_is_seen_from_outside(tmp_path: Path) -> None:
    """A hollow in a solid, with a block in it, and shallow booths under the sky; a lamp inside makes it a room."""
    solid = Glb()
    hollow = block((0, 0, 0), (4, 2.5, 4), inwards=True), block((0.5, 0, 1), (2.5, 1.8, 1.8))
    solid.part("Steel", [0.5, 0.5, 0.5], block((-1, -1, -1), (5, 3.5, 5)), *hollow)
    assert "It has an outside and no opening" in about(solid, tmp_path / "solid.glb")
    solid.part("Lamp", [0.5, 0.5, 0.5], block((3, 2.2, 3), (3.2, 2.3, 3.2)), emissiveFactor=[1.0, 1.0, 1.0])
    assert "so it is taken for a room" in about(solid, tmp_path / "lamp.glb")
    booths = Model()
    for x in range(5):
        open_sides = [0, 1, 8, 9]  # the front and the top
        booths.add("Wall", (0.5, 0.5, 0.5), np.delete(block((x, 0, 0), (x + 1, 1, 2), inwards=True), open_sides, 0))
    assert "It has no place to stand in" in about(booths, tmp_path / "booths.glb")


def test_the_same_scene_makes_the_same_job(tmp_path: Path) -> None:
    scene = rooms.bare_room().save(tmp_path / "room.glb")
    jobs = []
    for _ in range(2):
        init(scene, tmp_path / "room.toml", StartOptions(frames=3, lights=2), force=True)
        jobs.append((tmp_path / "room.toml").read_bytes())
    assert jobs[0] == jobs[1]
