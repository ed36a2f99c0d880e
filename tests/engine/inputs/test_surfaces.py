"""Texels, colours, normals and points where a ray meets a triangle."""

from typing import Any

import numpy as np
import pytest
from support import tiny
from support.triangles import QUANTITIES, find_numbers

from framearray_cli.base.colour import linear_from_srgb8
from framearray_cli.engine.inputs.mips import Footprint, Mips, filtered, mips
from framearray_cli.engine.inputs.surfaces import (
    OFFSET_ULPS,
    ULP,
    Surfaces,
    is_cut_out,
    nearest_texel_at,
    surfaces,
    texture_at,
    total_at,
)
from framearray_cli.engine.kernels.kernel import kernel
from framearray_cli.scene.files import Material, Meshes
from framearray_cli.scene.files.model import BLACK, CLAMP, MIRROR, NEAREST, REPEAT, SCREENED, UV_SET, WRAP_V, Part
from framearray_cli.scene.scene import build_scene

QUAD = tiny.quad((0, 0, 0), (1, 0, 0), (1, 1, 0), (0, 1, 0))
UVS = np.array([[[0, 0], [1, 0], [1, 1]], [[0, 0], [1, 1], [0, 1]]], np.float64)


@kernel
def look_up(s: Surfaces, uv: Any, out: Any) -> None:
    for i in range(uv.shape[0]):
        out[0, i, 0], out[0, i, 1], out[0, i, 2], out[0, i, 3] = texture_at(s, 0, uv[i, 0], uv[i, 1])
        out[1, i, 0], out[1, i, 1], out[1, i, 2], out[1, i, 3] = nearest_texel_at(s, 0, uv[i, 0], uv[i, 1])


@kernel
def add_up(s: Surfaces, triangle: int, uv: Any, out: Any) -> None:
    for i in range(uv.shape[0]):
        out[i, 0], out[i, 1], out[i, 2] = total_at(s, triangle, uv[i, 0], uv[i, 1])


@kernel
def cut_out(s: Surfaces, triangle: int, uv: Any, out: Any) -> None:
    for i in range(uv.shape[0]):
        out[i] = is_cut_out(s, triangle, uv[i, 0], uv[i, 1])


@kernel
def blur(m: Mips, uv: Any, steps: Any, taps: Any, width: Any, out: Any) -> None:
    for i in range(uv.shape[0]):
        out[i, 0], out[i, 1], out[i, 2] = filtered(m, 1, Footprint(uv[i, 0], uv[i, 1], steps[0], steps[1], taps, width))


def textured(texels: Any) -> Surfaces:
    return surfaces(tiny.scene_of(QUAD, Material(name="T", texture=0), uvs=UVS, textures=(texels,)))


def looked_up(s: Surfaces, uv: Any) -> Any:
    """Blended and nearest texels, (2, n, 4)."""
    uv = np.asarray(uv, np.float32)
    out = np.empty((2, len(uv), 4), np.float32)
    look_up(s, uv, out)
    return out


def expected_texels(texels: Any, uv: Any, along_u: int = REPEAT, along_v: int = REPEAT, *, nearest: bool) -> Any:
    """The twin in float64, (n, 4)."""
    height, width, _ = texels.shape
    values = np.concatenate([linear_from_srgb8(texels[..., :3]), texels[..., 3:] / 255], axis=2)

    def at(number: Any, wrap: int, n: int) -> Any:
        """Texels, and 0 for those that are black."""
        mirrored = np.minimum(number % (2 * n), 2 * n - 1 - number % (2 * n))
        clamped = np.clip(number, 0, n - 1)
        shown = (wrap != BLACK) | (number == clamped)
        return {REPEAT: number % n, MIRROR: mirrored}.get(wrap, clamped), shown

    place = uv.astype(np.float64) * [width, -height] - 0.5
    low = np.floor(place).astype(int)
    share = (place - low >= 0.5) if nearest else place - low
    low[:, 1] += height  # row 0 is on top
    expected = np.zeros((len(uv), 4))
    for i, j in ((0, 0), (1, 0), (0, 1), (1, 1)):
        weight = abs(1 - i - share[:, 0]) * abs(1 - j - share[:, 1])
        (row, has_row), (column, has_column) = at(low[:, 1] + j, along_v, height), at(low[:, 0] + i, along_u, width)
        expected += (weight * has_row * has_column)[:, None] * values[row, column]
    return expected


@pytest.mark.parametrize("nearest", [0, NEAREST])
@pytest.mark.parametrize(("along_u", "along_v"), [(CLAMP, REPEAT), (REPEAT, CLAMP), (MIRROR, CLAMP), (BLACK, MIRROR)])
def test_textures_continue_as_their_sampler_says(along_u: int, along_v: int, nearest: int) -> None:
    random = np.random.default_rng(4)
    texels, uv = random.integers(0, 256, (4, 5, 4), dtype=np.uint8), random.uniform(-2.5, 3.5, (200, 2))
    s = textured(texels)._replace(samplers=np.array([along_u | along_v << WRAP_V | nearest], np.int32))
    for found, whole in zip(looked_up(s, uv), (bool(nearest), True), strict=True):
        np.testing.assert_allclose(found, expected_texels(texels, uv, along_u, along_v, nearest=whole), atol=2e-6)


@pytest.mark.parametrize(("along_u", "along_v"), [(CLAMP, BLACK), (MIRROR, CLAMP), (BLACK, MIRROR), (REPEAT, BLACK)])
def test_smaller_copies_continue_as_their_sampler_says(along_u: int, along_v: int) -> None:
    """Within half a texel of all edges and beyond them, of three copies and between them, by one tap or several."""
    random = np.random.default_rng(5)
    texels = random.integers(0, 256, (12, 20, 4), dtype=np.uint8)
    wraps = along_u | along_v << WRAP_V | NEAREST  # copies are blended all the same
    part = Part(material=0, corners=QUAD, uvs=np.concatenate([UVS, UVS], 2))
    meshes = Meshes(
        parts=(part,), materials=(Material(name="T", texture=1, specular_texture=0, specular=(0.5, 0.5, 0.5)),),
        textures=(tiny.checks(4), texels), dropped={}, notes=(), samplers=(0, wraps),
    )  # fmt: skip
    scene = build_scene(meshes, {}, as_file=True)
    copies = [scene.texels[first : first + n * m].reshape(m, n, 4) for first, n, m in scene.levels[1, :5]]
    assert [copy.shape[:2] for copy in copies] == [(12, 20), (6, 10), (3, 5), (1, 2), (1, 1)]
    edges = (np.array([-1.7, -0.4, -0.1, 0.0, 0.1, 0.4, 0.6])[:, None] / [1, 5, 10, 20]).ravel()
    u, v = (values.ravel() for values in np.meshgrid([*edges, *(1 - edges)], [*edges, *(1 - edges)]))
    uv, steps = np.column_stack([u, v]).astype(np.float32), np.array([0.03, -0.05], np.float32)
    for level in range(3):
        for share, taps in ((0.0, 1), (0.25, 3)):
            out = np.empty((len(uv), 3), np.float32)
            blur(
                mips(scene, surfaces(scene), 1.0), uv, steps, np.float32(taps), np.float32(2**level * (1 + share)), out
            )
            expected = np.zeros((len(uv), 4))
            for tap in range(taps):
                place = uv.astype(float) + ((tap + 0.5) / taps - 0.5) * steps.astype(float)
                for copy, weight in ((copies[level], 1 - share), (copies[level + 1], share)):
                    expected += weight / taps * expected_texels(copy, place, along_u, along_v, nearest=False)
            np.testing.assert_allclose(out, expected[:, :3], atol=4e-6)


@pytest.mark.parametrize(("width", "height"), [(8, 8), (5, 3), (1, 1), (1, 7)])
def test_textures_without_a_sampler_repeat(width: int, height: int) -> None:
    """At centres of texels, on their borders, and anywhere else."""
    random = np.random.default_rng(1)
    texels = random.integers(0, 256, (height, width, 4), dtype=np.uint8)
    texels[0, 0] = (0, 255, 10, 255)
    halves = np.meshgrid(np.arange(-6 * width, 6 * width + 1) / 2, np.arange(-6 * height, 6 * height + 1) / 2)
    uv = np.concatenate([np.stack(halves, axis=-1).reshape(-1, 2) / (width, height), random.uniform(-3, 5, (999, 2))])
    uv = uv.astype(np.float32)
    blended, nearest = looked_up(textured(texels), uv)
    np.testing.assert_allclose(blended, expected_texels(texels, uv, nearest=False), rtol=0, atol=2e-6)
    inside = (abs(uv * (width, height) % 1 - 0.5) < 0.49).all(axis=1)
    assert 0.2 < inside.mean() < 0.95
    expected = expected_texels(texels, uv[inside], nearest=True)
    np.testing.assert_allclose(nearest[inside], expected, rtol=3e-7, atol=0)


def test_a_texture_reads_its_own_set_of_texture_coordinates() -> None:
    material = Material(name="T", reflectivity=(1.0, 1.0, 1.0), texture=0, alpha_texture=1, alpha_cutoff=0.5)
    texels = np.zeros((1, 2, 4), np.uint8)
    texels[0, 0], texels[0, 1] = 255, 0
    part = Part(material=0, corners=QUAD, uvs=np.concatenate([np.full_like(UVS, 0.25), np.full_like(UVS, 0.75)], 2))
    meshes = Meshes(
        parts=(part,), materials=(material,), textures=(texels, texels), dropped={}, notes=(), samplers=(0, 1 << UV_SET)
    )
    scene = build_scene(meshes, {})
    assert len(scene.texels) == 2 and len(scene.uvs) == 4
    s, uv = surfaces(scene), np.array([[0.3, 0.3]], np.float32)
    total, out = np.empty((1, 3), np.float32), np.empty(1, np.bool_)
    add_up(s, 1, uv, total)
    cut_out(s, 1, uv, out)
    assert total.tolist() == [[1, 1, 1]] and out[0]


def found(s: Surfaces, uv: Any = ((0.25, 0.25),), way: Any = (0, 0, -1), triangle: int = 0) -> Any:
    """Quantities (n, 3) by name, at points (n, 2) of a triangle."""
    points = np.ascontiguousarray(np.asarray(uv, np.float32).T)
    n = points.shape[1]
    ways = np.repeat(np.asarray(way, np.float32)[:, None], n, axis=1)
    out = np.empty((len(QUANTITIES), 3, n), np.float32)
    find_numbers(s, np.full(n, triangle, np.int32), points, ways, out)
    return {name: part.T for name, part in zip(QUANTITIES, out, strict=True)}


def test_nearest_texels_have_the_average_of_blended_ones() -> None:
    """Obscurance takes the nearest texel: each texel counts for its own area, as when it is blended."""
    s = textured(tiny.checks(16))
    places = ((np.arange(512) + 0.5) / 512).astype(np.float32)
    blended, nearest = looked_up(s, np.ascontiguousarray(np.stack(np.meshgrid(places, places), axis=-1).reshape(-1, 2)))
    np.testing.assert_allclose(nearest.mean(axis=0, dtype=float), blended.mean(axis=0, dtype=float), rtol=1e-5)
    assert abs(nearest - blended).max() > 0.1


def test_reflectivity_in_all_is_the_diffuse_and_the_mirror_part() -> None:
    """At texel centres, where blending changes nothing."""
    material = Material(name="T", reflectivity=(0.5, 0.4, 0.3), texture=0, specular=(0.2, 0.1, 0.4), specular_texture=0)
    s = surfaces(tiny.scene_of(QUAD, material, uvs=UVS, textures=(tiny.checks(4),)))
    uv = np.float32([[0.25, 0.125], [0.5, 0.125], [0.25, 0.375]])  # of the first triangle: (u + v, v) in the texture
    total = np.empty((len(uv), 3), np.float32)
    add_up(s, 0, uv, total)
    parts = found(s, uv)
    np.testing.assert_allclose(total, parts["diffuse"] + parts["mirror"], rtol=0, atol=2e-6)
    assert (parts["mirror"] > 0.01).any()


def test_v_points_up() -> None:
    texels = np.zeros((2, 1, 4), np.uint8)
    texels[0] = 255  # white on top
    low, high = looked_up(textured(texels), [[0.5, 0.25], [0.5, 0.75]])[0]
    assert high[:3].tolist() == [1, 1, 1] and low[:3].tolist() == [0, 0, 0]


def test_an_endless_coordinate_gives_some_texel() -> None:
    values = looked_up(textured(tiny.checks(8)), [[np.inf, 0.5], [0.5, np.nan], [-np.inf, np.nan]])
    assert np.isfinite(values).all()


def test_texture_and_corner_colours_multiply_the_factor() -> None:
    colours = np.array([[[1, 0, 0], [0, 1, 0], [0, 0, 1]], [[1, 1, 1]] * 3], np.float32)
    texels = np.full((2, 2, 4), 188, np.uint8)
    material = Material(name="T", reflectivity=(0.5, 1.0, 0.25), texture=0)
    s = surfaces(tiny.scene_of(QUAD, material, uvs=UVS, colours=colours, textures=(texels,)))
    grey = linear_from_srgb8(np.uint8([188]))[0]
    values = found(s, [[0, 0], [1, 0], [0, 1], [0.25, 0.5]])["diffuse"]
    weights = np.array([[1, 0, 0], [0, 1, 0], [0, 0, 1], [0.25, 0.25, 0.5]])
    np.testing.assert_allclose(values, weights * (0.5, 1.0, 0.25) * grey, rtol=1e-6, atol=1e-7)
    assert (found(s)["mirror"] == 0).all()


def test_the_mirror_part_has_its_own_factor_and_texture() -> None:
    texels = np.full((2, 2, 4), 255, np.uint8)
    texels[..., 1] = 188
    material = Material(name="M", reflectivity=(0.1, 0.1, 0.1), specular=(0.5, 0.5, 0.25), specular_texture=0)
    values = found(surfaces(tiny.scene_of(QUAD, material, uvs=UVS, textures=(texels,))))
    grey = linear_from_srgb8(np.uint8([188]))[0]
    np.testing.assert_allclose(values["mirror"][0], [0.5, 0.5 * grey, 0.25], rtol=1e-6)
    np.testing.assert_allclose(values["diffuse"][0], 0.1, rtol=1e-6)


def test_the_alpha_mask_cuts_below_the_cutoff() -> None:
    texels = np.full((1, 4, 4), 255, np.uint8)
    texels[0, :, 3] = (0, 127, 128, 255)
    uv = np.column_stack([np.arange(0.125, 1, 0.25), np.full(4, 0.5)])
    result = np.empty(4, np.uint8)
    for alpha, cutoff, expected in ((1.0, 0.5, [1, 1, 0, 0]), (0.5, 0.5, [1, 1, 1, 0]), (1.0, 0.2, [1, 0, 0, 0])):
        material = Material(name="A", alpha=alpha, alpha_texture=0, alpha_cutoff=cutoff)
        big = tiny.scene_of(
            QUAD[:1], material, uvs=np.array([[[0, 0], [1, 0], [0, 1]]], np.float64), textures=(texels,)
        )
        cut_out(surfaces(big), 0, uv.astype(np.float32), result)
        assert result.tolist() == expected


def test_a_screen_is_solid_at_the_share_alpha_of_its_places() -> None:
    n = 20_000
    uv = np.random.default_rng(6).dirichlet((1, 1, 1), n)[:, :2].astype(np.float32)
    holes = np.empty((2, n), np.uint8)
    for alpha in (0.0, 0.3, 0.75, 1.0):
        s = surfaces(tiny.scene_of(QUAD, Material(name="A", alpha=alpha, alpha_cutoff=SCREENED)))
        for triangle in (0, 1):
            cut_out(s, triangle, uv, holes[triangle])
        assert abs(holes.mean() - (1 - alpha)) <= 4 * np.sqrt(alpha * (1 - alpha) / holes.size)
        # both triangles have holes of their own
        assert abs(holes.all(axis=0).mean() - (1 - alpha) ** 2) <= 4 * np.sqrt(0.25 / n) * (0 < alpha < 1)


def test_normals_are_on_the_viewers_side() -> None:
    tilted = np.tile([0.0, 0.6, 0.8], (2, 3, 1))
    s = surfaces(tiny.scene_of(QUAD, normals=tilted))
    for way, sign in (((0, 0, -1), 1), ((0.9, 0, -0.1), 1), ((0, 0, 1), -1)):
        values = found(s, way=way)
        np.testing.assert_allclose(values["geometric"][0], [0, 0, sign], atol=1e-7)
        np.testing.assert_allclose(values["shading"][0], [0, sign * 0.6, sign * 0.8], atol=1e-7)


def test_interpolated_normals_have_length_one() -> None:
    normals = np.random.default_rng(3).normal(size=(2, 3, 3)) * 0.3 + [0, 0, 1]
    normals /= np.linalg.norm(normals, axis=-1, keepdims=True)
    s = surfaces(tiny.scene_of(QUAD, normals=normals))
    uv = np.random.default_rng(4).dirichlet((1, 1, 1), 100)[:, :2]
    values = found(s, uv)["shading"]
    np.testing.assert_allclose(np.linalg.norm(values, axis=1), 1, rtol=3e-7)
    expected = np.column_stack([1 - uv.sum(axis=1), uv]) @ s.normals[0].astype(np.float64)
    expected /= np.linalg.norm(expected, axis=1, keepdims=True)
    np.testing.assert_allclose(values, expected, atol=1e-6)


def test_normals_that_cancel_leave_the_geometric_one() -> None:
    scene = tiny.scene_of(QUAD[:1], normals=np.array([[[1.0, 0, 0], [-1.0, 0, 0], [0, 1.0, 0]]]))
    values = found(surfaces(scene), [[0.5, 0.0]])
    np.testing.assert_array_equal(values["shading"], values["geometric"])


@pytest.mark.parametrize("size", [1e-9, 1e-4, 1.0, 1e4, 1e9])
def test_points_and_normals_at_every_scale(size: float) -> None:
    rng = np.random.default_rng(5)
    scene = tiny.scene_of(rng.normal(size=(20, 3, 3)) * size)
    s = surfaces(scene)
    for triangle in range(20):
        values = found(s, [[0.2, 0.3]], triangle=triangle)
        a, b, c = scene.corners[triangle].astype(np.float64)
        np.testing.assert_allclose(values["position"][0], 0.5 * a + 0.2 * b + 0.3 * c, rtol=0, atol=2e-7 * size)
        normal = np.cross(b - a, c - a) / np.linalg.norm(np.cross(b - a, c - a))
        np.testing.assert_allclose(values["geometric"][0], normal * np.sign(normal[2]), atol=1e-6)


def test_the_offset_follows_the_largest_coordinate() -> None:
    scene = tiny.room()
    expected = OFFSET_ULPS * ULP * abs(scene.corners).max(axis=(1, 2))
    np.testing.assert_allclose(surfaces(scene).offset, expected, rtol=1e-6)
