"""Light neither leaks through walls nor is held up by them, in rooms that are hard to trace.

Each case counts shadow rays with a known answer. Not one leak is allowed. A false shadow is allowed only where a hit
lies nearer to another wall than rays start above their triangle: in the wedge's edge.
"""

import numpy as np
import pytest
from rooms import ROOMS, Count, count

from framearray_cli.surface import OFFSET_ULPS, ULP

# In a wedge of angle a, points nearer to the edge than offset / tan(a) start behind the other wall.
WEDGE_SHARE = 2 * OFFSET_ULPS * ULP / np.tan(np.radians(1.0))


def allowed(name: str, rays: int) -> int:
    """False shadows that must be expected: twice the mean number of hits in the strip along the wedge's edge, and 5."""
    return int(2 * WEDGE_SHARE * rays + 5) if name == "wedge" else 0


@pytest.mark.parametrize("name", ROOMS)
def test_no_leak_and_no_false_shadow(name: str) -> None:
    leaks, shadows = count(name)
    assert leaks.rays == shadows.rays == 5 * 16384
    assert leaks.wrong == 0
    assert shadows.wrong <= allowed(name, shadows.rays)


@pytest.mark.parametrize("size", [1e-6, 1e6])
@pytest.mark.parametrize("name", ROOMS)
def test_whatever_the_unit_of_length(name: str, size: float) -> None:
    leaks, shadows = count(name, size=size)
    assert (leaks.wrong, shadows.wrong <= allowed(name, shadows.rays)) == (0, True)


@pytest.mark.parametrize("name", ["plain", "thin", "t_junctions", "slivers", "ball"])
def test_ten_million_away(name: str) -> None:
    """Moved by 1e7 in float64: corners keep nine digits after the point, and the scene is centred before float32."""
    leaks, shadows = count(name, at=(1e7, -1e7, 1e7))
    assert (leaks.wrong, shadows.wrong) == (0, 0)


@pytest.mark.slow
@pytest.mark.parametrize("name", ROOMS)
def test_a_million_rays(name: str) -> None:
    leaks, shadows = count(name, n=200_000)
    assert leaks.rays == 1_000_000
    assert leaks.wrong == 0 and shadows.wrong <= allowed(name, shadows.rays)


def test_the_count_can_fail(monkeypatch: pytest.MonkeyPatch) -> None:
    """A room without one of its walls leaks; lamps outside that shine in are seen as leaks."""

    def open_room() -> np.ndarray:
        return np.asarray(ROOMS["plain"]()[2:])

    monkeypatch.setitem(ROOMS, "open", open_room)
    with pytest.raises(AssertionError, match="left a closed room"):
        count("open")

    def hole() -> np.ndarray:  # a wall a little way outside the room closes it again: rays from inside meet it
        return np.concatenate([np.asarray(ROOMS["plain"]()[2:]), 5 * np.asarray(ROOMS["plain"]())])

    monkeypatch.setitem(ROOMS, "hole", hole)
    leaks, shadows = count("hole")
    assert leaks.wrong > 100
    assert isinstance(shadows, Count)
