"""The terms of a batch of hits: obscurance W, light-independent radiance, and the irradiance E[l] of every light."""

from time import perf_counter

import numpy as np

from framearray_cli.base.arrays import Float32, Rgb

from ..hits.emission import EMISSION_COLUMNS, SOURCE, TEXTURE, record_emission
from ..hits.gloss import record_gloss
from ..hits.hits import ESCAPED, Hits
from ..hits.marks import record_marks
from ..kernels.kernel import inlined, kernel
from ..kernels.simd import LANES, bits, load
from ..terms.cells.exact import light_of_paths
from ..terms.cells.gather import Gathered, gather_cells, gather_settings
from ..terms.cells.smooth import smooth_light
from ..terms.obscurance import obscurance
from ..terms.sun_hours import find_sun_hours
from .direct_light import estimate_direct
from .records import (
    CLEAR,
    HALF,
    INDIRECT,
    LIGHT_INDEPENDENT,
    LIT,
    OBSCURANCE,
    REFLECTIVITY,
    WEIGHT,
    HitRecords,
    lit_bit,
)
from .scratch import Scratch
from .setup import FrameSetup

_NOTHING = np.empty((0, 3), np.float32)


def estimate_terms(
    setup: FrameSetup,
    hits: Hits,
    n: int,
    scratch: Scratch,
    out: HitRecords,
    obscurance_kind: str,
    shadow_kind: str,
    throughput: Rgb = _NOTHING,
    *,
    smooth: bool = False,
) -> None:
    """Estimate W, the light-independent radiance and E[l] of hits 0 to n - 1.

    Args:
        out: overwritten; `scratch` has what the hits send out, and their gloss, see `find_shine`.
        obscurance_kind, shadow_kind: kinds of rays and stages to count the cost under.
        throughput: (>= n, 3) the tint t of the mirrors on the way to each hit, or (0, 3) without mirrors.
        smooth: whether hits in a row are neighbours in the image, and their indirect light is filtered.
    """
    started = perf_counter()
    neighbours = not len(throughput)  # behind mirrors hits lie apart
    scratch.rays[obscurance_kind] += _estimate_indirect(setup, hits, n, scratch, out, neighbours)
    if smooth and scratch.smooth is not None:
        cams, passes = setup.cams, setup.smooth
        smooth_light(
            hits, n, cams.width, cams.height, passes, scratch.closeness, scratch.smooth, out.indirect, scratch.constant
        )  # fmt: skip
    skylight = scratch.skylight if setup.cells is None else scratch.constant
    middle = perf_counter()
    rays = estimate_direct(setup, hits, n, scratch, out, throughput)
    if setup.sun is not None and scratch.sun is not None and neighbours:
        rays += find_sun_hours(hits, n, setup.sun, setup.world.tracer, scratch.test_rays, scratch.sun, out.sun_hours)
    scratch.rays[shadow_kind] += rays
    if setup.shines:
        out.emission[:n] = scratch.emission[:n]
        if len(throughput):
            out.emission[:n, TEXTURE:] *= throughput[:n]
    background = setup.background
    if setup.alpha and neighbours:
        background = _leave_out_outside(hits, n, out)
    write_rows(hits, n, background, scratch.obscurance, skylight, throughput, out.irradiance, out.row)
    if setup.glows:
        seen = scratch.glow[:n] * throughput[:n] if len(throughput) else scratch.glow[:n]
        out.row[:n, LIGHT_INDEPENDENT : LIGHT_INDEPENDENT + 3] += seen
    scratch.seconds[obscurance_kind] += middle - started
    scratch.seconds[shadow_kind] += perf_counter() - middle


def _leave_out_outside(hits: Hits, n: int, out: HitRecords) -> Rgb:
    """Leave out what eye rays 0 to n - 1 that escaped see of environments; return the background in place of another.

    Args:
        hits: changed: nothing reflects there.
    """
    away = hits.kind[:n] == ESCAPED
    out.irradiance[:n][away] = 0.0
    hits.reflectivity[:n][away] = 0.0
    return np.zeros(3, np.float32)


def find_marks(setup: FrameSetup, scratch: Scratch, n: int, marks: Float32) -> None:
    """Find the marks of the n hits of the scratch, whose rays are still there; nothing where nobody asks.

    Args:
        marks: (n, columns) overwritten.
    """
    if setup.marks is not None:
        packets, position = scratch.hit_rays.packets, scratch.hits.position
        record_marks(setup.marks.pair, setup.marks.uvs, setup.world.tracer, packets, n, position, marks)


def find_shine(setup: FrameSetup, hits: Hits, scratch: Scratch, first: int, n: int) -> None:
    """Find what n hits whose rays are still in `scratch.hit_rays` send out, and their gloss.

    Args:
        hits: these; their base colours change where they are glossy.
        first: number of the first of them in the arrays of `scratch`.
    """
    packets = scratch.hit_rays.packets
    if setup.shines:
        record_emission(setup.lights.emitters, setup.world.tracer, packets, n, scratch.emission[first:])
    find_glow(setup, packets, n, scratch.glow[first:])
    if setup.shiny:
        record_gloss(setup.glossy, setup.world.tracer, packets, n, hits, scratch.alpha[first:], scratch.metal[first:])


def find_glow(setup: FrameSetup, packets: Float32, n: int, glow: Rgb) -> None:
    """Find the radiance that what traced rays 0 to n - 1 meet sends out without being a source.

    Args:
        glow: (>= n, 3) overwritten; (0, 3) where nothing does.
    """
    if setup.glows:
        found = np.empty((n, EMISSION_COLUMNS), np.float32)
        record_emission(setup.glow.emitters, setup.world.tracer, packets, n, found)
        radiance = setup.glow.radiance[found[:, SOURCE].astype(np.int64)]  # of any where the texture is 0
        np.multiply(radiance, found[:, TEXTURE:], out=glow[:n])


def _estimate_indirect(
    setup: FrameSetup, hits: Hits, n: int, scratch: Scratch, out: HitRecords, neighbours: bool
) -> int:
    """Estimate W, and the indirect light of cells where the job has them; return the number of rays."""
    rays: int
    gathered = Gathered(scratch.obscurance, scratch.skylight, out.indirect, scratch.constant, scratch.closeness)
    if setup.cells is None or scratch.gather is None or scratch.near is None or setup.exact:
        rays = obscurance(
            hits, n, setup.obscurance, setup.world.surfaces, setup.world.tracer, scratch.hit_rays, scratch.obscurance,
            scratch.skylight, neighbours,
        )  # fmt: skip
        if scratch.paths is not None:
            rays += light_of_paths(
                hits, n, setup.obscurance.n_rays, setup.world, setup.lights, setup.background,
                scratch.paths, gathered,
            )  # fmt: skip
    else:
        rays = gather_cells(
            hits, n, gather_settings(setup.obscurance), setup.world, setup.lights, setup.cells, scratch.hit_rays,
            scratch.gather, scratch.test_rays, scratch.near, scratch.mirrors, gathered, neighbours,
        )  # fmt: skip
    return rays


@kernel
def write_rows(
    hits: Hits,
    n: int,
    background: Rgb,
    obscurance: Rgb,
    skylight: Rgb,
    throughput: Rgb,
    irradiance: Float32,
    row: Float32,
) -> None:
    """Write the rows of hits 0 to n - 1; see `HitRecords`.

    Args:
        background: (3,) radiance that escaped rays see.
        obscurance: (>= n, 3) W.
        skylight: (>= n, 3) S, the background that reaches each hit, or (0, 3).
        throughput: (>= n, 3) t, see `estimate_terms`.
        row: (n, LANES) overwritten.
    """
    for i in range(n):
        # 1. R W, B, W and R of each channel, with R tinted by t behind mirrors. B has no l: it is the background where
        #    the ray left the scene, and R S.
        row[i, WEIGHT] = 1.0
        for channel in range(3):
            tint = throughput[i, channel] if throughput.shape[0] else np.float32(1.0)
            reflectivity = tint * hits.reflectivity[i, channel]
            light_independent = tint * background[channel] if hits.kind[i] == ESCAPED else np.float32(0.0)
            if skylight.shape[0]:
                light_independent += reflectivity * skylight[i, channel]
            row[i, INDIRECT + channel] = reflectivity * obscurance[i, channel]
            row[i, LIGHT_INDEPENDENT + channel] = light_independent
            row[i, OBSCURANCE + channel] = obscurance[i, channel]
            row[i, REFLECTIVITY + channel] = reflectivity
        # 2. Where E[l] is not zero, the half of the sample, and whether it shows what lies outside.
        row[i, LIT] = _lit_bits(irradiance, i)
        row[i, HALF] = hits.half[i]
        row[i, CLEAR] = 1.0 if hits.kind[i] == ESCAPED else 0.0


@inlined
def _lit_bits(irradiance: Float32, i: int) -> int:
    """The packets of light positions that give hit i any light, as bits; see `lit_bit`."""
    channels, n_lights = irradiance.shape[1], irradiance.shape[2]
    found = 0
    for channel in range(channels):
        row = (i * channels + channel) * n_lights
        for l in range(0, n_lights, LANES):
            light = bits(~(load(irradiance, row + l) == np.float32(0.0)))  # set for NaN, too
            if l + LANES > n_lights:  # the last packet reads beyond the end
                light &= (1 << (n_lights - l)) - 1
            found |= int(light != 0) << lit_bit(n_lights, l)
    return found
