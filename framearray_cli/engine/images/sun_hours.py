"""Hours of direct sun of pixels: the mean over the hits on surfaces, with the weights that images have."""

from collections.abc import Mapping, Sequence

import numpy as np

from framearray_cli.base.arrays import Addresses, Float32
from framearray_cli.base.sundays import TOTAL, SunDay

from ..kernels.kernel import integer_at, kernel, real_at
from .accumulate import row_of, weight_of
from .sources import HOURS, ORDER, START


@kernel
def average_sun_hours(sources: Addresses, first_pixel: int, n: int, out: Float32) -> None:
    """Average the hours of sun of pixels first_pixel to first_pixel + n - 1.

    Args:
        sources: of a `SourceList` with native and outer hits.
        out: (n_pixels, n_days) overwritten in these pixels; 0 where no hit is on a surface.
    """
    days = out.shape[1]
    for pixel in range(first_pixel, first_pixel + n):
        # --- loop state ---
        weight = np.float32(0.0)  # sum of w over hits on surfaces
        for day in range(days):
            out[pixel, day] = 0.0  # sum of w times hours

        for s in range(sources.shape[0]):
            listed = sources[s]
            if listed[START] == 0:  # no list, but a source of the one before
                continue
            for entry in range(integer_at(listed[START], pixel), integer_at(listed[START], pixel + 1)):
                hit = integer_at(listed[ORDER], entry)
                hours = sources[row_of(listed, s, entry)][HOURS] + 4 * days * hit
                if real_at(hours, 0) < 0.0:  # NO_SURFACE
                    continue
                w = weight_of(listed, entry, hit)
                weight += w
                for day in range(days):
                    out[pixel, day] += w * real_at(hours, day)

        if weight > 0.0:
            for day in range(days):
                out[pixel, day] /= weight


def sun_layers(days: Sequence[SunDay], hours: Float32, shape: tuple[int, ...]) -> Mapping[str, Float32]:
    """Name the hours of sun, (n_pixels, n_days): those of each day by its date, and their sum TOTAL; no days, none."""
    if not days:
        return {}
    by_day = {day.date: hours[:, k].reshape(shape) for k, day in enumerate(days)}
    return {TOTAL: hours.sum(axis=1, dtype=np.float32).reshape(shape), **by_day}
