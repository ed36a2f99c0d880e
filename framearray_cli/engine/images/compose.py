"""Composing pixels: sums of hits become images [FA eq. 2], or the differences of their halves."""

from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any, NamedTuple

import numpy as np

from framearray_cli.base.arrays import Addresses, Float32, Float64, Images, Int32

from ..hits.row import BY_SAMPLE, HALF, ROW_BYTES
from ..kernels.bundle import bundle
from ..kernels.kernel import integer_at, kernel, real_at
from .accumulate import accumulate
from .band import Band, Finish, Stored, finish
from .gloss import GlossView, add_gloss
from .sourcelists import ORDER, ROW, START, WEIGHTS


@dataclass(slots=True, kw_only=True, eq=False)
class Composed:
    """A composed frame, or some of its rows.

    Attributes:
        c: the eye of the frame.
        rows: of the frame; the arrays below have only these, from `height` on.
        images: (n_lights, height, width, 3) radiance.
        layers: what is the same under every light, by name: (height, width), (height, width, channels), or a `Matte`;
            see `features/surface.py`, `aov.py` and `sun_hours.py`. Empty unless the job has layers.
        hits: (n_pixels,) number of hits of each pixel, native and outer.
        beyond: number of values beyond the largest half; where images are halves, they were cut to it.
        bad: number of values that were not finite, or negative; each was replaced by 0.
        first_bad: light index and pixel of the first of them, or None.
        differences: (n_lights, height, width, 3) D of the halves of the hits, see `standard_error.py`; or None.
        alpha: (height, width) share of each pixel that the scene covers; None unless the job keeps it.
    """

    c: int
    rows: range
    images: Images
    layers: Mapping[str, Any]
    hits: Int32
    beyond: int
    bad: int
    first_bad: tuple[int, int] | None
    differences: Float32 | None = None
    alpha: Float32 | None = None


@bundle
class Summands(NamedTuple):
    """The hits that a frame shows; pixels count from the first that is composed.

    Attributes:
        hits: addresses of a `SourceList`: native and outer hits, averaged by weight.
        mirrored: addresses of a `SourceList`: reflected hits, summed and added to the average.
        channels: of irradiance, 1 or 3.
        gloss: of glossy hits, see `GlossView`.
    """

    hits: Addresses
    mirrored: Addresses
    channels: int
    gloss: GlossView


@bundle
class Pixels(NamedTuple):
    """Arrays of a frame that composing writes.

    Attributes:
        images: (n_lights, n_pixels, 3), see `finish`.
        samples: (n_pixels,) number of hits of each pixel.
        columns: (k,) columns of rows whose means are wanted; `means`: (n_pixels, k) these.
    """

    images: Stored
    samples: Int32
    columns: Int32
    means: Float32


@kernel
def compose_pixels(
    band: Band, first_pixel: int, n: int, summands: Summands, how: Finish, out: Pixels
) -> tuple[int, int, int, int]:
    """Compose pixels first_pixel to first_pixel + n - 1 of all images of a frame, a band at a time.

    Args:
        band: overwritten: the sums of as many pixels as it holds.
        out: overwritten in these pixels.

    Returns:
        as `finish`, for all bands together.
    """
    # --- loop state ---
    hits, mirrored, channels, view = summands.hits, summands.mirrored, summands.channels, summands.gloss
    images, samples, columns, means = out.images, out.samples, out.columns, out.means
    n_lights = images.shape[0]
    bad, bad_light, bad_pixel = 0, -1, -1  # values that are no radiance; light position and pixel of the first
    beyond = 0  # values beyond the largest half

    for first in range(first_pixel, first_pixel + n, band.hits.shape[0]):
        # 1. Means over native and outer hits: sum(w (R / pi E[l], R W, B, W, R)) / sum(w).
        m = min(band.hits.shape[0], first_pixel + n - first)
        accumulate(band, first, m, hits, channels, n_lights, True)

        # 2. Means that layers need.
        for i in range(m):
            samples[first + i] = band.hits[i]
            for k in range(columns.shape[0]):
                means[first + i, k] = band.sums[i, columns[k]]

        # 3. What glossy hits send to this eye beyond that.
        add_gloss(band, first, m, hits, view, channels, n_lights, True, True)

        # 4. Add reflected hits: sum(t (R / pi E[l], R W, B)) / n_native.
        if mirrored.shape[0] > 0:
            accumulate(band, first, m, mirrored, channels, n_lights, False)
            add_gloss(band, first, m, mirrored, view, channels, n_lights, False, True)

        # 5. Multiply by the colour of the lights and by I_A[l], and write the images.
        found, l, pixel, large = finish(band, first, m, how, images)
        if bad == 0 and found > 0:
            bad_light, bad_pixel = l, pixel
        bad, beyond = bad + found, beyond + large
    return bad, bad_light, bad_pixel, beyond


@kernel
def weigh_halves(sources: Addresses, halves: Int32, first_pixel: int, n: int, weights: Float64) -> None:
    """Sum the weights of the hits of both halves in pixels first_pixel to first_pixel + n - 1.

    Args:
        sources: of a `SourceList`.
        halves: (n_sources,) the half that all hits of a source belong to, or BY_SAMPLE.
        weights: (2, n_pixels) overwritten in these pixels: W_A and W_B.
    """
    for pixel in range(first_pixel, first_pixel + n):
        weights[0, pixel] = weights[1, pixel] = 0.0
        for s in range(sources.shape[0]):
            source, half = sources[s], halves[s]
            for entry in range(integer_at(source[START], pixel), integer_at(source[START], pixel + 1)):
                hit = integer_at(source[ORDER], entry)
                if halves[s] == BY_SAMPLE:
                    half = int(real_at(source[ROW] + ROW_BYTES * hit, HALF))
                weights[half, pixel] += real_at(source[WEIGHTS], hit) if source[WEIGHTS] != 0 else np.float32(1.0)


@kernel
def compose_differences(
    band: Band,
    first_pixel: int,
    n: int,
    sources: Addresses,
    channels: int,
    how: Finish,
    images: Float32,
    view: GlossView,
) -> None:
    """Compose the differences D of the halves of the hits, a band at a time; see `standard_error.py`.

    Args:
        band: overwritten: the sums of as many pixels as it holds.
        sources: of a `SourceList` with factors `scale` from `half_factors`.
        channels: of irradiance, 1 or 3.
        how: `lowest` is minus infinity, as differences have both signs.
        images: (n_lights, n_pixels, 3) overwritten in pixels first_pixel to first_pixel + n - 1.
        view: of glossy hits.
    """
    for first in range(first_pixel, first_pixel + n, band.hits.shape[0]):
        # 1. Sums are added to the band, so clear it.
        m = min(band.hits.shape[0], first_pixel + n - first)
        for i in range(m):
            for column in range(band.sums.shape[1]):
                band.sums[i, column] = 0.0
            for channel in range(3):
                for l in range(band.direct.shape[2]):
                    band.direct[i, channel, l] = 0.0

        # 2. Sum hits times factors, and write the sums as images.
        accumulate(band, first, m, sources, channels, images.shape[0], False)
        add_gloss(band, first, m, sources, view, channels, images.shape[0], False, False)
        finish(band, first, m, how, images)
