"""Warnings of pictures that are black or clipped."""

from collections.abc import Iterator

import numpy as np

from framearray_cli.array.images import FOR_SCREENS
from framearray_cli.base.arrays import Float32, Float64
from framearray_cli.base.units import digits
from framearray_cli.engine.frames.setup import FrameSetup
from framearray_cli.job.job import Job

from ..prepare import Prepared
from .positions import lights_text
from .rays import Flags
from .reached import scarce_light
from .seen import bounds, eyes_text
from .views import Views

# A screen shows values from 0 to 1. Linear formats keep what lies beyond, but two stops more are no exposure.
CLIPPED, TOO_BRIGHT = 1.0, 4.0
# Three of the 256 codes of a screen.
DARK = 1e-3
# Shares of the pixels that see surfaces, from which on a picture is lost.
MOSTLY_CLIPPED, MOSTLY_DARK = 0.6, 0.95
# Share of the pictures of a camera or light position, from which on it is named; fewer may be meant.
WHOLE = 0.9
# Pixels with a surface that a picture needs to be judged.
ENOUGH = 16
# Mid-grey, to which advice leads.
MIDDLE = 0.2
# A background that fills half of the picture, is clipped by two stops, and outshines what is seen before it.
MUCH_SKY, BRIGHT_SKY, OUTSHINES = 0.5, 4.0, 100.0


def level_warnings(views: Views, setup: FrameSetup, prepared: Prepared, counted: Flags, named: Flags) -> Iterator[str]:
    """Find pictures that are clipped or black.

    Args:
        counted: (E,) eyes that are judged: no other warning names them.
        named: (K,) light positions that another warning names, and that may be dark.
    """
    job = prepared.job
    values = _exposed(views, job)
    yield from _sky_warnings(views, job, values)
    counted = counted & (views.surface.sum(axis=1) >= ENOUGH)
    if not counted.any():
        return
    limit = CLIPPED if job.output.format in FOR_SCREENS else TOO_BRIGHT
    clipped = _shares(values > limit, views) * counted[:, None]
    bad = (clipped > MOSTLY_CLIPPED) & counted[:, None]
    if place := _place(bad, counted, views, prepared, np.ones(bad.shape[1], np.bool_)):
        bright = values[np.broadcast_to(bad[:, None] & views.surface[..., None], values.shape)]
        middle = float(np.median(bright))
        yield (
            f"{place}: {float(clipped[bad].mean()):.0%} of the pixels that see surfaces are clipped: the middle one "
            f"has {digits(middle, 3)}, and a screen shows up to 1; {_advice(job, middle)}"
        )
    yield from _dark_warnings(views, setup, prepared, values, counted, named)


def _dark_warnings(
    views: Views, setup: FrameSetup, prepared: Prepared, values: Float32, counted: Flags, named: Flags
) -> Iterator[str]:
    """Find pictures that are black; see `level_warnings`."""
    lit = (views.positions.bright | (not views.positions.bright.any())) & ~named
    dark = _shares(values < DARK, views)
    bad = (dark > MOSTLY_DARK) & counted[:, None] & lit
    if place := _place(bad, counted, views, prepared, lit):
        black = values[np.broadcast_to(bad[:, None] & views.surface[..., None], values.shape)]
        level = float(np.percentile(black, 90))
        reason = scarce_light(views, setup, prepared, bad) or _dark_reason(views, prepared, level)
        yield f"{place}: {float(dark[bad].mean()):.0%} of the pixels that see surfaces are black; {reason}"


def _exposed(views: Views, job: Job) -> Float32:
    """Return the largest channel of each pixel as the format shows it, (E, n, K)."""
    screens = job.output.format in FOR_SCREENS
    factor = np.float32(2.0**job.output.exposure) if screens else np.float32(1.0)
    exposed: Float32 = views.radiance.max(axis=-1) * factor
    return exposed


def _shares(flagged: Flags, views: Views) -> Float64:
    """Return the share of the pixels with a surface that are flagged, (E, K)."""
    on_surface = (flagged & views.surface[..., None]).sum(axis=1)
    shares: Float64 = on_surface / np.maximum(views.surface.sum(axis=1), 1)[:, None]
    return shares


def _place(bad: Flags, counted: Flags, views: Views, prepared: Prepared, lit: Flags) -> str:
    """Name the camera or light positions whose pictures are bad; "" if there are none."""
    if not bad.any() or not lit.any():
        return ""
    judged = bad[counted][:, lit]
    if judged.mean() >= WHOLE:
        return "all pictures"
    by_light, by_eye = judged.mean(axis=0) >= WHOLE, judged.mean(axis=1) >= WHOLE
    places = []
    if by_eye.any():
        flagged = np.zeros(len(counted), np.bool_)
        flagged[np.flatnonzero(counted)[by_eye]] = True
        places.append(eyes_text(flagged, views, prepared))
    if by_light.any():
        flagged = np.zeros(len(lit), np.bool_)
        flagged[np.flatnonzero(lit)[by_light]] = True
        places.append(lights_text(list(flagged), views.positions))
    return " and ".join(places)


def _advice(job: Job, level: float) -> str:
    factor = level / MIDDLE
    many = f"{float(f'{factor:.1g}'):,.0f}" if factor >= 2 else f"{factor:.2g}"
    if job.output.format in FOR_SCREENS:
        return f"divide the strength of the light by {many}, or set output.exposure = {_stops(job, factor):.1f}"
    return f"divide the strength of the light by {many}"


def _stops(job: Job, factor: float) -> float:
    return float(job.output.exposure - np.log2(factor))


def _dark_reason(views: Views, prepared: Prepared, level: float) -> str:
    """Say why pictures are black, and the remedy."""
    job = prepared.job
    if not (views.reflects | views.mirrors).any():
        if prepared.scene.has_mirrors and job.specular.depth == 0:
            return "mirrors are black, as specular.depth = 0"
        return "what is seen reflects no light: its materials are black; [scene.materials] replaces them"
    if not views.positions.bright.any() and not any(job.scene.background):
        return "all sources are off, and the background is black"
    factor = MIDDLE / max(level, float(np.finfo(np.float32).tiny))
    if level <= 0 or not np.isfinite(factor):
        return "no light arrives; move or add a source"
    many = f"{float(f'{factor:.1g}'):,.0f}"
    advice = f"multiply the strength of the light by about {many}"
    if job.output.format in FOR_SCREENS and _stops(job, 1 / factor) < 32:
        advice += f", or set output.exposure = {_stops(job, 1 / factor):.1f}"
    low, high = bounds(prepared)
    size = f"{float(np.linalg.norm(high - low)):,.4g}"
    return f"{advice}; the light of a lamp falls with the square of the distance, and the scene is {size} units across"


def _sky_warnings(views: Views, job: Job, values: Float32) -> Iterator[str]:
    """Find a background that outshines all that is seen before it."""
    sky = values[~views.surface]
    if (~views.surface).mean() < MUCH_SKY or not len(sky) or not views.surface.any():
        return
    background, surfaces = float(np.median(sky)), float(np.median(values[views.surface]))
    if background > BRIGHT_SKY and background > OUTSHINES * surfaces:
        yield (
            f"scene.background: {digits(background, 3)}, where surfaces have {digits(surfaces, 3)} and a screen shows "
            "up to 1: only outlines are seen; lower the background, or strengthen the light"
        )
