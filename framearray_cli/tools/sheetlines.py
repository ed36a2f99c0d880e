"""How images lie on a contact sheet: a row per light position, or the light positions of one camera line by line."""

from collections.abc import Sequence
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from framearray_cli.base.errors import JobError


class SheetLines(NamedTuple):
    """The lines of a sheet.

    Attributes:
        columns: a number over each column, or none.
        noun: before these numbers.
        labels: one per line; none on sheets without.
        per_line: images per line, where lines hold the light positions of one camera; else None.
        n_columns: images per line.
    """

    columns: Sequence[int]
    noun: str
    labels: Sequence[str]
    per_line: int | None
    n_columns: int

    def arrange(self, tiles: NDArray[Any], blank: int) -> NDArray[Any]:
        """Put tiles in lines: (rows, columns, h, w, 3) -> (lines, n_columns, h, w, 3).

        Args:
            blank: fills what is left of the last line.
        """
        if self.per_line is None:
            return tiles
        n, n_lines = len(tiles), -(-len(tiles) // self.per_line)
        padded = np.full((n_lines * self.per_line, *tiles.shape[2:]), blank, tiles.dtype)
        padded[:n] = tiles[:, 0]
        return padded.reshape(n_lines, self.per_line, *tiles.shape[2:])


def lay_out(cameras: Sequence[int], lights: Sequence[int], names: Sequence[str], most: int | None) -> SheetLines:
    """Lay out the images of some cameras and light positions.

    Args:
        names: of the light positions; none on sheets without labels.
        most: images per line of a sheet of one camera; None: a column per camera.

    Raises:
        JobError: there are several cameras, but one is needed.
    """
    if most is None:
        return SheetLines(cameras, "camera ", names, None, len(cameras))
    if len(cameras) > 1:
        raise JobError("--wrap", [f"expected one camera position, got {len(cameras)}; give one with --cameras"])
    per_line = min(most, len(lights))
    step = lights[1] - lights[0] if len(lights) > 1 else 1
    even = step > 0 and list(lights) == list(range(lights[0], lights[-1] + 1, step))
    columns = [k * step for k in range(per_line)] if even else []  # each so far from the first of its line
    return SheetLines(columns, "+", names[::per_line], per_line, per_line)
