"""`[[sensors]]`: points at which illuminance is measured, listed, in a file or on horizontal grids."""

from math import ceil, prod
from pathlib import Path
from typing import Annotated, Any, Literal

from pydantic import Field

from framearray_cli.base.forms.table import Float3, Problems, Table, optional
from framearray_cli.base.units import FARTHEST

from .keys import MOST_EYES, GroupName
from .rowfile import AT, AXES, RowFileError, csv_rows, read_text
from .values import Direction, FileName, Point, Rectangle


class SensorTable(Table):
    """Points that receive light as a small surface there would; they are no part of the scene.

    Attributes:
        name: Name in the table of results, different for each list of sensors.
        points: Positions, in the coordinates of the scene file.
        file: CSV with the columns x, y, z instead of `points`, one point per row.
        grid: Rectangle of a horizontal grid, instead of `points`: [low, low, high, high] along the two horizontal axes,
            x and z in a scene with y up, x and y in one with z up.
        height: Height of the grid, along the up axis.
        spacing: Distance of the points of the grid, scene units, at most: equal cells fill the rectangle, with a point
            in the middle of each.
        normal: Direction that the sensors face. Any length.
        error: Standard error of the illuminance of a point that is wanted, relative to it. A point gets 8,192 samples,
            and more until the error is reached over all light positions, at most 524,288.
    """

    name: GroupName
    points: Annotated[tuple[Point, ...], Field(strict=False)] = optional(
        "by `file` or `grid`", (), {"x-words": "a list of points, 3 numbers each"}
    )
    file: FileName | None = optional("none")
    grid: Rectangle | None = optional("none")
    height: float | None = optional("none; needed by `grid`", ge=-FARTHEST, le=FARTHEST)
    spacing: float | None = optional("0.5", gt=0, le=FARTHEST)
    normal: Direction | None = optional("the scene's up axis")
    error: float = Field(default=0.01, gt=0, le=1)

    def problems(self) -> Problems:
        """Check that there are points, either listed or on a grid."""
        if bool(self.points) == (self.grid is not None):
            yield (), "expected either `points`, `file` or `grid`"
        if self.grid is None:
            stray = [key for key in ("height", "spacing") if getattr(self, key) is not None]
            yield from (((key,), "expected it only next to `grid`") for key in stray)
        elif self.height is None:
            yield ("height",), "missing; expected the height of the grid"
        elif not (self.grid[0] < self.grid[2] and self.grid[1] < self.grid[3]):
            yield ("grid",), f"expected [low, low, high, high], got {list(self.grid)}"
        elif prod(self._cells) > MOST_EYES:
            yield ("spacing",), "expected a larger one: the grid has too many points"

    @property
    def _cells(self) -> tuple[int, int]:
        """Number of cells along both axes of the grid."""
        assert self.grid is not None
        spacing, (a, b, c, d) = self.spacing or 0.5, self.grid
        return ceil((c - a) / spacing), ceil((d - b) / spacing)

    def positions(self, up: Literal["y", "z"]) -> tuple[Float3, ...]:
        """Return all points; a grid runs along x first."""
        if self.grid is None or self.height is None:
            return self.points
        (low, front, high, back), (n, m), height = self.grid, self._cells, self.height
        level = (
            (low + (i + 0.5) * (high - low) / n, front + (k + 0.5) * (back - front) / m)
            for k in range(m)
            for i in range(n)
        )
        return tuple((x, y, height) if up == "z" else (x, height, y) for x, y in level)


def read_points(path: Path) -> list[list[Any]]:
    """Read a CSV of points.

    Raises:
        RowFileError: the file is missing, has other columns or no points.
    """
    rows = csv_rows(read_text(path), {AT: AXES}, (), [(AT,)])
    if not 1 <= len(rows) <= MOST_EYES:
        raise RowFileError(f"expected 1 to {MOST_EYES} points, got {len(rows)}")
    return [row[AT] for _, row in rows]
