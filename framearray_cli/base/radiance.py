"""Images of radiance: repair of texels that are no radiance, as resampling and lossy compression leave them.

A file of its own: job files, environment maps and the tools that sum images share the limits and the repair.
"""

import numpy as np
from numpy.typing import NDArray

from .arrays import Flags, Float32, Float64
from .errors import OutputError
from .units import MOST_EMISSION, counted

# Rings of texels that are filled from the outside in; farther inside, the mean of all finite texels counts.
MOST_RINGS = 16
LEAST_PERCENT = 0.01  # smaller percentages are printed as "less than"


def mend_radiance(pixels: Float32, *, panorama: bool) -> tuple[Float32, str]:
    """Repair texels that are no radiance.

    Channels below 0 become 0, channels above MOST_EMISSION become MOST_EMISSION. Texels with a channel that is infinite
    or not a number become the mean of their finite neighbours.

    Args:
        pixels: (h, w, k).
        panorama: True if the last column is next to the first one, and rows weigh as their solid angle.

    Returns:
        The pixels, the very array if nothing is repaired; and a note on the repair, or "".

    Raises:
        OutputError: no texel is finite.
    """
    if pixels.min(initial=0.0) >= 0 and pixels.max(initial=0.0) <= MOST_EMISSION:  # False for NaN
        return pixels, ""
    broken: Flags = np.logical_not(np.isfinite(pixels).all(axis=-1))
    if broken.all():
        raise OutputError("expected radiance, got no finite texel")
    given = np.where(broken[..., None], np.float32(0.0), pixels)
    found = np.clip(given, np.float32(0.0), np.float32(MOST_EMISSION))
    _fill(found, broken, wraps=panorama)
    counts = [
        (int((given < 0).any(axis=-1).sum()), "negative in {} (taken as 0)"),
        (
            int((given > MOST_EMISSION).any(axis=-1).sum()),
            f"above {MOST_EMISSION:g} in {{}} (taken as {MOST_EMISSION:g})",
        ),
        (int(broken.sum()), "not finite in {} (taken as the mean of the neighbours)"),
    ]
    kinds = [text.format(counted(n, "texel")) for n, text in counts if n]
    texels, light = sum(n for n, _ in counts) / broken.size, _share(given, found, panorama=panorama)
    return found, f"radiance is {', '.join(kinds)}: {_percent(texels)} of the texels, {_percent(light)} of the light"


def _fill(found: Float32, broken: Flags, *, wraps: bool) -> None:
    """Replace broken texels of an image (h, w, k) by the mean of their known neighbours, from the outside in."""
    known = ~broken
    rows, columns = np.nonzero(broken)
    for _ in range(MOST_RINGS):
        if not len(rows):
            return
        sums, counts = np.zeros((len(rows), found.shape[-1])), np.zeros(len(rows))
        for down, right in ((y, x) for y in (-1, 0, 1) for x in (-1, 0, 1) if y or x):
            good, y, x = _neighbours(rows + down, columns + right, known, wraps=wraps)
            sums[good] += found[y, x]
            counts[good] += 1
        done = counts > 0
        found[rows[done], columns[done]] = sums[done] / counts[done, None]
        known[rows[done], columns[done]] = True
        rows, columns = rows[~done], columns[~done]
    found[rows, columns] = found[known].mean(axis=0, dtype=np.float64)


def _neighbours(
    rows: NDArray[np.int64], columns: NDArray[np.int64], known: Flags, *, wraps: bool
) -> tuple[NDArray[np.int64], NDArray[np.int64], NDArray[np.int64]]:
    """Indices of the places that are known texels of the image, and their rows and columns."""
    height, width = known.shape
    columns = columns % width if wraps else columns
    inside = np.flatnonzero((rows >= 0) & (rows < height) & (columns >= 0) & (columns < width))
    good = inside[known[rows[inside], columns[inside]]]
    return good, rows[good], columns[good]


def _share(given: Float32, found: Float32, *, panorama: bool) -> float:
    """Light that the repair adds or removes, as a share of all light, at most 1."""
    edges: Float64 = np.sin(np.linspace(np.pi / 2, -np.pi / 2, len(found) + 1))
    weight = -np.diff(edges) if panorama else np.ones(len(found))
    changed, total = (
        float(np.abs(values).sum(axis=(1, 2), dtype=np.float64) @ weight) for values in (found - given, found)
    )
    return min(changed / total, 1.0) if total > 0 else 1.0


def _percent(share: float) -> str:
    percent = 100 * share
    if percent < LEAST_PERCENT:
        return f"less than {LEAST_PERCENT:g}%"
    return f"{percent:.0f}%" if percent >= 10 else f"{percent:.2g}%"
