"""The same job with a few of its light positions: they show what all of them cost, and need the same kernels."""

from dataclasses import replace

import numpy as np

from framearray_cli.engine.frames.setup import FrameSetup
from framearray_cli.engine.terms.ambient.intensity import Ambient

from .prepare import Prepared


def few_prepared(prepared: Prepared, most: int) -> Prepared:
    """Return the same job with at most about `most` light positions; the job itself if it has no more."""
    planes = prepared.lights.few(most)
    if len(planes) == prepared.n_lights:
        return prepared
    return replace(prepared, lights=prepared.lights.at(planes), light_arrays=prepared.light_arrays.at(planes))


def with_few_lights(
    prepared: Prepared, setup: FrameSetup, ambient: Ambient, most: int
) -> tuple[Prepared, FrameSetup, Ambient]:
    """Return a planned job with at most about `most` light positions."""
    few, planes = few_prepared(prepared, most), prepared.lights.few(most)
    if few is prepared:
        return prepared, setup, ambient
    return (
        few,
        setup.at(planes),
        replace(ambient, intensity=ambient.intensity[planes], standard_error=ambient.standard_error[planes]),
    )


def all_lights(prepared: Prepared, most: int, setup: FrameSetup, ambient: Ambient) -> tuple[FrameSetup, Ambient]:
    """Return the setup for all light positions, and their ambient light: each has that of the nearest known one.

    Args:
        setup, ambient: for `few_prepared(prepared, most)`.
    """
    planes = np.array(prepared.lights.few(most))
    if len(planes) == prepared.n_lights:
        return setup, ambient
    nearest = np.abs(np.arange(prepared.n_lights)[:, None] - planes).argmin(axis=1)
    return (
        replace(setup.at(nearest.tolist()), lights=prepared.light_arrays, planes=prepared.lights.planes),
        replace(ambient, intensity=ambient.intensity[nearest], standard_error=ambient.standard_error[nearest]),
    )
