"""Choose a path for a lamp in a room, so that it lights what the pictures show."""

from collections.abc import Sequence

import numpy as np

from framearray_cli.base.arrays import Float64
from framearray_cli.base.units import FARTHEST

from .model import LightKeys
from .rays import Probe
from .room import Room, free_ways, select_clear
from .views import view_directions

LAMP_SHARE = 0.75  # of the height of a room
LAMP_CLEAR = 0.15  # over the height: a lamp that is nearer would make a white spot on a wall
LAMPS, LIT_POINTS = 300, 300  # largest numbers of places for a lamp, and of points in the pictures for it to light
LIT_STRIDE, MOST_LIT_BY = 5, 8  # rays of a view of which one is followed to the lights; lights that are tried
TRIED = 20  # ends of its path that are tried at once


def choose_lamp_path(probe: Probe, room: Room, eyes: Float64, targets: Float64) -> Float64 | None:
    """Choose the start and end of a lamp's path, (2, 3), that light what the eyes see; None where no place has room.

    Args:
        eyes, targets: (n, 3) of the views to light.
    """
    spots = select_clear(probe, room, room.at_share(LAMP_SHARE), LAMP_CLEAR * room.height, LAMPS)
    points = _seen_points(probe, eyes, targets, room.up_dir)
    if not len(spots) or not len(points):
        return None
    lit = ~probe.blocked(np.repeat(spots, len(points), axis=0), np.tile(points, (len(spots), 1)))
    lit = lit.reshape(len(spots), -1)
    reach = np.linalg.norm(spots[:, None] - points[None], axis=2)
    # a distant lamp lights the points evenly, but then it mostly lights another room
    value = (lit / (1 + (reach / (2 * room.height)) ** 2)).mean(axis=1)
    first = int(value.argmax())
    start = spots[first]
    apart = np.linalg.norm(spots - start, axis=1)
    # squared, so that the light at the end of the path counts more than the length of the path
    order = np.argsort(-(value**2) * np.minimum(apart / room.height, 1.0), kind="stable")
    order = order[apart[order] > 0]
    for some in np.array_split(order, max(1, len(order) // TRIED)):
        free = free_ways(probe, room, np.tile(start, (len(some), 1)), spots[some], LAMP_CLEAR * room.height / 2)
        if free.any():
            return np.array([start, spots[some[int(free.argmax())]]])
    return np.array([start, start])


def lit_shares(probe: Probe, eyes: Float64, targets: Float64, up_dir: Float64, lights: Sequence[LightKeys]) -> Float64:
    """(n,) share of what each of n views shows that some light of the file reaches, halfway along the lights' paths."""
    look = targets - eyes
    directions = view_directions(look / np.linalg.norm(look, axis=1, keepdims=True), up_dir)[:, ::LIT_STRIDE]
    n, rays = directions.shape[:2]
    origins, directions = np.repeat(eyes, rays, axis=0), directions.reshape(-1, 3)
    seen = probe.trace(origins, directions)
    points = np.where(
        seen.hit[:, None], origins + directions * (np.where(seen.hit, seen.distance, 0) * (1 - 1e-3))[:, None], 0
    )
    lit = np.zeros(len(points), bool)
    for source in lights[:MOST_LIT_BY]:
        vector = np.clip(source.vectors[len(source.vectors) // 2], -FARTHEST, FARTHEST)
        far = 4 * float(np.linalg.norm(np.ptp(probe.scene.corners, axis=(0, 1))))
        end = vector - probe.scene.centre if source.kind != "directional" else points - far * vector
        lit |= ~probe.blocked(points, end)
    return np.asarray(
        (lit & seen.hit).reshape(n, rays).sum(axis=1) / np.maximum(seen.hit.reshape(n, rays).sum(axis=1), 1)
    )


def _seen_points(probe: Probe, eyes: Float64, targets: Float64, up_dir: Float64) -> Float64:
    """Points (n, 3) slightly in front of the surfaces that the views show."""
    look = targets - eyes
    look = look / np.linalg.norm(look, axis=1, keepdims=True)
    directions = view_directions(look, up_dir)
    origins = np.repeat(eyes, directions.shape[1], axis=0)
    directions = directions.reshape(-1, 3)
    seen = probe.trace(origins, directions)
    points = (origins + directions * (seen.distance * (1 - 1e-3))[:, None])[seen.hit]
    return np.asarray(points[:: max(1, len(points) // LIT_POINTS)])
