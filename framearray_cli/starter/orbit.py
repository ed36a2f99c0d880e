"""A thing seen from outside: eyes on part of a circle around it, and a sun that passes over it."""

import math

import numpy as np

from framearray_cli.base.arrays import Float64

from .rays import Probe
from .sample import level_directions
from .views import ASPECT, judge_views

FOV_DEG = 40.0  # longer than a room's: a thing seen from some way off is not distorted
ABOVE_DEG = 20.0  # elevation of the eye, seen from the middle of the thing
ARC_DEG, KEYS = 90.0, 7  # the largest number of keys: 15 degrees apart, the path leaves the circle by a thousandth
FILLED = 0.88  # largest share of the picture's height or width that the thing covers
SIDES = 8  # arcs to choose from
FRONT_BONUS = 0.5  # added to the worth of the front; the back loses as much
OUTLINE = 4000  # corners that stand for the outline
SUN_ARC_DEG, SUN_DEG, SUN_KEYS = 110.0, (35.0, 60.0), 5  # from left to right; elevation at the ends and at noon


def key_frames(n: int, most: int) -> tuple[list[int], Float64]:
    """Frames of at most `most` keys of a path of n frames, and the share of the path at each; of one frame, 0.5."""
    if n == 1:
        return [0], np.array([0.5])
    frames = sorted({round(float(k)) for k in np.linspace(0, n - 1, most)})
    return frames, np.array(frames) / (n - 1)


def choose_orbit(probe: Probe, up: int, shares: Float64) -> tuple[Float64, Float64]:
    """Choose the eyes of an orbit, (n, 3), and their common target (3,), in centred coordinates.

    Every picture shows the whole thing.

    Args:
        up: number of the up axis.
        shares: (n,) of the way around, 0 to 1.
    """
    corners = probe.scene.corners.reshape(-1, 3).astype(np.float64)
    target = (corners.min(axis=0) + corners.max(axis=0)) / 2
    outline = corners[:: max(1, len(corners) // OUTLINE)] - target
    up_dir = np.eye(3)[up]
    middle = level_directions(SIDES, up)
    ways = np.stack([_raise_direction(way, up_dir, ABOVE_DEG) for way in middle])
    far = _fitting_distance(outline, ways, up_dir)
    size = float(np.linalg.norm(outline, axis=1).max())
    shown, _ = judge_views(probe, target + ways * far, -ways, up_dir, size)
    best = middle[int((shown + FRONT_BONUS * (middle @ middle[0])).argmax())]
    arc = np.radians(ARC_DEG * (shares - 0.5))
    ways = np.stack([_raise_direction(turn_about(best, up_dir, angle), up_dir, ABOVE_DEG) for angle in arc])
    return target + ways * _fitting_distance(outline, ways, up_dir), target


def sun_directions(to_eye: Float64, up: int, shares: Float64) -> Float64:
    """Directions in which sunlight travels, (n, 3); the sun goes from left to right behind the eye.

    Args:
        to_eye: (3,) from the thing to the eye.
        shares: (n,) of the way over, 0 to 1.
    """
    up_dir = np.eye(3)[up]
    level = to_eye - (to_eye @ up_dir) * up_dir
    size = np.linalg.norm(level)
    level = level / size if size > 0 else level_directions(1, up)[0]
    low, high = SUN_DEG
    return -np.stack(
        [
            _raise_direction(
                turn_about(level, up_dir, math.radians(SUN_ARC_DEG * (share - 0.5))),
                up_dir,
                low + (high - low) * math.sin(math.pi * share),
            )
            for share in shares
        ]
    )


def turn_about(way: Float64, up_dir: Float64, angle: float) -> Float64:
    """Turn a level direction about the up axis by an angle, radians."""
    return np.asarray(math.cos(angle) * way + math.sin(angle) * np.cross(up_dir, way))


def _raise_direction(level: Float64, up_dir: Float64, above_deg: float) -> Float64:
    above = math.radians(above_deg)
    return np.asarray(math.cos(above) * level + math.sin(above) * up_dir)


def _fitting_distance(outline: Float64, ways: Float64, up_dir: Float64) -> float:
    """Distance from which the outline fits into the picture from all directions `ways`."""
    tall = math.tan(math.radians(FOV_DEG) / 2) * FILLED
    needed = []
    for way in ways:
        right = np.cross(-way, up_dir)
        right /= np.linalg.norm(right)
        above = np.cross(right, -way)
        across = np.maximum(np.abs(outline @ right) / (tall * ASPECT), np.abs(outline @ above) / tall)
        needed.append(float((across + outline @ way).max()))
    return max(needed)
