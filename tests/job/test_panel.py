"""Wrong keys of rectangles and discs."""

from pathlib import Path
from typing import Any

import pytest
from support.problems import problems_of_source

DISC = {"frame": 0, "position": [1, 2, 3], "direction": [0, 0, 1], "radius": 1}
RECT = {"frame": 0, "position": [1, 2, 3], "width": 1, "height": 2, "power": 3}
WRONG = [
    ({"type": "disc", "keys": [{"frame": 0, "position": [1, 2, 3], "target": [1, 2, 3], "radius": 0}]},
     ["keys[0].radius: expected a number above 0, got 0"]),
    ({"type": "rect", "keys": [RECT | {"target": [1, 2, 3], "radiance": 3}]},
     ["keys[0].target: expected a point away from `position`, got the same point",
      "keys[0]: expected either `power` or `radiance`, got both"]),
    ({"type": "rect", "keys": [RECT | {"target": [1, 2, 0]}, RECT | {"frame": 1, "direction": [0, 0, 1]},
                               {**RECT, "target": [1, 2, 0], "frame": 2, "up": [0, 1, 0]}]},
     ["keys[0].up: missing; keys[2] gives it, so every key of this list must",
      "keys[1].target: missing; keys[0] gives it, so every key of this list must"]),
    ({"type": "disc", "keys": [DISC | {"power": 1}, DISC | {"frame": 1, "radiance": 1}]},
     ["keys[1].power: missing; keys[0] gives it, so every key of this list must"]),
    ({"type": "disc", "units": "cd/m2", "keys": [DISC | {"power": 1}]},
     ['units: expected "W" or "lm", as the keys give `power`, got "cd/m2"']),
    ({"type": "disc", "units": "lm", "keys": [DISC | {"radiance": 1}]},
     ['units: expected "W/(m2 sr)" or "cd/m2", as the keys give `radiance`, got "lm"']),
]  # fmt: skip


@pytest.mark.parametrize(("source", "texts"), WRONG)
def test_wrong_keys_of_panels(source: dict[str, Any], texts: list[str], tmp_path: Path) -> None:
    assert problems_of_source(source, tmp_path) == texts
