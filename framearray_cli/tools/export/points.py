"""Points of the scene from the depth layers, each with the cameras that see it.

Notation: u = 1 / depth. Along a plane u is linear in the image, so u bends where surfaces end, and only there.
"""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from framearray_cli.array.images.images import read_layers
from framearray_cli.array.manifest import Manifest, layers_path
from framearray_cli.base.arrays import Bytes, Float32, Float64
from framearray_cli.base.errors import OutputError

from ..places import spread_with_ends
from .selection import focal_length, rigid_pose

SOURCES = 16  # cameras that points are taken from, evenly along the path; more add the same surfaces again
# A pixel counts as smooth where u bends by less than this share of itself; two hits in a pixel, each somewhere in it,
# already bend u by a quarter of its slope.
BEND = 0.02
# A camera sees a point where depths agree to this, plus what u changes across one pixel.
AGREE = 0.005


@dataclass(frozen=True, slots=True, kw_only=True)
class Sight:
    """What one camera sees of the points.

    Attributes:
        points: (n,) index of each point that is seen, ascending.
        position: (n, 2) where, pixels from the upper left corner; the first pixel's middle is (0.5, 0.5).
    """

    points: NDArray[np.int64]
    position: Float64


@dataclass(frozen=True, slots=True, kw_only=True)
class Cloud:
    """Points and who sees them.

    Attributes:
        position: (n, 3), world.
        codes: (n, 3) sRGB.
        seen: by camera.
    """

    position: Float64
    codes: Bytes
    seen: Mapping[int, Sight]


def read_depth(manifest: Manifest, c: int) -> Float32:
    """Depth along the optical axis, scene units, (h, w); 0 where nothing is.

    Raises:
        OutputError: the layers are missing or damaged, or hold no depth.
    """
    path = layers_path(manifest, c)
    depth = read_layers(path).get("depth.Z")
    width, height = manifest.resolution
    if depth is None or depth.shape != (height, width):
        raise OutputError(f"{path}: expected a channel depth.Z of {width} x {height} pixels")
    return depth


def find_points(manifest: Manifest, cameras: Sequence[int], shown: Mapping[int, Bytes], wanted: int) -> Cloud:
    """Take pixels of some cameras into the world, and keep what another camera sees where it should be.

    Args:
        cameras: those that are handed over.
        shown: sRGB codes of the pictures of `source_cameras`, (h, w, 3).
        wanted: points, at most.

    Returns:
        Points that at least two cameras see, or one if there is only one.

    Raises:
        OutputError: layers are missing or damaged.
    """
    sources = source_cameras(cameras)
    found, codes = [], []
    for k, c in enumerate(sources):
        n = wanted * (k + 1) // len(sources) - wanted * k // len(sources)
        depth = read_depth(manifest, c)
        rows, columns = _picked(smooth(depth), n, c)
        middle = np.stack([columns, rows], -1).astype(np.float64) + 0.5
        found.append(unproject(manifest, c, middle, depth[rows, columns]))
        codes.append(shown[c][rows, columns])
    position = np.concatenate(found)
    seen = {c: _sight(manifest, c, position) for c in cameras}
    times = np.zeros(len(position), np.int64)
    for sight in seen.values():
        times[sight.points] += 1
    kept = times >= min(2, len(cameras))
    new = np.cumsum(kept) - 1  # index among those that are kept
    sights = {c: _renumbered(sight, kept, new) for c, sight in seen.items()}
    return Cloud(position=position[kept], codes=np.concatenate(codes)[kept], seen=sights)


def source_cameras(cameras: Sequence[int]) -> list[int]:
    """The cameras that points are taken from."""
    return [cameras[k] for k in spread_with_ends(len(cameras), SOURCES)]


def unproject(manifest: Manifest, c: int, position: Float64, depth: Float32) -> Float64:
    """World points at image positions (n, 2), pixels, and depths (n,): (n, 3)."""
    pose, focal = rigid_pose(manifest, c), focal_length(manifest, c)
    width, height = manifest.resolution
    z = depth.astype(np.float64)
    x = (position[:, 0] - width / 2) / focal * z
    y = (height / 2 - position[:, 1]) / focal * z
    return np.asarray(np.stack([x, y, -z], -1) @ pose[:3, :3].T + pose[:3, 3])


def project(manifest: Manifest, c: int, points: Float64) -> tuple[Float64, Float64]:
    """Image positions (n, 2), pixels, and depths (n,) of world points; a position means nothing at depth 0 or less."""
    pose, focal = rigid_pose(manifest, c), focal_length(manifest, c)
    width, height = manifest.resolution
    x, y, back = ((points - pose[:3, 3]) @ pose[:3, :3]).T
    ahead = np.where(back < 0, -back, 1.0)
    return np.stack([width / 2 + focal * x / ahead, height / 2 - focal * y / ahead], -1), -back


def smooth(depth: Float32) -> NDArray[np.bool_]:
    """Pixels (h, w) on a surface that goes on on all sides; none at the border."""
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


def _picked(usable: NDArray[np.bool_], n: int, c: int) -> tuple[NDArray[np.int64], NDArray[np.int64]]:
    """Rows and columns of n pixels at most; the same ones for each export of a camera."""
    pixels = np.flatnonzero(usable)
    if len(pixels) > n:
        pixels = np.sort(np.random.default_rng(c).choice(pixels, n, replace=False))
    rows, columns = np.divmod(pixels, usable.shape[1])
    return rows, columns


def _sight(manifest: Manifest, c: int, points: Float64) -> Sight:
    """Which points camera c sees: those that lie where its own depths say, on a smooth surface."""
    depth = read_depth(manifest, c)
    flat, u = smooth(depth), _inverse(depth)
    position, away = project(manifest, c, points)
    height, width = depth.shape
    # the four pixels whose middles lie around each point, all of them inside the image
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
    return Sight(points=seen, position=position[seen])


def _renumbered(sight: Sight, kept: NDArray[np.bool_], new: NDArray[np.int64]) -> Sight:
    own = kept[sight.points]
    return Sight(points=new[sight.points[own]], position=sight.position[own])
