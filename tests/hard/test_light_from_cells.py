"""Light from cells where it is hard to find, against paths: what cells smear, miss, or let through."""

import numpy as np
import pytest
from support import tiny
from support.light_errors import light_error, paths_of, rendered
from support.lit_rooms import LIT_ROOMS
from support.pathtraced import path_traced
from support.two_rooms import rooms, wall

CELLS = {"method": "cells", "samples": 2**18}
# Paths per pixel; few find the floor behind a slit.
PATHS, PATHS_OF = 256, {"a lit slit": 4096}


@pytest.mark.parametrize("thickness", [0.0, 0.02])
def test_a_closed_room_stays_dark(thickness: float) -> None:
    images = tiny.render_frames(rooms([*wall(0.0, 0), *(wall(thickness, 0) if thickness else [])]), threads=2).images
    dark, lit = images.mean(axis=(1, 2, 3, 4))
    assert lit > 0.5
    assert dark < lit / 1000


@pytest.mark.slow
def test_a_room_behind_a_hole_is_as_bright_as_with_paths() -> None:
    inputs = rooms(wall(0.0, 0.15))
    image = tiny.render_frames(inputs, threads=2).images
    for c in range(2):
        paths = path_traced(inputs, c, 4096 if c == 0 else 64).mean(axis=(1, 2, 3))
        right, error = paths.mean(), paths.std(ddof=1) / len(paths) ** 0.5
        assert right > 0.001 and error < 0.04 * right
        assert abs(image[c].mean() - right) < 0.1 * right


@pytest.mark.slow
@pytest.mark.parametrize("name", LIT_ROOMS)
def test_light_is_that_of_paths(name: str) -> None:
    """The bounds are those that are asked of whole jobs: 2 % of the mean, a quarter of the indirect light per place."""
    room = LIT_ROOMS[name]
    found = light_error(
        rendered(room, indirect=CELLS), rendered(room, ambient=tiny.DARK), paths_of(room, PATHS_OF.get(name, PATHS))
    )
    assert found.mean_error < 0.01
    assert abs(found.mean) < 0.02 + 3 * found.mean_error
    assert found.indirect < 0.25


def test_a_floor_alone_is_lit_by_the_sky_only() -> None:
    """No walk meets a second surface, so that there are no cells; nothing is taken from the ambient light."""
    grey = (0.5, 0.4, 0.3)
    floor = tiny.scene_of(
        tiny.quad((-9, 0, 9), (9, 0, 9), (9, 0, -9), (-9, 0, -9)), tiny.Material(name="Grey", reflectivity=grey)
    )
    look = {"keys": [{"frame": 0, "eye": [0.2, 1.3, 1.7], "target": [0, 0, 0]}]}
    sky = [0.3, 0.4, 0.5]
    lit, unlit, direct = (
        tiny.render_frames(tiny.prepared(tiny.job(camera=look, **changes), floor), threads=2).images
        for changes in ({"indirect": CELLS, "scene": {"background": sky}}, {"indirect": CELLS}, {"ambient": tiny.DARK})
    )
    assert direct.mean() > 0.05
    np.testing.assert_array_equal(unlit, direct)
    lowest = (lit - direct)[:, :, -1]  # pixels that see nothing but the floor
    np.testing.assert_allclose(lowest, np.broadcast_to(np.multiply(grey, sky), lowest.shape), rtol=1e-4)
