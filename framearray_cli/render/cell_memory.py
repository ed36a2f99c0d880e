"""Memory of cells: the table that images read, and what building it takes beside it.

The number of cells is known after the build only; before, it is estimated by the number of samples.
"""

import numpy as np

from framearray_cli.engine.frames.setup import FrameSetup
from framearray_cli.engine.terms.cells.build import LIGHT_BLOCK

from .prepare import Prepared

# Cells per sample, about the most of all levels together, as a cell has four samples or more; cells per square root of
# the number of samples where the program chooses the edge; and per square of the edge on the surfaces of the scene.
MOST_PER_SAMPLE, PER_ROOT, PER_SQUARE = 0.2, 80.0, 2.0
# Bytes per cell of the table, beside its light: guard, tint, other, and its slots.
BYTES_PER_CELL = 16 + 32 + 4 + 64
# Bytes per sample while samples are drawn and join their cells, and once they have.
DRAWN, PLACED = 190, 86 + 6 * (4 + 4) + 4
# Bytes per thread, of batches of walks and rays.
PER_THREAD = 6 * 2**20


def builds_cells(prepared: Prepared) -> bool:
    """Whether a job builds cells."""
    return prepared.job.indirect.method != "obscurance" and not prepared.job.indirect.exact


def cells_memory(setup: FrameSetup, n_lights: int) -> int:
    """Return the bytes that the light of cells takes at some of the light positions; 0 without cells."""
    return 0 if setup.cells is None else setup.cells.light[:, :, :1].nbytes * n_lights


def _expected_cells(prepared: Prepared) -> int:
    """Return the number of cells to come, about."""
    samples, edge = prepared.job.indirect.samples, prepared.job.indirect.cell
    if edge is None:
        return int(min(MOST_PER_SAMPLE * samples, PER_ROOT * samples**0.5))
    corners = prepared.scene.corners.astype(np.float64)
    area = np.linalg.norm(np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0]), axis=1).sum() / 2
    return int(min(MOST_PER_SAMPLE * samples, PER_SQUARE * area / edge**2))


def expected_light(prepared: Prepared, n_lights: int) -> int:
    """Return the bytes that the light of the cells to come will take, about, at some of the light positions."""
    if not builds_cells(prepared):
        return 0
    return _expected_cells(prepared) * prepared.light_arrays.channels * n_lights * 4


def expected_table(prepared: Prepared) -> int:
    """Return the bytes of the table of cells to come, about, which stays for the whole render; 0 without cells."""
    if not builds_cells(prepared):
        return 0
    return _expected_cells(prepared) * BYTES_PER_CELL + expected_light(prepared, prepared.n_lights)


def expected_build(prepared: Prepared) -> int:
    """Return the bytes that building the cells takes at its peak, about, with the table; 0 without cells."""
    if not builds_cells(prepared):
        return 0
    samples, channels = prepared.job.indirect.samples, prepared.light_arrays.channels
    together = min(LIGHT_BLOCK, prepared.n_lights)
    direct = 4 * channels * together  # of a sample
    solved = (4 * channels + 2 * 4 * 3) * together  # of a cell: direct light, and that of two sweeps
    lit = (PLACED + direct) * samples + _expected_cells(prepared) * solved + expected_table(prepared)
    return max(DRAWN * samples, lit) + prepared.threads * PER_THREAD
