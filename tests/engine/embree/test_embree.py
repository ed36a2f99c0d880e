"""The door to Embree: packets find the hits that embreex's own API finds one by one."""

import os
import re
import sys
from collections.abc import Iterator
from functools import cache
from typing import Any

import numba
import numpy as np
import pytest
from embreex import rtcore_scene
from support import instructionset, scenes, tiny
from support.program import python

from framearray_cli.base.errors import MissingExtraError
from framearray_cli.engine.embree import library
from framearray_cli.engine.embree.embreescene import EmbreeScene
from framearray_cli.engine.embree.library import embree_library, embree_properties
from framearray_cli.engine.embree.packets import (
    DIRECTION,
    GEOMETRY,
    HIT_ROWS,
    MASK,
    MASKED,
    MISS,
    ORIGIN,
    RAY_ROWS,
    TFAR,
    TRIANGLE,
    U,
    V,
    aligned_zeros,
    empty_packets,
    intersect,
    occlude,
)
from framearray_cli.engine.inputs.surfaces import is_cut_out, surfaces
from framearray_cli.engine.kernels.simd import LANES
from framearray_cli.scene.files import Material
from framearray_cli.scene.files.model import SCREENED
from framearray_cli.scene.scene import Scene, load_scene

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


# Embree divides by a reciprocal that it refines by one Newton step, which depends on the instruction set. Step and
# product round to float32 and leave up to 4 units in the last place. Exact distances here leave none to a division.
RECIPROCAL = 2.0**-21


def filled(n_rows: int, origins: Any, dirs: Any, far: Any) -> Any:
    """Packets with rays (n, 3), (n, 3), (n,)."""
    packets = empty_packets(len(origins), n_rows)
    flat = packets.transpose(0, 2, 1).reshape(-1, packets.shape[1])
    flat[: len(origins), ORIGIN : ORIGIN + 3] = origins
    flat[: len(origins), DIRECTION : DIRECTION + 3] = dirs
    flat[: len(origins), TFAR] = far
    packets[:] = flat.reshape(len(packets), packets.shape[2], -1).transpose(0, 2, 1)
    return packets


def first_hits(
    scene: EmbreeScene, origins: Any, dirs: Any, far: Any = np.inf, coherent: bool = False, near: float = 0.0
) -> Any:
    """(n, 4) float64: triangle or -1, t, u, v of each ray."""
    packets = filled(HIT_ROWS, origins, dirs, far)
    intersect(scene.tracer, packets, len(origins), coherent, near)
    rows = packets.transpose(0, 2, 1).reshape(-1, HIT_ROWS)[: len(origins)]
    bits = np.ascontiguousarray(rows).view(np.int32)
    triangle = bits[:, TRIANGLE] + scene.tracer.first_masked * (bits[:, GEOMETRY] == MASKED)
    return np.column_stack([triangle, rows[:, [TFAR, U, V]]])


def blocked(scene: EmbreeScene, origins: Any, dirs: Any, far: Any, coherent: bool = False) -> Any:
    """(n,) whether each ray meets anything before `far`."""
    packets = filled(RAY_ROWS, origins, dirs, far)
    occlude(scene.tracer, packets, len(origins), coherent)
    return packets[:, TFAR].reshape(-1)[: len(origins)] < 0


def both(scene: Scene, *rays: Any, coherent: bool = False) -> tuple[Any, Any, Any, Any]:
    """First hits and occlusion of packets and of the twin; `coherent` is passed to packets."""
    twin = EmbreexTwin(scene)
    with EmbreeScene(scene) as a:
        return first_hits(a, *rays, coherent), twin.first_hits(*rays), blocked(a, *rays, coherent), twin.blocked(*rays)


def random_rays(scene: Scene, n: int, seed: int = 1) -> tuple[Any, Any, Any]:
    """Rays from anywhere in the scene's box in all directions; half of them are endless."""
    rng = np.random.default_rng(seed)
    low, high = scene.corners.min(axis=(0, 1)), scene.corners.max(axis=(0, 1))
    origins = (low + (high - low) * rng.random((n, 3))).astype(np.float32)
    dirs = rng.normal(size=(n, 3)).astype(np.float32)
    dirs /= np.linalg.norm(dirs, axis=1, keepdims=True)
    far = np.where(rng.random(n) < 0.5, np.inf, rng.random(n) * float((high - low).max()) / 2)
    return origins, dirs, far.astype(np.float32)


def litter(n: int, seed: int = 3, **material: Any) -> Scene:
    """n small triangles in a cube, with texture coordinates."""
    rng = np.random.default_rng(seed)
    corners = rng.random((n, 1, 3)) * 6 + rng.normal(size=(n, 3, 3)) * 0.2
    uvs = rng.random((n, 3, 2)) * 3
    texels = tiny.checks(16)
    texels[..., 3] = rng.integers(0, 2, (16, 16)) * 255
    return tiny.scene_of(corners, Material(name="Litter", **material), uvs=uvs, textures=(texels,))


@pytest.fixture(scope="module")
def large() -> Scene:
    """A real scene where there is one, else litter."""
    file = scenes.scenes_folder() / "modern_hall" / "modern_hall.glb"
    scene = load_scene(file) if file.is_file() else litter(30_000, texture=0)
    assert len(scene.corners) > 20_000 and scene.n_opaque == len(scene.corners)
    return scene


@pytest.mark.parametrize("n", [100_000, pytest.param(1_000_000, marks=pytest.mark.slow)])
def test_every_hit_is_the_same(n: int, large: Scene) -> None:
    a, b, dark_a, dark_b = both(large, *random_rays(large, n))
    hit = a[:, 0] >= 0
    assert 0.2 < hit.mean() < 0.98
    np.testing.assert_array_equal(a[:, 0], b[:, 0])
    np.testing.assert_array_equal(a[hit], b[hit])  # t, u and v to the last bit
    np.testing.assert_array_equal(dark_a, dark_b)
    np.testing.assert_array_equal(dark_a, hit)  # no mask: what blocks a ray is what it hits


def test_hits_are_the_same_in_packets_marked_as_coherent(large: Scene) -> None:
    """Rays that are, as eye and shadow rays, and rays that are not."""
    origins, dirs, far = random_rays(large, 200_000)
    rng = np.random.default_rng(4)
    bundled = np.repeat(dirs[: len(dirs) // LANES], LANES, axis=0) + rng.normal(size=(200_000, 3)) * 0.02
    together = np.repeat(origins[: len(dirs) // LANES], LANES, axis=0), bundled.astype(np.float32), far
    for rays in (together, (origins, dirs, far)):
        a, b, dark_a, dark_b = both(large, *rays, coherent=True)
        other = a[:, 0] != b[:, 0]
        hit = (a[:, 0] >= 0) & ~other
        np.testing.assert_array_equal(a[hit], b[hit])
        np.testing.assert_array_equal(dark_a, dark_b)
        # either of two coincident triangles may be found first; their distances differ in the last digits only
        assert (a[other, 0] >= 0).all() and (b[other, 0] >= 0).all()
        np.testing.assert_allclose(a[other, 1], b[other, 1], rtol=RECIPROCAL)
        assert other.mean() < 1e-3


def test_a_different_ray_would_be_seen(large: Scene) -> None:
    """The comparison above can fail."""
    origins, dirs, far = random_rays(large, 10_000)
    with EmbreeScene(large) as scene:
        a, b = first_hits(scene, origins, dirs, far), first_hits(scene, origins, np.nextafter(dirs, 2), far)
    assert (a != b).any()


def test_masked_triangles_are_cut_out_alike() -> None:
    """embreex starts again behind each cut-out hit, so its distances are sums and may differ in their last digits."""
    scene = litter(3_000, texture=0, alpha_texture=0, alpha_cutoff=0.5)
    assert scene.n_opaque == 0
    a, b, dark_a, dark_b = both(scene, *random_rays(scene, 6_000))
    hit = a[:, 0] >= 0
    assert 0.2 < hit.mean() < 0.9
    # a point within rounding of a mask's edge or of the far end may go either way: 1 ray in 1000 is far more than that
    other = a[:, 0] != b[:, 0]
    assert other.sum() <= 6
    assert (dark_a != dark_b).sum() <= 6
    np.testing.assert_array_equal(dark_a, hit)
    same = hit & ~other
    # some layers, each with a step of 4e-7 of coordinates up to 6
    np.testing.assert_allclose(a[same, 1], b[same, 1], rtol=0, atol=1e-5)
    # barycentric coordinates lose what the distance loses, over triangles of about 0.3, some of them slim
    assert np.quantile(abs(a[same, 2:] - b[same, 2:]), 0.99) < 1e-4
    opaque = litter(3_000, texture=0)
    solid = both(opaque, *random_rays(opaque, 6_000))[0]
    assert (solid[:, 0] >= 0).sum() > 1.1 * hit.sum()  # something was cut out


def test_masks_of_a_real_scene() -> None:
    scene = load_scene(scenes.shared_scene("grey_white_room/grey_white_room.glb"))
    masked = scene.corners[scene.n_opaque :]
    assert len(masked)
    rng = np.random.default_rng(5)
    inside = masked.mean(axis=1)[rng.integers(0, len(masked), 4_000)]
    origins = (inside + rng.normal(size=inside.shape) * 0.3).astype(np.float32)
    a, b, dark_a, dark_b = both(scene, origins, (inside - origins).astype(np.float32), np.float32(np.inf))
    assert (a[:, 0] >= scene.n_opaque).sum() > 100
    assert (a[:, 0] != b[:, 0]).sum() <= 4
    assert (dark_a != dark_b).sum() <= 4
    same = (a[:, 0] == b[:, 0]) & (a[:, 0] >= 0)
    np.testing.assert_allclose(a[same, 1], b[same, 1], rtol=1e-4)


def test_opaque_and_masked_triangles_of_one_scene() -> None:
    """A fence of two halves before a wall: the lower half of its texture is cut out."""
    texels = np.full((2, 2, 4), 255, np.uint8)
    texels[1, :, 3] = 0  # the bottom row
    fence = tiny.quad((-1, -1, 0), (1, -1, 0), (1, 1, 0), (-1, 1, 0))
    wall = tiny.quad((-9, -9, -1), (9, -9, -1), (9, 9, -1), (-9, 9, -1))
    uvs = np.array([[[0, 0], [1, 0], [1, 1]], [[0, 0], [1, 1], [0, 1]]])
    fencing = Material(name="Fence", alpha_texture=0, alpha_cutoff=0.5), {"corners": fence, "uvs": uvs}
    scene = tiny.scene_with(fencing, (Material(name="Wall"), wall), textures=(texels,))
    assert scene.n_opaque == 2
    origins = np.array([[0.1, 0.5, 5], [0.1, -0.5, 5], [0.1, 5, 5]], np.float32) - scene.centre.astype(np.float32)
    dirs = np.array([[0, 0, -1]] * 3, np.float32)
    with EmbreeScene(scene) as opened:
        hits = first_hits(opened, origins, dirs)
        assert (hits[:, 0] >= 2).tolist() == [True, False, False]  # fence, wall through the hole, wall
        assert hits[:, 1] == pytest.approx([5, 6, 6], rel=1e-6)
        assert blocked(opened, origins, dirs, 5.5).tolist() == [True, False, False]


def test_a_screen_stops_the_share_alpha_of_rays() -> None:
    """Rays that find hits and rays that are only tested agree, ray by ray."""
    alpha, n = 0.4, 10_000
    curtain = tiny.quad((-4, -4, 0), (4, -4, 0), (4, 4, 0), (-4, 4, 0))
    scene = tiny.scene_of(curtain, Material(name="A", alpha=alpha, alpha_cutoff=SCREENED))
    origins = np.column_stack([*np.random.default_rng(1).uniform(-1, 1, (2, n)), np.full(n, 3.0)]).astype(np.float32)
    dirs = np.tile(np.float32([0.1, 0.2, -1.0]), (n, 1))
    with EmbreeScene(scene) as opened:
        stopped = blocked(opened, origins, dirs, np.inf)
        assert abs(stopped.mean() - alpha) < 4 * np.sqrt(alpha * (1 - alpha) / n)
        np.testing.assert_array_equal(first_hits(opened, origins, dirs)[:, 0] >= 0, stopped)


def test_hits_nearer_than_the_limit_are_ignored() -> None:
    """Three sheets one behind the other, the first of them where rays start."""
    sheets = [tiny.quad((-1, -1, z), (1, -1, z), (1, 1, z), (-1, 1, z)) for z in (0.0, -1.0, -2.0)]
    scene = tiny.scene_of(np.concatenate(sheets))
    origins = np.tile(np.float32([0.2, 0.3, 1.0]), (20, 1))  # centred: the first sheet is at z = 1
    dirs = np.tile(np.float32([0, 0, -1]), (20, 1))
    with EmbreeScene(scene) as opened:
        for near, found in ((1e-5, 1), (0.999, 1), (1.001, 2)):
            assert first_hits(opened, origins, dirs, near=near)[:, 1] == pytest.approx(np.full(20, found), rel=1e-6)
        assert (first_hits(opened, origins, dirs, near=2.5)[:, 0] == MISS).all()
        assert (first_hits(opened, origins, dirs, 1.5, near=1.2)[:, 0] == MISS).all()
        # without a limit nothing is ignored
        assert first_hits(opened, origins + np.float32([0, 0, 0.5]), dirs)[:, 1] == pytest.approx(0.5, rel=1e-6)


def test_packets_can_be_used_again() -> None:
    """A later call with the same packets has no limit, or hit, of an earlier one."""
    sheets = [tiny.quad((-1, -1, z), (1, -1, z), (1, 1, z), (-1, 1, z)) for z in (0.0, -1.0, -2.0)]
    packets = filled(HIT_ROWS, np.tile([0.2, 0.3, 1.0], (20, 1)), np.tile([0.0, 0.0, -1.0], (20, 1)), np.inf)
    start = packets[:, TFAR].copy()
    with EmbreeScene(tiny.scene_of(np.concatenate(sheets))) as opened:
        for near, found in ((1.001, 2), (0.0, 0), (2.5, np.inf), (1e-5, 1)):
            packets[:, TFAR] = start
            intersect(opened.tracer, packets, 20, False, near)
            assert packets[:, TFAR].reshape(-1)[:20] == pytest.approx(np.full(20, found), rel=1e-6)


@pytest.mark.parametrize("masked", [False, True])
def test_the_twin_ignores_the_same_hits(masked: bool) -> None:
    scene = litter(3_000, texture=0, **({"alpha_texture": 0, "alpha_cutoff": 0.5} if masked else {}))
    origins, dirs, far = random_rays(scene, 4_000)
    other = EmbreexTwin(scene).first_hits(origins, dirs, far, near=0.7)
    with EmbreeScene(scene) as a:
        one = first_hits(a, origins, dirs, far, near=0.7)
        usual = first_hits(a, origins, dirs, far)
    assert (one[:, 0] != other[:, 0]).sum() <= 4  # where triangles meet at an edge, or a mask at a texel's
    assert (one[one[:, 0] >= 0, 1] >= 0.7).all()
    assert (usual[usual[:, 0] >= 0, 1] < 0.7).sum() > 100  # there was something to ignore
    same = usual[:, 1] >= 0.7
    np.testing.assert_array_equal(one[same], usual[same])


@pytest.mark.parametrize("n", [1, 15, 16, 17])
def test_the_last_packet_may_be_partly_empty(n: int) -> None:
    scene = tiny.scene_of(tiny.quad((-1, -1, 0), (1, -1, 0), (1, 1, 0), (-1, 1, 0)))
    origins = np.tile(np.float32([0.2, 0.3, 2]), (n, 1))
    dirs = np.tile(np.float32([0, 0, -1]), (n, 1))
    with EmbreeScene(scene) as opened:
        np.testing.assert_allclose(first_hits(opened, origins, dirs)[:, 1], 2, rtol=RECIPROCAL, atol=0)
        assert blocked(opened, origins, dirs, 3.0).all()
        assert not blocked(opened, origins, dirs, 1.5).any()
        assert (first_hits(opened, origins, dirs, 1.5)[:, 0] == MISS).all()


def test_coincident_faces_and_grazing_rays_do_not_let_rays_through() -> None:
    """Two boxes that share a face, met head on and at 0.1 degrees."""
    scene = tiny.scene_of(np.concatenate([tiny.box((-1, -1, -1), (0, 1, 1)), tiny.box((0, -1, -1), (1, 1, 1))]))
    rng = np.random.default_rng(2)
    aims = np.column_stack([np.zeros(2000), rng.uniform(-0.9, 0.9, (2000, 2))])
    grazing = np.array([np.sin(0.00175), 0.6, 0.8]) * 2.0
    for way in (np.array([1.0, 0.0, 0.0]), grazing):
        origins, dirs = (aims - 0.4 * way).astype(np.float32), np.tile(way.astype(np.float32), (2000, 1))
        inside = (abs(origins) < 1).all(axis=1)
        with EmbreeScene(scene) as opened:
            assert blocked(opened, origins[inside], dirs[inside], 10.0).all()


def test_a_wheel_that_does_not_hand_on_the_symbols_is_named(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setitem(library._SIGNATURES, "rtcNoSuchFunction", (None,))
    with pytest.raises(MissingExtraError, match=r"C functions, which .*rtcore_scene.* rtcNoSuchFunction"):
        library.embree_library.__wrapped__()


def test_packets_start_at_cache_lines() -> None:
    assert all(aligned_zeros(n).ctypes.data % 64 == 0 for n in range(1, 200))
    assert all(empty_packets(n, HIT_ROWS)[-1].ctypes.data % 64 == 0 for n in range(1, 20))


AVX2 = "isa=avx2"
NATIVE = """
from support import instructionset, tiny
from framearray_cli.engine.embree.embreescene import EmbreeScene
scene = EmbreeScene(tiny.scene_of(tiny.box((0, 0, 0), (1, 1, 1))))
print(instructionset.has_packets_of_16(scene._structures[0]._device))
"""


def test_avx2_can_be_forced_in_a_process_of_its_own() -> None:
    """As `make test-avx2` does; programs that tests start inherit it."""
    assert python(NATIVE, FRAMEARRAY_EMBREE=AVX2, PYTHONPATH=os.pathsep.join(sys.path)) == "False"


@pytest.mark.skipif(instructionset.FORCED != AVX2, reason="run by `make test-avx2`")
def test_forced_to_avx2_nothing_runs_with_avx512() -> None:
    with EmbreeScene(tiny.scene_of(tiny.box((0, 0, 0), (1, 1, 1)))) as opened:
        assert not instructionset.has_packets_of_16(opened._structures[0]._device)
    assert not instructionset.has_packets_of_16(instructionset.device_pointer(instructionset.forced_device()).value)
    assert rtcore_scene.EmbreeScene is instructionset.forced_scene
    limited = numba.njit(lower)
    limited(np.ones(64, np.float32), np.zeros(64, np.float32))
    (assembly,) = limited.inspect_asm().values()
    assert "ymm" in assembly and not re.search(r"zmm|%k[0-7]", assembly)


def lower(a: Any, b: Any) -> None:
    """A loop that AVX-512 would write with masks."""
    for i in range(len(a)):
        if a[i] > b[i]:
            a[i] = 3 * b[i]


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


# Packets at the very end of a page, behind which nothing may be read or written.
PROGRAM = """
import ctypes, mmap
import numpy as np
from framearray_cli.engine.embree import packets as module
from framearray_cli.engine.embree.library import embree_library

def at_the_end_of_a_page(n, dtype):
    size = n * np.dtype(dtype).itemsize
    room = -(-size // mmap.PAGESIZE) * mmap.PAGESIZE
    memory = mmap.mmap(-1, room + mmap.PAGESIZE)
    start = ctypes.addressof(ctypes.c_char.from_buffer(memory))
    assert not ctypes.CDLL(None).mprotect(ctypes.c_void_p(start + room), mmap.PAGESIZE, 0)
    return np.frombuffer(memory, dtype, n, room - size)

library = embree_library()
device = library.rtcNewDevice(b"isa=avx2") or library.rtcNewDevice(None)
scene = library.rtcNewScene(device)
vertices = np.array([0, 0, 0, 1, 0, 0, 0, 1, 0, 0, 0, 0, 0], np.float32)
indices = np.arange(3, dtype=np.uint32)
geometry = library.rtcNewGeometry(device, 0)
library.rtcSetSharedGeometryBuffer(geometry, 1, 0, 0x9003, vertices.ctypes.data, 0, 12, 3)
library.rtcSetSharedGeometryBuffer(geometry, 0, 0, 0x5003, indices.ctypes.data, 0, 12, 1)
library.rtcCommitGeometry(geometry)
library.rtcAttachGeometryByID(scene, geometry, 0)
library.rtcCommitScene(scene)
lanes = module.aligned_zeros(16).view(np.int32)
lanes[:] = -1
module.np = type("", (), dict(vars(np), zeros=staticmethod(at_the_end_of_a_page)))
rays = module.empty_packets(48, module.{rows})
rays[:, module.ORIGIN] = rays[:, module.ORIGIN + 1] = 0.2
rays[:, module.ORIGIN + 2], rays[:, module.DIRECTION + 2], rays[:, module.TFAR] = 1, -1, 10
for packet in rays:
    library.{function}(lanes.ctypes.data, scene, packet.ctypes.data, None)
print((rays[:, module.TFAR] < 10).all())
"""


@pytest.mark.parametrize(("rows", "function"), [("RAY_ROWS", "rtcOccluded16"), ("HIT_ROWS", "rtcIntersect16")])
def test_what_embree_writes_stays_in_the_memory_of_the_packets(rows, function):
    """Embree may write behind a packet of shadow rays; that memory must not belong to another array."""
    pytest.importorskip("fcntl", reason="no protected pages there")
    program = PROGRAM.format(rows=rows, function=function)
    assert python(program, FRAMEARRAY_PACKETS="16") == "True", "even where Embree has none"
