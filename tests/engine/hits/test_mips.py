"""Textures of what eyes see, blurred by what a ray stands for: a floor, near and far."""

from functools import cache
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from support import tiny
from support.scenes import Glb, png

from framearray_cli.base.colour import linear_from_srgb8
from framearray_cli.engine.embree.embreescene import EmbreeScene
from framearray_cli.engine.frames.setup import Scratch
from framearray_cli.engine.hits.hits import SURFACE
from framearray_cli.engine.hits.native import PixelSamples, native_hits
from framearray_cli.render.plan import frame_setup
from framearray_cli.render.prepare import open_embree, prepare

TILE = 64  # texels; one texture covers one unit of the floor
N = 1024


@cache
def pattern(kind: str) -> Any:
    """(TILE, TILE, 3) codes; stripes of a period of 8 texels that run along u or along v."""
    k = np.arange(TILE) // 4 % 2 * 200 + 30
    grey = {
        "along u": np.broadcast_to(k[:, None], (TILE, TILE)),
        "along v": np.broadcast_to(k, (TILE, TILE)),
        "noise": np.random.default_rng(3).integers(0, 256, (TILE, TILE)),
    }[kind]
    return np.repeat(grey[..., None], 3, axis=2).astype(np.uint8)


def floor(folder: Path, kind: str, *, second: bool = False) -> Path:
    """A floor of 400 x 400 units; u runs to the right and v away from the eye.

    Args:
        second: True for colours by a second set of coordinates with a transform, next to roughness by the first.
    """
    glb = Glb()
    s = 200.0
    corner = np.array([[-s, 0, s], [s, 0, s], [s, 0, -s], [-s, 0, -s]], np.float32)
    uvs = corner[:, [0, 2]] + np.float32(0.25)  # v of glTF points down, towards the eye
    paint: dict[str, Any] = {"baseColorTexture": {"index": glb.texture(png(pattern(kind)))}}
    sets = {"TEXCOORD_0": glb.accessor(uvs)}
    if second:
        paint["baseColorTexture"] |= {"texCoord": 1, "extensions": {"KHR_texture_transform": {"scale": [4, 4]}}}
        paint["metallicRoughnessTexture"] = {"index": glb.texture(png(pattern("along u")))}
        sets = {"TEXCOORD_0": glb.accessor(uvs / 7), "TEXCOORD_1": glb.accessor(uvs / 4)}
    glb.node(glb.mesh(glb.material("Floor", paint), positions=corner, **sets))
    return glb.save(folder / "floor.glb")


def reflectivities(
    file: Path, eye: Any, target: Any, *, surfaces: str = "file", fov: float = 2.0, hits: int = 1
) -> Any:
    """(N,) red reflectivity of the native hits of an image of 32 x 32 pixels."""
    camera = {"resolution": [32, 32], "fov": fov, "keys": [{"frame": 0, "eye": eye, "target": target}]}
    job = tiny.job(
        scene={"file": str(file), "surfaces": surfaces}, camera={"frames": 1, **camera}, samples={"hits": hits},
        light={"frames": 1, "sources": [tiny.SUN]},
    )  # fmt: skip
    prepared = prepare(job)
    with open_embree(prepared) as embree:
        assert isinstance(embree, EmbreeScene)
        setup = frame_setup(prepared, embree, np.zeros(3, np.float32))
        scratch = Scratch(setup, N)
        samples = PixelSamples(setup.seed, setup.order, per_pixel=1, first=0)
        native_hits(setup.cams, 0, samples, 0, N, setup.world, False, scratch.hit_rays.packets, scratch.hits)
    assert (scratch.hits.kind[:N] == SURFACE).all()
    return scratch.hits.reflectivity[:N, 0].astype(float)


def contrast(values: Any, kind: str) -> float:
    """Standard deviation over that of the texture."""
    return float(values.std() / linear_from_srgb8(pattern(kind)).std())


def test_what_is_near_keeps_its_texels(tmp_path: Path) -> None:
    """A pixel at 2 units with a view of 2 degrees is 0.002 wide, an eighth of a texel."""
    file = floor(tmp_path, "noise")
    near = ([0.1, 2.0, 0.1], [0.1, 0.0, 0.0])
    assert (reflectivities(file, *near) == reflectivities(file, *near, surfaces="diffuse")).all()


@pytest.mark.parametrize("eye", [[0.1, 600.0, 0.1], [0.1, 60.0, 190.0]])
def test_what_is_far_has_the_mean_of_its_texture(tmp_path: Path, eye: Any) -> None:
    """A pixel is 0.65 units wide or more, two thirds of the texture."""
    file = floor(tmp_path, "noise")
    found = reflectivities(file, eye, [0.0, 0.0, -0.1])
    mean = linear_from_srgb8(pattern("noise"))[..., 0].mean()
    # means of 20 x 20 texels or more of the 64 x 64: a twentieth of their standard deviation; codes are 0.9 % apart
    assert abs(found - mean).max() < 4 * linear_from_srgb8(pattern("noise")).std() / 20
    assert found.mean() == pytest.approx(mean, rel=0.01)
    # between texels, blending leaves two thirds of the contrast of noise: the mean of (1 - x)^2 + x^2, per side
    sharp = contrast(reflectivities(file, eye, [0.0, 0.0, -0.1], surfaces="diffuse"), "noise")
    assert sharp == pytest.approx(2 / 3, abs=4 * 2 / 3 / (2 * N) ** 0.5)


def test_blurring_keeps_the_mean_at_every_distance(tmp_path: Path) -> None:
    file = floor(tmp_path, "noise")
    for height in (5.0, 15.0, 40.0, 100.0):
        sharp, blurred = (
            reflectivities(file, [0.1, height, 0.1], [0.0, 0.0, 0.0], surfaces=kind, fov=20.0)
            for kind in ("diffuse", "file")
        )
        assert blurred.mean() == pytest.approx(sharp.mean(), abs=4 * sharp.std() / N**0.5)
        assert blurred.std() < sharp.std()


def test_a_slanted_floor_is_blurred_along_the_slant_only(tmp_path: Path) -> None:
    """Seen at 4 degrees from 30 units away, a pixel is 0.02 units wide and 0.3 deep: stripes of 0.125 units stay where
    they run away from the eye, and vanish where they run across."""
    eye, target = [0.0, 2.1, 15.0], [0.0, 0.0, -15.0]
    away, across = (reflectivities(floor(tmp_path, kind), eye, target, fov=1.2) for kind in ("along v", "along u"))
    sharp = reflectivities(floor(tmp_path, "along u"), eye, target, fov=1.2, surfaces="diffuse")
    assert contrast(sharp, "along u") > 0.9
    assert contrast(away, "along v") > 0.7
    assert contrast(across, "along u") < 0.25


def test_more_hits_per_pixel_blur_less(tmp_path: Path) -> None:
    """A pixel is 2.8 texels wide; of 64 hits each stands for an eighth of that."""
    file = floor(tmp_path, "noise")
    view = ([0.1, 40.0, 0.1], [0.0, 0.0, 0.0])
    one, many = (reflectivities(file, *view, hits=hits) for hits in (1, 64))
    assert contrast(one, "noise") < 0.6 * contrast(many, "noise")
    assert contrast(many, "noise") == pytest.approx(2 / 3, abs=4 * 2 / 3 / (2 * N) ** 0.5)


def test_a_second_set_of_coordinates_blurs_like_the_first(tmp_path: Path) -> None:
    low, high = ([0.0, 2.1, 15.0], [0.0, 0.0, -15.0]), ([0.1, 40.0, 0.1], [0.0, 0.0, 0.0])
    for kind, view, fov in (("along u", low, 1.2), ("noise", high, 20.0)):
        first, second = (
            reflectivities(floor(tmp_path, kind, second=second), *view, fov=fov) for second in (False, True)
        )
        np.testing.assert_allclose(second, first, atol=2e-3 * first.mean())
        assert first.std() > 0
