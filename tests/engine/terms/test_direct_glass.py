"""Shadow rays through thin glass, against the formulas of its faces."""

from typing import Any

import numpy as np
import pytest
from support import tiny
from support.glass_twin import Pane
from support.hits import points
from support.panoramas import environment

from framearray_cli.engine.embree.embreescene import EmbreeScene
from framearray_cli.engine.hits.rays import room_for_tests
from framearray_cli.engine.inputs.emitters import emitters
from framearray_cli.engine.inputs.lights import LightArrays, light_arrays
from framearray_cli.engine.inputs.panes import NO_PANES, Sight, pane_arrays
from framearray_cli.engine.terms.cells.exact import coloured
from framearray_cli.engine.terms.direct import direct
from framearray_cli.scene.files import Material
from framearray_cli.scene.files.model import PaneGlass
from framearray_cli.scene.paths.lightpath import Emitter, LightPath
from framearray_cli.scene.paths.paths import lights_without_groups
from framearray_cli.scene.scene import Scene

COLOUR, N_HITS, N_LIGHTS = (0.8, 0.5, 0.2), 203, 19
RNG = np.random.default_rng(3)
LAMPS = RNG.uniform(-3, 3, (N_LIGHTS, 3)) + np.array([0, 4.5, 0])
PLACES = RNG.uniform(-3, 3, (N_HITS, 3)) * [1, 0, 1]
ROOF = tiny.quad((-9, 1, -9), (9, 1, -9), (9, 1, 9), (-9, 1, 9))
BOX = tiny.box((-9, 0.5, -9), (9, 1, 9))
BOARD = tiny.box((-1, 1.4, -1), (1, 1.45, 0.5))  # hides some lamps


def scene_of(*panes: Pane) -> Scene:
    board = np.concatenate([BOARD, tiny.box((90, -21, -1), (91, -20, 1))])
    glass = [(Material(name="Glass", glass=PaneGlass(colour=of.colour, ior=of.ior)), of.corners) for of in panes]
    return tiny.scene_with((Material(name="Board"), board), *glass)


def lamps(scene: Scene, at: Any) -> LightArrays:
    path = LightPath(kind="point", vector=at, intensity=np.tile([3.0, 2.0, 1.0], (N_LIGHTS, 1)))
    return coloured(light_arrays(lights_without_groups([path]), scene.centre))


def lit(scene: Scene, *, through: bool, room: int, neighbours: bool, at: Any = LAMPS) -> Any:
    hits = points(N_HITS, (0, 0, 0), (0, 1, 0))
    hits.position[:] = PLACES - scene.centre
    lights, out = lamps(scene, at), np.full((N_HITS, 3, N_LIGHTS), np.nan, np.float32)
    with EmbreeScene(scene) as embree:
        panes = pane_arrays(scene, embree.panes if through else None)
        direct(hits, N_HITS, lights, Sight(embree.tracer, panes), room_for_tests(room, N_LIGHTS), out, neighbours)
    return out


def passed(panes: tuple[Pane, ...]) -> Any:
    """(N_HITS, 3, N_LIGHTS) by formula."""
    found = np.ones((N_HITS, 3, N_LIGHTS))
    for l, lamp in enumerate(LAMPS):
        for pane in panes:
            t, share, _, _ = pane.faces(PLACES, lamp - PLACES)
            found[:, :, l] *= np.where((t < 1)[..., None], share, 1.0).prod(axis=0)
    return found


@pytest.mark.parametrize(("room", "neighbours"), [(64, True), (4096, False)])
@pytest.mark.parametrize(
    "panes",
    [
        (Pane(ROOF, COLOUR),),
        (Pane(BOX, COLOUR, body=True),),
        (Pane(BOX[:-2], COLOUR, ior=1.8),),
        (Pane(BOX, COLOUR, body=True), Pane(ROOF + np.array([0, 0.5, 0]), (0.9, 0.9, 1.0), ior=1.3)),
    ],
    ids=["sheet", "closed box", "open box", "two panes"],
)
def test_shadow_rays_are_dimmed_by_every_pane(panes: tuple[Pane, ...], room: int, neighbours: bool) -> None:
    scene = scene_of(*panes)
    free = lit(scene, through=False, room=room, neighbours=neighbours)
    found = lit(scene, through=True, room=room, neighbours=neighbours)
    assert 0.02 < (free == 0).mean() < 0.9
    np.testing.assert_allclose(found, free * passed(panes), rtol=2e-5)


def test_a_lamp_inside_a_closed_body_is_dimmed_by_one_face_only() -> None:
    scene, inside = scene_of(Pane(BOX, COLOUR, body=True)), np.tile([0.5, 0.75, 0.5], (N_LIGHTS, 1))
    free, found = (lit(scene, through=through, room=4096, neighbours=True, at=inside) for through in (False, True))
    # some hits lie right below the lamp: F is 0.04 there, and grows towards the horizon
    shares = (found / free)[:, 2]
    assert 0.955 * np.sqrt(0.2) < shares.max() < 0.961 * np.sqrt(0.2)


@pytest.mark.slow
@pytest.mark.parametrize("neighbours", [True, False])
def test_environments_and_surfaces_that_shine_are_dimmed_too(neighbours: bool) -> None:
    """Hits in a closed body that covers a fifth: its face is on every way out, and has one colour at all angles."""
    cover = Material(name="Cover", glass=PaneGlass(colour=(0.8, 0.5, 0.2), ior=1.0, covers=True))
    shining = Material(name="Shining", emission=(2.0, 1.0, 0.5))
    panel = tiny.quad((-1, 3, -1), (1, 3, -1), (1, 3, 1), (-1, 3, 1))
    scene = tiny.scene_with((shining, panel), (cover, tiny.box((-5, -0.5, -5), (5, 1, 5))))
    emitter = Emitter(material="Shining", two_sided=True, flat=False, absolute=True)
    source = LightPath(kind="mesh", vector=np.zeros((2, 3)), intensity=np.ones((2, 3)), emitter=emitter)
    sky = environment(RNG.random((6, 12, 3)), turns_deg=(0.0, 70.0))
    paths = lights_without_groups([source, sky])
    lights = coloured(light_arrays(paths, scene.centre, emitters(paths, scene)))
    hits = points(N_HITS, (0, 0, 0), (0, 1, 0))
    hits.position[:] = PLACES - scene.centre
    found = []
    with EmbreeScene(scene) as embree:
        for panes in (NO_PANES, pane_arrays(scene, embree.panes)):
            out = np.full((N_HITS, 3, 2), np.nan, np.float32)
            sight = Sight(embree.tracer, panes)
            direct(hits, N_HITS, lights, sight, room_for_tests(4096, 2), out, neighbours)
            found.append(out)
    assert (found[0] > 0).all()
    np.testing.assert_allclose(found[1], found[0] * np.array([[0.8], [0.5], [0.2]]), rtol=1e-5)
