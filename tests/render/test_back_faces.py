"""`scene.back_faces = "hide"`: eyes and mirrors look through the backs of one-sided surfaces, light does not."""

from typing import Any

import numpy as np
import pytest
from support import tiny
from support.models.shapes import block

from framearray_cli.render.identity import identity_of
from framearray_cli.scene.files import Material, Meshes, Part
from framearray_cli.scene.scene import Scene, build_scene

WALL = tiny.quad((12, -12, 0), (-12, -12, 0), (-12, 12, 0), (12, 12, 0))  # its front towards -z, away from the eye
BEHIND = tiny.quad((-30, -30, -2), (30, -30, -2), (30, 30, -2), (-30, 30, -2))
MIRROR = tiny.quad((2, -2, 6), (-2, -2, 6), (-2, 2, 6), (2, 2, 6))
WITHIN, OUTSIDE = (0.5, 0.5, -1.0), (0.5, 0.5, 5.0)  # positions of the lamp
RED, BLUE = (0.8, 0.0, 0.0), (0.0, 0.0, 0.8)


def scene_of(*sheets: tuple[Any, Any, bool], hide: bool = True) -> Scene:
    """A wall behind sheets, and a mirror behind the eye; each sheet has corners, reflectivity and `one_sided`."""
    materials = [
        Material(name="Behind", reflectivity=(0.5, 0.5, 0.5)),
        Material(name="Mirror", reflectivity=(0.0,) * 3, specular=(1.0,) * 3),
        *(Material(name=f"Sheet {k}", reflectivity=r, one_sided=s) for k, (_, r, s) in enumerate(sheets)),
    ]
    corners = [BEHIND, MIRROR, *(corners for corners, _, _ in sheets)]
    parts = [Part(material=m, corners=c) for m, c in enumerate(corners)]
    return build_scene(Meshes(parts=parts, materials=materials, textures=(), dropped={}, notes=()), {}, hide_backs=hide)


def job_of(
    scene: Scene, lamp: Any, *, eye: float = 4.0, to: float = 0.0, n_r: int = 1, back_faces: str = "hide"
) -> Any:
    """Three eyes side by side, at z = `eye`, that look at z = `to`."""
    keys = [{"frame": c, "eye": [c - 1.0, 0.0, eye], "target": [0.2 * c, 0.1, to]} for c in (0, 2)]
    lit = {"type": "point", "keys": [{"frame": 0, "position": list(lamp), "intensity": 10.0}]}
    job = tiny.job(
        scene={"back_faces": back_faces},
        camera={"resolution": [16, 12], "fov": 30.0, "frames": 3, "keys": keys},
        light={"frames": 1, "sources": [lit]},
        samples={"hits": 2, "obscurance": 1},
        reuse={"n_r": n_r},
        specular={"depth": 1},
        ambient=tiny.DARK,
    )
    return tiny.prepared(job, scene)


def images(*args: Any, **more: Any) -> Any:
    """(3, 1, height, width, 3) of the three eyes."""
    return np.array(tiny.render_frames(job_of(*args, **more)).images)


SHEET = (WALL, RED, True)


@pytest.mark.parametrize("to", [0.0, 6.0], ids=["eye", "mirror"])
@pytest.mark.parametrize("n_r", [0, 2])
def test_eyes_look_through_the_back(n_r: int, to: float) -> None:
    without = images(scene_of(), WITHIN, n_r=n_r, to=to)
    assert without.min() > 0.0
    np.testing.assert_array_equal(images(scene_of(SHEET), WITHIN, n_r=n_r, to=to), without)
    assert not images(scene_of(SHEET), WITHIN, n_r=n_r, to=to, back_faces="show").any()


def test_its_shadow_stays() -> None:
    assert images(scene_of(), OUTSIDE).min() > 0.0
    assert not images(scene_of(SHEET), OUTSIDE).any()


def test_a_dolls_house_is_open_to_eyes_and_closed_to_light() -> None:
    """A room modelled from inside, with a wall in it, from outside."""
    room = block((-12, -12, -6), (12, 12, 0), inwards=True)
    near = (room[..., 2] == 0).all(axis=1)
    without = images(scene_of((room[~near], RED, True)), WITHIN)
    assert without.min() > 0.0
    house = scene_of((room, RED, True))
    np.testing.assert_array_equal(images(house, WITHIN), without)
    assert not images(house, OUTSIDE).any() and not images(house, WITHIN, back_faces="show").any()


def test_other_surfaces_hide_nothing() -> None:
    two_sided = images(scene_of((WALL, RED, False)), OUTSIDE)
    np.testing.assert_array_equal(two_sided, images(scene_of((WALL, RED, False)), OUTSIDE, back_faces="show"))
    assert two_sided[..., 0].min() > 0.0 and not two_sided[..., 1:].any()


@pytest.mark.parametrize("n_r", [0, 2])
def test_the_front_is_seen(n_r: int) -> None:
    front = images(scene_of(SHEET), WITHIN, eye=-1.5, n_r=n_r)
    assert front[..., 0].min() > 0.0 and not front[..., 1:].any()


@pytest.mark.parametrize("lamp, eye, colour", [(OUTSIDE, 4.0, 2), (WITHIN, -1.5, 0)])
def test_each_of_two_sheets_in_one_place_shows_its_side(lamp: Any, eye: float, colour: int) -> None:
    """Exporters write a wall with two materials in this way."""
    both = scene_of(SHEET, (WALL[:, ::-1], BLUE, True))
    seen = images(both, lamp, eye=eye)
    assert seen[..., colour].min() > 0.0 and not np.delete(seen, colour, axis=-1).any()


def test_a_material_that_others_cover_is_named() -> None:
    scene = scene_of(SHEET, (WALL[:, ::-1], BLUE, True), hide=False)
    assert scene.report.dropped == {"duplicate": 2}
    assert "other surfaces are in the same place, some are left out: Sheet 1" in scene.report.notes


def test_hidden_backs_are_another_job() -> None:
    shown, hidden = (job_of(scene_of(SHEET), WITHIN, back_faces=key) for key in ("show", "hide"))
    assert identity_of(shown).fingerprint != identity_of(hidden).fingerprint
