"""Native hits and their rows."""

from typing import Any

import numpy as np
import pytest
from scipy.ndimage import binary_dilation
from support import tiny
from support.hits import lit_packets, native, points
from support.oracle import Oracle

from framearray_cli.base.arrays import with_room
from framearray_cli.engine.hits.hits import ESCAPED, SURFACE, empty_hits, record_hits
from framearray_cli.engine.hits.native import PixelSamples, extra_hits, flag_mirrors, pixel_order
from framearray_cli.engine.hits.rays import room_for_hits
from framearray_cli.engine.hits.row import (
    CLEAR,
    HALF,
    INDIRECT,
    LIGHT_INDEPENDENT,
    LIT,
    LIT_BITS,
    OBSCURANCE,
    REFLECTIVITY,
    WEIGHT,
    write_rows,
)
from framearray_cli.engine.kernels.simd import LANES


@pytest.mark.parametrize(("width", "height"), [(400, 300), (24, 18), (1, 1), (33, 5), (7, 40)])
def test_every_pixel_once(width: int, height: int) -> None:
    order = pixel_order(width, height)
    np.testing.assert_array_equal(np.sort(order), np.arange(width * height))


def test_packets_are_blocks_of_pixels() -> None:
    """Coherent packets: 16 pixels in turn are a block of 4 x 4."""
    order = pixel_order(64, 32).reshape(-1, 16)
    for axis in (order % 64, order // 64):
        assert (np.ptp(axis, axis=1) == 3).all()


@pytest.mark.parametrize(("resolution", "per_pixel"), [([24, 18], 1), ([24, 18], 3), ([5, 7], 2), ([1, 1], 4)])
def test_every_pixel_has_its_hits_inside_its_box(resolution: Any, per_pixel: int) -> None:
    inputs = tiny.prepared(tiny.job(camera={"resolution": resolution}))
    with tiny.planned(inputs) as (setup, _):
        hits = native(setup, 0, per_pixel, batch=48)
    assert (np.bincount(hits.pixel, minlength=setup.n_pixels) == per_pixel).all()
    assert len(np.unique(hits.key)) == len(hits.key)
    frame = np.stack([setup.cams.right[0], setup.cams.up[0], setup.cams.forward[0]])
    a, b, forward = (hits.incoming @ frame.T).astype(np.float64).T
    np.testing.assert_allclose(forward, 1, rtol=1e-6)
    x = a * setup.cams.focal + resolution[0] / 2 - hits.pixel % resolution[0]
    y = resolution[1] / 2 - b * setup.cams.focal - hits.pixel // resolution[0]
    assert min(x.min(), y.min()) > -1e-4 and max(x.max(), y.max()) < 1 + 1e-4


def test_batches_of_any_size_find_the_same_hits() -> None:
    with tiny.planned(tiny.prepared(tiny.job(scene={"background": 1.0}))) as (setup, _):
        one, other = native(setup, 0, 3), native(setup, 0, 3, batch=37)
    surface = one.kind == SURFACE
    assert surface.any() and not surface.all()
    for name in ("kind", "key", "pixel", "position", "incoming", "reflectivity", "specular"):
        np.testing.assert_array_equal(getattr(one, name), getattr(other, name))
    for name in ("geometric", "shading", "offset"):
        np.testing.assert_array_equal(getattr(one, name)[surface], getattr(other, name)[surface])


def test_hits_are_those_of_the_twin() -> None:
    inputs = tiny.prepared(tiny.job())
    with tiny.planned(inputs) as (setup, ambient):
        hits = native(setup, 0, 2)
    twin = Oracle(inputs, ambient).native(0)
    here = {key: i for i, key in enumerate(hits.key.tolist())}
    order = [here[key] for key in twin.key]
    np.testing.assert_array_equal(hits.kind[order] == SURFACE, twin.surface)
    np.testing.assert_array_equal(hits.pixel[order], twin.pixel)
    surface = np.flatnonzero(twin.surface)
    order = [order[i] for i in surface]
    # 2e-6: some tens of roundings of 2^-24, of a room that is 4 wide
    for name in ("position", "geometric", "shading", "reflectivity", "specular"):
        np.testing.assert_allclose(getattr(hits, name)[order], getattr(twin, name)[surface], rtol=0, atol=5e-6)
    np.testing.assert_allclose(hits.offset[order], twin.lift[surface], rtol=1e-6)


def test_normals_are_on_the_side_that_is_seen() -> None:
    with tiny.planned(tiny.prepared(tiny.job())) as (setup, _):
        hits = native(setup, 0, 2)
    surface = hits.kind == SURFACE
    way, geometric, shading = hits.incoming[surface], hits.geometric[surface], hits.shading[surface]
    assert ((way * geometric).sum(axis=1) <= 0).all()
    assert ((geometric * shading).sum(axis=1) >= 0).all()
    assert (geometric != shading).any()


def test_an_escaped_ray_is_a_unit_direction_and_reflects_nothing() -> None:
    with tiny.planned(tiny.prepared(tiny.job())) as (setup, _):
        hits = native(setup, 0, 2)
    gone = hits.kind == ESCAPED
    np.testing.assert_allclose(np.linalg.norm(hits.position[gone], axis=1), 1, rtol=3e-7)
    assert not hits.reflectivity[gone].any() and not hits.specular[gone].any()


def test_extra_hits_go_on_where_the_pixels_own_hits_end() -> None:
    """Hits beyond the first two of some pixels are hits 2, 3 and 4 of a frame that has five of each."""
    with tiny.planned(tiny.prepared(tiny.job())) as (setup, _):
        all_hits = native(setup, 0, 5)
        pixels = np.array([3, 100, 431], np.int32)
        more, packets = empty_hits(9), room_for_hits(16).packets
        samples = PixelSamples(setup.seed, pixels, per_pixel=3, first=2)
        extra_hits(setup.cams, 0, samples, 0, 9, setup.world, packets, more)
        fewer = empty_hits(2)
        extra_hits(setup.cams, 0, samples, 4, 2, setup.world, packets, fewer)
    assert more.pixel.tolist() == [3] * 3 + [100] * 3 + [431] * 3
    here = {key: i for i, key in enumerate(all_hits.key.tolist())}
    order = [here[key] for key in more.key.tolist()]
    np.testing.assert_array_equal(more.position, all_hits.position[order])
    np.testing.assert_array_equal(fewer.position, more.position[4:6])
    own = all_hits.key[all_hits.pixel == 3]
    assert len(own) == 5 and len(np.setdiff1d(own, more.key)) == 2


def test_pilot_rays_pass_through_pixel_centres_and_flag_mirrors_with_their_neighbours() -> None:
    with tiny.planned(tiny.prepared(tiny.job())) as (setup, _):
        hits, packets, flags = empty_hits(432), room_for_hits(432).packets, np.zeros(432, np.uint8)
        flag_mirrors(setup.cams, 0, setup.order, 0, 432, setup.world, packets, hits, flags)
        seen = empty_hits(432)
        record_hits(setup.world, packets, 432, True, seen)
    np.testing.assert_allclose(hits.specular, seen.specular, rtol=1e-6)
    seen_mirror = np.zeros((18, 24), bool)
    seen_mirror.flat[hits.pixel] = hits.specular.max(axis=1) > 0
    np.testing.assert_array_equal(flags.reshape(18, 24), binary_dilation(seen_mirror, np.ones((3, 3))))
    assert 0 < flags.sum() < 432
    frame = np.stack([setup.cams.right[0], setup.cams.up[0], setup.cams.forward[0]])
    a, b, _ = (seen.incoming @ frame.T).astype(np.float64).T
    np.testing.assert_allclose(a * setup.cams.focal + 12, hits.pixel % 24 + 0.5, atol=1e-4)
    np.testing.assert_allclose(9 - b * setup.cams.focal, hits.pixel // 24 + 0.5, atol=1e-4)


N = 37
NOTHING = np.empty((0, 3), np.float32)


def written(n_lights: int = 20, channels: int = 1, skylight: bool = False, throughput: bool = False) -> Any:
    """Rows of N hits, and what they were written from."""
    rng = np.random.default_rng(n_lights)
    hits = points(N, (0, 0, 0), (0, 1, 0))
    hits.kind[:] = np.where(rng.random(N) < 0.3, ESCAPED, SURFACE)
    hits.half[:] = rng.integers(0, 2, N)
    hits.reflectivity[:] = rng.random((N, 3)) * (hits.kind == SURFACE)[:, None]

    def values() -> Any:
        return rng.random((N, 3)).astype(np.float32)

    irradiance = with_room((N, channels, n_lights), np.float32, fill=5)  # what lies behind it does not count
    irradiance[:] = rng.random(irradiance.shape) * (rng.random(irradiance.shape) < 1 / (n_lights + 1))
    given = {
        "background": np.float32([1, 2, 3]),
        "obscurance": values() * (hits.kind == SURFACE)[:, None],
        "skylight": values() if skylight else NOTHING,
        "throughput": values() if throughput else NOTHING,
        "irradiance": irradiance,
    }
    row = np.full((N, LANES), np.nan, np.float32)
    write_rows(hits, N, *given.values(), row)
    return row, hits, given


@pytest.mark.parametrize("throughput", [False, True])
@pytest.mark.parametrize("skylight", [False, True])
def test_rows_are_those_of_numpy(skylight: bool, throughput: bool) -> None:
    row, hits, given = written(skylight=skylight, throughput=throughput)
    tint = given["throughput"] if throughput else 1.0
    reflectivity = tint * hits.reflectivity
    light_independent = np.where((hits.kind == ESCAPED)[:, None], tint * given["background"], 0.0)
    if skylight:
        light_independent = light_independent + reflectivity * given["skylight"]
    expected = {
        INDIRECT: reflectivity * given["obscurance"],
        LIGHT_INDEPENDENT: light_independent,
        OBSCURANCE: given["obscurance"],
        REFLECTIVITY: reflectivity,
    }
    assert (row[:, WEIGHT] == 1).all() and LANES == CLEAR + 1
    assert np.array_equal(row[:, CLEAR], hits.kind == ESCAPED)
    assert np.array_equal(row[:, HALF], hits.half) and 0 < hits.half.sum() < N
    for first, values in expected.items():
        np.testing.assert_allclose(row[:, first : first + 3], values, rtol=3e-7)


@pytest.mark.parametrize("channels", [1, 3])
@pytest.mark.parametrize("n_lights", [1, 15, 16, 17, 48, LANES * LIT_BITS, LANES * LIT_BITS + 1, 1700])
def test_bits_mark_the_packets_that_have_light(channels: int, n_lights: int) -> None:
    row, _, given = written(n_lights, channels)
    np.testing.assert_array_equal(row[:, LIT], lit_packets(given["irradiance"]))
    assert 0 < np.count_nonzero(row[:, LIT]) < N


@pytest.mark.parametrize("value", [np.nan, np.inf, -1.0, 1e-45])
def test_any_value_but_zero_is_light(value: float) -> None:
    """Invalid values must reach composing, which counts them."""
    hits = points(1, (0, 0, 0), (0, 1, 0))
    irradiance = with_room((1, 1, 33), np.float32, fill=0)
    irradiance[0, 0, 32] = value
    row, nothing = np.empty((1, LANES), np.float32), np.zeros((1, 3), np.float32)
    write_rows(hits, 1, nothing[0], nothing, NOTHING, NOTHING, irradiance, row)
    assert row[0, LIT] == 0b100
