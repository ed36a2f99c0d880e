"""Frame rates as exact fractions, the form in which movie and EXR files keep them."""

from fractions import Fraction

# A rate that people write as 23.976, 29.97 or 59.94 means 24, 30 or 60 times 1000 / 1001.
_NTSC = tuple(Fraction(n * 1000, 1001) for n in (24, 30, 48, 60, 120))


def frame_rate(fps: float | Fraction) -> Fraction:
    """Turn frames per second into an exact fraction: 24 -> 24/1, 23.976 -> 24000/1001, 12.5 -> 25/2.

    Raises:
        ValueError: fps is not a positive, finite number.
    """
    if not 0 < fps < float("inf"):
        raise ValueError(f"expected a positive frame rate, got {fps}")
    if isinstance(fps, Fraction):
        return fps
    for rate in _NTSC:
        if abs(fps - float(rate)) < 0.005:  # 23.98 is 0.004 off; the next rate in use, 24, is 0.024 off
            return rate
    return Fraction(fps).limit_denominator(1001)
