"""Parts of a picture where errors of reuse are looked for."""

import numpy as np

from framearray_cli.engine.inputs.cameras import Cameras

from .regions import edges_of_shadows, regions

H, W, F = 40, 60, 50.0


def looking_ahead(*eyes: float) -> Cameras:
    """Eyes side by side, at places along x, that look along -z."""
    axes = {"right": [1, 0, 0], "up": [0, 1, 0], "forward": [0, 0, -1]}
    arrays = {name: np.tile(np.array(axis, np.float32), (len(eyes), 1)) for name, axis in axes.items()}
    position = np.array([[x, 0, 0] for x in eyes], np.float32)
    return Cameras(position=position, focal=F, width=W, height=H, near=0.0, **arrays)


def floor_and_wall() -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Normal, depth and reflectivity: a wall at depth 4, and below the middle a floor 1 below the eye."""
    down = (np.arange(H) + 0.5 - H / 2) / F
    depth = np.repeat(np.where(down > 0.25, 1 / np.maximum(down, 0.01), 4.0)[:, None], W, 1).astype(np.float32)
    normal = np.zeros((H, W, 3), np.float32)
    normal[..., 2], normal[down > 0.25, :] = 1, [0, 1, 0]
    return normal, depth, np.full((H, W, 3), 0.5, np.float32)


def test_parts_of_a_room():
    normal, depth, reflectivity = floor_and_wall()
    reflectivity[:10, :20] = 0.3  # a picture on the wall
    depth[5:15, 40:50] = 2.0  # a board before it
    share = np.ones((H, W))
    share[5:15, 50:52] = 0.4
    found = regions(normal, depth, reflectivity, share, looking_ahead(0.0), 0, 3)
    corner = 33  # the first row of the floor
    assert found["silhouettes"][corner - 1 : corner + 1].all()
    assert not found["silhouettes"][corner + 2 :].any()  # a plane seen at a slant has no outline
    outline = found["silhouettes"][: corner - 1]
    assert outline[10, 39] and outline[10, 40] and outline[10, 49] and outline[10, 50]
    assert not outline[10, 42:48].any() and not outline[:, :38].any()
    assert found["textures"][5, 19] and found["textures"][5, 20] and not found["textures"][5, 10]
    assert found["disocclusions"].sum() == 20
    assert not found["frame edges"].any()
    assert found["the rest"][20, 10] and not found["the rest"][5, 19] and not found["the rest"][10, 50]


def test_grazing_angles_are_those_to_the_eye():
    normal, depth, reflectivity = floor_and_wall()
    normal[:], depth[:] = [0, 1, 0], 4.0  # all is floor, seen at the angle that its row says
    found = regions(normal, depth, reflectivity, np.ones((H, W)), looking_ahead(0.0), 0, 3)["grazing angles"]
    down = np.abs(np.arange(H) + 0.5 - H / 2) / F
    assert found[:, W // 2].tolist() == (down / np.hypot(1, down) < 0.25).tolist()
    depth[:] = 0  # nothing is seen
    assert not regions(normal, depth, reflectivity, np.ones((H, W)), looking_ahead(0.0), 0, 3)["grazing angles"].any()


def test_frame_edges_are_where_the_picture_of_another_eye_ends():
    normal, depth, reflectivity = floor_and_wall()
    normal[:], depth[:] = [0, 0, 1], 4.0  # all is wall
    # the second eye sees it 10.25 pixels to the left, the third is not in the window
    cams = looking_ahead(0.0, 0.82, 5.0)
    found = regions(normal, depth, reflectivity, np.ones((H, W)), cams, 0, 1)["frame edges"]
    middles = np.arange(W) + 0.5
    assert np.flatnonzero(found[H // 2]).tolist() == np.flatnonzero(np.abs(middles - 10.25) < 1.5).tolist()
    assert not found[H // 2, 20:].any()
    depth[:] = 0  # an infinitely far point lies in one direction from both
    found = regions(normal, depth, reflectivity, np.ones((H, W)), cams, 0, 1)["frame edges"]
    assert np.flatnonzero(found[H // 2]).tolist() == [0, W - 1]


def test_edges_of_shadows_are_where_light_jumps_but_nothing_else():
    normal, depth, reflectivity = floor_and_wall()
    reflectivity[:, :20] = 0.25  # a texture, which is no shadow
    light = np.ones((2, H, W, 1), np.float32)
    light[1, :, 40:] = 0.2  # a shadow, under the second light position only
    light[:, 33:] *= 0.5  # the corner, which is a silhouette
    found = edges_of_shadows(light * reflectivity, normal, depth, reflectivity)
    assert found.shape == (2, H, W)
    assert not found[0].any()
    assert found[1, 5:25, 39:41].all()
    assert found[1, 5:25].sum() == 2 * 20
