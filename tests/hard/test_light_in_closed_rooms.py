"""No ray passes a wall, and none is held up where nothing is, in rooms that are hard to trace.

Each case counts rays with a known answer: shadow rays, visibility rays of reused hits, rays of obscurances, eye rays.
Not one leak is allowed. A ray that is held up is allowed only where a hit lies nearer to another wall than rays start
above their triangle: in the wedge's edge.
"""

from typing import Any

import numpy as np
import pytest
from support.counting import (
    FAR_SHARE,
    Count,
    eyes_on_walls,
    eyes_on_walls_lose,
    hemisphere_rays,
    lamps_on_walls,
    lamps_reach,
    light_from_within,
    shadow_rays,
    visibility_rays,
)
from support.rooms import ON_WALLS, ROOMS, TURN
from support.staging import Stage, staged

from framearray_cli.engine.inputs.surfaces import OFFSET_ULPS, ULP

# In a wedge of angle a, points nearer to the edge than offset / tan(a) start behind the other wall.
WEDGE_SHARE = 2 * OFFSET_ULPS * ULP / np.tan(np.radians(1.0))
# The ball's right answers take all of its twenty thousand planes: fewer points do.
POINTS = {"ball": 512}


def allowed(name: str, rays: int) -> int:
    """Rays that must be expected wrong: twice the mean number of hits in the strip along the wedge's edge, and 5."""
    return int(2 * WEDGE_SHARE * rays + 5) if name == "wedge" else 0


def assert_right(name: str, leaks: Count, held_up: Count) -> None:
    assert leaks.wrong == 0
    assert held_up.wrong <= allowed(name, held_up.rays)


def assert_all_right(name: str, stage: Stage) -> None:
    """Rays of every kind between the walls of a room."""
    assert_right(name, *shadow_rays(stage))
    assert_right(name, *visibility_rays(stage))
    rays = hemisphere_rays(stage)
    assert rays.wrong <= allowed(name, rays.rays)


@pytest.mark.parametrize(("count", "n"), [(shadow_rays, [5 * 16384]), (visibility_rays, range(40_001, 10**9))])
@pytest.mark.parametrize("name", ROOMS)
def test_nothing_leaks_and_nothing_is_held_up(name: str, count: Any, n: Any) -> None:
    """Lamps and eyes outside light and take over no hit; inside they miss none."""
    with staged(name) as stage:
        leaks, held_up = count(stage)
    assert leaks.rays in n and held_up.rays in n
    assert_right(name, leaks, held_up)


@pytest.mark.parametrize("name", ROOMS)
def test_rays_of_obscurances_meet_the_walls_of_their_room(name: str) -> None:
    """One that passed a wall would be taken for the average reflectivity; one that met its own surface darkens it."""
    with staged(name, n=POINTS.get(name, 16384)) as stage:
        rays = hemisphere_rays(stage)
    assert rays.rays == 5 * POINTS.get(name, 16384)
    assert rays.wrong <= allowed(name, rays.rays)


# Each point of the ball is compared with more than 12,000 triangles.
NOT_THE_BALL = [pytest.param(name, marks=pytest.mark.slow) if name == "ball" else name for name in ROOMS]


@pytest.mark.parametrize("size", [1e-6, 1e6])
@pytest.mark.parametrize("name", NOT_THE_BALL)
def test_any_unit_of_length(name: str, size: float) -> None:
    with staged(name, size=size, n=POINTS.get(name, 8192)) as stage:
        assert_all_right(name, stage)


@pytest.mark.parametrize("name", NOT_THE_BALL)
def test_ten_million_away(name: str) -> None:
    """Moved by 1e7 in float64: corners keep nine digits after the point, and the scene is centred before float32."""
    with staged(name, at=(1e7, -1e7, 1e7), n=POINTS.get(name, 8192)) as stage:
        assert_all_right(name, stage)


@pytest.mark.parametrize("count", [lamps_on_walls, eyes_on_walls_lose])
@pytest.mark.parametrize("name", ON_WALLS)
def test_lamps_and_eyes_on_walls_edges_and_corners_reach_what_they_face(name: str, count: Any) -> None:
    """A shadow ray ends a little before its lamp: so the wall that the lamp is on does not hide it."""
    with staged(name) as stage:
        rays = count(stage)
    assert rays.rays > 20_000
    assert rays.wrong <= allowed(name, rays.rays)


@pytest.mark.parametrize("name", ROOMS)
def test_lamps_inside_a_mesh_light_nothing_outside(name: str) -> None:
    """A lamp inside each room, and points of a shell around it: no light gets out."""
    rays = light_from_within(name)
    assert rays.rays > 20_000
    assert rays.wrong == 0


@pytest.mark.parametrize(("gap", "leaks"), [(2.0, False), (0.5, True)])
def test_how_near_to_a_wall_a_lamp_may_be(gap: float, leaks: bool) -> None:
    """The stated limit of lamps on surfaces: nearer to a wall than 1e-4 of the distance, they shine through it."""
    with staged("plain") as stage:
        point = stage.hits.position[0].astype(np.float64) @ TURN.T
        across = -point  # the opposite point of the walls
        distance = np.linalg.norm(across - point)
        behind = across + (across - point) / distance * gap * FAR_SHARE * distance
        assert bool(lamps_reach(stage, behind[None])[0, 0]) == leaks


@pytest.mark.parametrize("name", ON_WALLS)
def test_eyes_on_walls_see_the_room_and_nothing_of_their_wall(name: str) -> None:
    """Eyes exactly on a wall, to the precision of float32, look in; where walls are single ones, they look out too."""
    with staged(name) as stage:
        n = 2 if name == "ball" else 64
        inwards, outwards = eyes_on_walls(stage, True, n), eyes_on_walls(stage, False, n)
    assert len(inwards.wrong) == n * 1024
    assert inwards.wrong.sum() <= allowed(name, len(inwards.wrong))
    assert name == "thin" or not outwards.wrong.any()  # from inside that wall its outer face is seen, as it should


@pytest.mark.slow
@pytest.mark.parametrize("name", ROOMS)
def test_a_million_rays(name: str) -> None:
    with staged(name, n=200_000) as stage:
        leaks, shadows = shadow_rays(stage)
        assert leaks.rays == 1_000_000
        assert_right(name, leaks, shadows)
        assert_right(name, *visibility_rays(stage))


def open_room() -> np.ndarray:
    return np.asarray(ROOMS["plain"]()[2:])


def hole() -> np.ndarray:
    """The same with a larger closed room around it: rays from inside meet that."""
    return np.concatenate([open_room(), 5 * np.asarray(ROOMS["plain"]())])


def screened() -> np.ndarray:
    """A closed room with a screen inside, off the place from which its points are seen."""
    screen = np.array([[(-0.5, -0.4, -0.5), (0.5, -0.4, -0.5), (0.5, -0.4, 0.5)]])
    return np.concatenate([np.asarray(ROOMS["plain"]()), screen])


def test_a_missing_wall_is_counted(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setitem(ROOMS, "open", open_room)
    with pytest.raises(AssertionError, match="left a closed room"), staged("open"):
        pass
    monkeypatch.setitem(ROOMS, "hole", hole)
    with staged("hole") as stage:
        shadow_leaks, _ = shadow_rays(stage)
        leaks, _ = visibility_rays(stage)
        rays = hemisphere_rays(stage)
    assert min(shadow_leaks.wrong, leaks.wrong, rays.wrong) > 100
    assert light_from_within("hole").wrong > 100


def test_what_stands_in_the_way_is_counted(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setitem(ROOMS, "screened", screened)
    monkeypatch.setitem(ON_WALLS, "screened", ON_WALLS["plain"])
    with staged("screened") as stage:
        _, shadows = shadow_rays(stage)
        _, losses = visibility_rays(stage)
        found = [shadows, losses, hemisphere_rays(stage), lamps_on_walls(stage), eyes_on_walls_lose(stage)]
    assert min(count.wrong for count in found) > 100


def test_eyes_that_see_from_zero_on_see_their_own_wall() -> None:
    """The count of eyes on walls can fail: without `Cameras.near` half of their rays end where they start."""
    with staged("plain") as stage:
        inwards = eyes_on_walls(stage, True, near=0.0)
    assert inwards.wrong.mean() > 0.1
