"""Gather rays behind mirrors: every pixel against the twin, and a room with a mirror against one twice as large."""

from typing import Any

import numpy as np
import pytest
from engine.terms.cells.test_cells import CELLS, FLIPS, SKY, built
from support import tiny
from support.lit_rooms import GREY, lamp
from support.oracle_cells import CellOracle
from support.pathtraced import path_traced

from framearray_cli.engine.frames.threads import TracePool
from framearray_cli.scene.files import Material, Meshes, Part
from framearray_cli.scene.scene import Scene, build_scene

JOBS: dict[str, dict[str, Any]] = {
    "sky": SKY,
    "three colours of light": {"light": {"sources": [tiny.TABLE["light"]["sources"][0], tiny.SUN, tiny.RED]}},
    "wide cells": {"indirect": {**CELLS["indirect"], "cell": 0.6}},
    "one mirror on the way": {"specular": {"depth": 1}},
    "more rays than packets hold": {"samples": {"hits": 1, "obscurance": 300}, "camera": {"resolution": [4, 3]}},
}
# float32 sums of some rays, times a chance that is rounded, too
ROUNDING = 256 * 2.0**-24


@pytest.mark.parametrize("name", JOBS)
def test_every_pixel_is_that_of_the_twin(name: str) -> None:
    with built(tiny.room(), **JOBS[name]) as case, TracePool(case.setup, 2) as pool:
        image = tiny.frames_of(case.setup, case.ambient, pool)[0].images
        twin = CellOracle(case.inputs, case.ambient, case.cells)
        for l in range(case.inputs.n_lights):
            expected = twin.image(0, l)
            off = abs(image[l] - expected) / (expected + expected.mean())
            assert (off > ROUNDING).any(axis=-1).sum() <= FLIPS, f"light {l}"
        assert twin.mirrored > 100


# A room of 3 x 2.5 x 4 whose wall at x = WALL is a mirror; a lamp in a bucket lights the ceiling, not that wall.
WALL, BUCKET = 1.5, (-0.6, 0.9, 0.3)
LOOK = {"keys": [{"frame": 0, "eye": [-1.2, 1.3, 1.7], "target": [1.0, 1.1, -1.2]}], "resolution": [32, 24]}
SHINING = Material(name="mirror", reflectivity=(0.0, 0.0, 0.0), specular=(1.0, 1.0, 1.0))


def furnished(side: float) -> list[Any]:
    """The walls but that of the mirror, and what stands in the room; side -1: mirrored at that wall."""

    def at(x: float) -> float:
        return WALL + side * (x - WALL)

    def quad(*corners: Any) -> Any:
        return tiny.quad(*((at(x), y, z) for x, y, z in corners))

    def block(low: Any, high: Any) -> Any:
        (x0, y0, z0), (x1, y1, z1) = low, high
        return tiny.box((min(at(x0), at(x1)), y0, z0), (max(at(x0), at(x1)), y1, z1))

    x, y, z, h = BUCKET[0], BUCKET[1], BUCKET[2], 2.5
    return [
        quad((-1.5, 0, -2), (WALL, 0, -2), (WALL, 0, 2), (-1.5, 0, 2)),
        quad((-1.5, h, -2), (WALL, h, -2), (WALL, h, 2), (-1.5, h, 2)),
        quad((-1.5, 0, -2), (-1.5, 0, 2), (-1.5, h, 2), (-1.5, h, -2)),
        quad((-1.5, 0, -2), (WALL, 0, -2), (WALL, h, -2), (-1.5, h, -2)),
        quad((-1.5, 0, 2), (WALL, 0, 2), (WALL, h, 2), (-1.5, h, 2)),
        block((0.3, 0, -1.0), (0.9, 1.0, -0.4)),
        *(quad((x - a, y, z - b), (x - c, y, z - d), (x - c, y + 0.7, z - d), (x - a, y + 0.7, z - b))
          for a, b, c, d in ((0.3, 0.3, -0.3, 0.3), (-0.3, 0.3, -0.3, -0.3), (-0.3, -0.3, 0.3, -0.3),
                             (0.3, -0.3, 0.3, 0.3))),
        quad((x - 0.3, y, z - 0.3), (x + 0.3, y, z - 0.3), (x + 0.3, y, z + 0.3), (x - 0.3, y, z + 0.3)),
    ]  # fmt: skip


def with_mirror() -> Scene:
    wall = tiny.quad((WALL, 0, -2), (WALL, 0, 2), (WALL, 2.5, 2), (WALL, 2.5, -2))
    materials = (Material(name="grey", reflectivity=GREY), SHINING)
    parts = (Part(material=0, corners=np.concatenate(furnished(1.0))), Part(material=1, corners=wall))
    return build_scene(Meshes(parts=parts, materials=materials, textures=(), dropped={}, notes=()), {})


def doubled() -> Scene:
    corners = np.concatenate([*furnished(1.0), *furnished(-1.0)])
    return tiny.scene_of(corners, Material(name="grey", reflectivity=GREY))


def inputs_of(scene: Scene, *, twice: bool = False, place: Any = None, **changes: Any) -> Any:
    x, y, z = place or (BUCKET[0], BUCKET[1] + 0.5, BUCKET[2])
    lamps = [lamp((at, y, z)) for at in ((x, 2 * WALL - x) if twice else (x,))]
    tables: dict[str, Any] = {
        "camera": LOOK, "light": {"frames": 1, "sources": lamps}, "samples": {"hits": 16, "obscurance": 16},
        "indirect": {"method": "cells", "samples": 2**18},
    }  # fmt: skip
    return tiny.prepared(tiny.job(**{**tables, **changes}), scene)


def image_of(inputs: Any) -> Any:
    return tiny.render_frames(inputs, threads=2).images[0, 0].astype(np.float64)


def standard_error(means: Any) -> float:
    return float(np.std(means, ddof=1)) / len(means) ** 0.5


def test_light_beside_a_mirror_is_that_of_paths() -> None:
    """A lamp beside the mirror, which as a diffuse surface would light the room by another 30 %."""
    keys = {"place": (1.1, 1.6, 0.3), "indirect": {"method": "cells", "samples": 2**16}}
    images = [image_of(inputs_of(with_mirror(), seed=seed, **keys)).mean() for seed in range(3)]
    paths = path_traced(inputs_of(with_mirror(), **keys), 0, 512).mean(axis=(1, 2, 3))
    error = standard_error(paths)
    assert error < 0.005 * paths.mean()
    assert abs(np.mean(images) - paths.mean()) < 3 * np.hypot(error, standard_error(images)) + 0.01 * paths.mean()


@pytest.mark.slow
def test_a_room_with_a_mirror_is_as_bright_as_one_twice_as_large() -> None:
    keys = {"indirect": {"method": "cells", "samples": 2**18}}
    one, two = (
        [image_of(inputs_of(scene, twice=scene is large, seed=seed, **keys)).mean() for seed in range(4)]
        for large in [doubled()]
        for scene in (with_mirror(), large)
    )
    error = np.hypot(standard_error(one), standard_error(two))
    assert error < 0.01 * np.mean(two)
    assert abs(np.mean(one) - np.mean(two)) < 3 * error + 0.01 * np.mean(two)
