"""Meshes that shine: one random point per hit, on average the light of the whole mesh."""

from itertools import pairwise, product
from typing import Any

import numpy as np
import pytest
from support import tiny
from support.irradiance import FAR, N, P, check_mean, hits_at, irradiances, lambert, lamps

from framearray_cli.engine.embree.embreescene import EmbreeScene
from framearray_cli.engine.hits.rays import room_for_tests
from framearray_cli.engine.inputs.emitters import NONE, emitters
from framearray_cli.engine.inputs.lights import LightArrays, light_arrays
from framearray_cli.engine.inputs.panes import Sight
from framearray_cli.engine.terms.direct import direct
from framearray_cli.scene.files import Material
from framearray_cli.scene.paths.lightpath import Emitter, LightPath
from framearray_cli.scene.paths.paths import lights_without_groups
from framearray_cli.scene.scene import Scene

QUAD = np.array([(-0.6, 1.5, -0.3), (0.6, 1.5, -0.3), (0.6, 1.5, 0.3), (-0.6, 1.5, 0.3)])  # above P, its front down
WALLS = tiny.box((-4, -1, -4), (4, 5, 4))


def scene_with(lamp: Any, *, hides: Any = FAR, textures: Any = (), **more: Any) -> Scene:
    """A scene of two materials, "rest" and "lamp"; `more` are arrays of `Part` of the lamp."""
    material = Material(name="lamp", emission=(1.0, 1.0, 1.0), emission_texture=0 if len(textures) else -1)
    return tiny.scene_with((Material(name="rest"), hides), (material, {"corners": lamp, **more}), textures=textures)


def mesh(intensity: Any = ((1.0,) * 3,), *, two_sided: bool = True) -> LightPath:
    emitter = Emitter(material="lamp", two_sided=two_sided, flat=False, absolute=True)
    return LightPath(
        kind="mesh", vector=np.zeros((len(intensity), 3)), intensity=np.array(intensity, float), emitter=emitter
    )


def arrays(scene: Scene, *sources: LightPath) -> LightArrays:
    lights = lights_without_groups(sources)
    return light_arrays(lights, scene.centre, emitters(lights, scene))


def lit(scene: Scene, lights: LightArrays, n: int = N, neighbours: bool = True) -> Any:
    """Irradiance at P, (n, channels, n_lights)."""
    return irradiances(hits_at(P - scene.centre, n), lights, scene, neighbours)


def closed_ball(middle: Any, radius: float) -> Any:
    """An octahedron, each face cut into 64 and pushed onto a sphere, fronts outwards: (512, 3, 3)."""
    faces = np.array([np.diag(signs)[:: int(np.prod(signs))] for signs in product((1.0, -1.0), repeat=3)])
    for _ in range(3):
        a, b, c = faces[:, 0], faces[:, 1], faces[:, 2]
        d, e, f = (a + b) / 2, (b + c) / 2, (c + a) / 2
        faces = np.concatenate([np.stack(face, 1) for face in ((a, d, f), (d, b, e), (f, e, c), (d, e, f))])
    return np.add(middle, radius * faces / np.linalg.norm(faces, axis=2, keepdims=True))


def light_of_ball(ball: Any) -> float:
    """The irradiance at the origin by the triangles that face it; a convex body hides nothing of them."""
    normal = np.cross(ball[:, 1] - ball[:, 0], ball[:, 2] - ball[:, 0])
    return sum(lambert(face) for face in ball[(ball[:, 0] * normal).sum(axis=1) < 0])


def test_a_quad_has_lamberts_light() -> None:
    scene = scene_with(tiny.quad(*(QUAD + P)))
    check_mean(lit(scene, arrays(scene, mesh()), 4 * N)[:, 0, 0], lambert(QUAD))


def test_triangles_of_all_sizes_are_drawn_by_their_area() -> None:
    """The quad cut into strips of 1, 1/2, 1/4, ... of what is left, and a second quad beside it."""
    cuts = np.append(1 - 0.5 ** np.arange(9), 1.0)
    edge = [QUAD[0] + t * (QUAD[1] - QUAD[0]) for t in cuts]
    across = QUAD[3] - QUAD[0]
    strips = [tiny.quad(a, b, b + across, a + across) for a, b in pairwise(edge)]
    beside = np.add(QUAD, (1.5, 0.0, 0.2))
    scene = scene_with(np.concatenate([*strips, tiny.quad(*beside)]) + P)
    check_mean(lit(scene, arrays(scene, mesh()))[:, 0, 0], lambert(QUAD) + lambert(beside))


def test_the_back_shines_only_if_both_sides_do() -> None:
    for corners, front in ((QUAD, True), (QUAD[::-1], False)):
        scene = scene_with(tiny.quad(*(corners + P)))
        one_side = lit(scene, arrays(scene, mesh(two_sided=False)), 400)
        both = lit(scene, arrays(scene, mesh()), 400)
        np.testing.assert_array_equal(one_side, both if front else 0 * both)
        assert both.mean() > 0


def test_one_ray_serves_all_light_positions() -> None:
    """Each has its strength times the same light; one without strength has none; without any there is no ray."""
    scene = scene_with(tiny.quad(*(QUAD + P)))
    lights = arrays(scene, mesh([(1, 1, 1), (3, 3, 3), (0, 0, 0)]))
    found = lit(scene, lights, 300)
    np.testing.assert_allclose(found[:, 0, 1], 3 * found[:, 0, 0], rtol=1e-6)
    assert (found[:, 0, 2] == 0).all() and (found[:, 0, 0] > 0).all()
    hits, room = hits_at(P - scene.centre, 300), room_for_tests(4096, 3)
    out = np.empty((300, 1, 3), np.float32)
    with EmbreeScene(scene) as embree:
        assert direct(hits, 300, lights, Sight(embree.tracer), room, out, True) == 300
        assert direct(hits, 300, lights.at([2]), Sight(embree.tracer), room, out[:, :, :1].copy(), True) == 0


@pytest.mark.parametrize(("middle", "radius"), [((0.3, 1.5, -0.2), 0.6), ((0.02, 0.1, 0.01), 0.05), ((9, 12, -4), 0.2)])
def test_a_closed_ball_has_the_light_of_the_side_that_faces_the_place(middle: Any, radius: float) -> None:
    """Near and far, in a shade that is open below: what lies around the ball hides none of it."""
    high, wide = 1.3 * radius, 3 * radius
    shade = tiny.box(np.subtract(middle, (wide, 0, wide)), np.add(middle, (wide, high, wide)))
    open_below = shade[(shade[..., 1] > middle[1]).any(axis=1)]
    assert len(open_below) == 10
    ball = closed_ball(middle, radius)
    scene = scene_with(ball + P, hides=np.concatenate([open_below + P, FAR]))
    check_mean(lit(scene, arrays(scene, mesh(two_sided=False)), 4 * N)[:, 0, 0], light_of_ball(ball))


def test_of_a_closed_ball_hits_choose_points_that_face_them() -> None:
    """Far away one point by area has a variance of 5 / 3 of the mean's square, half of all points facing away: the
    integrals of c and c^2 over c = -1 to 1 where it is positive. Four that are independent have a quarter of that, and
    all face away with a chance of 1 / 16; here they depend on each other a little."""
    ball = closed_ball((0.0, 30.0, 0.0), 0.1)
    scene = scene_with(ball + P)
    found = lit(scene, arrays(scene, mesh(two_sided=False)))[:, 0, 0]
    assert found.var() < 5 / 9 * found.mean() ** 2
    assert (found > 0).mean() > 0.9


def test_what_stands_between_hides_half() -> None:
    wall = tiny.box(np.add(P, (-5, 0.8, -5)), np.add(P, (0, 0.81, 5)))
    scene = scene_with(tiny.quad(*(QUAD + P)), hides=np.concatenate([wall, FAR]))
    check_mean(lit(scene, arrays(scene, mesh()), 2 * N)[:, 0, 0], lambert(QUAD) / 2)


@pytest.mark.slow
def test_the_same_bits_for_any_grouping_and_beside_other_sources() -> None:
    scene = scene_with(tiny.quad(*(QUAD + P)), hides=np.concatenate([WALLS, FAR]))
    strength = np.linspace(0.5, 2, 12)[:, None] * (1, 1, 1)
    lamp = LightPath(kind="point", vector=np.tile(np.add(P, (1.0, 2.0, 0.0)), (12, 1)), intensity=strength)
    together = arrays(scene, lamp, mesh(strength))
    found = lit(scene, together, 200)
    np.testing.assert_array_equal(lit(scene, together, 200, neighbours=False), found)
    # streams have the numbers of sources, so the mesh is the second one here, too
    dark = LightPath(kind="point", vector=lamp.vector, intensity=0 * strength)
    alone, others = (lit(scene, arrays(scene, *pair), 200) for pair in ((dark, mesh(strength)), (lamp, dark)))
    assert alone.mean() > 0 and others.mean() > 0
    np.testing.assert_allclose(found, alone + others, rtol=1e-5)


@pytest.mark.parametrize("size", [1, 4])
def test_a_texture_colours_the_light(size: int) -> None:
    """Texels of a quad, each a small quad of its own; the first is black and none is seen past the borders."""
    texels = tiny.checks(size, seed=3)
    if size > 1:
        texels[0, 0, :3] = 0
    texels = np.kron(texels, np.ones((16, 16, 1), np.uint8))  # so that blending at borders is of no account
    uvs = np.array([[[0, 0], [1, 0], [1, 1]], [[0, 0], [1, 1], [0, 1]]], float)
    scene = scene_with(tiny.quad(*(QUAD + P)), textures=(texels,), uvs=uvs)
    lights = arrays(scene, mesh())
    assert lights.channels == 3
    found = lit(scene, lights, 4 * N)[:, :, 0]
    expected = np.zeros(3)
    linear = np.where(texels / 255 <= 0.04045, texels / 255 / 12.92, ((texels / 255 + 0.055) / 1.055) ** 2.4)
    right, up = QUAD[1] - QUAD[0], QUAD[3] - QUAD[0]
    for j in range(size):
        for i in range(size):
            corner = QUAD[0] + right * i / size + up * (size - 1 - j) / size
            part = [corner, corner + right / size, corner + (right + up) / size, corner + up / size]
            expected += linear[16 * j, 16 * i, :3] * lambert(np.array(part))
    for channel in range(3):
        error = found[:, channel].std() / np.sqrt(len(found))
        # the borders are blended over one texel of 16, which moves light by less than a hundredth of a part
        assert abs(found[:, channel].mean() - expected[channel]) <= 3.5 * error + 1e-3 * expected[channel]


def test_without_meshes_there_are_no_arrays() -> None:
    scene = scene_with(tiny.quad(*(QUAD + P)))
    assert emitters(lights_without_groups([lamps(np.ones((2, 3)))]), scene) is NONE
    assert not NONE.coloured
