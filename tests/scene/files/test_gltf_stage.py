"""Cameras and lights of glTF files, and their motion: matrices against ones computed by hand."""

import math
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from support.scenes import Glb
from support.staged import QUARTER, animate, camera, light, shift, turn_y

from framearray_cli.base.errors import SceneError
from framearray_cli.scene.files import StageLens, read_meshes, read_stage


def test_a_file_without_any_has_none(tmp_path: Path) -> None:
    glb = Glb()
    glb.node(glb.mesh())
    stage = read_stage(glb.save(tmp_path / "a.glb"))
    assert stage.cameras == () and stage.lights == () and stage.notes == ()
    assert read_stage(tmp_path / "scene.obj").cameras == ()  # of such a format nothing is read


def test_a_camera_is_where_its_ancestors_put_it(tmp_path: Path) -> None:
    """A translated camera below a node with a matrix, below one that is turned and scaled."""
    glb = Glb()
    shot = camera(glb, translation=[1.0, 2.0, 3.0])
    matrix = shift(0, 5, 0) @ turn_y(0.3)
    middle = glb.add("nodes", {"matrix": matrix.T.reshape(-1).tolist(), "children": [shot]})
    glb.node(children=[middle], rotation=[0.0, QUARTER, 0.0, QUARTER], scale=[2.0, 2.0, 2.0])
    stage = read_stage(glb.save(tmp_path / "a.glb"))
    (found,) = stage.cameras
    assert (found.name, found.aspect) == ("Shot", 1.5)
    assert found.lens.fov_deg == pytest.approx(50)
    expected = turn_y(math.pi / 2) @ np.diag([2.0, 2.0, 2.0, 1.0]) @ matrix @ shift(1, 2, 3)
    np.testing.assert_allclose(stage.world_from(found.node, [0.0])[0], expected, atol=1e-6)
    assert stage.span([found.node]) is None


def test_a_rotating_ancestor_carries_the_camera_around(tmp_path: Path) -> None:
    glb = Glb()
    shot = camera(glb, translation=[0.0, 0.0, 4.0])
    arm = glb.node(children=[shot])
    animate(glb, arm, "rotation", [1.0, 3.0], [[0, 0, 0, 1], [0, QUARTER, 0, QUARTER]])
    stage = read_stage(glb.save(tmp_path / "a.glb"))
    assert stage.span([shot]) == (1.0, 3.0)
    times = [0.0, 1.0, 1.5, 2.0, 3.0, 9.0]
    for time, matrix in zip(times, stage.world_from(shot, times), strict=True):
        angle = math.pi / 2 * min(max((time - 1) / 2, 0), 1)  # at constant speed; at rest before and after
        np.testing.assert_allclose(matrix, turn_y(angle) @ shift(0, 0, 4), atol=1e-6)


def test_rotations_take_the_shorter_way(tmp_path: Path) -> None:
    """The second key is the same quarter turn with all signs changed."""
    glb = Glb()
    shot = camera(glb)
    glb.tree["scenes"][0]["nodes"].append(shot)
    animate(glb, shot, "rotation", [0.0, 1.0], [[0, 0, 0, 1], [0, -QUARTER, 0, -QUARTER]])
    stage = read_stage(glb.save(tmp_path / "a.glb"))
    np.testing.assert_allclose(stage.world_from(shot, [0.5])[0], turn_y(math.pi / 4), atol=1e-6)


def test_steps_stay_until_the_next_key(tmp_path: Path) -> None:
    glb = Glb()
    shot = camera(glb)
    glb.tree["scenes"][0]["nodes"].append(shot)
    animate(glb, shot, "translation", [0.0, 1.0, 2.0], [[0, 0, 0], [1, 0, 0], [5, 0, 0]], "STEP")
    stage = read_stage(glb.save(tmp_path / "a.glb"))
    x = stage.world_from(shot, [0.0, 0.99, 1.0, 1.99, 2.0, 3.0])[:, 0, 3]
    np.testing.assert_array_equal(x, [0, 0, 1, 1, 5, 5])


def test_a_cubic_spline_follows_its_tangents(tmp_path: Path) -> None:
    """x = t^3 - 2 t has value and slope -1 and 1 at 1, 4 and 10 at 2; two keys with those are that very cubic."""
    glb = Glb()
    shot = camera(glb)
    glb.tree["scenes"][0]["nodes"].append(shot)
    values = [[9, 9, 9], [-1, 0, 0], [1, 0, 0], [10, 0, 0], [4, 0, 0], [9, 9, 9]]  # arriving, value, leaving
    animate(glb, shot, "translation", [1.0, 2.0], values, "CUBICSPLINE")
    stage = read_stage(glb.save(tmp_path / "a.glb"))
    times = np.array([1.0, 1.25, 1.5, 1.9, 2.0])
    x = stage.world_from(shot, times.tolist())[:, 0, 3]
    np.testing.assert_allclose(x, times**3 - 2 * times, atol=1e-6)


def test_scale_is_animated_too_and_animations_add_up(tmp_path: Path) -> None:
    """Blender writes one animation per object; all of them count."""
    glb = Glb()
    shot = camera(glb, translation=[1.0, 0.0, 0.0])
    root = glb.node(children=[shot])
    animate(glb, root, "scale", [0.0, 1.0], [[1, 1, 1], [3, 1, 1]])
    animate(glb, root, "translation", [0.0, 2.0], [[0, 0, 0], [0, 8, 0]])
    stage = read_stage(glb.save(tmp_path / "a.glb"))
    assert stage.span([shot]) == (0.0, 2.0)
    np.testing.assert_allclose(stage.world_from(shot, [0.5])[0, :3, 3], [2.0, 2.0, 0.0], atol=1e-6)


def test_lights_have_their_kind_colour_and_strength(tmp_path: Path) -> None:
    glb = Glb()
    glb.node(name="Lamp", **light(glb, intensity=20.0, color=[1.0, 0.5, 0.25]))
    glb.node(name="Sun", **light(glb, "directional", intensity=3.0))
    glb.node(**light(glb, "spot", name="Beam", spot={"outerConeAngle": 0.5}))
    stage = read_stage(glb.save(tmp_path / "a.glb"))
    assert [(one.name, one.kind, one.intensity) for one in stage.lights] == [
        ("Lamp", "point", (20.0, 10.0, 5.0)),
        ("Sun", "directional", (3.0, 3.0, 3.0)),
        ("Beam", "spot", (1.0, 1.0, 1.0)),
    ]
    assert [one.cone_deg for one in stage.lights] == [None, None, (0.0, pytest.approx(np.degrees(0.5)))]


@pytest.mark.parametrize("cone", [{"outerConeAngle": 0}, {"innerConeAngle": 1.0}, {"outerConeAngle": 3.0}])
def test_a_spot_with_impossible_cones_is_refused(cone: dict[str, float], tmp_path: Path) -> None:
    glb = Glb()
    glb.node(**light(glb, "spot", spot=cone))
    with pytest.raises(SceneError, match="cone angles"):
        read_stage(glb.save(tmp_path / "a.glb"))


def test_what_the_default_scene_does_not_show_is_left_out(tmp_path: Path) -> None:
    glb = Glb()
    glb.node(glb.mesh())
    camera(glb)
    stage = read_stage(glb.save(tmp_path / "a.glb"))
    assert stage.cameras == ()


def test_an_orthographic_camera_sees_twice_its_magnification(tmp_path: Path) -> None:
    """One that sees nothing is left out."""
    glb = Glb()
    for name, tall in (("Plan", 1.5), ("Flat", 0.0)):
        lens = {"type": "orthographic", "orthographic": {"xmag": 3, "ymag": tall, "znear": 0, "zfar": 9}}
        glb.node(name=name, camera=glb.add("cameras", lens))
    stage = read_stage(glb.save(tmp_path / "a.glb"))
    (plan,) = stage.cameras
    assert (plan.lens, plan.aspect) == (StageLens(height=3.0), 2.0)
    assert stage.notes == ("camera Flat: sees a height of 0 scene units and is left out",)


@pytest.mark.parametrize(
    ("times", "values", "message"),
    [
        ([0.0, 0.0], [[0, 0, 0], [1, 0, 0]], "do not rise"),
        ([0.0, 1.0], [[0, 0, 0]], "2 times and 1 value"),
        ([0.0, math.nan], [[0, 0, 0], [1, 0, 0]], "do not rise, or are not finite"),
    ],
)
def test_broken_animations_are_reported(times: Any, values: Any, message: str, tmp_path: Path) -> None:
    glb = Glb()
    shot = camera(glb)
    glb.tree["scenes"][0]["nodes"].append(shot)
    animate(glb, shot, "translation", times, values)
    with pytest.raises(SceneError, match=message):
        read_stage(glb.save(tmp_path / "a.glb"))


def notes_of(glb: Glb, tmp_path: Path) -> tuple[str, ...]:
    return read_meshes(glb.save(tmp_path / "a.glb")).notes


def test_animations_of_cameras_and_lights_are_no_loss(tmp_path: Path) -> None:
    """Jobs have paths for them; only a mesh that stands still differs from the file."""
    glb = Glb()
    mesh = glb.node(glb.mesh())
    eye = camera(glb, translation=[0, 0, 5])
    lamp = glb.add("nodes", light(glb))
    glb.tree["scenes"][0]["nodes"] += [eye, lamp]
    for node in (eye, lamp):
        animate(glb, node, "translation", [0, 1], [[0, 0, 0], [1, 0, 0]])
    assert read_meshes(glb.save(tmp_path / "a.glb")).lights == 1
    assert not any("animation" in note or "light" in note for note in notes_of(glb, tmp_path))
    above = glb.add("nodes", {"children": [mesh]})
    glb.tree["scenes"][0]["nodes"].remove(mesh)
    glb.tree["scenes"][0]["nodes"].append(above)
    animate(glb, above, "translation", [0, 1], [[0, 0, 0], [1, 0, 0]])
    assert "animations of meshes are left out; they stand in their rest pose" in notes_of(glb, tmp_path)
