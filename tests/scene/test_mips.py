"""Smaller copies of textures: means in linear light, of all sizes."""

from itertools import pairwise
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from support.scenes import QUAD_UVS, Glb, png

from framearray_cli.base.colour import linear_from_srgb8, srgb8_from_linear
from framearray_cli.scene.scene import MOST_LEVELS, add_mips, halved, load_scene


def noise(height: int, width: int) -> Any:
    return np.random.default_rng(height * width).integers(0, 256, (height, width, 4), dtype=np.uint8)


def test_four_texels_become_their_mean_in_linear_light() -> None:
    texture = noise(6, 4)
    small = halved(texture)
    assert small.shape == (3, 2, 4)
    blocks = texture.reshape(3, 2, 2, 2, 4).swapaxes(1, 2).reshape(3, 2, 4, 4)
    right = linear_from_srgb8(blocks[..., :3]).mean(axis=2)
    # 0.54 code values, which are at most 2.3 / 255 of linear light wide
    assert linear_from_srgb8(small[..., :3]) == pytest.approx(right, abs=0.54 * 2.3 / 255)
    assert abs(small[..., 3] - blocks[..., 3].mean(axis=2)).max() <= 0.5


@pytest.mark.parametrize("shape", [(1, 1), (1, 9), (7, 1), (5, 3), (3, 8), (255, 17)])
def test_odd_sizes_keep_the_mean(shape: tuple[int, int]) -> None:
    texture = noise(*shape)
    small = halved(texture)
    assert small.shape == (max(shape[0] // 2, 1), max(shape[1] // 2, 1), 4)
    before, after = (linear_from_srgb8(t[..., :3]).mean(axis=(0, 1)) for t in (texture, small))
    assert after == pytest.approx(before, abs=0.54 * 2.3 / 255)
    grey = np.full((*shape, 4), 99, np.uint8)
    assert (halved(grey) == 99).all()


@pytest.mark.parametrize("shape", [(3, 1), (5, 3), (255, 17), (33, 4099), (20_001, 7)])
def test_every_part_of_odd_sizes_is_that_of_the_twin(shape: tuple[int, int]) -> None:
    texture = noise(*shape)
    means = np.concatenate([linear_from_srgb8(texture[..., :3]), texture[..., 3:].astype(np.float32)], axis=2)
    means = mean_of_parts(mean_of_parts(means).swapaxes(0, 1)).swapaxes(0, 1)
    small = halved(texture)
    assert small[..., :3].tolist() == srgb8_from_linear(means[..., :3]).tolist()
    assert small[..., 3].tolist() == np.rint(means[..., 3]).tolist()


def mean_of_parts(values: Any) -> Any:
    """Means of n // 2 equal parts of the n rows, part by part."""
    n = len(values)
    edges = np.arange(n // 2 + 1) * (n / (n // 2)) if n > 1 else np.arange(2)
    found = np.zeros((len(edges) - 1, *values.shape[1:]), np.float32)
    for k, (low, high) in enumerate(pairwise(edges)):
        rows = np.arange(int(low), min(int(np.ceil(high - 1e-9)), n))
        weight = np.minimum(rows + 1, high) - np.maximum(rows, low)
        found[k] = np.tensordot(weight / weight.sum(), values[rows], 1)
    return found


def test_levels_of_wanted_textures() -> None:
    textures = [noise(4, 2), noise(3, 3), noise(1, 1)]
    copies, levels = add_mips(textures, {0, 2})
    assert levels.shape == (3, MOST_LEVELS, 3)
    assert [copy.shape[:2] for copy in copies] == [(2, 1), (1, 1)]
    assert levels[0, :4].tolist() == [[0, 2, 4], [18, 1, 2], [20, 1, 1], [20, 1, 1]]
    assert levels[1].tolist() == [[8, 3, 3]] * MOST_LEVELS
    assert levels[2].tolist() == [[17, 1, 1]] * MOST_LEVELS


def test_only_surfaces_as_the_file_has_them_get_copies(tmp_path: Path) -> None:
    glb = Glb()
    paint = {"baseColorTexture": {"index": glb.texture(png(noise(8, 8)[..., :3]))}}
    bumps = {"index": glb.texture(png(noise(16, 16)[..., :3]))}
    mesh = glb.mesh(glb.material("Wall", paint, normalTexture=bumps), TEXCOORD_0=glb.accessor(QUAD_UVS))
    glb.node(mesh)
    file = glb.save(tmp_path / "a.glb")
    plain, by_file = load_scene(file), load_scene(file, as_file=True)
    assert (len(plain.texels), plain.levels.shape) == (64, (0, MOST_LEVELS, 3))
    assert len(by_file.texels) == 64 + 256 + 16 + 4 + 1
    assert by_file.textures.tolist() == [[0, 8, 8], [64, 16, 16]]
    assert by_file.levels[:, 3].tolist() == [[340, 1, 1], [64, 16, 16]]
