"""Tracing through embreex's public API: slower than packets, but independent of how the wheel was linked."""

import ctypes
from typing import Any

import numpy as np

from framearray_cli.base.arrays import Float32, Int32
from framearray_cli.scene.scene import Scene

from ..embree_c import packet_width
from ..inputs.surfaces import is_cut_out, surfaces
from .packets import (
    DIRECTION,
    GEOMETRY,
    HIT_ROWS,
    MASKED,
    MISS,
    NORMAL,
    OPAQUE,
    ORIGIN,
    RAY_ROWS,
    TFAR,
    TNEAR,
    TRIANGLE,
    Tracer,
    U,
    V,
)

_CALLBACK = ctypes.CFUNCTYPE(None, *[ctypes.c_ssize_t] * 4)
_FAR = 1e37  # embreex's "no limit"; larger distances mean the same
# A ray passes at most this many cut-out layers; each costs a call.
_MAX_LAYERS = 256


class EmbreexScene:
    """An embreex scene and the C callbacks that kernels call; each callback acquires the GIL."""

    def __init__(self, scene: Scene) -> None:
        from embreex.mesh_construction import TriangleMesh
        from embreex.rtcore_scene import EmbreeScene

        self._surfaces = surfaces(scene)
        self._n_opaque = scene.n_opaque
        self._scene = EmbreeScene()
        self._scene_has_masks = scene.n_opaque < len(scene.corners)
        # one geometry: embreex then numbers triangles as in the scene
        self._mesh = TriangleMesh(self._scene, scene.corners)
        self._callbacks = (_CALLBACK(self._intersect), _CALLBACK(self._occlude))
        addresses = [ctypes.cast(callback, ctypes.c_void_p).value or 0 for callback in self._callbacks]
        self.tracer = Tracer(0, addresses[0], addresses[1], 1, 0, 0, scene.n_opaque)

    def close(self) -> None:
        """Drop embreex's scene."""
        self._scene = self._mesh = None

    def first_hits(self, origins: Float32, directions: Float32, tnear: Float32, tfar: Float32) -> dict[str, Any]:
        """Trace rays (n, 3), (n, 3), (n,), (n,) and return embreex's output: tfar, u, v, primID, Ng.

        Ignores hits nearer than tnear and hits that are cut out.
        """
        out = dict(self._scene.run(origins, directions, tfar.copy(), query="INTERSECT", output=1))
        if self._scene_has_masks or tnear.any():
            self._pass_over(origins, directions, tnear, tfar, out)
        return out

    def _pass_over(
        self, origins: Float32, directions: Float32, tnear: Float32, tfar: Float32, out: dict[str, Any]
    ) -> None:
        """Trace each ray on behind an ignored hit, until it finds one that counts, or nothing."""
        start = np.zeros(len(origins), np.float32)
        todo = self._ignored(out, tnear)
        for _ in range(_MAX_LAYERS):
            rays = np.flatnonzero(todo)
            if not len(rays):
                return
            # step past the layer by a few units in the last place of the largest number that its distance came from
            reach = np.abs(origins[rays]).max(axis=1) / np.maximum(np.abs(directions[rays]).max(axis=1), 1e-30)
            step = np.float32(4e-7) * (out["tfar"][rays] + start[rays] + reach)
            start[rays] = np.maximum(out["tfar"][rays] + step, tnear[rays])
            moved = origins[rays] + start[rays, None] * directions[rays]
            left = np.minimum(tfar[rays], _FAR) - start[rays]
            again = self._scene.run(
                moved, directions[rays], np.maximum(left, 0).astype(np.float32), query="INTERSECT", output=1
            )
            # a line hits a triangle once: hitting the same one again means that rounding swallowed the step
            same = (again["primID"] == out["primID"][rays]) & (again["primID"] >= 0)
            for name in ("u", "v", "primID", "Ng"):
                out[name][rays] = again[name]
            out["tfar"][rays] = again["tfar"] + start[rays]
            todo[:] = False
            todo[rays] = same | self._ignored({name: out[name][rays] for name in out}, tnear[rays])

    def _ignored(self, out: dict[str, Any], tnear: Float32) -> Any:
        """Whether to ignore each hit, (n,)."""
        return ((out["primID"] >= 0) & (out["tfar"] < tnear)) | self._cut_out(out["primID"], out["u"], out["v"])

    def _cut_out(self, triangles: Int32, u: Float32, v: Float32) -> Any:
        """Whether the alpha mask cuts out each hit, (n,)."""
        cut = np.zeros(len(triangles), bool)
        for i in np.flatnonzero(triangles >= self._n_opaque):
            cut[i] = is_cut_out(self._surfaces, triangles[i], u[i], v[i])
        return cut

    def _intersect(self, n_packets: int, _scene: int, address: int, _unused: int) -> None:
        """Find the first hits of packets at an address; see `Tracer.batch`."""
        packets = _view(address, n_packets, HIT_ROWS)
        live, rays = _rays(packets)
        out = self.first_hits(*rays)
        bits = packets.view(np.int32)
        where = np.nonzero(live)
        for row, values in ((TFAR, out["tfar"]), (U, out["u"]), (V, out["v"])):
            packets[where[0], row, where[1]] = values
        for axis in range(3):
            packets[where[0], NORMAL + axis, where[1]] = out["Ng"][:, axis]
        masked = out["primID"] >= self._n_opaque
        bits[where[0], TRIANGLE, where[1]] = np.where(masked, out["primID"] - self._n_opaque, out["primID"])
        bits[where[0], GEOMETRY, where[1]] = np.where(out["primID"] < 0, MISS, np.where(masked, MASKED, OPAQUE))

    def _occlude(self, n_packets: int, _scene: int, address: int, _unused: int) -> None:
        """Test whether anything blocks the rays of packets at an address; see `Tracer.batch`."""
        packets = _view(address, n_packets, RAY_ROWS)
        live, rays = _rays(packets)
        origins, directions, tnear, tfar = rays
        if self._scene_has_masks or tnear.any():
            blocked = self.first_hits(*rays)["primID"] >= 0
        else:
            blocked = self._scene.run(origins, directions, tfar.copy(), query="OCCLUDED") == 0
        where = np.nonzero(live)
        tfar = packets[where[0], TFAR, where[1]]
        packets[where[0], TFAR, where[1]] = np.where(blocked, -np.inf, tfar)


def _view(address: int, n_packets: int, rows: int) -> Float32:
    """Packets at an address, (n_packets, rows, width)."""
    width = packet_width()
    block = (ctypes.c_float * (n_packets * rows * width)).from_address(address)
    return np.ctypeslib.as_array(block).reshape(n_packets, rows, width)


def _rays(packets: Float32) -> tuple[Any, tuple[Float32, Float32, Float32, Float32]]:
    """The lanes that are not idle, and their rays: origins, directions, tnear, tfar."""
    live = packets[:, TFAR] >= 0  # (n_packets, width)
    by_lane = packets.transpose(0, 2, 1)[live]
    origins = np.ascontiguousarray(by_lane[:, ORIGIN : ORIGIN + 3])
    directions = np.ascontiguousarray(by_lane[:, DIRECTION : DIRECTION + 3])
    tfar = np.minimum(by_lane[:, TFAR], np.float32(_FAR))
    return live, (origins, directions, np.ascontiguousarray(by_lane[:, TNEAR]), tfar)
