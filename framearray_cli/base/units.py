"""Bounds of values, and counts, frame rates, times and numbers of bytes as messages show them."""

from fractions import Fraction

MIB, GIB = 2**20, 2**30
# Bounds in job files, path files and options; values beyond them are typing errors.
FARTHEST = 1e12  # scene units; squares and cubes of it still fit in float32 (3e38)
MOST_EMISSION = 1e16  # W/sr, W/m2 or radiance; stays finite and in the range of kept light, see `put_shorts`
LEAST_FPS, MOST_FPS = 0.01, 1000  # frames per second
LUMENS_PER_WATT = 683.0  # of light of 555 nm, by the definition of the candela; renderers take it for all light
MOST_SECONDS = 40_000.0  # of a movie or of one segment
MOST_STOPS = 64  # of exposure, up or down
MOST_THREADS = 1024

# 23.976, 29.97 and 59.94 stand for 24, 30 and 60 times 1000 / 1001.
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


def counted(n: int, noun: str, plural: str = "") -> str:
    """A number of things: "1 image", "0 images", "1,200 images".

    Args:
        plural: where it is not the noun and an s.
    """
    return f"{n:,} {noun}" if n == 1 else f"{n:,} {plural or noun + 's'}"


def agree(n: int, one: str, many: str) -> str:
    """The form of a verb that goes with a number: `agree(n, "is", "are")`."""
    return one if n == 1 else many


def digits(value: float, n: int) -> str:
    """Write a number with n significant digits; large ones without an exponent: "47000", "0.68"."""
    return f"{float(f'{value + 0.0:.{n}g}'):.12g}"


def duration(seconds: float) -> str:
    """A time in one or two units: "3 h 05 min", "2 min 07 s", "12.3 s"."""
    if seconds < 60:
        return f"{seconds:.1f} s"
    minutes, rest = divmod(round(seconds), 60)
    if minutes < 60:
        return f"{minutes} min {rest:02d} s"
    return f"{minutes // 60} h {minutes % 60:02d} min"


def size(n_bytes: float) -> str:
    """A number of bytes in the unit that fits: "1.3 GiB"."""
    for unit in ("bytes", "KiB", "MiB"):
        if n_bytes < 1024:
            return f"{n_bytes:.0f} {unit}" if unit == "bytes" else f"{n_bytes:.1f} {unit}"
        n_bytes /= 1024
    return f"{n_bytes:.1f} GiB" if n_bytes < 1024 else f"{n_bytes / 1024:.1f} TiB"


def gibibytes(n_bytes: int) -> str:
    """A number of bytes in GiB, with two decimals below 1 GiB: "1.3 GiB", "0.42 GiB"."""
    return f"{n_bytes / GIB:.{1 if n_bytes >= GIB else 2}f} GiB"


_TYPED = ((2**40, "TiB"), (10**12, "TB"), (GIB, "GiB"), (10**9, "GB"), (MIB, "MiB"), (10**6, "MB"), (2**10, "KiB"))


def in_unit_of(n_bytes: int, typed: int) -> str:
    """A number of bytes in the unit in which another one was typed: 500,000,000 was most likely 500 MB."""
    units = (unit for unit in _TYPED if typed >= unit[0] and 100 * typed % unit[0] == 0)
    unit, name = next(units, (1, "bytes"))
    return f"{n_bytes / unit:,.{0 if n_bytes >= 100 * unit or unit == 1 else 2}f} {name}"


def amount(n_bytes: int) -> str:
    """A number of bytes in GiB, or in MiB below 0.1 GiB: "1.3 GiB", "12.0 MiB"."""
    if n_bytes >= 0.1 * GIB:
        return f"{n_bytes / GIB:,.1f} GiB"
    return f"{max(n_bytes, 0) / MIB:.1f} MiB"
