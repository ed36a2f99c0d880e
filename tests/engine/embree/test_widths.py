"""Rays meet the same in packets of any width, but where they pass an edge within rounding."""

from collections.abc import Iterator
from functools import cache
from typing import Any

import numpy as np
import pytest
from support import tiny

from framearray_cli.engine.embree.embreescene import EmbreeScene
from framearray_cli.engine.embree.library import embree_library, embree_properties
from framearray_cli.engine.embree.packets import DIRECTION, HIT_ROWS, MASK, MISS, ORIGIN, TFAR, TRIANGLE, aligned_zeros
from framearray_cli.scene.scene import Scene

# Rays that start at one point, as eye rays do.
TOGETHER = 64
N_RAYS = 256 * TOGETHER
# A ray that passes the plane of its origin and an edge at a smaller sine may be on either side of it in float32.
CLEAR = 1e-5
QUERIES = {"Intersect": np.inf, "Occluded": 1.5}


@pytest.fixture(scope="module")
def scene() -> Iterator[EmbreeScene]:
    with EmbreeScene(room()) as found:
        yield found


@cache
def room() -> Scene:
    """A room with two boxes and a ball that touch nothing: no two triangles lie in one plane at the same place."""
    corners = [tiny.box((-2, -2, -2), (2, 2, 2)), tiny.box((-1.2, -0.4, -1), (-0.3, 0.5, 0.1), 0.5)]
    corners += [tiny.box((0.4, -1.7, -0.7), (1.1, 0.3, 0.2), 0.2), tiny.ball((0.2, 0.9, 0.8), 0.6)[0]]
    return tiny.scene_of(np.concatenate(corners))


@cache
def edges() -> Any:
    """(n, 2, 3) ends of all edges of the room."""
    corners = room().corners.reshape(-1, 3, 3).astype(np.float64)
    return np.concatenate([corners[:, [i, (i + 1) % 3]] for i in range(3)])


def starts(rng: np.random.Generator) -> Any:
    """Points in the room, each for TOGETHER rays."""
    low, high = edges().min(axis=(0, 1)), edges().max(axis=(0, 1))
    points = low + (high - low) * rng.random((N_RAYS // TOGETHER, 3))
    return np.repeat(points, TOGETHER, axis=0).astype(np.float32)


def rays_at_edges() -> tuple[Any, Any]:
    """Rays to edges, where most triangles meet others."""
    rng = np.random.default_rng(11)
    origins, ends = starts(rng), edges()
    edge, along = ends[rng.integers(len(ends), size=N_RAYS)], rng.random((N_RAYS, 1))
    return origins, edge[:, 0] * along + edge[:, 1] * (1 - along) - origins


def rays_between_edges() -> tuple[Any, Any]:
    """Rays in all directions that pass all edges by more than rounding, or point away from the room."""
    rng = np.random.default_rng(12)
    origins, ends = starts(rng), edges()
    directions = rng.normal(size=(N_RAYS, 3)).astype(np.float32)
    directions /= np.linalg.norm(directions, axis=1, keepdims=True)
    for first in range(0, N_RAYS, TOGETHER):
        some = slice(first, first + TOGETHER)
        normals = np.cross(ends[:, 0] - origins[first], ends[:, 1] - origins[first])
        normals /= np.linalg.norm(normals, axis=1, keepdims=True)
        close = (np.abs(directions[some] @ normals.T) < CLEAR).any(axis=1)
        origins[some][close], directions[some][close] = [0, -9, 0], [0, -1, 0]
    return origins, directions


def traced(scene: EmbreeScene, query: str, width: int, coherent: bool, rays: tuple[Any, Any]) -> tuple[Any, Any]:
    """The triangle of each ray, or MISS, and row TFAR."""
    found = np.zeros((N_RAYS, HIT_ROWS), np.float32)
    found[:, ORIGIN : ORIGIN + 3], found[:, DIRECTION : DIRECTION + 3] = rays
    found[:, TFAR] = QUERIES[query]
    found.view(np.int32)[:, [MASK, TRIANGLE, TRIANGLE + 1]] = -1, MISS, MISS
    packets = aligned_zeros(found.size).reshape(-1, HIT_ROWS, width)
    packets[:] = found.reshape(-1, width, HIT_ROWS).transpose(0, 2, 1)
    function, tracer = getattr(embree_library(), f"rtc{query}{width}"), scene.tracer
    for packet in packets:
        function(tracer.lanes, tracer.scene, packet.ctypes.data, tracer.coherent if coherent else None)
    found = np.ascontiguousarray(packets.transpose(0, 2, 1)).reshape(-1, HIT_ROWS)
    return found.view(np.int32)[:, TRIANGLE], found[:, TFAR]


@pytest.mark.parametrize("query", QUERIES)
@pytest.mark.parametrize("width", [16, 8, 4])
def test_a_ray_meets_the_same_in_packets_of_any_width(width: int, query: str, scene: EmbreeScene) -> None:
    """Without the flag of coherent rays at edges, too. With it the order in which boxes are searched decides there."""
    narrow = min(embree_properties().packet_widths)
    for rays, flags in ((rays_at_edges(), [False]), (rays_between_edges(), [False, True])):
        triangle, distance = traced(scene, query, narrow, False, rays)
        met = triangle != MISS if query == "Intersect" else distance < 0
        assert met.mean() > 0.3
        for coherent in flags:
            same, there = traced(scene, query, width, coherent, rays)
            np.testing.assert_array_equal(same, triangle)
            np.testing.assert_array_equal(there, distance)
