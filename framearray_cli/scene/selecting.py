"""Which triangles of a file stay: those that can be traced, and hide nothing twice."""

from collections.abc import Mapping, Sequence

import numpy as np
from numpy.typing import NDArray

from framearray_cli.base.arrays import Corners, Float64
from framearray_cli.base.errors import SceneError

from .cleaning import has_area, is_finite, is_repeated
from .files import Material
from .merge import Merged
from .panes import is_glass
from .vectors import rows_of

# Between these sizes tracing was measured to be right. Far below, float32 is denormal; far above, rays hit nothing.
SMALLEST_SCENE, LARGEST_SCENE = 1e-12, 1e12


def select_triangles(
    merged: Merged, materials: Sequence[Material], dropped: dict[str, int], notes: Sequence[str]
) -> tuple[NDArray[np.int64], Float64, Corners]:
    """Select the triangles that stay, and centre them.

    Args:
        merged: all triangles of the file.
        materials: indexed by `merged.material`.
        dropped: gets the reasons and numbers of triangles left out.
        notes: repeated in the error when nothing stays.

    Returns:
        Rows of `merged` that stay, opaque ones first; the centre (3,); their corners (n, 3, 3), centred.

    Raises:
        SceneError: nothing stays, or a size that cannot be traced.
    """
    rows = np.flatnonzero(~is_glass(merged, materials))
    if not len(rows):
        raise SceneError("no triangle is left to render: all of them are thin glass")
    rows = _drop(rows, ~is_finite(rows_of(merged.corners, rows)), "non-finite", dropped)
    for reason in sorted({material.left_out for material in materials} - {""}):
        absent = np.array([material.left_out == reason for material in materials])
        rows = _drop(rows, absent[merged.material[rows]], reason, dropped)
    rows = _drop(rows, ~has_area(rows_of(merged.corners, rows)), "degenerate", dropped)
    _check_left(rows, dropped, notes)
    left = rows_of(merged.corners, rows)
    # axis by axis: numpy takes ten times as long for the bounds of all three at once
    low, high = (np.array([bound(left[..., axis]) for axis in range(3)]) for bound in (np.min, np.max))
    centre = low / 2 + high / 2
    size = float((high / 2 - low / 2).max()) * 2
    if not SMALLEST_SCENE <= size <= LARGEST_SCENE:
        raise SceneError(
            f"the scene is {size:.3g} units wide; expected {SMALLEST_SCENE:g} to {LARGEST_SCENE:g}; scale the model"
        )
    corners = (left - centre).astype(np.float32)
    flat = ~has_area(corners)
    rows, corners = _drop(rows, flat, "degenerate", dropped), rows_of(corners, np.flatnonzero(~flat))
    cutoff = np.array([material.alpha_cutoff for material in materials])
    masked = cutoff[merged.material[rows]] != 0
    order = np.argsort(masked, kind="stable")
    rows, corners, masked = rows[order], rows_of(corners, order), masked[order]
    # of coinciding opaque triangles one hides the others, of any material; a cut-out one lets others show
    again = is_repeated(corners, np.where(masked, merged.material[rows] + 1, 0))
    rows, corners = _drop(rows, again, "duplicate", dropped), rows_of(corners, np.flatnonzero(~again))
    _check_left(rows, dropped, notes)
    return rows, centre, corners


def _drop(rows: NDArray[np.int64], bad: NDArray[np.bool_], reason: str, dropped: dict[str, int]) -> NDArray[np.int64]:
    count = int(bad.sum())
    if count:
        dropped[reason] = dropped.get(reason, 0) + count
    return rows[~bad] if count else rows


def _check_left(rows: NDArray[np.int64], dropped: Mapping[str, int], notes: Sequence[str]) -> None:
    if len(rows) == 0:
        found = "; ".join((dropped_text(dropped), *notes))
        raise SceneError(f"no triangle is left to render: {found}")


def dropped_text(dropped: Mapping[str, int]) -> str:
    """The numbers of triangles left out, with the reasons."""
    return ", ".join(f"{count} {reason}" for reason, count in dropped.items())
