"""Embree through its C functions."""

import ctypes
from typing import Any

import numpy as np

from framearray_cli.base.arrays import Float32
from framearray_cli.base.errors import SceneError
from framearray_cli.scene.scene import Scene

from ..embree_c import device_configuration, packet_width
from ..kernels.simd import LANES
from .masks import MaskTable
from .packets import MASKED, OPAQUE, Tracer, aligned_zeros

_TRIANGLES = 0  # RTC_GEOMETRY_TYPE_TRIANGLE
_INDEX_BUFFER, _VERTEX_BUFFER = 0, 1
_UINT3, _FLOAT3 = 0x5003, 0x9003
_COHERENT = 1 << 16  # RTC_RAY_QUERY_FLAG_COHERENT
_ALL_FEATURES = 0xFFFFFFFF
_ROBUST = 1 << 2  # RTC_SCENE_FLAG_ROBUST: no ray slips between neighbouring triangles


class NativeScene:
    """An Embree device and scene, built and traced through Embree's C functions."""

    def __init__(self, scene: Scene, library: ctypes.CDLL) -> None:
        self._library = library
        self._device = library.rtcNewDevice(device_configuration())
        self._scene = library.rtcNewScene(self._device)
        self._kept: list[Any] = [scene]  # memory that Embree points into
        library.rtcSetSceneFlags(self._scene, _ROBUST)
        # Embree reads 16 bytes per vertex of 12: the last vertex needs a float of padding
        vertices = np.empty(scene.corners.size + 4, np.float32)
        vertices[: scene.corners.size] = scene.corners.reshape(-1)
        self._kept.append(vertices)
        n = len(scene.corners)
        self._attach(vertices, 0, scene.n_opaque, masks=None)
        if scene.n_opaque < n:
            masks = MaskTable(scene)
            self._kept.append(masks)
            self._attach(vertices, scene.n_opaque, n, masks)
        library.rtcCommitScene(self._scene)
        problem = library.rtcGetDeviceError(self._device)
        if problem:
            raise SceneError(f"embree: building {n} triangles failed with error {problem}")
        self._lanes = aligned_zeros(LANES).view(np.int32)
        self._lanes[:] = -1
        # RTCIntersectArguments and RTCOccludedArguments: flags, features; pointers to context, filter and function
        self._arguments = np.zeros(8, np.uint64)
        self._arguments.view(np.uint32)[:2] = _COHERENT, _ALL_FEATURES
        self.tracer = Tracer(
            self._scene,
            _address(getattr(library, f"rtcIntersect{packet_width()}")),
            _address(getattr(library, f"rtcOccluded{packet_width()}")),
            0,
            self._arguments.ctypes.data,
            self._lanes.ctypes.data,
            scene.n_opaque,
        )

    def _attach(self, vertices: Float32, start: int, stop: int, masks: "MaskTable | None") -> None:
        """Add triangles start to stop - 1 as a geometry, with a filter if they have masks."""
        if start == stop:
            return
        library = self._library
        indices = np.arange(3 * start, 3 * stop, dtype=np.uint32)
        self._kept.append(indices)
        geometry = library.rtcNewGeometry(self._device, _TRIANGLES)
        share = library.rtcSetSharedGeometryBuffer
        share(geometry, _VERTEX_BUFFER, 0, _FLOAT3, vertices.ctypes.data, 0, 12, 3 * stop)
        share(geometry, _INDEX_BUFFER, 0, _UINT3, indices.ctypes.data, 0, 12, stop - start)
        if masks:
            library.rtcSetGeometryUserData(geometry, masks.address)
            library.rtcSetGeometryIntersectFilterFunction(geometry, masks.filter_address)
            library.rtcSetGeometryOccludedFilterFunction(geometry, masks.filter_address)
        library.rtcCommitGeometry(geometry)
        library.rtcAttachGeometryByID(self._scene, geometry, MASKED if masks else OPAQUE)
        library.rtcReleaseGeometry(geometry)

    def close(self) -> None:
        """Release Embree's scene and device."""
        if self._device:
            self._library.rtcReleaseScene(self._scene)
            self._library.rtcReleaseDevice(self._device)
            self._device = None


def _address(function: Any) -> int:
    return ctypes.cast(function, ctypes.c_void_p).value or 0
