"""Lenses as the slow twin sees them: rays through image positions, image positions of points, densities of hits.

Axes are position, right, up and forward of an eye; `size` is width and height in pixels.
"""

from typing import Any

import numpy as np

from support.oracle_scene import Points, dot


def focal(lens: Any, size: Any) -> tuple[Any, Any]:
    """Pixels per unit at depth 1, of an orthographic camera at all depths, and where the axis meets the picture."""
    (width, height), longer = size, max(size)
    tall = lens.height if lens.type == "orthographic" else 2 * np.tan(np.radians(lens.fov) / 2)
    f_y = height / tall
    centre = width / 2 - lens.shift[0] * longer, height / 2 + lens.shift[1] * longer
    return (f_y / lens.pixel_aspect, f_y), centre


def rays(lens: Any, size: Any, axes: Any, xy: Any) -> tuple[Any, Any]:
    """Origins and directions of rays through image positions (n, 2), pixels from the top left."""
    position, right, up, forward = axes
    if lens.type == "panorama":
        around, lift = 2 * np.pi * (xy[:, :1] / size[0] - 0.5), np.pi * (0.5 - xy[:, 1:] / size[1])
        dirs = np.cos(lift) * (np.sin(around) * right + np.cos(around) * forward) + np.sin(lift) * up
        return np.broadcast_to(position, dirs.shape), dirs
    (f_x, f_y), (c_x, c_y) = focal(lens, size)
    plane = (xy[:, :1] - c_x) / f_x * right + (c_y - xy[:, 1:]) / f_y * up
    if lens.type == "orthographic":
        return position + plane, np.broadcast_to(forward, plane.shape)
    dirs = plane + forward
    return np.broadcast_to(position, dirs.shape), dirs


def ways(lens: Any, axes: Any, hits: Points) -> Any:
    """Vectors from an eye to hits; of an escaped ray its direction, or its origin where rays are parallel."""
    eye = axes[0]
    if lens.type == "orthographic":
        return np.where(hits.surface[:, None], hits.position, hits.origin) - eye
    return np.where(hits.surface[:, None], hits.position - eye, hits.escape)


def places(lens: Any, size: Any, axes: Any, way: Any) -> tuple[Any, Any]:
    """Image positions x and y of vectors from an eye."""
    _, right, up, forward = axes
    across, lift, depth = dot(way, right), dot(way, up), dot(way, forward)
    if lens.type == "panorama":
        x = size[0] * (0.5 + np.arctan2(across, depth) / (2 * np.pi))
        return x, size[1] * (0.5 - np.arctan2(lift, np.sqrt(across**2 + depth**2)) / np.pi)
    (f_x, f_y), (c_x, c_y) = focal(lens, size)
    with np.errstate(divide="ignore", invalid="ignore"):
        scale = 1 if lens.type == "orthographic" else 1 / depth
        return c_x + f_x * across * scale, c_y - f_y * lift * scale


def densities(lens: Any, size: Any, axes: Any, hits: Points, y: Any) -> tuple[Any, Any]:
    """Hits of an eye per pixel sample and area at hits, if nothing hides them, and whether it looks there.

    cos theta f^2 / (d^2 cos^3 alpha); f^2 cos theta of parallel rays; cos theta / d^2 per solid angle of a panorama's
    pixel. A density of 0 or less is a surface that turns its back.
    """
    forward, way = axes[3], ways(lens, axes, hits)
    distance, depth = np.sqrt(dot(way, way)), way @ forward
    if lens.type == "orthographic":
        (f_x, f_y), _ = focal(lens, size)
        ahead = np.where(hits.surface, depth > 0, hits.escape @ forward > 1 - 1e-6)
        return np.where(hits.surface, -hits.geometric @ forward, 1) * f_x * f_y, ahead
    cos_theta = np.where(hits.surface, -dot(hits.geometric, way) / distance, 1)
    if lens.type == "panorama":
        solid_angle = 2 * np.pi**2 / (size[0] * size[1]) * np.cos(np.pi * (0.5 - y / size[1]))
        return cos_theta / (distance**2 * solid_angle), distance > 0
    (f_x, f_y), _ = focal(lens, size)
    with np.errstate(divide="ignore"):
        return cos_theta * f_x * f_y / (distance**2 * (depth / distance) ** 3), depth > 0


def ways_out(lens: Any, axes: Any, hits: Points) -> tuple[Any, Any]:
    """From hits to where an eye sees them from, and for escaped rays where they begin."""
    eye, forward = axes[0], axes[3]
    if lens.type != "orthographic":
        return eye - hits.start, np.broadcast_to(eye, hits.position.shape)
    out = ways(lens, axes, hits)
    return -((hits.start - eye) @ forward)[:, None] * forward, eye + out - (out @ forward)[:, None] * forward
