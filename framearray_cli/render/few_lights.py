"""The same job with a few of its light positions: they show what all of them cost, and need the same kernels."""

from dataclasses import replace

import numpy as np

from framearray_cli.engine.frames.setup import FrameSetup
from framearray_cli.engine.terms.ambient.estimate import Ambient

from .prepare import Prepared


def few_prepared(prepared: Prepared, most: int) -> Prepared:
    """Return the same job with at most about `most` light positions; the job itself if it has no more."""
    planes = _planes(prepared, most)
    if len(planes) == prepared.n_lights:
        return prepared
    return replace(prepared, lights=prepared.lights.at(planes), light_arrays=prepared.light_arrays.at(planes))


def with_few_lights(
    prepared: Prepared, setup: FrameSetup, ambient: Ambient, most: int
) -> tuple[Prepared, FrameSetup, Ambient]:
    """Return a planned job with at most about `most` light positions."""
    few, planes = few_prepared(prepared, most), _planes(prepared, most)
    if few is prepared:
        return prepared, setup, ambient
    return (
        few,
        replace(
            setup,
            lights=few.light_arrays,
            kept=range(len(planes)),
            planes=few.lights.planes,
            cells=setup.cells_at(planes),
        ),
        replace(ambient, intensity=ambient.intensity[planes], standard_error=ambient.standard_error[planes]),
    )


def all_lights(prepared: Prepared, most: int, setup: FrameSetup, ambient: Ambient) -> tuple[FrameSetup, Ambient]:
    """Return the setup for all light positions, and their ambient light: each has that of the nearest known one.

    Args:
        setup, ambient: for `few_prepared(prepared, most)`.
    """
    planes = np.array(_planes(prepared, most))
    if len(planes) == prepared.n_lights:
        return setup, ambient
    nearest = np.abs(np.arange(prepared.n_lights)[:, None] - planes).argmin(axis=1)
    return (
        replace(
            setup,
            lights=prepared.light_arrays,
            kept=range(prepared.n_lights),
            planes=prepared.lights.planes,
            cells=setup.cells_at(nearest.tolist()),
        ),
        replace(ambient, intensity=ambient.intensity[nearest], standard_error=ambient.standard_error[nearest]),
    )


def _planes(prepared: Prepared, most: int) -> list[int]:
    """Return some image planes; shadow steps need light positions that follow one another."""
    return prepared.lights.few(most, consecutive=prepared.job.samples.shadow_step > 1)
