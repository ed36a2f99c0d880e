"""Smooth curves through the values of key frames: numbers and positions, and unit directions.

Numbers and positions follow monotone cubic curves (PCHIP): they pass through their keys, never leave the span
between two neighbouring keys, and rest where two keys are equal. Directions follow the same kind of curve on the
sphere: each span between two keys is a cubic Bezier curve whose straight lines are replaced by great circles
[Shoemake85], so a direction is never shortened, and two keys give a turn of constant speed. Before the first and after
the last key everything rests.
"""

from collections.abc import Sequence

import numpy as np

from framearray_cli.base.arrays import Float64


def interpolate_keys(frames: Sequence[int], values: Sequence[Sequence[float]], n: int) -> Float64:
    """Interpolate key values to frames 0 .. n - 1.

    Edge cases: one key is constant, two are a straight line; equal neighbours stay equal to the last bit.

    Args:
        frames: frame of each key, strictly increasing.
        values: (n_keys, k) value of each key.
        n: number of frames.

    Returns:
        (n, k)
    """
    keyed = np.asarray(values, dtype=np.float64)
    if len(frames) == 1:
        return np.repeat(keyed, n, axis=0)
    at = np.clip(np.arange(n, dtype=np.float64), frames[0], frames[-1])
    before = np.searchsorted(frames, at, side="right").clip(max=len(frames) - 1) - 1  # (n,) key before each frame
    ends = np.stack([keyed[before], keyed[before + 1]])
    if len(frames) > 2:  # a PCHIP curve rises or falls between two keys, and turns back only at keys
        from scipy.interpolate import PchipInterpolator  # the import takes 0.25 s, which two keys do not need

        with np.errstate(over="ignore"):  # a slope below 1e-308 has an infinite inverse, whose inverse is 0, as wanted
            curve: Float64 = PchipInterpolator(frames, keyed, axis=0)(at)
    else:
        share = ((at - frames[0]) / (frames[1] - frames[0]))[:, None]
        curve = (1 - share) * keyed[0] + share * keyed[1]
    curve = np.clip(curve, ends.min(axis=0), ends.max(axis=0))  # rounding must not leave the span between two keys
    for key, frame in enumerate(frames):
        curve[at == frame] = keyed[key]
    return curve


# If two directions are closer to parallel than this (radians), rounding decides what is normal to both.
PARALLEL = 1e-6


def unit(vectors: Float64) -> Float64:
    """Scale vectors (n, 3) to length 1; none may be zero."""
    scaled = vectors / np.abs(vectors).max(axis=-1, keepdims=True)  # so that no square over- or underflows
    return np.asarray(scaled / np.linalg.norm(scaled, axis=-1, keepdims=True))


def interpolate_directions(frames: Sequence[int], directions: Sequence[Sequence[float]], n: int) -> Float64:
    """Interpolate key directions to frames 0 .. n - 1.

    Edge cases: one key is constant; equal neighbours stay equal to the last bit; before the first and after
    the last key the direction rests. Neighbours that are opposite are refused while the job is read.

    Args:
        frames: frame of each key, strictly increasing.
        directions: (n_keys, 3), of any length but 0.
        n: number of frames.

    Returns:
        (n, 3) unit directions.
    """
    keyed = unit(np.asarray(directions, dtype=np.float64))
    if len(frames) == 1:
        return np.repeat(keyed, n, axis=0)
    times = np.asarray(frames, dtype=np.float64)
    at = np.clip(np.arange(n), times[0], times[-1])
    before = np.searchsorted(times, at, side="right").clip(max=len(times) - 1) - 1  # (n,) key before each frame
    span = np.diff(times)
    t = ((at - times[before]) / span[before])[:, None]
    speed = _tangents(keyed, span)
    leave = _move(keyed[:-1], speed[:-1] * span[:, None] / 3)[before]  # inner control points
    arrive = _move(keyed[1:], -speed[1:] * span[:, None] / 3)[before]
    a, b, c = slerp(keyed[before], leave, t), slerp(leave, arrive, t), slerp(arrive, keyed[before + 1], t)
    path = unit(slerp(slerp(a, b, t), slerp(b, c, t), t))
    resting = (keyed[before] == keyed[before + 1]).all(axis=1)
    path[resting] = keyed[before][resting]
    for key, frame in enumerate(frames):
        path[at == frame] = keyed[key]
    return path


def _tangents(keyed: Float64, span: Float64) -> Float64:
    """Choose the angular velocity at each key, (n_keys, 3), normal to the key's direction, radians per frame.

    As in PCHIP, but with vectors: it lies between the velocities of the spans on both sides, is at most twice the
    slower one, and is zero where the path rests on one side or turns back.
    """
    after = turn(keyed[:-1], keyed[1:]) / span[:, None]  # velocity in which each span leaves its first key
    arriving = -turn(keyed[1:], keyed[:-1]) / span[:, None]  # and in which it reaches its second
    tangents = np.zeros_like(keyed)
    tangents[0], tangents[-1] = after[0], arriving[-1]
    for k in range(1, len(keyed) - 1):
        come, go = arriving[k - 1], after[k]
        slow, fast = sorted((np.linalg.norm(come), np.linalg.norm(go)))
        mean = come * span[k] + go * span[k - 1]  # the shorter span counts more
        size = np.linalg.norm(mean)
        if come @ go > 0 and slow > 0:
            harmonic = 2 * slow * fast / (slow + fast)
            tangents[k] = mean / size * harmonic
    return tangents


def turn(start: Float64, end: Float64) -> Float64:
    """Angle from start to end, (n, 3), as a vector normal to start that points along the great circle."""
    across = end - (start * end).sum(axis=-1, keepdims=True) * start
    sine = np.linalg.norm(across, axis=-1, keepdims=True)
    angle = _angle(start, end)
    return np.asarray(np.divide(across, sine, out=np.zeros_like(across), where=sine > 0) * angle)


def _move(start: Float64, turn_vec: Float64) -> Float64:
    """Follow the great circle from start for the angle and direction of `turn_vec`: the inverse of `turn`."""
    angle = np.linalg.norm(turn_vec, axis=-1, keepdims=True)
    return np.asarray(np.cos(angle) * start + np.sinc(angle / np.pi) * turn_vec)


def slerp(start: Float64, end: Float64, t: Float64) -> Float64:
    """Turn from start to end, (n, 3) unit directions, by the share t, (n, 1), of the angle between them.

    Edge case: opposite directions turn about an axis that depends only on the start.
    """
    angle = _angle(start, end)
    sine = np.sin(angle)
    near = angle < 1e-4  # the straight line differs by angle^2 / 8 of the step, and its length by as much
    opposite = angle > np.pi - 1e-4
    with np.errstate(invalid="ignore", divide="ignore"):
        curve = (np.sin((1 - t) * angle) * start + np.sin(t * angle) * end) / sine
    line = start + t * (end - start)
    axis = np.eye(3)[np.abs(start).argmin(axis=-1)]
    side = unit(np.cross(start, axis))
    around = np.cos(t * angle) * start + np.sin(t * angle) * side
    return unit(np.where(near, line, np.where(opposite, around, curve)))


def _angle(a: Float64, b: Float64) -> Float64:
    """Angle between unit directions, (n, 1), exact to rounding from 0 to half a turn (Kahan)."""
    return np.asarray(2 * np.arctan2(np.linalg.norm(a - b, axis=-1), np.linalg.norm(a + b, axis=-1)))[..., None]
