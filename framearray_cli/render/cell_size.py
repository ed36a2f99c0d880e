"""The edge of cells: within what keys of cells and single precision hold."""

import numpy as np

from framearray_cli.base.errors import JobError
from framearray_cli.base.units import digits
from framearray_cli.engine.terms.cells.table import MOST_CELLS
from framearray_cli.job.job import Job
from framearray_cli.scene.scene import Scene


def extent(scene: Scene) -> float:
    """Return the longest side of the box around the scene, scene units."""
    corners = scene.corners.reshape(-1, 3)
    return float((corners.max(axis=0).astype(np.float64) - corners.min(axis=0)).max())


def least_edge(scene: Scene) -> float:
    """Return the edge of the smallest cells that differ over the whole scene."""
    return extent(scene) / MOST_CELLS


def require_cell_size(job: Job, scene: Scene) -> None:
    """Refuse cells of which there would be more than have keys, or that are larger than the scene.

    Raises:
        JobError: `indirect.cell` is such an edge.
    """
    edge, least, most = job.indirect.cell, least_edge(scene), extent(scene)
    if edge is None or least <= edge <= most:
        return
    size = digits(most, 3)
    problem = (
        f"indirect.cell: expected a number from {least:.2g} to {size}, as the scene is {size} units wide, "
        f"got {edge:g}; without the key it is a 30th of the median length of obscurance rays"
    )
    raise JobError(job.file or job.name, [problem])
