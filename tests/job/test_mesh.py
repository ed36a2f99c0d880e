"""Wrong keys of surfaces that shine, and their strength along the path."""

from pathlib import Path
from typing import Any

import numpy as np
import pytest
from support import tiny
from support.problems import problems_of_source

from framearray_cli.scene.paths.lightpath import LightPath
from framearray_cli.scene.paths.placing import place_source

LAMP = {"type": "mesh", "material": "Lamp"}
WRONG = [
    (LAMP | {"material": ""}, ['material: expected a text, got ""']),
    (LAMP | {"material": "  "}, ["material: expected the name of a material, got blanks"]),
    ({"type": "mesh"}, ["material: missing; expected a text"]),
    (LAMP | {"keys": [{"frame": 0, "radiance": 1, "intensity": 2}]},
     ["keys[0]: expected either `intensity` or `radiance`, got both"]),
    (LAMP | {"keys": [{"frame": 0, "radiance": 1}, {"frame": 0, "intensity": 1}]},
     ["keys[1].frame: expected more than 0, the frame of the key before, got 0",
      "keys[0].intensity: missing; keys[1] gives it, so every key of this list must",
      "keys[1].radiance: missing; keys[0] gives it, so every key of this list must"]),
    (LAMP | {"units": "lm"}, ['units: expected "W/(m2 sr)" or "cd/m2", got "lm"']),
]  # fmt: skip


@pytest.mark.parametrize(("source", "texts"), WRONG)
def test_wrong_keys_of_meshes(source: dict[str, Any], texts: list[str], tmp_path: Path) -> None:
    assert problems_of_source(source, tmp_path) == texts


def path(**source: Any) -> LightPath:
    light = {"frames": 3, "sources": [LAMP | source]}
    return place_source(tiny.job() if not source else tiny.job(light=light), 0, 3, None)


def test_strength_and_colour_move_along_the_path() -> None:
    found = path(
        keys=[{"frame": 0, "radiance": 2, "color": [1, 0, 1]}, {"frame": 2, "radiance": 4, "color": [1, 1, 1]}]
    )
    np.testing.assert_allclose(found.intensity, [[2, 0, 2], [3, 1.5, 3], [4, 4, 4]])
    assert found.table(1) == {"type": "mesh", "material": "Lamp", "radiance": [3.0, 1.5, 3.0], "two_sided": True}
    assert found.at([2]).table(0)["radiance"] == [4.0] * 3


def test_candela_per_square_metre_are_watts_by_683() -> None:
    found = path(units="cd/m2", keys=[{"frame": 0, "radiance": 683.0}])
    np.testing.assert_allclose(found.intensity, np.ones((3, 3)))


def test_without_keys_the_emission_of_the_scene_counts_once() -> None:
    found = path(two_sided=False)
    np.testing.assert_array_equal(found.intensity, np.ones((3, 3)))
    assert found.emitter is not None and not found.emitter.absolute and not found.emitter.two_sided
