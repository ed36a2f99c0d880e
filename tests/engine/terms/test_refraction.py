"""Rays of eyes through solid glass, against Snell's law."""

import math
from typing import Any

import numpy as np
import pytest
from support import tiny
from support.hits import points

from framearray_cli.engine.embree.embreescene import EmbreeScene
from framearray_cli.engine.hits.rays import room_for_hits
from framearray_cli.engine.inputs.panes import bends_rays, pane_arrays
from framearray_cli.engine.terms.refraction import Bent, bend
from framearray_cli.scene.files import Material, Meshes, Part
from framearray_cli.scene.files.model import Glass
from framearray_cli.scene.scene import Scene, build_scene

INDEX, COLOUR = 1.5, (0.81, 0.49, 0.25)
FLOOR = tiny.quad((-50, -5, 50), (50, -5, 50), (50, -5, -50), (-50, -5, -50))
SLAB = tiny.box((-20, 0, -20), (20, 1, 20))
EYE = np.array([0.0, 4.0, 0.0])


def prism() -> Any:
    """A body with a right angle at (0, 0), legs of 2 along x and y, and 8 long in z."""
    a, b, c = (0.0, 0.0), (2.0, 0.0), (0.0, 2.0)
    near, far = 4.0, -4.0

    def at(p: Any, z: float) -> list[float]:
        return [*p, z]

    sides = [tiny.quad(at(p, near), at(p, far), at(q, far), at(q, near)) for p, q in ((a, b), (b, c), (c, a))]
    ends = [[[at(a, near), at(b, near), at(c, near)]], [[at(a, far), at(c, far), at(b, far)]]]
    return np.concatenate([*sides, *map(np.array, ends)]).astype(float)


def scene_of(body: Any, **glass: Any) -> Scene:
    materials = (Material(name="Floor"), Material(name="Glass", glass=Glass(colour=COLOUR, ior=INDEX, **glass)))
    parts = (Part(material=0, corners=FLOOR), Part(material=1, corners=body))
    return build_scene(Meshes(parts=parts, materials=materials, textures=(), dropped={}, notes=()), {})


def bent_rays(scene: Scene, eye: Any, ways: Any, ends: Any) -> Bent:
    """Bend rays that found hits at `ends`; results in coordinates of the file."""
    n = len(ways)
    hits = points(n, (0, 0, 0), (0, 1, 0))
    hits.position[:n], hits.incoming[:n] = ends - scene.centre, ways
    with EmbreeScene(scene) as embree:
        panes = pane_arrays(scene, embree.panes)
        assert bends_rays(panes)
        found = bend(hits, n, (eye - scene.centre).astype(np.float32), panes, embree.tracer, room_for_hits(64).packets)
    return found._replace(origin=found.origin + scene.centre)


def test_a_slab_shifts_rays_and_dims_them_by_both_faces() -> None:
    angles = np.radians(np.linspace(0, 75, 101))  # more than fit into the packets
    ways = np.column_stack([np.sin(angles), -np.cos(angles), 0 * angles])
    ends = EYE + ways * (9 / np.cos(angles))[:, None]
    found = bent_rays(scene_of(SLAB, solid=True), EYE, ways, ends)
    assert found.hit.tolist() == list(range(101))
    np.testing.assert_allclose(found.way, ways, atol=2e-6)
    inside = np.arcsin(np.sin(angles) / INDEX)
    x = 3 * np.tan(angles) + np.tan(inside)  # 3 down to the slab, 1 through it
    np.testing.assert_allclose(found.origin[:, 0], x, atol=1e-4)
    np.testing.assert_allclose(found.origin[:, 1], 0.0, atol=1e-4)
    f0 = ((INDEX - 1) / (INDEX + 1)) ** 2
    f = f0 + (1 - f0) * (1 - np.cos(angles)) ** 5
    np.testing.assert_allclose(found.passed, ((1 - f) ** 2)[:, None] * COLOUR, rtol=1e-4)


def test_a_prism_turns_rays_by_a_right_angle() -> None:
    """Light that meets the long face at 45 degrees from inside is caught: it leaves by the other leg."""
    eye = np.array([-3.0, 0.7, 0.3])
    found = bent_rays(scene_of(prism(), solid=True), eye, np.array([[1.0, 0.0, 0.0]]), np.array([[40.0, 0.7, 0.3]]))
    np.testing.assert_allclose(found.way, [[0.0, -1.0, 0.0]], atol=1e-6)
    np.testing.assert_allclose(found.origin, [[1.3, 0.0, 0.3]], atol=1e-4)
    f0 = ((INDEX - 1) / (INDEX + 1)) ** 2
    np.testing.assert_allclose(found.passed, [np.multiply(COLOUR, (1 - f0) ** 2)], rtol=1e-4)


def test_what_stands_before_glass_hides_it() -> None:
    found = bent_rays(scene_of(SLAB, solid=True), EYE, np.array([[0.0, -1.0, 0.0]]), np.array([[0.0, 2.0, 0.0]]))
    assert len(found.hit) == 0


@pytest.mark.parametrize(("body", "glass"), [(SLAB, {}), (SLAB[:-2], {"solid": True})])
def test_only_closed_bodies_with_a_volume_bend(body: Any, glass: Any) -> None:
    scene = scene_of(body, **glass)
    with EmbreeScene(scene) as embree:
        assert not bends_rays(pane_arrays(scene, embree.panes))


def test_without_mirror_bounces_nothing_bends() -> None:
    scene = scene_of(SLAB, solid=True)
    with EmbreeScene(scene) as embree:
        assert bends_rays(pane_arrays(scene, embree.panes))
        assert not bends_rays(pane_arrays(scene, embree.panes, bends=False))
    assert math.isclose(scene.pane_optics[0, -1], INDEX, rel_tol=1e-6), "the scene is left as it is"
