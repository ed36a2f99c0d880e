"""Lamps that eyes see: the shapes of sources, drawn into composed images.

A lamp hides nothing, so its radiance is added to what lies behind it: sums of light positions stay right, and what
mirrors show follows the same rule. A pixel that may show a lamp gets SAMPLES eye rays; they are traced once, whatever
the number of light positions, and followed over mirrors. What they meet of each shape is a formula.
"""

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any, TypeAlias

import numpy as np
from numpy.typing import NDArray

from framearray_cli.base.arrays import Flags, Float32, Float64, Images, Int32
from framearray_cli.scene.paths.lightpath import LightPath

from ..frames.bounces import mirror_flags
from ..frames.pool import TracePool
from ..frames.setup import FrameSetup, Scratch
from ..hits.aiming import ray_origins
from ..hits.glass import transmission_along
from ..hits.hits import ESCAPED, SURFACE, Hits
from ..hits.native import PixelSamples, extra_hits
from ..inputs.cameras import is_orthographic, picture_rays, pixel_width
from ..inputs.panes import PaneArrays, has_panes
from ..terms.bounces import reflect
from .band import HALF_MAX

SAMPLES = 16  # eye rays per pixel at the edge of a lamp
ROUND = 1.0  # pixels by which a lamp's outline is widened before pixels are chosen


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class Paths:
    """Straight parts of eye paths: n rays.

    Attributes:
        origin: (n, 3) or (3,), centred.
        direction: (n, 3) unit.
        reach: (n,) distance to the surface that they meet; infinite where they meet none.
        tint: (n, 3) product of the mirrors before.
        number: (n,) number of the eye ray.
    """

    origin: Float64
    direction: Float64
    reach: Float64
    tint: Float32
    number: Int32


class Lamps:
    """The visible sources in the picture of an eye."""

    def __init__(
        self, setup: FrameSetup, sources: Sequence[LightPath], centre: Float64, planes: range, c: int, pool: TracePool
    ) -> None:
        """Find the pixels of eye c that may show them.

        Args:
            centre: of the scene.
            planes: image planes.
        """
        self._setup, self._centre, self._planes, self._c, self._pool = setup, centre, planes, c, pool
        self._lit = [(s, k) for s in sources for k, l in enumerate(planes) if s.intensity[l].any()]
        self._pixels, self._inside = _pixels_of(setup, c, [(s, planes[k]) for s, k in self._lit], centre, pool)

    def draw(self, images: Images, rows: range) -> int:
        """Add them to some rows of the images.

        Args:
            images: (n_planes, len(rows), width, 3), float32 or float16.

        Returns:
            the number of values beyond the largest half, if images are halves; they are cut to it.
        """
        setup, pixels, pool = self._setup, self._pixels, self._pool
        samples = PixelSamples(setup.seed, pixels, SAMPLES, 0)
        row, place = pixels // setup.cams.width, pixels - rows.start * setup.cams.width
        shown = (row >= rows.start) & (row < rows.stop)

        def draw_batch(first: int, scratch: Scratch) -> int:
            n = min(pool.batch, len(pixels) * SAMPLES - first)
            at = slice(first // SAMPLES, (first + n) // SAMPLES)
            if not shown[at].any():
                return 0
            extra_hits(setup.cams, self._c, samples, first, n, setup.world, scratch.hit_rays.packets, scratch.hits)
            scratch.rays["native"] += n
            parts, beyond = _follow(setup, self._c, n, scratch), 0
            for i, (source, k) in enumerate(self._lit):
                seen = np.zeros((n, 3), np.float32)
                for bounce, part in enumerate(parts):
                    own = np.repeat(self._inside[i, at], SAMPLES)
                    which = np.flatnonzero(own) if bounce == 0 else np.arange(len(part.number))
                    if len(which):
                        _add(seen, part, which, source, self._planes[k], self._centre, setup.world.panes)
                if seen.any():
                    light = seen.reshape(-1, SAMPLES, 3).mean(axis=1)
                    beyond += _put(images[k].reshape(-1, 3), place[at][shown[at]], light[shown[at]])
            return beyond

        return sum(pool.run(draw_batch, range(0, len(pixels) * SAMPLES, pool.batch)))


def _add(
    seen: Float32, part: Paths, rows: NDArray[Any], source: LightPath, l: int, centre: Float64, panes: PaneArrays
) -> None:
    """Add what some rays of a part see of a source, through glass, to the light of their eye rays."""
    origin = part.origin if part.origin.ndim == 1 else part.origin[rows]
    found = radiance_along(source, l, centre, origin, part.direction[rows], part.reach[rows])
    lit = np.flatnonzero(found.any(axis=1))
    if has_panes(panes) and len(lit):
        start = np.broadcast_to(origin, (len(rows), 3))[lit]
        far = np.full(len(lit), np.inf) if source.kind == "directional" else _away(source, l, centre, start)
        reach = np.minimum(far, part.reach[rows][lit])
        found[lit] *= transmission_along(start, part.direction[rows][lit], reach, panes)[0]
    seen[part.number[rows]] += found * part.tint[rows]  # a part has at most one ray of each eye ray


def _away(source: LightPath, l: int, centre: Float64, start: Float64) -> Float64:
    """Distance of the middle of a lamp from some points."""
    return np.asarray(np.linalg.norm(source.vector[l] - centre - start, axis=1))


def _put(image: Float32, pixels: Int32, light: Float32) -> int:
    """Add light to pixels; return the number of values that halves cannot hold, which are cut."""
    total = image[pixels].astype(np.float32) + light
    if image.dtype != np.float16:
        image[pixels] = total
        return 0
    image[pixels] = np.minimum(total, HALF_MAX)
    return int((total > HALF_MAX).sum())


def _pixels_of(
    setup: FrameSetup, c: int, lit: Sequence[tuple[LightPath, int]], centre: Float64, pool: TracePool
) -> tuple[Int32, Flags]:
    """Choose the pixels of eye c that may show a lamp.

    Args:
        lit: sources and the light positions at which they are wanted.

    Returns:
        the pixels, and for each lamp whether they may show it without mirrors, (n_lit, n_pixels).
    """
    cams = setup.cams
    origin, rays = picture_rays(cams, c)
    margin, eye = ROUND * pixel_width(cams, c), cams.position[c].astype(np.float64)
    inside = np.empty((len(lit), setup.n_pixels), np.bool_)
    for row, (source, l) in zip(inside, lit, strict=True):
        if is_orthographic(cams, c) and source.kind != "directional":
            middle, radius = sphere_of(source, l, centre)
            way = middle - origin
            across = way - (way @ cams.forward[c])[:, None] * cams.forward[c]
            row[:] = np.linalg.norm(across, axis=1) <= radius + margin
            continue
        way, angle = bound_of(source, l, centre, eye)
        widest = min(angle + (0.0 if is_orthographic(cams, c) else margin), np.pi)
        row[:] = rays @ way.astype(np.float32) >= np.float32(np.cos(widest) - 1e-6)
    wanted = inside.any(axis=0)
    if setup.depth:
        wanted |= mirror_flags(setup, c, pool) > 0
    pixels = np.flatnonzero(wanted).astype(np.int32)
    return pixels, inside[:, pixels]


def _follow(setup: FrameSetup, c: int, n: int, scratch: Scratch) -> list[Paths]:
    """Follow eye rays 0 to n - 1, which found the hits of the scratch, over mirrors; return their straight parts."""
    hits = scratch.hits
    eye = ray_origins(setup.cams, c, hits, n).astype(np.float64)
    tint, number = np.ones((n, 3), np.float32), np.arange(n, dtype=np.int32)
    parts = [_part(hits, n, eye[0] if len(eye) == 1 else eye, tint, number)]
    for bounce in range(setup.depth):
        mirrors = (hits.kind[:n] == SURFACE) & (hits.specular[:n] > 0).any(axis=1)
        if not mirrors.any():
            break
        origin = hits.position[:n][mirrors].astype(np.float64)
        reflected, next_tint = scratch.reflected[bounce % 2], scratch.throughput[bounce % 2]
        n = reflect(hits, n, tint, setup.world, scratch.hit_rays.packets, reflected, next_tint)
        hits, tint, number = reflected, next_tint[:n].copy(), number[mirrors]
        scratch.rays["mirror"] += n
        parts.append(_part(hits, n, origin, tint, number))
    return parts


def _part(hits: Hits, n: int, origin: Float64, tint: Float32, number: Int32) -> Paths:
    """The rays that found hits 0 to n - 1."""
    direction = hits.incoming[:n].astype(np.float64)
    direction /= np.linalg.norm(direction, axis=1, keepdims=True)
    reach = ((hits.position[:n] - origin) * direction).sum(axis=1)
    reach[hits.kind[:n] == ESCAPED] = np.inf
    return Paths(origin=origin, direction=direction, reach=reach, tint=tint, number=number)


# A lamp that lies on a wall, or is set into it up to its surface, is seen: of the distance of the wall.
FLUSH = 1e-4

Bound: TypeAlias = tuple[Float64, float]  # unit direction, and the angle about it that holds the whole source


def bound_of(source: LightPath, l: int, centre: Float64, eye: Float64) -> Bound:
    """The cone in which an eye sees a source at position l."""
    if source.kind == "directional":
        assert source.size is not None
        return -source.vector[l], float(np.radians(source.size[l]) / 2)
    way = source.vector[l] - centre - eye
    distance = float(np.linalg.norm(way))
    radius = _radius(source, l)
    if distance <= radius:
        return np.array([0.0, 0.0, 1.0]), np.pi
    return way / distance, float(np.arcsin(radius / distance))


def sphere_of(source: LightPath, l: int, centre: Float64) -> tuple[Float64, float]:
    """Middle, centred, and radius of a sphere that holds a source at position l."""
    return np.asarray(source.vector[l] - centre), _radius(source, l)


def _radius(source: LightPath, l: int) -> float:
    """Radius of the sphere about the middle of a source that contains it."""
    if source.panel is not None:
        return float(np.linalg.norm(source.panel.sides[l]) / 2)
    assert source.size is not None
    return float(source.size[l])


def radiance_along(
    source: LightPath, l: int, centre: Float64, origin: Float64, direction: Float64, reach: Float64
) -> Float32:
    """The radiance of a source at position l along rays, (n, 3); 0 where they miss it, or meet a surface before it.

    Args:
        origin: (n, 3) or (3,), centred.
        direction: (n, 3) unit.
        reach: (n,) distance of the surface that each ray meets.
    """
    if source.kind == "directional":
        assert source.size is not None
        half = np.radians(source.size[l]) / 2
        seen = np.isinf(reach) & (direction @ -source.vector[l] >= np.cos(half))
        share, area = np.asarray(seen, np.float64), np.pi * np.sin(half) ** 2
    elif source.panel is not None:
        share, area = _of_panel(source, l, centre, origin, direction, reach), source.panel.area[l]
    else:
        share, area = _of_sphere(source, l, centre, origin, direction, reach), np.pi * _radius(source, l) ** 2
    strength = source.intensity[l] / area if area > 0 else np.zeros(3)
    return np.asarray(share[:, None] * strength, np.float32)


def _of_panel(
    source: LightPath, l: int, centre: Float64, origin: Float64, direction: Float64, reach: Float64
) -> Float64:
    """1 where rays meet a bright side of a rectangle or disc, else 0."""
    panel = source.panel
    assert panel is not None
    axis, (a, b) = panel.axis[l], (half[l] for half in panel.half_axes)
    way, slope = source.vector[l] - centre - origin, direction @ axis
    with np.errstate(divide="ignore", invalid="ignore", over="ignore"):
        t = (way @ axis) / slope
        place = t[:, None] * direction - way
        u, v = (place @ side / (side @ side) for side in (a, b))
        within = u * u + v * v <= 1 if panel.shape == "disc" else (np.abs(u) <= 1) & (np.abs(v) <= 1)
    faces = (slope != 0) if panel.two_sided else (slope < 0)
    return np.asarray(within & faces & (t > 0) & (t <= reach * (1 + FLUSH)), np.float64)


def _of_sphere(
    source: LightPath, l: int, centre: Float64, origin: Float64, direction: Float64, reach: Float64
) -> Float64:
    """The share of a sphere's radiance that rays see of it: 1 or 0, and of a spot its falloff."""
    way, radius = source.vector[l] - centre - origin, _radius(source, l)
    along = (direction * way).sum(axis=1)
    aside = (way * way).sum(axis=-1) - along * along  # squared distance of the centre from the ray
    outside = (way * way).sum(axis=-1) > radius * radius
    t = along - np.sqrt(np.maximum(radius * radius - aside, 0.0))
    seen = outside & (aside <= radius * radius) & (t > 0) & (t <= reach * (1 + FLUSH))
    if source.cone is None:
        return np.asarray(seen, np.float64)
    inner, outer = np.cos(np.radians(source.cone.angles_deg[l]))
    cosine = -(direction @ source.cone.axis[l])
    edge = np.clip((cosine - outer) / max(inner - outer, 1e-3 * (1 - outer)), 0.0, 1.0)
    return np.asarray(seen * edge**2)
