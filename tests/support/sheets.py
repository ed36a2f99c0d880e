"""Cut contact sheets into their images."""

import numpy as np

from framearray_cli.tools.drawing import GAP, SHEET_GREY


def blocks(codes: np.ndarray, tile: tuple[int, int]) -> list[list[np.ndarray]]:
    """Cut a sheet at its background into images: rows of columns."""
    # Letters stand above and to the left; the images end at the margins of the right and the bottom.
    covered = (np.abs(codes.astype(int) - SHEET_GREY) > 12).any(-1)
    bottom, right = np.flatnonzero(covered.any(1))[-1] + 1, np.flatnonzero(covered.any(0))[-1] + 1
    found = []
    for y in range(bottom - tile[1], 70, -tile[1] - GAP):
        row = [codes[y : y + tile[1], x : x + tile[0]] for x in range(right - tile[0], 60, -tile[0] - GAP)]
        found.append(row[::-1])
    return found[::-1]
