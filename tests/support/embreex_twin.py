"""First hits by embreex's own API, which calls Embree once per ray: the twin that tests compare packets with."""

from typing import Any

import numpy as np

from framearray_cli.engine.inputs.surfaces import is_cut_out, surfaces
from framearray_cli.scene.scene import Scene

FAR = 1e37  # embreex's "no limit"; larger distances mean the same
# A ray passes at most this many cut-out layers; each costs a call.
MOST_LAYERS = 256


class EmbreexTwin:
    """A scene in embreex; rays start again behind hits that a mask cuts out, or that are too near."""

    def __init__(self, scene: Scene) -> None:
        from embreex.mesh_construction import TriangleMesh
        from embreex.rtcore_scene import EmbreeScene

        self._surfaces, self._n_opaque = surfaces(scene), scene.n_opaque
        self._scene = EmbreeScene()
        self._mesh = TriangleMesh(self._scene, scene.corners)  # one geometry: numbers are the scene's

    def first_hits(self, origins: Any, dirs: Any, far: Any = np.inf, near: float = 0.0) -> Any:
        """(n, 4) float64: triangle or -1, t, u, v of each ray, of hits between near and far."""
        far = np.minimum(np.broadcast_to(far, len(origins)), FAR).astype(np.float32)
        out = self._scene.run(origins, dirs, far.copy(), query="INTERSECT", output=1)
        found = np.column_stack([out["primID"], out["tfar"], out["u"], out["v"]]).astype(np.float64)
        start = np.zeros(len(origins), np.float32)
        todo = np.flatnonzero(self._is_ignored(found, near))
        for _ in range(MOST_LAYERS):
            if not len(todo):
                break
            # step past the layer by a few units in the last place of the largest number that its distance came from
            reach = np.abs(origins[todo]).max(axis=1) / np.maximum(np.abs(dirs[todo]).max(axis=1), 1e-30)
            start[todo] = np.maximum(found[todo, 1] + 4e-7 * (found[todo, 1] + reach), near)
            moved = origins[todo] + start[todo, None] * dirs[todo]
            left = np.maximum(far[todo] - start[todo], 0).astype(np.float32)
            out = self._scene.run(moved, dirs[todo], left, query="INTERSECT", output=1)
            # a line hits a triangle once: hitting the same one again means that rounding swallowed the step
            same = (out["primID"] == found[todo, 0]) & (out["primID"] >= 0)
            found[todo] = np.column_stack([out["primID"], out["tfar"] + start[todo], out["u"], out["v"]])
            todo = todo[same | self._is_ignored(found[todo], near)]
        return found

    def blocked(self, origins: Any, dirs: Any, far: Any) -> Any:
        """(n,) True where a ray meets anything before `far`."""
        if self._n_opaque < len(self._surfaces.corners):
            return self.first_hits(origins, dirs, far)[:, 0] >= 0
        far = np.minimum(np.broadcast_to(far, len(origins)), FAR).astype(np.float32)
        return self._scene.run(origins, dirs, far, query="OCCLUDED") == 0

    def _is_ignored(self, found: Any, near: float) -> Any:
        """(n,) True for hits that are nearer than the limit, or cut out."""
        triangles = found[:, 0].astype(np.int64)
        ignored = (triangles >= 0) & (found[:, 1] < near)
        for i in np.flatnonzero(triangles >= self._n_opaque):
            ignored[i] |= is_cut_out(self._surfaces, triangles[i], *found[i, 2:].astype(np.float32))
        return ignored
