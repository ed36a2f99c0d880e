"""Selection of the triangles that can be traced: finite, with an area, and not repeated."""

from collections.abc import Mapping, Sequence

import numpy as np
from numpy.typing import NDArray

from framearray_cli.base.arrays import Corners, Float64
from framearray_cli.base.errors import SceneError

from .files import Material
from .merge import Merged
from .vectors import Keys, Mask, are_finite, cross, largest, mix, rows_of

# A triangle lower than this share of its longest side is narrower than float32 resolves its corners: its normal would
# be noise.
SLIVER = 2.0**-23


def is_finite(corners: Float64) -> Mask:
    """(n,) True if all corners of a triangle are finite."""
    return are_finite(corners.reshape(len(corners), -1))


def has_area(corners: Float64 | Corners) -> Mask:
    """(n,) True if a triangle is more than a line, at any scale of the scene.

    Args:
        corners: (n, 3, 3) finite positions.
    """
    # float64 holds differences and products of float32 coordinates exactly, so flat means flat
    with np.errstate(all="ignore"):  # a triangle beyond the range of float64 compares false, and is left out
        first = corners[:, 1].astype(np.float64) - corners[:, 0]
        second = corners[:, 2].astype(np.float64) - corners[:, 0]
        longest = np.maximum(largest(first), largest(second))
        scale = 1.0 / np.where(longest > 0, longest, 1.0)
        area = cross(first * scale[:, None], second * scale[:, None])
    return np.asarray((longest > 0) & (largest(area) > SLIVER))


def is_repeated(corners: Corners, group: NDArray[np.integer]) -> Mask:
    """(n,) True if an earlier triangle of the same group has the same three corners, in any order.

    Args:
        corners: (n, 3, 3) positions.
        group: (n,) only triangles of the same group are compared.
    """
    hashes = _corner_hashes(corners)  # (n, 3)
    keys = hashes[:, 0] + hashes[:, 1] + hashes[:, 2] + mix(group.astype(np.uint64))
    found = np.zeros(len(keys), dtype=np.bool_)
    ordered = np.sort(keys)
    if not (ordered[1:] == ordered[:-1]).any():  # as in most scenes
        return found
    order = np.argsort(keys, kind="stable")
    new = np.ones(len(keys), dtype=np.bool_)
    new[1:] = keys[order][1:] != keys[order][:-1]
    first = order[new][np.cumsum(new) - 1]  # the earliest triangle with the same key
    again, earlier = order[~new], first[~new]
    # equal keys almost always mean equal corners; the corners themselves decide
    same = (_sorted_corners(corners, hashes, again) == _sorted_corners(corners, hashes, earlier)).all(axis=(1, 2))
    same &= group[again] == group[earlier]
    found[again[same]] = True
    return found


def _corner_hashes(corners: Corners) -> Keys:
    """(n, 3) hash of each corner's position; 0.0 and -0.0 are the same place."""
    bits = np.ascontiguousarray(corners + np.float32(0.0)).view(np.uint32).astype(np.uint64)
    with np.errstate(over="ignore"):
        return mix(bits[..., 0] + mix(bits[..., 1] + mix(bits[..., 2])))


def _sorted_corners(corners: Corners, hashes: Keys, rows: NDArray[np.integer]) -> Corners:
    """(r, 3, 3) corners of some triangles, in the order of their hashes."""
    order = np.argsort(hashes[rows], axis=1)
    return np.asarray(np.take_along_axis(corners[rows], order[:, :, None], axis=1))


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


def is_glass(merged: Merged, materials: Sequence[Material]) -> NDArray[np.bool_]:
    """(n,) True if each triangle of all parts is thin glass."""
    glass = np.array([material.glass is not None for material in materials], np.bool_)
    return np.asarray(glass[merged.material])


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
