"""An independent path tracer: embreex's own API, numpy's random numbers, none of the program's kernels.

It knows triangles of one grey reflectivity each, seen from both sides, and the sun.
"""

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from support.stages import Part

Array = NDArray[np.float64]

NEAR = 1e-4  # how far rays start above a surface, in a scene of a few units


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class Points:
    """Places on surfaces: position and normal towards where they are seen from, (n, 3); reflectivity (n,)."""

    position: Array
    normal: Array
    reflectivity: Array

    def take(self, rows: NDArray[np.int64] | NDArray[np.bool_]) -> "Points":
        """Some of the places."""
        return Points(position=self.position[rows], normal=self.normal[rows], reflectivity=self.reflectivity[rows])


class PathTracer:
    """Traces paths by embreex's `run()`."""

    def __init__(self, parts: list[Part], reflectivity: dict[str, float], sun_way: list[float], seed: int) -> None:
        from embreex.mesh_construction import TriangleMesh
        from embreex.rtcore_scene import EmbreeScene

        corners = np.concatenate([part.points[part.faces] for part in parts])
        self.corners = corners
        self.reflectivity = np.concatenate([np.full(len(part.faces), reflectivity[part.material]) for part in parts])
        normals = np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0])
        self.area = np.linalg.norm(normals, axis=1) / 2
        self.normals = normals / (2 * self.area[:, None])
        self.to_sun = -np.array(sun_way) / np.linalg.norm(sun_way)
        self.random = np.random.default_rng(seed)
        self._scene = EmbreeScene()
        self._mesh = TriangleMesh(self._scene, corners.astype(np.float32))

    def first_hits(self, start: Array, way: Array) -> tuple[Points, NDArray[np.bool_]]:
        """Follow rays; return the places of those that hit a surface, and which did."""
        out = self._scene.run(start.astype(np.float32), way.astype(np.float32), query="INTERSECT", output=1)
        met = out["primID"] >= 0
        triangle = out["primID"][met]
        u, v = out["u"][met, None].astype(float), out["v"][met, None].astype(float)
        a, b, c = self.corners[triangle].transpose(1, 0, 2)
        side = -np.sign((self.normals[triangle] * way[met]).sum(axis=1, keepdims=True))
        points = Points(
            position=(1 - u - v) * a + u * b + v * c,
            normal=side * self.normals[triangle],
            reflectivity=self.reflectivity[triangle],
        )
        return points, met

    def cosine_ways(self, normals: Array) -> Array:
        """Cosine-distributed directions: normal plus a uniform direction."""
        way = self.random.normal(size=normals.shape)
        way = normals + way / np.linalg.norm(way, axis=1, keepdims=True)
        return way / np.linalg.norm(way, axis=1, keepdims=True)

    def bounce(self, points: Points) -> tuple[Points, NDArray[np.bool_]]:
        """Find the first hits of cosine-distributed rays from points."""
        return self.first_hits(points.position + NEAR * points.normal, self.cosine_ways(points.normal))

    def sunlight(self, points: Points) -> Array:
        """Direct irradiance of a sun of 1 W/m2."""
        cosine = np.maximum(points.normal @ self.to_sun, 0.0)
        start = (points.position + NEAR * points.normal).astype(np.float32)
        out = self._scene.run(start, np.tile(self.to_sun.astype(np.float32), (len(start), 1)), query="OCCLUDED")
        return np.where(out == 0, 0.0, cosine)

    def irradiance(self, points: Points) -> Array:
        """One-path estimates of the irradiance at points, all bounces, without Russian roulette."""
        total, weight = np.zeros(len(points.position)), np.ones(len(points.position))
        rows = np.arange(len(points.position))
        while len(rows):
            total[rows] += weight[rows] * self.sunlight(points)
            points, met = self.bounce(points)
            rows = rows[met]
            weight[rows] *= points.reflectivity
            bright = weight[rows] > 1e-4
            rows, points = rows[bright], points.take(bright)
        return total

    def seen(self, eye: list[float], target: list[float], fov: float, aspect: float, n: int) -> Points:
        """Find the first hits of n rays of an eye."""
        forward = np.subtract(target, eye) / np.linalg.norm(np.subtract(target, eye))
        right = np.cross(forward, [0, 1, 0]) / np.linalg.norm(np.cross(forward, [0, 1, 0]))
        up = np.cross(right, forward)
        half = np.tan(np.radians(fov) / 2)
        x, y = self.random.uniform(-half, half, (2, n, 1))
        way = forward + aspect * x * right + y * up
        return self.first_hits(np.tile(np.array(eye, float), (n, 1)), way)[0]

    def seen_first(self, eye: list[float], target: list[float], fov: float, aspect: float, n: int) -> Points:
        """First surfaces behind what an eye sees: where cosine-distributed rays from the hits of n eye rays end."""
        return self.bounce(self.seen(eye, target, fov, aspect, n))[0]

    def fitted(self, points: Points, d_max: float, groups: int) -> Array:
        """Irradiance that makes obscurances of falloff `sqrt` as bright as the light at some points: one per group.

        A group is the ratio of the sums of R(P) R(Q) E(Q) and of R(P) R(Q) rho(d), with the average reflectivity where
        nothing is met within d_max.
        """
        behind, met = self.bounce(points)
        light, openness = np.zeros(len(met)), np.ones(len(met))
        light[met] = behind.reflectivity * self.irradiance(behind)
        away = np.linalg.norm(behind.position - points.position[met], axis=1)
        reflected = np.full(len(met), behind.reflectivity.mean())
        near = np.zeros(len(met), bool)
        near[met] = away < d_max
        openness[near] = np.sqrt(away[near[met]] / d_max)
        reflected[near] = behind.reflectivity[near[met]]
        y, x = points.reflectivity * light, points.reflectivity * reflected * openness
        n = len(met) // groups * groups
        return np.asarray(y[:n].reshape(groups, -1).sum(axis=1) / x[:n].reshape(groups, -1).sum(axis=1))

    def spread(self, parts: list[int], n: int, sides: Array) -> Points:
        """n places, even by area, on some triangles, on the side that `sides` (n_triangles, 3) points to."""
        of = np.array(parts)
        triangle = self.random.choice(of, n, p=self.area[of] / self.area[of].sum())
        a, b, c = self.corners[triangle].transpose(1, 0, 2)
        root, v = np.sqrt(self.random.random((n, 1))), self.random.random((n, 1))
        side = np.sign((self.normals[triangle] * sides[triangle]).sum(axis=1, keepdims=True))
        return Points(
            position=(1 - root) * a + root * (1 - v) * b + root * v * c,
            normal=side * self.normals[triangle],
            reflectivity=self.reflectivity[triangle],
        )
