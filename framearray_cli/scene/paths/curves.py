"""Smooth curves through the values of key frames.

Numbers and positions follow monotone cubic curves (PCHIP): they pass through their keys, never leave the span
between two neighbouring keys, and rest where two keys are equal. Directions follow the same kind of curve on the
sphere (`directions.py`). Before the first and after the last key everything rests.
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
    curve = _smooth(frames, keyed, at) if len(frames) > 2 else _straight(frames, keyed, at)
    curve = np.clip(curve, ends.min(axis=0), ends.max(axis=0))  # rounding must not leave the span between two keys
    for key, frame in enumerate(frames):
        curve[at == frame] = keyed[key]
    return curve


def _straight(frames: Sequence[int], keyed: Float64, at: Float64) -> Float64:
    """The line through two keys."""
    share = ((at - frames[0]) / (frames[1] - frames[0]))[:, None]
    line: Float64 = (1 - share) * keyed[0] + share * keyed[1]
    return line


def _smooth(frames: Sequence[int], keyed: Float64, at: Float64) -> Float64:
    """The PCHIP curve through the keys; it rises or falls between two keys, and turns back only at keys."""
    from scipy.interpolate import PchipInterpolator  # the import takes 0.25 s, which two keys do not need

    with np.errstate(over="ignore"):  # a slope below 1e-308 has an infinite inverse, whose inverse is 0, as wanted
        curve: Float64 = PchipInterpolator(frames, keyed, axis=0)(at)
    return curve
