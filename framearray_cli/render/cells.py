"""The cells of an array: solved by the first run that needs them, and shared by all that render into its folder.

Images of one array must come from the same cells, bit for bit. Their digest stands in the record of each run, so a run
with others is refused when it begins, and wherever the array is summed up.
"""

from collections.abc import Callable, Sequence
from dataclasses import asdict, dataclass, fields
from pathlib import Path
from typing import TypeAlias

import numpy as np

from framearray_cli import __version__
from framearray_cli.array.celltable import (
    CAUSES,
    CellTable,
    cells_text,
    read_table,
    remedy,
    short_digest,
    write_table,
)
from framearray_cli.array.folder import ArrayFolder
from framearray_cli.array.record import RecordedRun, read_records, record_file
from framearray_cli.base.arrays import box_of
from framearray_cli.base.errors import JobError, OutputError
from framearray_cli.base.files import fingerprint
from framearray_cli.base.units import digits
from framearray_cli.engine.terms.ambient.intensity import Accuracy
from framearray_cli.engine.terms.cells.lookup import MOST_CELLS, VERSION, Cells, Grid, are_sound
from framearray_cli.job.job import Job
from framearray_cli.scene.scene import Scene

NAMES = ("slots", "other", "guard", "tint", "light", "weights", "background")  # of `Cells`, without the grid


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class SolvedCells:
    """The cells of a job with their light.

    Attributes:
        note: how far this is from the light of paths; empty where they were not compared.
        accuracy: the same in figures; None without.
        shared_s: seconds that do not grow with the number of light positions; 0 where another run solved the cells.
    """

    cells: Cells
    note: str = ""
    accuracy: Accuracy | None = None
    shared_s: float = 0.0


Solve: TypeAlias = Callable[[], SolvedCells]
Share: TypeAlias = Callable[[Solve], SolvedCells]  # `SharedCells.take`, or a call


@dataclass(frozen=True, slots=True, kw_only=True)
class SharedCells:
    """The cells in the folder of an array.

    Attributes:
        folder: to lock; `directory`: its path.
        array: fingerprint of job and scene.
        cameras: of this run, as a range.
        n_lights: of the job.
    """

    folder: ArrayFolder
    directory: Path
    array: str
    cameras: str
    n_lights: int

    def take(self, solve: Solve) -> SolvedCells:
        """Read the cells, or have them solved and keep them for others.

        No run waits for another one that solves: of two that begin together both do, and both take what was kept first.

        Raises:
            OutputError: existing images were made with other cells, or the cells cannot be kept.
        """
        if found := self._known():
            return found
        solved = solve()
        digest = cells_digest(solved.cells)
        with self.folder.exclusive():
            if found := self._known():
                return found
            self.require_same(digest)
            write_table(self.directory, _to_table(solved, self._key, digest))
        return solved

    def require_same(self, digest: str) -> None:
        """Refuse other cells than existing images or running renders have; enter it within `exclusive`.

        Raises:
            OutputError: they differ.
        """
        runs = self._runs()
        last = {record_file(self.directory, run.cameras).stem: run for run in runs}
        others = {lock.stem for lock in self.folder.other_locks()} - {record_file(self.directory, self.cameras).stem}
        bound = [*(run for run in runs if run.rays), *(run for stem, run in last.items() if stem in others)]
        if other := next((run for run in bound if run.cells != digest), None):
            raise OutputError(
                f"{self.directory}: expected the cells of the images that are there, got others: {cells_text(other)} "
                f"there, {short_digest(digest)} now; {CAUSES}; render the rest where those images were rendered, or "
                f"{remedy(other)}"
            )

    @property
    def _key(self) -> str:
        return fingerprint(self.array.encode(), __version__.encode(), str(VERSION).encode())

    def _known(self) -> SolvedCells | None:
        """Return the cells in the folder; None if there are none that fit the images."""
        table = read_table(self.directory, self._key)
        if table is None or any(run.rays and run.cells != table.digest for run in self._runs()):
            return None
        return _from_table(table, self.n_lights)

    def _runs(self) -> Sequence[RecordedRun]:
        return read_records(self.directory, self.array).runs


def _to_table(solved: SolvedCells, key: str, digest: str) -> CellTable:
    cells = solved.cells
    numbers = {name: getattr(cells, name) for name in NAMES}
    numbers |= {"edge": np.array([cells.grid.edge]), "jitter": cells.grid.jitter}
    accuracy = asdict(solved.accuracy) if solved.accuracy else {}
    return CellTable(key=key, digest=digest, note=solved.note, accuracy=accuracy, numbers=numbers)


def _from_table(table: CellTable, n_lights: int) -> SolvedCells | None:
    """Return the cells of a table; None if they do not have the digest that it says, or kernels could not read them."""
    numbers = dict(table.numbers)
    if {*NAMES, "edge", "jitter"} - numbers.keys() or numbers["edge"].shape != (1,):
        return None
    grid = Grid(edge=float(numbers["edge"][0]), jitter=numbers["jitter"])
    cells = Cells(grid=grid, **{name: numbers[name] for name in NAMES})
    if not are_sound(cells, n_lights) or cells_digest(cells) != table.digest:
        return None
    known = {field.name for field in fields(Accuracy)} == {*table.accuracy}
    return SolvedCells(cells=cells, note=table.note, accuracy=Accuracy(**table.accuracy) if known else None)


def table_bytes(cells: Cells, n_lights: int) -> int:
    """Return the size of the file of some cells, if they had that many light positions."""
    rest = sum(getattr(cells, name).nbytes for name in NAMES if name != "light")
    return int(rest + cells.light[:, :, :1].nbytes * n_lights)


def cells_digest(cells: Cells | None) -> str:
    """Hash the cells that indirect light is read from, with their light; empty without cells."""
    if cells is None:
        return ""
    return fingerprint(*(np.ascontiguousarray(a).data for a in (cells.slots, cells.other, cells.tint, cells.light)))


def extent(scene: Scene) -> float:
    """Return the longest side of the box around the scene, scene units."""
    return float(np.ptp(box_of(scene.corners).astype(np.float64), axis=0).max())


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
