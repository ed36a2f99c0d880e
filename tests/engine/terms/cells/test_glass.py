"""Light from cells behind glass: a room whose only light comes through a tinted window."""

from typing import Any

import numpy as np
import pytest
from support import tiny

from framearray_cli.job.job import Job
from framearray_cli.scene.files import Material, Meshes, Part
from framearray_cli.scene.files.model import Glass
from framearray_cli.scene.scene import Scene, build_scene

TINT = (0.5, 0.25, 0.8)
WALLS = tiny.box((-2, 0, -2), (2, 2.5, 2))
LOW, HIGH = (-0.6, 0.8), (0.6, 1.9)  # x and y of the window, in the wall at z = -2


def wall_with_window() -> Any:
    """The wall at z = -2 as a frame of four quads."""

    def piece(x0: float, y0: float, x1: float, y1: float) -> Any:
        return tiny.quad((x0, y0, -2), (x1, y0, -2), (x1, y1, -2), (x0, y1, -2))

    (x0, y0), (x1, y1) = LOW, HIGH
    return np.concatenate([piece(-2, 0, x0, 2.5), piece(x1, 0, 2, 2.5), piece(x0, 0, x1, y0), piece(x0, y1, x1, 2.5)])


def room(colour: Any) -> Scene:
    """A room with a pane in its window, which covers and mirrors nothing."""
    others = WALLS[~(WALLS[..., 2] == -2).all(axis=1)]
    (x0, y0), (x1, y1), z = np.subtract(LOW, 0.5), np.add(HIGH, 0.5), -2.05
    pane = tiny.quad((x0, y0, z), (x1, y0, z), (x1, y1, z), (x0, y1, z))
    materials = (
        Material(name="Walls", reflectivity=(0.7, 0.6, 0.5)),
        Material(name="Pane", glass=Glass(colour=colour, ior=1.0, covers=True)),
    )
    parts = (
        Part(material=0, corners=np.concatenate([others, wall_with_window()])),
        Part(material=1, corners=pane),
    )
    return build_scene(Meshes(parts=parts, materials=materials, textures=(), dropped={}, notes=()), {})


def picture(colour: Any, background: float, intensity: float, indirect: dict[str, Any]) -> Any:
    eye = {"frame": 0, "eye": [1.2, 1.4, 1.7], "target": [-0.6, 0.6, -1.0]}
    lamp = {"type": "point", "keys": [{"frame": 0, "position": [0.0, 1.3, -2.6], "intensity": intensity}]}
    job = tiny.job(
        scene={"background": background},
        camera={"frames": 1, "resolution": [32, 24], "fov": 60.0, "keys": [eye]},
        light={"frames": 1, "sources": [lamp]},
        samples={"hits": 4, "obscurance": 4},
        reuse={"n_r": 0},
        indirect=indirect,
    )
    assert isinstance(job, Job)
    return tiny.render_frames(tiny.prepared(job, room(colour)), threads=2).images[0, 0].astype(np.float64)


@pytest.mark.parametrize("indirect", [tiny.CELLS, {"method": "cells", "exact": True}, {"method": "obscurance"}])
@pytest.mark.parametrize(("background", "intensity"), [(1.0, 1e-9), (0.0, 3.0)])
def test_all_light_behind_a_window_has_its_colour(
    background: float, intensity: float, indirect: dict[str, Any]
) -> None:
    """Pixel by pixel, as all rays are the same: light that leaves the room does not come back."""
    clear = picture((1.0, 1.0, 1.0), background, intensity, indirect)
    tinted = picture(TINT, background, intensity, indirect)
    lit = clear.min(axis=2) > 1e-3 * clear.max()
    assert lit.mean() > (0.6 if "exact" in indirect else 0.9)  # few paths of a pixel leave by the window
    ratio = tinted[lit] / clear[lit]
    np.testing.assert_allclose(np.median(ratio, axis=0), TINT, rtol=1e-4)
    assert (np.abs(ratio / TINT - 1) < 0.01).mean() > 0.98
