"""Find the triangles that can be rendered: finite, with an area, and not repeated."""

import numpy as np
from numpy.typing import NDArray

from framearray_cli.base.arrays import Corners, Float64

from .vectors import Mask, are_finite, cross, largest

Keys = NDArray[np.uint64]

# A triangle lower than this share of its longest side is narrower than float32 resolves its corners: its normal would
# be noise.
SLIVER = 2.0**-23


def is_finite(corners: Float64) -> Mask:
    """(n,) whether all corners of a triangle are finite."""
    return are_finite(corners.reshape(len(corners), -1))


def has_area(corners: Float64 | Corners) -> Mask:
    """(n,) whether a triangle is more than a line, at any scale of the scene.

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
    """(n,) whether an earlier triangle of the same group has the same three corners, in any order.

    Args:
        corners: (n, 3, 3) positions.
        group: (n,) only triangles of the same group are compared.
    """
    hashes = _corner_hashes(corners)  # (n, 3)
    keys = hashes[:, 0] + hashes[:, 1] + hashes[:, 2] + _mix(group.astype(np.uint64))
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
        return _mix(bits[..., 0] + _mix(bits[..., 1] + _mix(bits[..., 2])))


def hash_rows(rows: Float64) -> Keys:
    """(n,) hash of each row of numbers (n, k); 0.0 and -0.0 are the same number."""
    bits = np.ascontiguousarray(rows + 0.0).view(np.uint64)
    found = np.zeros(len(rows), np.uint64)
    with np.errstate(over="ignore"):
        for k in range(bits.shape[1]):
            found = _mix(found + bits[:, k])
    return found


def _mix(keys: Keys) -> Keys:
    """Spread 64-bit keys over all their bits (the finaliser of splitmix64)."""
    with np.errstate(over="ignore"):
        keys = (keys + np.uint64(0x9E3779B97F4A7C15)).astype(np.uint64)
        keys = (keys ^ (keys >> np.uint64(30))) * np.uint64(0xBF58476D1CE4E5B9)
        keys = (keys ^ (keys >> np.uint64(27))) * np.uint64(0x94D049BB133111EB)
        return np.asarray(keys ^ (keys >> np.uint64(31)))


def _sorted_corners(corners: Corners, hashes: Keys, rows: NDArray[np.integer]) -> Corners:
    """(r, 3, 3) corners of some triangles, in the order of their hashes."""
    order = np.argsort(hashes[rows], axis=1)
    return np.asarray(np.take_along_axis(corners[rows], order[:, :, None], axis=1))
