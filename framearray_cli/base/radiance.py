"""Images of radiance: repair of texels that are no radiance, as resampling and lossy compression leave them.

A file of its own: job files, environment maps and the tools that sum images share the limits and the repair.
"""

import numpy as np

from .arrays import Float32
from .errors import OutputError
from .units import MOST_EMISSION, counted


def mend_radiance(pixels: Float32) -> tuple[Float32, str]:
    """Repair texels that are no radiance.

    Channels below 0 become 0, channels above MOST_EMISSION become MOST_EMISSION. Texels with a channel that is infinite
    or not a number become the mean of all others.

    Args:
        pixels: (h, w, k).

    Returns:
        The pixels, the very array if nothing is repaired; and a note on the repair, or "".

    Raises:
        OutputError: no texel is finite.
    """
    if pixels.min(initial=0.0) >= 0 and pixels.max(initial=0.0) <= MOST_EMISSION:  # False for NaN
        return pixels, ""
    finite = np.isfinite(pixels).all(axis=-1)
    if not finite.any():
        raise OutputError("expected radiance, got no finite texel")
    low, high = (pixels < 0).any(axis=-1) & finite, (pixels > MOST_EMISSION).any(axis=-1) & finite
    found = np.clip(pixels, np.float32(0.0), np.float32(MOST_EMISSION))
    found[~finite] = found[finite].mean(axis=0, dtype=np.float64)
    counts = [
        (int(low.sum()), "negative in {} (taken as 0)"),
        (int(high.sum()), f"above {MOST_EMISSION:g} in {{}} (taken as {MOST_EMISSION:g})"),
        (int((~finite).sum()), "not finite in {} (taken as the mean of the others)"),
    ]
    kinds = [text.format(counted(n, "texel")) for n, text in counts if n]
    return found, f"radiance is {', '.join(kinds)}"
