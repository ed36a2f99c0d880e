"""Eyes, lights, their groups and image planes at every frame of a job."""

from pathlib import Path
from typing import Any

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from support import tiny
from support.irradiance import flat_arrays

from framearray_cli.array.manifest import array_files, file_name
from framearray_cli.base.errors import JobError
from framearray_cli.base.forms.table import changed
from framearray_cli.engine.inputs.lights import light_arrays
from framearray_cli.engine.terms.ambient.intensity import Ambient
from framearray_cli.render.identity import identity_of
from framearray_cli.render.manifest import initial_manifest
from framearray_cli.render.plan import image_ambient
from framearray_cli.render.writer import array_names, array_target
from framearray_cli.scene.paths.curves import interpolate_directions, interpolate_keys, slerp, turn, unit
from framearray_cli.scene.paths.paths import (
    Lights,
    Plane,
    eyes,
    first_with_background,
    group_planes,
    lights,
)

FEW = settings(max_examples=60, deadline=None)
numbers = st.floats(-1e6, 1e6)
vectors = st.tuples(numbers, numbers, numbers)
frame_lists = st.lists(st.integers(0, 60), min_size=1, max_size=6, unique=True).map(sorted)


def job_of(camera_keys, *, scene=None, **camera):
    """Make a job with these camera keys."""
    return tiny.Job.model_validate(tiny.table(scene=scene or {}) | {"camera": {"keys": camera_keys, **camera}})


def lit(*sources):
    """The lights of a job with these sources."""
    return lights(tiny.Job.model_validate(tiny.table() | {"light": {"sources": list(sources)}}))


def fixed(eye, target, **more):
    """Return the matrix of a fixed camera."""
    return eyes(job_of([{"frame": 0, "eye": eye, "target": target, **more}])).world_from_camera[0]


@FEW
@given(frames=frame_lists, data=st.data())
def test_numbers_pass_through_keys_and_stay_between_neighbours(frames, data):
    values = np.array(data.draw(st.lists(vectors, min_size=len(frames), max_size=len(frames))))
    n = frames[-1] + 5
    curve = interpolate_keys(frames, values, n)
    assert curve.shape == (n, 3)
    assert (curve[frames] == values).all()
    assert (curve[: frames[0]] == values[0]).all()
    assert (curve[frames[-1] :] == values[-1]).all()
    for k in range(len(frames) - 1):
        span = curve[frames[k] : frames[k + 1] + 1]
        assert (span >= np.minimum(values[k], values[k + 1])).all()
        assert (span <= np.maximum(values[k], values[k + 1])).all()


def test_equal_neighbours_stay_equal_bit_for_bit():
    curve = interpolate_keys([0, 7, 19, 30], [[0.1], [0.7], [0.7], [0.3]], 31)
    assert (curve[7:20] == 0.7).all()
    assert len(np.unique(curve[:8])) == 8


def test_two_keys_are_a_straight_line():
    curve = interpolate_keys([2, 12], [[0.0, 5.0], [1.0, -5.0]], 13)[:, 0]
    np.testing.assert_allclose(curve[2:], np.linspace(0, 1, 11), rtol=0, atol=1e-15)


def test_a_path_through_keys_has_no_corner():
    curve = interpolate_keys([0, 100, 250], [[0.0], [1.0], [4.0]], 251)[:, 0]
    steps = np.diff(curve)
    assert np.abs(np.diff(steps)).max() < 0.05 * steps.max()  # a broken line would jump by half of its largest step


@FEW
@given(frames=frame_lists, seed=st.integers(0, 2**32 - 1))
def test_directions_pass_through_keys_and_stay_unit(frames, seed):
    keys = np.random.default_rng(seed).normal(size=(len(frames), 3))
    path = interpolate_directions(frames, keys, frames[-1] + 4)
    np.testing.assert_allclose(np.linalg.norm(path, axis=1), 1, rtol=0, atol=1e-12)
    assert (path[frames] == unit(keys)).all()
    assert (path[frames[-1] :] == path[frames[-1]]).all()


def test_two_directions_turn_at_constant_speed():
    path = interpolate_directions([0, 10], [[1, 0, 0], [-1, 1e-3, 0]], 11)
    whole = np.pi - 1e-3
    angles = np.arctan2(path[:, 1], path[:, 0])
    np.testing.assert_allclose(angles, np.linspace(0, whole, 11), rtol=0, atol=1e-6)
    assert (path[:, 2] == 0).all()


def test_directions_on_a_great_circle_stay_on_it_without_turning_back():
    angles = np.array([0.0, 0.2, 0.3, 1.7, 1.8])
    keys = np.stack([np.cos(angles), np.zeros(5), np.sin(angles)], axis=1)
    path = interpolate_directions([0, 20, 25, 60, 90], keys, 91)
    np.testing.assert_allclose(path[:, 1], 0, atol=1e-15)
    assert (np.diff(np.arctan2(path[:, 2], path[:, 0])) > 0).all()


def test_direction_path_has_no_corner_at_a_key():
    path = interpolate_directions([0, 200, 400], [[1, 0, 0], [0.6, 0.7, 0.2], [0, 0.2, 1]], 401)
    steps = turn(path[:-1], path[1:])
    length = np.linalg.norm(steps, axis=1)
    bend = np.linalg.norm(np.diff(steps, axis=0), axis=1)
    assert bend.max() < 0.05 * length.max()


def test_equal_directions_of_any_length_rest():
    path = interpolate_directions([0, 5, 9, 12], [[0, -1, 0.3], [1, -1, 0], [3, -3, 0], [1, 0, 0]], 13)
    assert (path[5:10] == path[5]).all()
    assert not (path[4] == path[5]).all()


def test_directions_do_not_depend_on_axes():
    rotation = np.linalg.qr(np.random.default_rng(1).normal(size=(3, 3)))[0]
    keys = np.array([[1, 0.1, 0], [0.2, 1, 0.4], [-1, 0.3, 1], [-1, -1, 1]])
    plain = interpolate_directions([0, 4, 11, 20], keys, 21)
    turned = interpolate_directions([0, 4, 11, 20], keys @ rotation.T, 21)
    np.testing.assert_allclose(turned, plain @ rotation.T, rtol=0, atol=1e-12)


def test_slerp_of_opposite_directions_stays_unit():
    start = np.array([[0.0, 0.0, 1.0]])
    half = slerp(start, -start, np.array([[0.5]]))
    assert abs(half[0] @ start[0]) < 1e-12
    assert abs(np.linalg.norm(half) - 1) < 1e-12


def test_camera_looks_along_minus_z_with_y_up():
    matrix = fixed([1, 2, 3], [1, 2, -7])
    expected = np.eye(4)
    expected[:3, 3] = [1, 2, 3]
    assert (matrix == expected).all()


@FEW
@given(seed=st.integers(0, 2**32 - 1))
def test_matrices_are_right_handed_and_look_at_the_target(seed):
    random = np.random.default_rng(seed)
    keys = [
        {"frame": f, "eye": list(random.normal(size=3)), "target": list(np.add(random.normal(size=3), [5, 0, 0]))}
        for f in (0, 9, 14)
    ]
    placed = eyes(job_of(keys))
    rotation = placed.world_from_camera[:, :3, :3]
    np.testing.assert_allclose(
        rotation.transpose(0, 2, 1) @ rotation, np.broadcast_to(np.eye(3), (15, 3, 3)), atol=1e-12
    )
    np.testing.assert_allclose(np.linalg.det(rotation), 1, atol=1e-12)
    assert (rotation[:, 1, 0] == 0).all() or np.abs(rotation[:, 1, 0]).max() < 1e-15  # the horizon is level
    assert (rotation[:, 1, 1] > 0).all()
    for key in keys:
        look = unit(np.subtract(key["target"], key["eye"]))
        np.testing.assert_allclose(-rotation[key["frame"], :, 2], look, atol=1e-14)
        assert (placed.position[key["frame"]] == key["eye"]).all()
    assert (placed.world_from_camera[:, 3] == [0, 0, 0, 1]).all()
    assert placed.n == 15


def test_z_up_scene_holds_the_camera_by_z():
    job = job_of([{"frame": 0, "eye": [0, 0, 0], "target": [0, 5, 0]}], scene={"file": "part.STL"})
    np.testing.assert_array_equal(eyes(job).world_from_camera[0, :3, 1], [0, 0, 1])


@pytest.mark.parametrize(
    ("up", "target", "picture_up"),
    [
        ("y", [0, -1, 0], [0, 0, -1]),
        ("y", [0, 1, 0], [0, 0, 1]),
        ("z", [0, 0, -1], [0, 1, 0]),
        ("z", [0, 0, 1], [0, -1, 0]),
    ],
)
def test_looking_along_up_is_a_tilted_camera(up, target, picture_up):
    job = job_of([{"frame": 0, "eye": [0, 0, 0], "target": target}], scene={"up": up})
    np.testing.assert_array_equal(eyes(job).world_from_camera[0, :3, 1], picture_up)


def test_arriving_at_the_zenith_keeps_right_where_it_was():
    keys = [
        {"frame": 0, "eye": [0, 0, 0], "target": [3, 0, 4]},
        {"frame": 10, "eye": [0, 0, 0], "target": [0, 5, 0]},
        {"frame": 15, "eye": [0, 0, 0], "target": [0, 7, 0]},
    ]
    right = eyes(job_of(keys)).world_from_camera[:, :3, 0]
    np.testing.assert_allclose(right, np.broadcast_to([-0.8, 0, 0.6], (16, 3)), atol=1e-12)


def test_up_of_the_keys_rolls_the_picture():
    matrix = fixed([0, 0, 0], [0, 0, -1], up=[5, 0, 0])
    np.testing.assert_allclose(matrix[:3, :2].T, [[0, -1, 0], [1, 0, 0]], atol=1e-15)
    along = fixed([0, 0, 0], [0, 0, -1], up=[0, 0, 2])
    assert abs(np.linalg.det(along[:3, :3]) - 1) < 1e-12


def test_equal_keys_give_the_same_eye_bit_for_bit():
    still = {"eye": [0.1, 1.7, 3.3], "target": [0.7, 0.2, -1.1]}
    placed = eyes(job_of([{"frame": 3, **still}, {"frame": 40, **still}], frames=50))
    assert placed.n == 50
    assert (placed.world_from_camera == placed.world_from_camera[0]).all()


def test_a_camera_is_at_rest_only_where_no_frame_differs():
    first = {"frame": 0, "eye": [0.1, 1.7, 3.3], "target": [0.7, 0.2, -1.1]}
    assert eyes(job_of([first], frames=50)).at_rest
    assert eyes(job_of([first, {**first, "frame": 40}], frames=50)).at_rest
    one_step = [first, {**first, "frame": 48}, {**first, "frame": 49, "target": [0.7, 0.2, -1.0]}]
    assert not eyes(job_of(one_step, frames=50)).at_rest
    there_and_back = [first, {**first, "frame": 20, "eye": [0.2, 1.7, 3.3]}, {**first, "frame": 49}]
    assert not eyes(job_of(there_and_back, frames=50)).at_rest


def test_far_from_the_origin_the_eye_keeps_its_digits():
    near = fixed([0.5, 1.5, 2.5], [0.25, 1.0, -1.0])
    far = fixed([5e6 + 0.5, 1.5, 2.5 - 5e6], [5e6 + 0.25, 1.0, -1.0 - 5e6])
    np.testing.assert_array_equal(near[:3, :3], far[:3, :3])


def test_an_eye_that_meets_its_target_is_an_error():
    keys = [{"frame": 0, "eye": [0, 0, 0], "target": [2, 0, 0]}, {"frame": 4, "eye": [2, 0, 0], "target": [0, 0, 0]}]
    with pytest.raises(JobError, match="got the same point at frame 2"):
        eyes(job_of(keys))


def test_sizes_change_between_keys():
    keys = [{"frame": 4 * k, "position": [0, k, 0], "intensity": 1, "radius": 0.1 * k} for k in range(2)]
    sun = {"type": "directional", "keys": [{"frame": 0, "direction": [0, -1, 0], "irradiance": 2, "angle": 0.53}]}
    lamp, sun = lit({"type": "point", "keys": keys}, sun).sources
    np.testing.assert_allclose(lamp.size, np.arange(5) * 0.025, atol=1e-15)
    assert (lamp.table(4)["radius"], sun.table(2)["angle"]) == (0.1, 0.53)
    np.testing.assert_allclose(lamp.at([3, 1]).size, [0.075, 0.025])


def test_lights_multiply_intensity_and_colour():
    keys = [
        {"frame": 0, "position": [0, 0, 0], "intensity": 10, "color": [1, 0.5, 0]},
        {"frame": 10, "position": [0, 4, 0], "intensity": [20, 10, 4], "color": [1, 0.5, 1]},
    ]
    sun = {"type": "directional", "keys": [{"frame": 3, "direction": [0, -9, 0], "irradiance": 2}]}
    placed = lit({"type": "point", "keys": keys}, sun)
    lamp, sun = placed.sources
    assert placed.n == 11
    np.testing.assert_allclose(lamp.vector[5], [0, 2, 0], atol=1e-15)
    np.testing.assert_array_equal(lamp.intensity[[0, 10]], [[10, 5, 0], [20, 5, 4]])
    np.testing.assert_allclose(lamp.intensity[5], [15, 5, 3.5], atol=1e-14)
    assert (sun.kind, lamp.kind) == ("directional", "point")
    assert sun.size is lamp.size is None and "angle" not in sun.table(0)
    np.testing.assert_array_equal(sun.vector, np.broadcast_to([0, -1, 0], (11, 3)))
    np.testing.assert_array_equal(sun.intensity, np.full((11, 3), 2.0))


@FEW
@given(values=st.lists(st.floats(0, 1e16), min_size=2, max_size=5))
def test_intensity_is_never_negative(values):
    keys = [{"frame": 7 * i, "position": [0, 0, 0], "intensity": value} for i, value in enumerate(values)]
    assert (lit({"type": "point", "keys": keys}).sources[0].intensity >= 0).all()


def test_some_eyes_in_an_order_of_their_own():
    first = {"frame": 0, "eye": [0.1, 1.7, 3.3], "target": [0.7, 0.2, -1.1]}
    every = eyes(job_of([first, {**first, "frame": 4, "eye": [1.0, 1.5, 3.0]}]))
    some = every.at([3, 0, 3])
    assert some.n == 3 and some.lenses == every.lenses[:3]
    for name in ("position", "world_from_camera"):
        np.testing.assert_array_equal(getattr(some, name), getattr(every, name)[[3, 0, 3]])


LAMP = {**tiny.TABLE["light"]["sources"][0], "group": "lamps", "axis": "lamps"}
SKY, NIGHT = [0.3, 0.4, 0.5], [0.0, 0.0, 0.0]
GROUPS = (Plane.LIGHT,) * 4


def job(background: Any, sources: Any = (LAMP, tiny.RED)) -> Any:
    return tiny.Job.model_validate(tiny.table(scene={"background": background}) | {"light": {"sources": list(sources)}})


def test_without_groups_each_light_position_has_a_picture() -> None:
    found = lights(tiny.job(scene={"background": SKY}))
    assert found.planes == (Plane.PICTURE,) * 3
    assert found.unlit == () and found.n == 3


@pytest.mark.parametrize(
    ("background", "unlit"), [(SKY, (Plane.INDIRECT, Plane.BACKGROUND)), (NIGHT, (Plane.INDIRECT,))]
)
def test_group_planes_end_with_those_that_no_source_lights(background: Any, unlit: Any) -> None:
    found = lights(job(background))
    assert found.planes == GROUPS + unlit == group_planes(4, background=any(background))
    assert (found.unlit, found.n) == (unlit, 4 + len(unlit))
    for source in found.sources:
        assert len(source.vector) == len(source.intensity) == found.n
    shines = np.any([source.intensity.any(axis=1) for source in found.sources], axis=0)
    assert shines.tolist() == [plane.lit for plane in found.planes]


def test_names_follow_the_planes() -> None:
    at = job(SKY)
    names = array_names(at, 1, lights(at))
    assert [(image.group, image.light) for image in names.images] == [
        ("lamps", 0), ("lamps", 1), ("lamps", 2), ("main", 0), ("ambient", None), ("background", None),
    ]  # fmt: skip
    assert [image.file(0) for image in names.images[3:]] == [
        "tiny.main.c0000.l000.exr", "tiny.ambient.c0000.exr", "tiny.background.c0000.exr",
    ]  # fmt: skip
    night = job(NIGHT)
    assert [image.group for image in array_names(night, 1, lights(night)).images][-2:] == ["main", "ambient"]


def estimated(n: int) -> Ambient:
    """The ambient light of n positions."""
    intensity, reflectivity = np.full((n, 3), 7.0, np.float32), np.ones(3, np.float32)
    return Ambient(intensity=intensity, standard_error=np.zeros(n), reflectivity=reflectivity, paths=1, rays=1)


def test_ambient_light_multiplies_the_plane_of_its_own_and_no_other() -> None:
    found = lights(job(SKY))
    estimate = estimated(found.n)
    given = image_ambient(estimate, found).intensity
    assert given[:, 0].tolist() == [0, 0, 0, 0, 1, 0]
    assert image_ambient(estimate, lights(tiny.job())) is estimate


@pytest.mark.parametrize(
    ("planes", "first"),
    [
        ((Plane.PICTURE,) * 3, 0),
        (group_planes(4, background=True), 5),
        (group_planes(4, background=False), 5),
        (group_planes(4, background=True)[2:4], 2),
        (group_planes(4, background=True)[4:], 1),
        (group_planes(4, background=True)[5:], 0),
    ],
)
def test_the_background_is_in_all_planes_from_one_on(planes: Any, first: int) -> None:
    assert first_with_background(planes) == first
    assert all(plane.holds_background for plane in planes[first:])
    assert not any(plane.holds_background for plane in planes[:first])


def test_a_block_of_light_positions_has_the_planes_of_its_own() -> None:
    with tiny.planned(tiny.prepared(job(SKY))) as (setup, _):
        assert setup.planes == (*GROUPS, Plane.INDIRECT, Plane.BACKGROUND) and setup.light_independent_from == 5
        for block, first in ((range(0, 2), 2), (range(3, 5), 2), (range(3, 6), 2), (range(5, 6), 0)):
            part = setup.for_block(block)
            assert part.planes == setup.planes[block.start : block.stop]
            assert len(part.planes) == part.lights.n_lights
            assert part.light_independent_from == first


@pytest.mark.parametrize("sources", [(LAMP, tiny.RED), (tiny.RED, tiny.SUN)])
@pytest.mark.parametrize("background", [SKY, NIGHT])
def test_files_that_are_written_are_those_that_a_manifest_lists(sources: Any, background: Any, tmp_path: Path) -> None:
    at = job(background, sources)
    output = changed(at.output, directory=tmp_path, layers=True)
    prepared = tiny.prepared(changed(at, camera=changed(at.camera, frames=3), output=output))
    n = prepared.lights.n
    target = array_target(prepared)
    written = {target.directory / image.file(c) for image in target.names.images for c in range(3)}
    written |= {target.directory / file_name(target.names.layers, c) for c in range(3)}
    assert len(written) == 3 * (n + 1)
    assert written == set(array_files(initial_manifest(prepared, estimated(n), identity_of(prepared), None, None)))


def lamp(n: int, **more: Any) -> dict[str, Any]:
    keys = [{"frame": k, "position": [0.1 * k, 1, 0], "intensity": [k + 1] * 3} for k in (0, n - 1)]
    return {"type": "point", "keys": keys, **more}


def path(n: int) -> Lights:
    return lights(tiny.job(light={"frames": n, "sources": [lamp(n), tiny.SUN]}))


def grouped(n: int, m: int) -> Lights:
    sources = [lamp(n, group="key"), lamp(m, group="fill", axis="side")]
    return lights(tiny.job(light={"frames": n, "axes": {"side": m}, "sources": sources}))


def test_all_are_taken_where_they_are_few() -> None:
    assert path(12).few(12) == list(range(12))
    many = grouped(5, 7)
    assert many.few(12) == list(range(many.n))


def test_they_lie_all_along_the_path() -> None:
    assert path(100).few(4) == [0, 33, 66, 99]


@pytest.mark.parametrize("most", [1, 10, 30])
def test_every_group_keeps_a_position_and_all_planes_without_light_stay(most: int) -> None:
    many = grouped(60, 40)
    planes = many.few(most)
    few = many.at(planes)
    assert planes == sorted(set(planes))
    assert few.unlit == many.unlit
    assert [len(group.positions) for group in few.groups] == [max(most * 60 // 100, 1), max(most * 40 // 100, 1)]
    for group, old in zip(few.groups, many.groups, strict=True):
        assert all(planes[p] in old.positions for p in group.positions)
    found, wanted = light_arrays(few, np.zeros(3)), light_arrays(many, np.zeros(3)).at(planes)
    assert all(np.array_equal(a, b) for a, b in zip(flat_arrays(found), flat_arrays(wanted), strict=True))
