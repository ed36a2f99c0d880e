"""Scenes to trace rays through, built by Embree's C functions, with filters of hits for alpha masks and back faces."""

import ctypes
from functools import cache
from types import TracebackType
from typing import Any, Self

import numba as nb
import numpy as np
from numba import types
from numba.core.ccallback import CFunc
from numba.extending import intrinsic

from framearray_cli.base.arrays import Bytes, Float32
from framearray_cli.base.errors import SceneError
from framearray_cli.scene.scene import Scene

from ..inputs.panes import NOWHERE
from ..inputs.surfaces import NO_SURFACES, is_cut_out, surfaces
from ..kernels.machine_code import keep_on_disk
from ..kernels.simd import LANES
from .library import device_configuration, embree_library, packet_width
from .packets import MASKED, OPAQUE, TO_EYE, Tracer, aligned_zeros

_TRIANGLES = 0  # RTC_GEOMETRY_TYPE_TRIANGLE
_INDEX_BUFFER, _VERTEX_BUFFER = 0, 1
_UINT3, _FLOAT3 = 0x5003, 0x9003
_COHERENT = 1 << 16  # RTC_RAY_QUERY_FLAG_COHERENT
_ALL_FEATURES = 0xFFFFFFFF
_ROBUST = 1 << 2  # RTC_SCENE_FLAG_ROBUST: no ray slips between neighbouring triangles
_FILTERED = 1 << 1  # RTC_RAY_QUERY_FLAG_INVOKE_ARGUMENT_FILTER
# RTCFilterFunctionNArguments: valid, geometryUserPtr, context, ray, hit (pointers), N
_VALID, _USER, _RAY, _HIT = 0, 1, 3, 4
_RAY_NEAR, _RAY_DIRECTION, _RAY_ID = 3, 4, 10  # rows of RTCRayN, which has 12
_HIT_NORMAL, _HIT_U, _HIT_V, _HIT_TRIANGLE = 0, 3, 4, 5  # rows of RTCHitN
_FILTER = 2  # of RTCIntersectArguments and RTCOccludedArguments, in words of 8 bytes


class EmbreeScene:
    """A scene to trace rays through; owns Embree's structures and frees them on `close`.

    Attributes:
        tracer: of all triangles but glass; `eyes`: the same without hidden back faces, or NOWHERE if none are hidden.
        panes: of the triangles of thin glass; None without.
    """

    def __init__(self, scene: Scene, *, hide_backs: bool = False) -> None:
        """Build the acceleration structures.

        Args:
            scene: the triangles; opaque ones become geometry 0, triangles with an alpha mask geometry 1.
            hide_backs: True if eyes look through the back faces of one-sided materials.

        Raises:
            MissingExtraError: embreex is not installed, or cannot be loaded.
            SceneError: Embree rejects the scene.
        """
        hidden = scene.one_sided[scene.material] if hide_backs else None
        if hidden is not None and not hidden.any():
            hidden = None
        self._structures = [_Structure(scene, scene.corners, scene.n_opaque, hidden)]
        if scene.has_glass:
            self._structures.append(_Structure(scene, scene.pane_corners, len(scene.pane_corners)))
        self.tracer: Tracer = self._structures[0].tracer
        self.eyes: Tracer = self._structures[0].eyes
        self.panes: Tracer | None = self._structures[1].tracer if scene.has_glass else None

    def close(self) -> None:
        """Free Embree's memory; do not trace afterwards."""
        while self._structures:
            self._structures.pop().close()

    def __enter__(self) -> Self:
        return self

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None
    ) -> None:
        self.close()


class _Structure:
    """Triangles on an Embree device of their own."""

    def __init__(self, scene: Scene, corners: Float32, n_opaque: int, hidden: Bytes | None = None) -> None:
        """Build the acceleration structure of triangles, corners (n, 3, 3); those after n_opaque have masks.

        Args:
            hidden: (n,) flags of triangles whose backs eyes do not see; None if they see all.
        """
        self._library = library = embree_library()
        self._device = library.rtcNewDevice(device_configuration())
        self._scene = library.rtcNewScene(self._device)
        library.rtcSetSceneFlags(self._scene, _ROBUST)
        # Embree reads 16 bytes per vertex of 12: the last vertex needs a float of padding
        vertices = np.empty(corners.size + 4, np.float32)
        vertices[: corners.size] = corners.reshape(-1)
        self._kept: list[Any] = [vertices, hidden]  # memory that Embree points into
        for first, last in ((0, n_opaque), (n_opaque, len(corners))):
            masked = first >= n_opaque
            if first < last:
                read = _Filtered(scene, first, hidden) if masked or hidden is not None else None
                self._attach(vertices, first, last, read, masked=masked)
        library.rtcCommitScene(self._scene)
        problem = library.rtcGetDeviceError(self._device)
        if problem:
            raise SceneError(f"embree: building {len(corners)} triangles failed with error {problem}")
        self._lanes = aligned_zeros(LANES).view(np.int32)
        self._lanes[:] = -1
        self.eyes, self.tracer = (
            NOWHERE,
            Tracer(
                self._scene,
                _address(getattr(library, f"rtcIntersect{packet_width()}")),
                _address(getattr(library, f"rtcOccluded{packet_width()}")),
                self._arguments(_COHERENT),
                0,
                self._lanes.ctypes.data,
                n_opaque,
            ),
        )
        if hidden is not None:
            coherent, scattered = (self._arguments(flag | _FILTERED, _back_filter()) for flag in (_COHERENT, 0))
            self.eyes = self.tracer._replace(coherent=coherent, scattered=scattered)

    def _arguments(self, flags: int, filter_address: int = 0) -> int:
        """The address of RTCIntersectArguments or RTCOccludedArguments: flags, features, context, filter, function."""
        words = np.zeros(8, np.uint64)
        words.view(np.uint32)[:2] = flags, _ALL_FEATURES
        words[_FILTER] = filter_address
        self._kept.append(words)
        return words.ctypes.data

    def _attach(self, vertices: Float32, start: int, stop: int, read: "_Filtered | None", *, masked: bool) -> None:
        """Add triangles start to stop - 1 as a geometry, with a filter if they have masks, and with what it reads."""
        self._kept.append(read)
        library = self._library
        indices = np.arange(3 * start, 3 * stop, dtype=np.uint32)
        self._kept.append(indices)
        geometry = library.rtcNewGeometry(self._device, _TRIANGLES)
        share = library.rtcSetSharedGeometryBuffer
        share(geometry, _VERTEX_BUFFER, 0, _FLOAT3, vertices.ctypes.data, 0, 12, 3 * stop)
        share(geometry, _INDEX_BUFFER, 0, _UINT3, indices.ctypes.data, 0, 12, stop - start)
        if read:
            library.rtcSetGeometryUserData(geometry, read.address)
        if masked:
            library.rtcSetGeometryIntersectFilterFunction(geometry, _mask_filter())
            library.rtcSetGeometryOccludedFilterFunction(geometry, _mask_filter())
        library.rtcCommitGeometry(geometry)
        library.rtcAttachGeometryByID(self._scene, geometry, MASKED if masked else OPAQUE)
        library.rtcReleaseGeometry(geometry)

    def close(self) -> None:
        """Release Embree's scene and device."""
        self._library.rtcReleaseScene(self._scene)
        self._library.rtcReleaseDevice(self._device)


def _address(function: Any) -> int:
    return ctypes.cast(function, ctypes.c_void_p).value or 0


@intrinsic
def _pointer(typingctx: Any, address: Any) -> Any:
    """Turn an integer address into a pointer that `carray` takes."""

    def codegen(context: Any, builder: Any, signature: Any, args: Any) -> Any:
        return builder.inttoptr(args[0], context.get_value_type(types.voidptr))

    return types.voidptr(types.intp), codegen


_carray = nb.carray
_surfaces_of: Any = surfaces  # a bundle knows its address


@intrinsic
def _surfaces(typingctx: Any, address: Any) -> Any:
    """Turn the address of the words of a scene's `Surfaces` into these."""
    kind = nb.typeof(NO_SURFACES)

    def codegen(context: Any, builder: Any, signature: Any, args: Any) -> Any:
        return builder.inttoptr(args[0], context.get_value_type(kind))

    return kind(types.intp), codegen


@cache
def _mask_filter() -> int:
    """Compile the filter that rejects hits that a mask cuts out; return its address."""

    def filter_masked(address: int) -> None:
        arguments = _carray(_pointer(address), (6,), np.int64)
        n = _carray(_pointer(address + 40), (1,), np.uint32)[0]
        valid = _carray(_pointer(arguments[_VALID]), (n,), np.int32)
        words = _carray(_pointer(arguments[_USER]), (3,), np.int64)
        hits = _carray(_pointer(arguments[_HIT]), (8, n), np.float32)
        triangles = _carray(_pointer(arguments[_HIT]), (8, n), np.uint32)
        s = _surfaces(words[0])
        for lane in range(n):
            if valid[lane] != 0:
                triangle = np.int64(triangles[_HIT_TRIANGLE, lane]) + words[1]
                if is_cut_out(s, triangle, hits[_HIT_U, lane], hits[_HIT_V, lane]):
                    valid[lane] = 0

    return _compiled(filter_masked)


@cache
def _back_filter() -> int:
    """Compile the filter that rejects hits on the backs of one-sided triangles; return its address."""

    def filter_backs(address: int) -> None:
        arguments = _carray(_pointer(address), (6,), np.int64)
        n = _carray(_pointer(address + 40), (1,), np.uint32)[0]
        valid = _carray(_pointer(arguments[_VALID]), (n,), np.int32)
        words = _carray(_pointer(arguments[_USER]), (3,), np.int64)
        rays = _carray(_pointer(arguments[_RAY]), (12, n), np.float32)
        ids = _carray(_pointer(arguments[_RAY]), (12, n), np.int32)
        hits = _carray(_pointer(arguments[_HIT]), (8, n), np.float32)
        triangles = _carray(_pointer(arguments[_HIT]), (8, n), np.uint32)
        for lane in range(n):
            if valid[lane] == 0:
                continue
            triangle = words[1] + np.int64(triangles[_HIT_TRIANGLE, lane])
            if _carray(_pointer(words[2] + triangle), (1,), np.uint8)[0] != 0:
                along = rays[_RAY_DIRECTION, lane] * hits[_HIT_NORMAL, lane]
                along += rays[_RAY_DIRECTION + 1, lane] * hits[_HIT_NORMAL + 1, lane]
                along += rays[_RAY_DIRECTION + 2, lane] * hits[_HIT_NORMAL + 2, lane]
                to_eye = ids[_RAY_ID, lane] == TO_EYE and rays[_RAY_NEAR, lane] == 0.0
                if (along < 0.0) if to_eye else (along > 0.0):
                    valid[lane] = 0

    return _compiled(filter_backs)


def _compiled(function: Any) -> int:
    """Compile a callback `void (RTCFilterFunctionNArguments*)`, or load it, and return its address.

    Embree passes n rays, a flag per ray with a hit, the words of `_Filtered`, and the hits.
    """
    callback: Any = keep_on_disk(CFunc(function, ((types.intp,), types.void), locals={}, options={"nopython": True}))
    callback.compile()
    address: int = callback.address
    return address


class _Filtered:
    """The words that filters read of a geometry: addresses of surfaces and of flags, and its first triangle.

    Embree calls the filter of masks, for rays of every kind, at masked triangles only, and the filter of back faces for
    eye rays only: scenes without either pay nothing.
    """

    def __init__(self, scene: Scene, first: int, hidden: Bytes | None) -> None:
        self._surfaces = _surfaces_of(scene)
        flags = 0 if hidden is None else hidden.ctypes.data
        self._words = np.array([self._surfaces._address, first, flags], np.int64)
        self.address: int = self._words.ctypes.data
