"""Shapes of visible sources: the radiance that rays see of them."""

from typing import TypeAlias

import numpy as np

from framearray_cli.base.arrays import Float32, Float64
from framearray_cli.scene.paths.lightpath import LightPath

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
    """Of the sphere about the middle of a source that holds it."""
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
        within = u * u + v * v <= 1 if panel.round else (np.abs(u) <= 1) & (np.abs(v) <= 1)
    faces = (slope != 0) if panel.two_sided else (slope < 0)
    return np.asarray(within & faces & (t > 0) & (t <= reach * (1 + FLUSH)), np.float64)


def _of_sphere(
    source: LightPath, l: int, centre: Float64, origin: Float64, direction: Float64, reach: Float64
) -> Float64:
    """The share of a sphere's radiance that rays see of it: 1 or 0, and of a spot its falloff."""
    way, radius = source.vector[l] - centre - origin, _radius(source, l)
    along = (direction * way).sum(axis=1)
    beside = (way * way).sum(axis=-1) - along * along  # squared distance of the centre from the ray
    outside = (way * way).sum(axis=-1) > radius * radius
    t = along - np.sqrt(np.maximum(radius * radius - beside, 0.0))
    seen = outside & (beside <= radius * radius) & (t > 0) & (t <= reach * (1 + FLUSH))
    if source.cone is None:
        return np.asarray(seen, np.float64)
    inner, outer = np.cos(np.radians(source.cone.angles_deg[l]))
    cosine = -(direction @ source.cone.axis[l])
    edge = np.clip((cosine - outer) / max(inner - outer, 1e-3 * (1 - outer)), 0.0, 1.0)
    return np.asarray(seen * edge**2)
