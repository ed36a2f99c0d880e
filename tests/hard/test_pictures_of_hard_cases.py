"""Whole pictures of hard cases and of scenes far from the origin: the same, or sound, pictures everywhere."""

from pathlib import Path
from typing import Any

import numpy as np
import pytest
from support import tiny
from support.scenes import Glb

from framearray_cli.scene.files import Material
from framearray_cli.scene.scene import load_scene

SMALL = {"resolution": [96, 72]}


# In another unit of length or at another place a ray may pass an edge, or a corner of a texel, on its other side: one
# sample of a pixel, in less than one pixel of a hundred. All other values differ by roundings.
ROUNDING, FLIPPED = 1e-3, 0.01


def walk(size: float = 1.0, at: Any = (0.0, 0.0, 0.0), **changes: Any) -> Any:
    """The tiny job with all lengths and places changed: the picture must stay."""

    def placed(point: Any) -> list[float]:
        return [float(x) for x in size * np.array(point) + np.array(at)]

    camera, source = tiny.walk(3, **SMALL), tiny.TABLE["light"]["sources"][0]
    camera["keys"] = [key | {"eye": placed(key["eye"]), "target": placed(key["target"])} for key in camera["keys"]]
    lamps = [
        key | {"position": placed(key["position"]), "intensity": [size**2 * x for x in key["intensity"]]}
        for key in source["keys"]
    ]
    light = {"sources": [source | {"keys": lamps}]}
    return tiny.job(camera=camera, light=light, reuse={"n_r": 1}, obscurance={"range": 1.5 * size}, **changes)


def pictures(job: Any, scene: Any = None) -> Any:
    """(n_c, n_l, h, w, 3), and the proof that no value had to be replaced."""
    rendered = tiny.render_frames(tiny.prepared(job, scene))
    assert all(frame.bad == 0 for frame in rendered.composed)
    images = np.asarray(rendered.images, np.float64)
    assert np.isfinite(images).all() and (images >= 0).all()
    return images


def differing(a: Any, b: Any) -> float:
    """Share of pixels that differ by more than roundings."""
    return float((np.abs(a - b).max(axis=-1) > ROUNDING * b.mean()).mean())


@pytest.fixture(scope="module")
def usual() -> Any:
    return pictures(walk(), tiny.room())


@pytest.mark.parametrize("size", [1e-6, 1e-3, 0.7, 1e3, 1e6])
def test_any_unit_of_length_gives_the_same_picture(size: float, usual: Any) -> None:
    assert differing(pictures(walk(size), tiny.room(size=size)), usual) < FLIPPED


@pytest.mark.parametrize("at", [(1e7, 0, 0), (-3e6, 2e6, 1e7)])
def test_any_place_gives_the_same_picture(at: Any, usual: Any) -> None:
    assert differing(pictures(walk(at=at), tiny.room(at=at)), usual) < FLIPPED


def test_another_place_of_the_lamp_would_be_seen(usual: Any) -> None:
    """The two tests above can fail: a lamp that is moved by one part in a hundred changes a tenth of the pixels."""
    job = walk()
    keys = [
        key.model_copy(update={"position": tuple(1.01 * x for x in key.position)}) for key in job.light.sources[0].keys
    ]
    source = job.light.sources[0].model_copy(update={"keys": tuple(keys)})
    moved = job.model_copy(update={"light": job.light.model_copy(update={"sources": (source,)})})
    assert differing(pictures(moved, tiny.room()), usual) > 10 * FLIPPED


@pytest.mark.parametrize("power", [1e-12, 1e-6, 1e6, 1e12])
def test_light_of_any_strength_gives_the_picture_in_proportion(power: float, usual: Any) -> None:
    """Every value times the same number, to float32's roundings; a picture of 1e12 needs 32 bits per channel."""
    job = walk()
    source = job.light.sources[0]
    keys = [key.model_copy(update={"intensity": tuple(power * x for x in key.intensity)}) for key in source.keys]
    light = job.light.model_copy(update={"sources": (source.model_copy(update={"keys": tuple(keys)}),)})
    found = pictures(job.model_copy(update={"light": light}), tiny.room())
    np.testing.assert_allclose(found / power, usual, rtol=1e-5, atol=1e-6 * usual.mean())


@pytest.mark.parametrize("fov", [1.0, 170.0])
def test_narrow_and_wide_views(fov: float) -> None:
    images = pictures(tiny.job(camera=tiny.WALK | SMALL | {"fov": fov}, reuse={"n_r": 2}), tiny.room())
    assert images.mean() > 0


@pytest.mark.parametrize("reach", [1e-9, 1e-4, 1e4, 1e12])
def test_obscurances_of_any_range(reach: float) -> None:
    """Next to nothing within a tiny range: W is the average reflectivity. In a huge one everything is near: W is 0."""
    closed = tiny.scene_of(tiny.box((-2, 0, -2), (2, 2.5, 2)), Material(name="Grey", reflectivity=(0.6, 0.6, 0.6)))
    job = tiny.job(camera=SMALL, obscurance={"range": reach}, output={"layers": True})
    frame = tiny.render_frames(tiny.prepared(job, closed)).composed[0]
    layers = frame.layers
    assert frame.bad == 0
    if reach < 1:
        np.testing.assert_allclose(layers["obscurance"], 0.6, rtol=0.02)  # but for what lies in the room's edges
    else:
        assert layers["obscurance"].max() <= 0.6 * np.sqrt(8 / reach)  # rho of the room's diagonal, at most 7.6


@pytest.mark.parametrize("reflectivity", [0.0, 1.0])
@pytest.mark.parametrize("closed", [False, True])
def test_black_and_white_surfaces(reflectivity: float, closed: bool) -> None:
    """Black shows nothing. In a closed white room light never ends, so walks are cut; the picture is finite."""
    corners = tiny.box((-2, 0, -2), (2, 2.5, 2))
    scene = tiny.scene_of(corners if closed else corners[2:], Material(name="All", reflectivity=(reflectivity,) * 3))
    images = pictures(tiny.job(camera=SMALL, ambient={"paths": 64}), scene)
    assert images.any() == (reflectivity > 0)


def lamp_at(position: Any) -> Any:
    key = {"frame": 0, "position": [float(x) for x in position], "intensity": [8.0, 8.0, 8.0]}
    return {"frames": 1, "sources": [{"type": "point", "keys": [key]}]}


EYE = (0.2, 1.3, 1.7)  # the first of tiny.WALK


@pytest.mark.parametrize(
    "position",
    [
        (0.0, 0.0, 0.0),  # on the floor
        (-2.0, 1.0, 0.0),  # on a wall
        (-2.0, 0.0, -2.0),  # at a vertex
        (-0.6, 0.5, -0.7),  # inside the ball
        (0.8, 0.45, -0.7),  # inside the box
        EYE,
    ],
    ids=["floor", "wall", "vertex", "ball", "box", "eye"],
)
def test_lamps_where_no_lamp_should_be(position: Any) -> None:
    images = pictures(tiny.job(camera=tiny.WALK | SMALL, light=lamp_at(position), reuse={"n_r": 1}), tiny.room())
    dark = pictures(tiny.job(camera=tiny.WALK | SMALL, light=lamp_at((0, 50, 90)), reuse={"n_r": 1}), tiny.room())
    if position in ((-0.6, 0.5, -0.7), (0.8, 0.45, -0.7)):  # its light stays inside, but for what walks find there
        assert images.mean() < 0.05 + dark.mean()
    else:
        assert images.mean() > 2 * dark.mean()


def test_a_sun_parallel_to_a_wall_lights_only_the_others() -> None:
    """Straight down: the walls get nothing directly, and the floor below the hole in the roof does."""
    sun = {"type": "directional", "keys": [{"frame": 0, "direction": [0.0, -1.0, 0.0], "irradiance": [3.0, 3.0, 3.0]}]}
    still = {"keys": tiny.WALK["keys"][:1], "frames": 1}
    job = tiny.job(camera=still | SMALL, light={"frames": 1, "sources": [sun]}, ambient=tiny.DARK)
    scene = tiny.room(mirrors=False, textured=False)
    rendered = tiny.render_frames(tiny.prepared(job, scene)).composed[0]
    assert rendered.bad == 0
    normal, image = rendered.layers["normal"], np.asarray(rendered.images[0], np.float64)
    upright = (np.abs(normal[..., 1]) < 1e-6) & (np.linalg.norm(normal, axis=-1) > 0.999)
    assert upright.sum() > 500 and not image[upright].any()
    assert image.max() > 0.1


@pytest.mark.parametrize(
    ("eye", "target", "lit"),
    [
        ((0.8, 0.9, -0.7), (0.8, 2.0, -0.7), True),  # on the box, looking up along up
        ((0.8, 0.9, -0.7), (0.8, 0.0, -0.7), False),  # on the box, looking down: into it
        ((0.8, 0.9001, -0.7), (0.8, 0.0, -0.7), True),  # a tenth of a millimetre above it: at its face
        ((-2.0, 1.0, 0.5), (1.0, 1.0, 0.5), False),  # on a wall, behind the mirror before it
        ((-2.0, 0.0, 2.0), (0.0, 1.0, 0.0), True),  # in a corner of the room
        ((-1.95, 1.0, 0.0), (1.0, 1.0, 0.0), False),  # between a wall and a mirror that stands before it
        ((0.8, 0.5, -0.7), (0.8, 0.5, 3.0), False),  # inside the closed box
        ((0.2, 1.3, 1.7), (0.2, -1.0, 1.7), True),  # straight down, with the up of a still camera
    ],
)
def test_eyes_where_no_eye_should_be(eye: Any, target: Any, lit: bool) -> None:
    """What is seen is what a point there sees: black where no light comes, and never anything that is no number."""
    key = {"frame": 0, "eye": list(eye), "target": list(target)}
    images = pictures(tiny.job(camera=SMALL | {"keys": [key], "frames": 1}), tiny.room())
    assert (images.mean() > 0.01) == lit


def test_an_eye_inside_a_thick_wall_sees_black() -> None:
    """Between the two faces of a wall there is no light, and its picture is all there."""
    shell = np.concatenate([tiny.box((-2, 0, -2), (2, 2.5, 2)), tiny.box((-2.3, -0.3, -2.3), (2.3, 2.8, 2.3))])
    scene = tiny.scene_of(shell, Material(name="Grey", reflectivity=(0.6, 0.6, 0.6)))
    within, before = (
        pictures(tiny.job(camera=SMALL | {"keys": [key], "frames": 1}, ambient=tiny.DARK), scene)
        for key in ({"frame": 0, "eye": [x, 1.0, 0.0], "target": [1.0, 1.0, 0.0]} for x in (-2.15, -1.95))
    )
    assert not within.any() and before.mean() > 0.01


@pytest.mark.parametrize("n_r", [0, 2])
def test_an_eye_on_the_floor_sees_the_room_as_one_just_above_it(n_r: int) -> None:
    """A camera that glides over the floor, exactly on it: above the horizon nothing is hidden by the floor itself."""

    def walk_at(height: float) -> Any:
        keys = [
            {"frame": 0, "eye": [0.2, height, 1.7], "target": [-0.1, 0.4 + height, -1.0]},
            {"frame": 4, "eye": [0.3, height, 1.5], "target": [-0.1, 0.4 + height, -1.0]},
        ]
        return tiny.job(camera=SMALL | {"keys": keys, "frames": 5}, reuse={"n_r": n_r}, ambient=tiny.DARK)

    room = tiny.room()
    on, above = pictures(walk_at(0.0), room), pictures(walk_at(1e-5), room)
    upper = np.s_[:, :, :36]  # the eye looks up a little: all of the image's upper half is above the horizon
    assert above[upper].mean() > 0.01
    assert differing(on[upper], above[upper]) < FLIPPED


def test_facing_mirrors_end() -> None:
    panels = [
        tiny.quad((-1, 0, -2), (-1, 0, 2), (-1, 2, 2), (-1, 2, -2)),
        tiny.quad((1, 0, 2), (1, 0, -2), (1, 2, -2), (1, 2, 2)),
    ]
    scene = tiny.scene_of(np.concatenate(panels), Material(name="Mirror", reflectivity=(0, 0, 0), specular=(1, 1, 1)))
    key = {"frame": 0, "eye": [0.0, 1.0, 0.0], "target": [1.0, 1.0, 0.0]}
    job = tiny.job(camera=SMALL | {"keys": [key], "frames": 1}, specular={"depth": 16}, scene={"background": 1.0})
    assert pictures(job, scene).max() <= 1.0 + 1e-6


def test_scenes_of_this_file_are_not_all_black(usual: Any) -> None:
    assert usual.mean() > 0.01 and (usual > 0).mean() > 0.9


# Coordinates of 1e7 have steps of 1 in float32. Node transforms and text hold float64, whose steps there are 2e-9.
FAR = (1e7, -1e7, 1e7)


def room() -> Any:
    """All triangles of the tiny room, corners as float32 holds them: (n, 3, 3)."""
    parts = tiny.room_meshes(mirrors=False, textured=False).parts
    return np.concatenate([part.corners for part in parts]).astype(np.float32).astype(np.float64)


def node(file: Path, at: Any) -> None:
    """A GLB: float32 corners about the origin, below a node that moves them."""
    glb, points = Glb(), room().reshape(-1, 3)
    mesh = glb.mesh(positions=points.astype(np.float32), faces=np.arange(len(points), dtype=np.uint16))
    glb.node(mesh, translation=list(at))
    glb.save(file)


def matrix(file: Path, at: Any) -> None:
    """A GLB with two nodes, one above the other, the upper one with a matrix: half the way each."""
    glb, points = Glb(), room().reshape(-1, 3)
    mesh = glb.mesh(positions=points.astype(np.float32), faces=np.arange(len(points), dtype=np.uint16))
    half = [x / 2 for x in at]
    inner = glb.add("nodes", {"mesh": mesh, "translation": half})
    glb.node(matrix=[1, 0, 0, 0, 0, 1, 0, 0, 0, 0, 1, 0, *half, 1], children=[inner])
    glb.save(file)


def obj(file: Path, at: Any) -> None:
    corners = room() + np.array(at)
    lines = [f"v {x!r} {y!r} {z!r}" for x, y, z in corners.reshape(-1, 3).tolist()]
    lines += [f"f {i} {i + 1} {i + 2}" for i in range(1, 3 * len(corners), 3)]
    file.write_text("\n".join(lines) + "\n")


def ply(file: Path, at: Any) -> None:
    corners = room() + np.array(at)
    head = ["ply", "format ascii 1.0", f"element vertex {3 * len(corners)}"]
    head += [f"property double {axis}" for axis in "xyz"]
    head += [f"element face {len(corners)}", "property list uchar int vertex_index", "end_header"]
    rows = [f"{x!r} {y!r} {z!r}" for x, y, z in corners.reshape(-1, 3).tolist()]
    rows += [f"3 {i} {i + 1} {i + 2}" for i in range(0, 3 * len(corners), 3)]
    file.write_text("\n".join(head + rows) + "\n")


WRITERS = {"node": (node, "glb"), "matrix": (matrix, "glb"), "obj": (obj, "obj"), "ply": (ply, "ply")}


def picture(folder: Path, kind: str, at: Any) -> Any:
    write, suffix = WRITERS[kind]
    file = folder / f"{kind}.{suffix}"
    write(file, at)
    return pictures(walk(at=at), load_scene(file))


@pytest.mark.parametrize("kind", WRITERS)
def test_a_model_ten_million_away_gives_the_picture_of_the_model_at_the_origin(kind: str, tmp_path: Path) -> None:
    here, there = picture(tmp_path, kind, (0.0, 0.0, 0.0)), picture(tmp_path, kind, FAR)
    assert here.mean() > 0.01
    assert differing(there, here) < FLIPPED


def test_a_model_whose_corners_are_float32_is_another_one_there(tmp_path: Path) -> None:
    """The test above can fail: corners that were rounded to float32 at 1e7 are a scene of steps of 1."""
    rounded = (room() + np.array(FAR)).astype(np.float32).astype(np.float64)
    here = picture(tmp_path, "node", (0.0, 0.0, 0.0))
    assert differing(pictures(walk(at=FAR), tiny.scene_of(rounded)), here) > 10 * FLIPPED
