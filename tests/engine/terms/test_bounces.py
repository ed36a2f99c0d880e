"""Mirrors, and solid glass, against plain optics."""

import math
from typing import Any

import numpy as np
import pytest
from support import tiny
from support.hits import native, points

from framearray_cli.engine.embree.embreescene import EmbreeScene
from framearray_cli.engine.frames.setup import FrameSetup
from framearray_cli.engine.hits.hits import SURFACE, Hits, empty_hits
from framearray_cli.engine.hits.rays import room_for_hits
from framearray_cli.engine.inputs.panes import bends_rays, pane_arrays
from framearray_cli.engine.terms.bounces import Bent, bend, count_mirrors, reflect
from framearray_cli.scene.files import Material
from framearray_cli.scene.files.model import PaneGlass
from framearray_cli.scene.scene import Scene

TINT = np.float32([0.9, 0.8, 0.7])


def behind_mirror() -> Scene:
    """A mirror in the plane z = -1 that fills the view, and a coloured box and ball between it and the eye."""
    corners, normals = tiny.ball((0.8, 0.2, 1.5), 0.5)
    boxes = [tiny.box((-1.5, -0.5, 0.4), (-0.6, 0.6, 1.2), 0.4), tiny.box((-9, -9, 6), (9, 9, 9))]
    mirror = Material(name="Mirror", reflectivity=(0, 0, 0), specular=tuple(float(t) for t in TINT))
    return tiny.scene_with(
        (mirror, tiny.quad((-9, -9, -1), (9, -9, -1), (9, 9, -1), (-9, 9, -1))),
        (Material(name="Box", reflectivity=(0.8, 0.3, 0.2)), np.concatenate(boxes)),
        (Material(name="Ball", reflectivity=(0.2, 0.4, 0.9)), {"corners": corners, "normals": normals}),
    )


def work_of(scene: Scene, **changes: Any) -> Any:
    keys = [{"frame": 0, "eye": [0.0, 0.1, 3.0], "target": [0.0, 0.1, -1.0]}]
    return tiny.planned(tiny.prepared(tiny.job(camera={"keys": keys, "fov": 60.0}, **changes), scene))


def reflected(setup: FrameSetup, hits: Hits, throughput: Any = None) -> tuple[Hits, Any, int]:
    n = len(hits.kind)
    out, through = empty_hits(n), np.empty((n, 3), np.float32)
    throughput = np.ones((n, 3), np.float32) if throughput is None else throughput
    packets = room_for_hits(n).packets
    m = reflect(hits, n, throughput, setup.world, packets, out, through)
    return Hits(*(array[:m] for array in out)), through[:m], m


def test_a_mirror_shows_the_mirrored_scene() -> None:
    """A ray to a point of the mirror goes on as a ray of the mirrored eye through the same point would."""
    with work_of(behind_mirror()) as (setup, _):
        hits = native(setup, 0, 2)
        mirrors = (hits.specular > 0).any(axis=1)
        assert 50 < mirrors.sum() == count_mirrors(hits, len(hits.kind))
        seen, through, m = reflected(setup, hits)
        assert m == mirrors.sum()
        mirror = hits.position[mirrors].astype(np.float64)  # so that the roundings below are those of the program
        flip = np.array([1, 1, -1])
        eye = setup.cams.position[0] * flip + np.array([0, 0, 2 * mirror[:, 2].mean()])
        way = mirror - eye
        np.testing.assert_allclose(seen.incoming, hits.incoming[mirrors] * flip, atol=1e-6)
        surface = seen.kind == SURFACE
        assert surface.sum() > 50
        # what the mirrored eye sees lies on the line from it through the mirror's point
        line = way[surface] / np.linalg.norm(way[surface], axis=1, keepdims=True)
        beyond = seen.position[surface] - eye
        off = beyond - (beyond * line).sum(axis=1, keepdims=True) * line
        assert abs(off).max() < 1e-5  # 2^-24 of coordinates up to 9, some roundings
        assert ((beyond * line).sum(axis=1) > np.linalg.norm(way[surface], axis=1)).all()
        assert len(np.unique(seen.reflectivity[surface], axis=0)) >= 2, "box and ball are both seen"
    np.testing.assert_array_equal(through, np.tile(TINT, (m, 1)))
    np.testing.assert_array_equal(seen.pixel, hits.pixel[mirrors])


def test_throughput_multiplies() -> None:
    with work_of(behind_mirror()) as (setup, _):
        hits = native(setup, 0, 1)
        before = np.random.default_rng(1).random((len(hits.kind), 3)).astype(np.float32)
        _, through, _ = reflected(setup, hits, before)
    np.testing.assert_allclose(through, before[(hits.specular > 0).any(axis=1)] * TINT, rtol=1e-7)


def test_random_streams_move_on() -> None:
    """Else a reflected hit would use the very directions of the hit before it."""
    with work_of(behind_mirror()) as (setup, _):
        hits = native(setup, 0, 3)
        seen, _, m = reflected(setup, hits)
    assert len(np.unique(np.concatenate([hits.key, seen.key]))) == len(hits.key) + m


def corridor(depth: int) -> Any:
    """Two mirrors that face each other; every path goes on to the depth of the job."""
    plates = [tiny.quad((-99, -99, z), (99, -99, z), (99, 99, z), (-99, 99, z)) for z in (-1, 1)]
    scene = tiny.scene_of(
        np.concatenate(plates), Material(name="M", reflectivity=(0.0, 0.0, 0.0), specular=(0.5, 0.5, 0.5))
    )
    keys = [{"frame": 0, "eye": [0, 0, 0.5], "target": [0.01, 0.02, -1.0]}]
    job = tiny.job(
        camera={"keys": keys, "fov": 40.0}, specular={"depth": depth}, scene={"background": 1.0}, ambient={"paths": 64}
    )
    return tiny.render_frames(tiny.prepared(job, scene))


@pytest.mark.parametrize("depth", [1, 2, 5])
def test_paths_end_at_the_depth(depth: int) -> None:
    rendered = corridor(depth)
    assert rendered.rays["mirror"] == depth * 2 * 24 * 18
    assert not rendered.images.any(), "nothing but mirrors: no light at any depth"


@pytest.mark.parametrize(("hits", "n_r"), [(4, 0), (0.125, 0), (0.125, 1), (0.125, 2)])
def test_a_mirror_shows_the_background_once(hits: float, n_r: int) -> None:
    """A mirror that sees nothing but sky is the sky, tinted; around the mirror the sky is itself.

    A mirror's pixel that no hit of the frame reaches is shown by its own mirror hits, and not again by another.
    """
    plate = tiny.quad((-1, -1, 0), (1, -1, 0), (1, 1, 0), (-1, 1, 0))
    scene = tiny.scene_of(plate, Material(name="M", reflectivity=(0.0, 0.0, 0.0), specular=(0.5, 0.25, 1.0)))
    keys = [
        {"frame": 0, "eye": [0, 0, 3], "target": [0, 0, 0]},
        {"frame": 4, "eye": [0.1, 0, 3], "target": [0.1, 0, 0]},
    ]
    job = tiny.job(
        camera={"frames": 5, "keys": keys, "fov": 60.0},
        scene={"background": [2.0, 2.0, 3.0]},
        samples={"hits": hits},
        reuse={"n_r": n_r},
    )
    for image in tiny.render_frames(tiny.prepared(job, scene)).images[:, 0]:
        np.testing.assert_allclose(image[8:11, 11:14], np.tile([1.0, 0.5, 3.0], (3, 3, 1)), rtol=1e-6)
        np.testing.assert_allclose(image[0], np.tile([2.0, 2.0, 3.0], (24, 1)), rtol=1e-6)


def test_without_mirrors_no_mirror_ray_is_traced() -> None:
    for scene, depth in ((tiny.room(mirrors=False), 4), (tiny.room(), 0)):
        rendered = tiny.render_frames(tiny.prepared(tiny.job(specular={"depth": depth, "hits": 9}), scene))
        assert not {"mirror", "pilot", "mirror shadow", "mirror obscurance"} & rendered.rays.keys()


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
    pane = Material(name="Glass", glass=PaneGlass(colour=COLOUR, ior=INDEX, **glass))
    return tiny.scene_with((Material(name="Floor"), FLOOR), (pane, body))


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
