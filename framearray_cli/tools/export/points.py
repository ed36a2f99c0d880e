"""A point cloud of the scene from the depth layers, with the cameras that see each point.

Notation: u = 1 / depth. On a plane u is linear in image position, so u bends only where surfaces end or curve.
"""

from collections.abc import Mapping, Sequence

import numpy as np
from numpy.typing import NDArray

from framearray_cli.array.images import read_channels
from framearray_cli.array.manifest import Manifest, layers_path
from framearray_cli.base.arrays import Bytes, Float32, Float64

from ..axes import evenly_spaced
from .format import Observations, PointCloud, rigid_pose

SOURCES = 16  # cameras that points are taken from, evenly along the path; more would add the same surfaces
# A pixel counts as smooth where u bends by at most this share of itself. With two random hits per pixel u bends by a
# quarter of its slope already.
BEND = 0.02
# A camera sees a point if 1 / depth agrees to this share, plus the change of u across one pixel.
AGREE = 0.005


def read_depth(manifest: Manifest, c: int) -> Float32:
    """Read the depth along the optical axis, of a panorama the distance, scene units, (h, w); 0 where nothing is."""
    return read_channels(layers_path(manifest, c), ["depth.Z"], manifest.resolution)[..., 0]


def find_points(manifest: Manifest, cameras: Sequence[int], colours: Mapping[int, Bytes], wanted: int) -> PointCloud:
    """Unproject pixels of some cameras, and keep the points that another camera sees as well.

    Args:
        cameras: that are exported.
        colours: sRGB codes (h, w, 3) of the pictures of `source_cameras`.
        wanted: the number of points, at most.

    Returns:
        The points that at least two cameras see, or one camera if there is only one.
    """
    sources = source_cameras(cameras)
    found, codes = [], []
    for k, c in enumerate(sources):
        n = wanted * (k + 1) // len(sources) - wanted * k // len(sources)
        depth = read_depth(manifest, c)
        rows, columns = _pick_pixels(smooth_pixels(depth), n, c)
        middle = np.stack([columns, rows], -1).astype(np.float64) + 0.5
        pose, (origin, way) = rigid_pose(manifest, c), manifest.cameras[c].lens.rays(manifest.resolution, middle)
        points = origin + depth[rows, columns].astype(np.float64)[:, None] * way
        found.append(points @ pose[:3, :3].T + pose[:3, 3])
        codes.append(colours[c][rows, columns])
    position = np.concatenate(found)
    seen = {c: _observe(manifest, c, position) for c in cameras}
    n_seeing = np.bincount(np.concatenate([indices for indices, _ in seen.values()]), minlength=len(position))
    kept = n_seeing >= min(2, len(cameras))
    new = np.cumsum(kept) - 1  # index among the kept points
    for c, (indices, places) in seen.items():
        own = kept[indices]
        seen[c] = (new[indices[own]], places[own])
    return PointCloud(position=position[kept], codes=np.concatenate(codes)[kept], observations=seen)


def source_cameras(cameras: Sequence[int]) -> list[int]:
    """Choose the cameras that points are taken from."""
    return [cameras[k] for k in evenly_spaced(len(cameras), SOURCES)]


def smooth_pixels(depth: Float32) -> NDArray[np.bool_]:
    """Find the pixels (h, w) whose surface continues on all sides; none at the border."""
    u = _inverse(depth)
    middle = u[1:-1, 1:-1]
    flat = np.zeros(depth.shape, bool)
    across = np.abs(u[1:-1, :-2] - 2 * middle + u[1:-1, 2:])
    down = np.abs(u[:-2, 1:-1] - 2 * middle + u[2:, 1:-1])
    there = depth > 0
    around = there[1:-1, :-2] & there[1:-1, 2:] & there[:-2, 1:-1] & there[2:, 1:-1] & there[1:-1, 1:-1]
    flat[1:-1, 1:-1] = around & (np.maximum(across, down) <= BEND * middle)
    return flat


def _inverse(depth: Float32) -> Float64:
    return np.where(depth > 0, 1 / np.where(depth > 0, depth, 1).astype(np.float64), 0.0)


def _pick_pixels(usable: NDArray[np.bool_], n: int, c: int) -> tuple[NDArray[np.int64], NDArray[np.int64]]:
    """Pick at most n pixels, the same in each export of a camera; return their rows and columns."""
    pixels = np.flatnonzero(usable)
    if len(pixels) > n:
        pixels = np.sort(np.random.default_rng(c).choice(pixels, n, replace=False))
    rows, columns = np.divmod(pixels, usable.shape[1])
    return rows, columns


def _observe(manifest: Manifest, c: int, points: Float64) -> Observations:
    """Find the points that camera c sees: those that agree with its own depths, on a smooth surface."""
    depth = read_depth(manifest, c)
    flat, u = smooth_pixels(depth), _inverse(depth)
    pose, lens = rigid_pose(manifest, c), manifest.cameras[c].lens
    # in pixels, void at depth 0 or less
    position, away = lens.project(manifest.resolution, (points - pose[:3, 3]) @ pose[:3, :3])
    height, width = depth.shape
    # the four pixels whose middles surround each point, if all are inside the image
    corner = np.floor(position - 0.5)
    inside = (away > 0) & (corner >= 0).all(-1) & (corner[:, 0] < width - 1) & (corner[:, 1] < height - 1)
    index = np.flatnonzero(inside)
    column, row = corner[index].astype(np.int64).T
    s, t = (position[index] - 0.5 - corner[index]).T
    four = np.stack([u[row, column], u[row, column + 1], u[row + 1, column], u[row + 1, column + 1]])
    usable = np.stack([flat[row, column], flat[row, column + 1], flat[row + 1, column], flat[row + 1, column + 1]])
    there = (1 - t) * ((1 - s) * four[0] + s * four[1]) + t * ((1 - s) * four[2] + s * four[3])
    change = four.max(0) - four.min(0)
    agrees = np.abs(1 / away[index] - there) <= AGREE * there + change
    seen = index[usable.all(0) & agrees]
    return seen, position[seen]
