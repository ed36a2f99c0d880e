"""Alpha masks as an Embree filter: rays of every kind pass through points that a mask cuts out.

Embree calls the filter for masked triangles only, so scenes without masks pay nothing.
"""

from functools import cache
from typing import Any

import numba as nb
import numpy as np
from numba import types
from numba.core.ccallback import CFunc
from numba.extending import intrinsic

from framearray_cli.scene.scene import Scene

from ..inputs.surfaces import Surfaces, is_cut_out, surfaces
from ..kernels.kernel import keep_on_disk

# RTCFilterFunctionNArguments: valid, geometryUserPtr, context, ray, hit (pointers), N
_VALID, _USER, _HIT = 0, 1, 4
_HIT_U, _HIT_V, _HIT_TRIANGLE = 3, 4, 5  # rows of RTCHitN


def _pointer_to(typingctx: Any, address: Any) -> Any:
    """Turn an integer address into a pointer that `carray` takes."""

    def codegen(context: Any, builder: Any, signature: Any, args: Any) -> Any:
        return builder.inttoptr(args[0], context.get_value_type(types.voidptr))

    return types.voidptr(types.intp), codegen


_pointer: Any = intrinsic(_pointer_to)
_numba: Any = nb  # its stubs do not know this one
_carray = _numba.carray


@keep_on_disk
@nb.njit()
def _surfaces_at(table: Any) -> Surfaces:
    """Rebuild `Surfaces` from the addresses and lengths in a `MaskTable`; fields that masks do not need are empty."""
    n, m, n_texels, n_textures = table[0], table[1], table[2], table[3]
    none3 = _carray(_pointer(table[4]), (0, 3, 3), np.float32)
    uvs = _carray(_pointer(table[5]), (n, 3, 2), np.float32)
    material = _carray(_pointer(table[6]), (n,), np.int32)
    alpha = _carray(_pointer(table[7]), (m,), np.float32)
    alpha_texture = _carray(_pointer(table[8]), (m,), np.int32)
    alpha_cutoff = _carray(_pointer(table[9]), (m,), np.float32)
    texels = _carray(_pointer(table[10]), (n_texels, 4), np.uint8)
    textures = _carray(_pointer(table[11]), (n_textures, 3), np.int32)
    linear = _carray(_pointer(table[12]), (256,), np.float32)
    none1 = _carray(_pointer(table[4]), (0, 3), np.float32)
    return Surfaces(
        none3, none3, uvs, none3, material, none1, none1, alpha_texture, alpha_texture,
        alpha, alpha_texture, alpha_cutoff, texels, textures, alpha, linear, texels[0], none1,
    )  # fmt: skip


@cache
def _filter() -> Any:
    """The filter as a compiled callback `void (RTCFilterFunctionNArguments*)`."""

    def filter_masked(address: int) -> None:
        # what Embree passes: n rays, a flag per ray with a hit, the address of a `MaskTable`, and the hits
        arguments = _carray(_pointer(address), (6,), np.int64)
        n = _carray(_pointer(address + 40), (1,), np.uint32)[0]
        valid = _carray(_pointer(arguments[_VALID]), (n,), np.int32)
        table = _carray(_pointer(arguments[_USER]), (16,), np.int64)
        hits = _carray(_pointer(arguments[_HIT]), (8, n), np.float32)
        triangles = _carray(_pointer(arguments[_HIT]), (8, n), np.uint32)
        s = _surfaces_at(table)
        first_masked = table[13]
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


class MaskTable:
    """What the filter reads: the addresses and lengths of the scene's arrays in one block. Keeps the arrays alive."""

    def __init__(self, scene: Scene) -> None:
        s = surfaces(scene)
        nothing = np.zeros(1, np.float32)
        self._kept = (s, nothing)
        arrays = (nothing, s.uvs, s.material, s.alpha, s.alpha_texture, s.alpha_cutoff, s.texels, s.textures, s.linear)
        self._table = np.array(
            [len(scene.corners), len(s.alpha), len(s.texels), len(s.textures)]
            + [array.ctypes.data for array in arrays]
            + [scene.n_opaque, 0, 0],
            np.int64,
        )
        self.address: int = self._table.ctypes.data
        self.filter_address: int = _filter().address
