"""Warnings of values that are typing errors or mistaken units, found without a ray."""

import math
from collections.abc import Iterator

import numpy as np

from framearray_cli.base.lens import PERSPECTIVE
from framearray_cli.base.units import digits
from framearray_cli.job.job import Job
from framearray_cli.job.sources import DirectionalKey, PanelKey, PointKey
from framearray_cli.scene.scene import Scene

# Fields of view up to pi are what radians look like; a telescope's picture is rarely meant.
RADIANS = math.pi
# Colours are factors from 0 to 1, some a little above; 100 are per cent, and 255 codes of 8 bits.
MOST_COLOUR = 10.0
COLOUR_REMEDY = "expected factors from 0 to 1: divide 8-bit codes by 255, and convert them from sRGB to linear values"
_STRENGTHS = ("intensity", "irradiance", "power", "radiance")
# Of the size of the scene: where surfaces obscure each other from farther away, all of them are obscured.
FAR_RANGE = 10.0
# Of the distance of what is seen: about a pixel of a picture with 300 rows. Closer surfaces look like one.
NEAR_RANGE = 1 / 300


def typed_warnings(job: Job) -> Iterator[str]:
    """Find values that were most likely meant in another unit."""
    fovs = [key.fov for key in job.camera.keys if key.fov is not None] or [job.camera.fov]
    fov, degrees = min(fovs), math.degrees(min(fovs))
    if fov <= RADIANS and job.camera.type == PERSPECTIVE:
        yield (
            f"camera.fov: {fov:g} degrees is the view of a telescope; if radians were meant, they are {degrees:.3g} "
            f"degrees: set fov = {degrees:.3g}"
        )
    for i, source in enumerate(job.light.sources):
        keys = {
            k: key for k, key in enumerate(source.key_frames) if isinstance(key, PointKey | DirectionalKey | PanelKey)
        }
        bad = {k: key.color for k, key in keys.items() if key.color is not None and max(key.color) > MOST_COLOUR}
        for k, colour in list(bad.items())[:1]:
            strength = next(name for name in _STRENGTHS if getattr(keys[k], name, None) is not None)
            more = f", and {len(bad) - 1} more" if len(bad) > 1 else ""
            values = ", ".join(f"{value:g}" for value in colour)
            yield (
                f"light.sources[{i}].keys[{k}].color{more}: [{values}] multiplies the {strength} by up to "
                f"{max(colour):g}; {COLOUR_REMEDY}"
            )


def layer_warnings(job: Job, scene: Scene) -> Iterator[str]:
    """Find layers that would be empty."""
    if job.output.aov["uv"] and not len(scene.uvs):
        yield (
            "output.uv: the scene has no texture coordinates, so the layer would be 0 everywhere; leave the key out, "
            "or add them to the scene file"
        )


def range_warnings(job: Job, size: float, distances: "np.ndarray") -> Iterator[str]:
    """Find a range of obscurance that hides all indirect light, or that no picture can show.

    Args:
        size: diagonal of the scene.
        distances: of the surfaces seen.
    """
    wanted = job.d_max
    if wanted > FAR_RANGE * size:
        yield (
            f"obscurance.range: {wanted:g} scene units, in a scene of {_short(size)}: everything obscures everything, "
            f"and indirect light is almost black; about {_good_range(size)} would suit the scene"
        )
    elif len(distances) and wanted < NEAR_RANGE * (middle := float(np.median(distances))):
        yield (
            f"obscurance.range: {wanted:g} scene units, where surfaces are seen from {_short(middle)} away: obscurance "
            f"is narrower than a pixel, and indirect light is flat; about {_good_range(min(size, 2 * middle))} would "
            "suit the scene"
        )


def _short(length: float) -> str:
    """Return a length with three digits, without an exponent where it has few."""
    return digits(length, 3)


def _good_range(size: float) -> str:
    """Return about a quarter of a length, with one digit."""
    return digits(size / 4, 1)
