"""Scenes to trace rays through, built by Embree's C functions, with alpha masks as a filter of its hits."""

import ctypes
from functools import cache
from types import TracebackType
from typing import Any, Self

import numba as nb
import numpy as np
from numba import types
from numba.core.ccallback import CFunc
from numba.extending import intrinsic

from framearray_cli.base.arrays import Float32
from framearray_cli.base.errors import SceneError
from framearray_cli.scene.scene import Scene

from ..inputs.surfaces import NO_SURFACES, is_cut_out, surfaces
from ..kernels.machine_code import keep_on_disk
from ..kernels.simd import LANES
from .library import device_configuration, embree_library, packet_width
from .packets import MASKED, OPAQUE, Tracer, aligned_zeros

_TRIANGLES = 0  # RTC_GEOMETRY_TYPE_TRIANGLE
_INDEX_BUFFER, _VERTEX_BUFFER = 0, 1
_UINT3, _FLOAT3 = 0x5003, 0x9003
_COHERENT = 1 << 16  # RTC_RAY_QUERY_FLAG_COHERENT
_ALL_FEATURES = 0xFFFFFFFF
_ROBUST = 1 << 2  # RTC_SCENE_FLAG_ROBUST: no ray slips between neighbouring triangles
# RTCFilterFunctionNArguments: valid, geometryUserPtr, context, ray, hit (pointers), N
_VALID, _USER, _HIT = 0, 1, 4
_HIT_U, _HIT_V, _HIT_TRIANGLE = 3, 4, 5  # rows of RTCHitN


class EmbreeScene:
    """A scene to trace rays through; owns Embree's structures and frees them on `close`.

    Attributes:
        tracer: of all triangles but glass.
        panes: of the triangles of thin glass; None without.
    """

    def __init__(self, scene: Scene) -> None:
        """Build the acceleration structures.

        Args:
            scene: the triangles; opaque ones become geometry 0, triangles with an alpha mask geometry 1.

        Raises:
            MissingExtraError: embreex is not installed, or cannot be loaded.
            SceneError: Embree rejects the scene.
        """
        self._structures = [_Structure(scene, scene.corners, scene.n_opaque)]
        if scene.has_glass:
            self._structures.append(_Structure(scene, scene.pane_corners, len(scene.pane_corners)))
        self.tracer: Tracer = self._structures[0].tracer
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

    def __init__(self, scene: Scene, corners: Float32, n_opaque: int) -> None:
        """Build the acceleration structure of triangles, corners (n, 3, 3); those after n_opaque have masks."""
        self._library = library = embree_library()
        self._device = library.rtcNewDevice(device_configuration())
        self._scene = library.rtcNewScene(self._device)
        library.rtcSetSceneFlags(self._scene, _ROBUST)
        # Embree reads 16 bytes per vertex of 12: the last vertex needs a float of padding
        vertices = np.empty(corners.size + 4, np.float32)
        vertices[: corners.size] = corners.reshape(-1)
        self._kept: list[Any] = [vertices]  # memory that Embree points into
        self._attach(vertices, 0, n_opaque, masks=None)
        if n_opaque < len(corners):
            masks = _Masks(scene)
            self._kept.append(masks)
            self._attach(vertices, n_opaque, len(corners), masks)
        library.rtcCommitScene(self._scene)
        problem = library.rtcGetDeviceError(self._device)
        if problem:
            raise SceneError(f"embree: building {len(corners)} triangles failed with error {problem}")
        self._lanes = aligned_zeros(LANES).view(np.int32)
        self._lanes[:] = -1
        # RTCIntersectArguments and RTCOccludedArguments: flags, features; pointers to context, filter and function
        self._arguments = np.zeros(8, np.uint64)
        self._arguments.view(np.uint32)[:2] = _COHERENT, _ALL_FEATURES
        self.tracer = Tracer(
            self._scene,
            _address(getattr(library, f"rtcIntersect{packet_width()}")),
            _address(getattr(library, f"rtcOccluded{packet_width()}")),
            self._arguments.ctypes.data,
            self._lanes.ctypes.data,
            n_opaque,
        )

    def _attach(self, vertices: Float32, start: int, stop: int, masks: "_Masks | None") -> None:
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
        self._library.rtcReleaseScene(self._scene)
        self._library.rtcReleaseDevice(self._device)


def _address(function: Any) -> int:
    return ctypes.cast(function, ctypes.c_void_p).value or 0


def _pointer_to(typingctx: Any, address: Any) -> Any:
    """Turn an integer address into a pointer that `carray` takes."""

    def codegen(context: Any, builder: Any, signature: Any, args: Any) -> Any:
        return builder.inttoptr(args[0], context.get_value_type(types.voidptr))

    return types.voidptr(types.intp), codegen


_pointer: Any = intrinsic(_pointer_to)
_numba: Any = nb  # its stubs do not know this one
_carray = _numba.carray
_surfaces_of: Any = surfaces  # a bundle knows its address


def _surfaces_at(typingctx: Any, address: Any) -> Any:
    """Turn the address of the words of a scene's `Surfaces` into these."""
    kind = _numba.typeof(NO_SURFACES)

    def codegen(context: Any, builder: Any, signature: Any, args: Any) -> Any:
        return builder.inttoptr(args[0], context.get_value_type(kind))

    return kind(types.intp), codegen


_surfaces: Any = intrinsic(_surfaces_at)


@cache
def _filter() -> Any:
    """Compile the filter: a callback `void (RTCFilterFunctionNArguments*)` that rejects hits that a mask cuts out."""

    def filter_masked(address: int) -> None:
        # what Embree passes: n rays, a flag per ray with a hit, the address of `_Masks.words`, and the hits
        arguments = _carray(_pointer(address), (6,), np.int64)
        n = _carray(_pointer(address + 40), (1,), np.uint32)[0]
        valid = _carray(_pointer(arguments[_VALID]), (n,), np.int32)
        words = _carray(_pointer(arguments[_USER]), (2,), np.int64)
        hits = _carray(_pointer(arguments[_HIT]), (8, n), np.float32)
        triangles = _carray(_pointer(arguments[_HIT]), (8, n), np.uint32)
        s, first_masked = _surfaces(words[0]), words[1]
        # reject the hits on points that are cut out
        for lane in range(n):
            if valid[lane] != 0:
                triangle = np.int64(triangles[_HIT_TRIANGLE, lane]) + first_masked
                if is_cut_out(s, triangle, hits[_HIT_U, lane], hits[_HIT_V, lane]):
                    valid[lane] = 0

    declared = CFunc(filter_masked, ((types.intp,), types.void), locals={}, options={"nopython": True})
    callback: Any = keep_on_disk(declared)
    callback.compile()  # or load
    return callback


class _Masks:
    """The address of a scene's surfaces and its first masked triangle, as the filter reads them; keeps them alive.

    Embree calls the filter, for rays of every kind, at masked triangles only: scenes without masks pay nothing.
    """

    def __init__(self, scene: Scene) -> None:
        self._surfaces = _surfaces_of(scene)
        self._words = np.array([self._surfaces._address, scene.n_opaque], np.int64)
        self.address: int = self._words.ctypes.data
        self.filter_address: int = _filter().address
