"""Sixteen numbers at a time: every operation against numpy, and functions of lanes against functions of one number."""

from collections.abc import Callable
from pathlib import Path
from typing import Any

import numba as nb
import numpy as np
import pytest
from PIL import Image
from support import tiny
from support.program import python
from support.triangles import everything, find_numbers

from framearray_cli.array.folder import read_array
from framearray_cli.array.record import read_records
from framearray_cli.engine.embree import library
from framearray_cli.engine.inputs.cameras import OUTSIDE, Cameras, project_to_pixel
from framearray_cli.engine.inputs.random import above, cosine_direction, disc
from framearray_cli.engine.inputs.surfaces import Surfaces, nearest_texel_at, surfaces, texture_at
from framearray_cli.engine.kernels import start
from framearray_cli.engine.kernels.kernel import kernel
from framearray_cli.engine.kernels.processor import has_instructions
from framearray_cli.engine.kernels.simd import (
    LANES,
    access,
    append,
    bits,
    compress,
    ctz,
    doubles,
    floor,
    gather,
    integers,
    lane_numbers,
    largest_of_lanes,
    load,
    load_row,
    popcount,
    product,
    put_triples,
    reals,
    scatter,
    select,
    sqrt,
    store,
    store_columns,
    store_row,
    stored,
    triples_at,
    width_of_packets,
    words,
)

ULP = 2.0**-23  # one float32 rounding, of a number of size 1, is at most half of it
FEW = 8 * ULP
ODD = 3  # a flat offset that no packet starts at
READ, WRITTEN = np.s_[ODD : ODD + LANES], np.s_[5 : 5 + LANES]


def fresh(dtype: Any, n: int = 2 * LANES) -> Any:
    """An array of 77, so that a test sees which elements were written."""
    return np.full(n, 77, dtype)


def only_changed(array: Any, at: slice) -> Any:
    """The elements at a slice; nothing else was written."""
    rest = np.ones(len(array), bool)
    rest[at] = False
    assert (array[rest] == 77).all()
    return array[at]


def flagged(number: int) -> Any:
    """(16,) the flags that `bits` packed, one per lane."""
    return (number >> np.arange(LANES)) & 1 == 1


@kernel
def with_reals(a: Any, b: Any, one: Any, out: Any, answers: Any) -> None:
    """Operators of reals; `one` is a number of the same dtype."""
    x, y = load(a, 3), load(b, 3)
    chosen, other = select(x < y, x, one), select(x < y, one, y)
    # at the end numbers of other dtypes, on either side
    found = (x + y, x - y, x * y, x / y, -x, sqrt(x), floor(x), chosen, other, x + 2, 1 - x)
    for k in range(11):
        store(out, 16 * k, found[k])
    store(out, 176, one)
    total = x
    for _ in range(3):
        total = total + y
    store(out, 192, total)
    for i in range(16):
        out[208 + i] = sqrt(a[3 + i])
        out[224 + i] = floor(a[3 + i])
        out[240 + i] = select(a[3 + i] < b[3 + i], a[3 + i], b[3 + i])
    less, more = x < y, x > y
    answers[0], answers[1], answers[2] = bits(less), bits(x <= y), bits(more)
    answers[3], answers[4], answers[5] = bits(x >= y), bits(x == y), bits(less | more)
    answers[6], answers[7], answers[8] = bits(less & more), bits(~less), bits(less ^ (x <= y))
    answers[9], answers[10] = bits(x < one), bits(one < x)
    answers[11], answers[12] = popcount(less), popcount(a[3] < b[3])


@pytest.mark.parametrize("dtype", [np.float32, np.float64])
def test_reals_are_those_of_numpy(dtype: Any) -> None:
    a, b = np.random.default_rng(1).normal(size=(2, 2 * LANES)).astype(dtype) * 9
    a[3:11] = (np.nan, 1, np.inf, -0.0, np.finfo(dtype).smallest_subnormal, -np.inf, np.nan, 2.5)
    b[3:11] = (1, np.nan, np.inf, 0.0, 0.5, np.inf, np.nan, 2.5)
    one, out, answers = dtype(0.75), fresh(dtype, 272), np.zeros(13, np.int64)
    with_reals(a, b, one, out, answers)
    x, y = a[READ], b[READ]
    with np.errstate(all="ignore"):
        expected = [x + y, x - y, x * y, x / y, -x, np.sqrt(x), np.floor(x), np.where(x < y, x, one)]
        expected += [np.where(x < y, one, y), x + dtype(2), dtype(1) - x, np.full(LANES, one), ((x + y) + y) + y]
        expected += [np.sqrt(x), np.floor(x), np.where(x < y, x, y)]
    np.testing.assert_array_equal(out[:256].reshape(16, LANES), expected)
    np.testing.assert_array_equal(np.signbit(out[64:80]), np.signbit(-x))
    assert (out[256:] == 77).all()
    less, same, more = x < y, x == y, x > y  # each false for nan
    flags = [less, less | same, more, more | same, same, less | more, less & more, ~less, same, x < one, one < x]
    np.testing.assert_array_equal([flagged(number) for number in answers[:11]], flags)
    assert answers[11] == less.sum() and answers[12] == less[0]


@kernel
def with_integers(a: Any, b: Any, out: Any, answers: Any) -> None:
    x, y = load(a, 3), load(b, 3)
    found = (x + y, x - y, x * y, x & y, x | y, x ^ y, ~x, -x, x >> 5, select(x == y, x, 3))
    for k in range(10):
        store(out, 16 * k, found[k])
    answers[0], answers[1] = bits(x == y), bits(x == 9)


@pytest.mark.parametrize("dtype", [np.int32, np.uint8, np.uint64])
def test_integers_are_those_of_numpy_and_shifts_bring_in_zeros(dtype: Any) -> None:
    info = np.iinfo(dtype)
    a, b = np.random.default_rng(2).integers(info.min, info.max, (2, 2 * LANES), dtype, endpoint=True)
    a[3:7], b[3:7] = (info.min, info.max, 9, 0), (info.max, info.max, 9, 0)
    out, answers = fresh(dtype, 176), np.zeros(2, np.int64)
    with_integers(a, b, out, answers)
    x, y = a[READ], b[READ]
    shifted = (x.view(f"u{x.itemsize}") >> dtype(5).view(f"u{x.itemsize}")).view(dtype)
    expected = [x + y, x - y, x * y, x & y, x | y, x ^ y, ~x, np.zeros_like(x) - x, shifted, np.where(x == y, x, 3)]
    np.testing.assert_array_equal(out[:160].reshape(10, LANES), np.array(expected, dtype))
    assert (out[160:] == 77).all()
    np.testing.assert_array_equal([flagged(number) for number in answers], [x == y, x == 9])


@kernel
def with_signs(a: Any, b: Any, answers: Any) -> None:
    x, y = load(a, 3), load(b, 3)
    answers[0], answers[1], answers[2], answers[3] = bits(x < y), bits(x <= y), bits(x > y), bits(x >= 5)


def test_int32_has_an_order() -> None:
    a, b = np.random.default_rng(3).integers(-9, 9, (2, 2 * LANES), np.int32)
    answers = np.zeros(4, np.int64)
    with_signs(a, b, answers)
    x, y = a[READ], b[READ]
    np.testing.assert_array_equal([flagged(number) for number in answers], [x < y, x <= y, x > y, x >= 5])


@kernel
def convert(f: Any, d: Any, i: Any, b: Any, u: Any, pixel: Any, to_f: Any, to_d: Any, to_i: Any, to_u: Any) -> None:
    """Each conversion of lanes (rows of 16), and in the row behind it of one number at a time."""
    x, y, k, m, w = load(f, 3), load(d, 3), load(i, 3), load(b, 3), load(u, 3)
    as_reals, as_doubles = (reals(x), reals(y), reals(k)), (doubles(x), doubles(y), doubles(k))
    as_words = (words(m), words(w), words(load(pixel, 3)))
    as_integers = (integers(x), integers(y), integers(k), integers(m), integers(w))
    for n in range(3):
        store(to_f, 32 * n, as_reals[n])
        store(to_d, 32 * n, as_doubles[n])
        store(to_u, 32 * n, as_words[n])
    for n in range(5):
        store(to_i, 32 * n, as_integers[n])
    store(to_i, 160, lane_numbers())
    store(to_i, 176, integers(2.9))
    for n in range(16):
        to_f[16 + n], to_f[48 + n], to_f[80 + n] = reals(f[3 + n]), reals(d[3 + n]), reals(i[3 + n])
        to_d[16 + n], to_d[48 + n], to_d[80 + n] = doubles(f[3 + n]), doubles(d[3 + n]), doubles(i[3 + n])
        to_i[16 + n], to_i[48 + n], to_i[80 + n] = integers(f[3 + n]), integers(d[3 + n]), integers(i[3 + n])
        to_i[112 + n], to_i[144 + n] = integers(b[3 + n]), integers(u[3 + n])
        to_u[16 + n], to_u[48 + n], to_u[80 + n] = words(b[3 + n]), words(u[3 + n]), words(pixel[3 + n])


def test_conversions_are_those_of_numpy_for_lanes_and_for_numbers() -> None:
    rng = np.random.default_rng(4)
    d = rng.normal(size=2 * LANES) * 1e6
    d[3:6] = (-0.5, 2.0**31 - 1, -(2.0**31))
    f = (rng.normal(size=2 * LANES) * 1e6).astype(np.float32)
    i = rng.integers(-(2**31), 2**31, 2 * LANES, np.int32)
    b = rng.integers(0, 256, 2 * LANES, np.uint8)
    b[3] = 255
    u = rng.integers(0, 2**64, 2 * LANES, np.uint64)
    pixel = np.abs(i >> 3)
    to_f, to_d, to_i = fresh(np.float32, 96), fresh(np.float64, 96), fresh(np.int32, 192)
    to_u = fresh(np.uint64, 96)
    convert(f, d, i, b, u, pixel, to_f, to_d, to_i, to_u)
    for found, sources in ((to_f, (f, d, i)), (to_d, (f, d, i)), (to_i, (f, d, i, b, u)), (to_u, (b, u, pixel))):
        for source, (lanes, numbers) in zip(sources, found.reshape(-1, 2, LANES), strict=False):
            np.testing.assert_array_equal(lanes, source[READ].astype(found.dtype))
            np.testing.assert_array_equal(numbers, lanes)
    np.testing.assert_array_equal(to_i[160:176], np.arange(LANES))
    np.testing.assert_array_equal(to_i[176:], 2)


@kernel
def move(source: Any, at: Any, to: Any, put: Any, gathered: Any, one_by_one: Any, scattered: Any) -> None:
    store(put, 5, load(source, 3))
    found = gather(source, load(at, 3))
    store(gathered, 5, found)
    for k in range(16):
        one_by_one[5 + k] = gather(source, at[3 + k])
    scatter(scattered, load(to, 1), found)


@pytest.mark.parametrize("dtype", [np.float32, np.float64, np.int32, np.uint8, np.uint64])
def test_lanes_are_read_and_written_where_they_belong(dtype: Any) -> None:
    rng = np.random.default_rng(5)
    source = rng.integers(0, 256, 60).astype(dtype)
    at = rng.integers(0, 60, 2 * LANES, np.int32)
    at[3:6] = (59, 0, 59)
    to = rng.permutation(60)[: 2 * LANES].astype(np.int32)
    put, gathered, one_by_one, scattered = fresh(dtype), fresh(dtype), fresh(dtype), fresh(dtype, 60)
    move(source, at, to, put, gathered, one_by_one, scattered)
    np.testing.assert_array_equal(only_changed(put, WRITTEN), source[READ])
    np.testing.assert_array_equal(only_changed(gathered, WRITTEN), source[at[READ]])
    np.testing.assert_array_equal(only_changed(one_by_one, WRITTEN), source[at[READ]])
    expected = fresh(dtype, 60)
    expected[to[1 : 1 + LANES]] = source[at[READ]]
    np.testing.assert_array_equal(scattered, expected)


def test_arrays_of_more_dimensions_are_counted_flat() -> None:
    source, put = np.arange(60, dtype=np.float32).reshape(5, 4, 3), fresh(np.float32, 40).reshape(2, 20)
    at = np.arange(2 * LANES, dtype=np.int32) + 20
    move(source, at, at, put, fresh(np.float32), fresh(np.float32), fresh(np.float32, 60))
    np.testing.assert_array_equal(only_changed(put.reshape(40), WRITTEN), np.arange(3, 19))


@kernel
def turn(source: Any, columns: Any, rows: Any) -> None:
    x, y, z = triples_at(source, 2)
    store(columns, 0, x)
    store(columns, LANES, y)
    store(columns, 2 * LANES, z)
    put_triples(rows, 1, x, y, z)


@pytest.mark.parametrize("dtype", [np.float32, np.int32])
def test_rows_of_three_become_columns_and_rows_again(dtype: Any) -> None:
    source = np.arange(3 * (LANES + 4)).reshape(-1, 3).astype(dtype)
    columns, rows = np.zeros((3, LANES), dtype), np.full((LANES + 3, 3), -1, dtype)
    turn(source, columns, rows)
    assert np.array_equal(columns, source[2 : 2 + LANES].T)
    assert np.array_equal(rows[1 : 1 + LANES], source[2 : 2 + LANES])
    assert (rows[0] == -1).all() and (rows[1 + LANES :] == -1).all()


def test_of_two_lanes_at_one_place_the_later_stays() -> None:
    source, scattered = np.arange(60, dtype=np.float32), fresh(np.float32, 60)
    at, to = np.arange(2 * LANES, dtype=np.int32), np.zeros(2 * LANES, np.int32)
    move(source, at, to, fresh(np.float32), fresh(np.float32), fresh(np.float32), scattered)
    assert scattered[0] == ODD + LANES - 1 and (scattered[1:] == 77).all()


@kernel
def pick(mask: Any, f: Any, d: Any, i: Any, out_f: Any, out_d: Any, out_i: Any, answers: Any) -> None:
    flags = load(mask, 0) > 0
    compress(flags, load(f, 3), out_f, 5)
    compress(flags, load(d, 3), out_d, 5)
    compress(flags, load(i, 3), out_i, 5)
    answers[0], answers[1], answers[2] = popcount(flags), bits(flags), ctz(bits(flags))


@pytest.mark.parametrize("lanes", [[], [0], [15], [1, 4, 5, 11], list(range(LANES))])
def test_compress_writes_the_flagged_lanes_and_nothing_else(lanes: list[int]) -> None:
    mask = np.zeros(LANES, np.int32)
    mask[lanes] = 1
    arrays = [np.random.default_rng(6).integers(-99, 70, 2 * LANES).astype(t) for t in (np.float32, "f8", np.int32)]
    outs, answers = [fresh(array.dtype) for array in arrays], np.zeros(3, np.int64)
    pick(mask, *arrays, *outs, answers)
    for array, out in zip(arrays, outs, strict=True):
        written = only_changed(out, np.s_[5 : 5 + len(lanes)])
        np.testing.assert_array_equal(written, array[READ][lanes])
    assert answers.tolist() == [len(lanes), sum(1 << lane for lane in lanes), lanes[0] if lanes else 64]


MISUSES: dict[str, Callable[..., Any]] = {
    "float32 + float64": lambda f, d, i: store(f, 0, load(f, 0) + load(d, 0)),
    "float32 * int32": lambda f, d, i: store(f, 0, load(f, 0) * load(i, 0)),
    "float32 < int32": lambda f, d, i: popcount(load(f, 0) < load(i, 0)),
    "flags & int32": lambda f, d, i: popcount((load(f, 0) < 1.0) & load(i, 0)),
    "lanes + an array": lambda f, d, i: store(f, 0, load(f, 0) + f),
    "lanes !=": lambda f, d, i: popcount(load(f, 0) != load(f, 1)),
    "if lanes": lambda f, d, i: 1 if load(f, 0) < 1.0 else 2,
}


@pytest.mark.parametrize("misuse", MISUSES)
def test_misuse_is_a_typing_error(misuse: str) -> None:
    arrays = [np.zeros(2 * LANES, dtype) for dtype in (np.float32, np.float64, np.int32)]
    with pytest.raises(nb.TypingError):
        nb.njit(MISUSES[misuse])(*arrays)


@kernel
def sample_numbers(normal: Any, way: Any, uv: Any, out: Any) -> None:
    for i in range(uv.shape[1]):
        u, v, gx, gy, gz = uv[0, i], uv[1, i], normal[0, i], normal[1, i], normal[2, i]
        out[0, i], out[1, i] = disc(u, v)
        out[2, i], out[3, i], out[4, i] = cosine_direction(gx, gy, gz, u, v)
        out[5, i], out[6, i], out[7, i] = above(way[0, i], way[1, i], way[2, i], gx, gy, gz)


@kernel
def sample_lanes(normal: Any, way: Any, uv: Any, out: Any) -> None:
    n = uv.shape[1]
    for i in range(0, n, LANES):
        u, v = load(uv, i), load(uv, n + i)
        gx, gy, gz = load(normal, i), load(normal, n + i), load(normal, 2 * n + i)
        turned = above(load(way, i), load(way, n + i), load(way, 2 * n + i), gx, gy, gz)
        found = (*disc(u, v), *cosine_direction(gx, gy, gz, u, v), *turned)
        for k in range(8):
            store(out, k * n + i, found[k])


def units(rng: Any, n: int) -> Any:
    """(3, n) directions."""
    found = rng.normal(size=(3, n))
    return (found / np.linalg.norm(found, axis=0)).astype(np.float32)


def test_directions_of_lanes_are_those_of_numbers() -> None:
    rng, n = np.random.default_rng(7), 64 * LANES
    uv = (rng.integers(0, 2**24, (2, n)) * 2.0**-24).astype(np.float32)
    edges = np.float32([0, 0.25, 0.5, 0.75, 1 - 2.0**-24])
    uv[:, :25] = np.reshape(np.meshgrid(edges, edges), (2, 25))
    uv[1, 25:50] = uv[0, 25:50]  # on the diagonal, where the map changes over
    normal, way = units(rng, n), units(rng, n)
    normal[:, 10:16] = np.float32([[0, 0, 1], [0, 0, -1], [1, 0, 0], [1, 0, -0.0], [0, 1, -1e-8], [1e-4, 0, -1]]).T
    way[:, 50:60] = -normal[:, 50:60]  # straight below
    numbers, lanes = np.full((2, 8, n), np.nan, np.float32)
    sample_numbers(normal, way, uv, numbers)
    sample_lanes(normal, way, uv, lanes)
    np.testing.assert_allclose(lanes[[0, 1, 5, 6, 7]], numbers[[0, 1, 5, 6, 7]], rtol=0, atol=FEW)
    # The height above the surface is a root, which makes more of a rounding near 0: its square does not.
    parts = []
    for found in (numbers, lanes):
        height = (found[2:5].astype(np.float64) * normal).sum(axis=0)
        parts.append((height * height, found[2:5] - height * normal))
    np.testing.assert_allclose(parts[1][0], parts[0][0], rtol=0, atol=2 * FEW)
    np.testing.assert_allclose(parts[1][1], parts[0][1], rtol=0, atol=FEW)


@kernel
def texture_numbers(s: Surfaces, texture: Any, uv: Any, out: Any) -> None:
    for i in range(uv.shape[1]):
        out[0, i], out[1, i], out[2, i], out[3, i] = texture_at(s, texture[i], uv[0, i], uv[1, i])
        out[4, i], out[5, i], out[6, i], out[7, i] = nearest_texel_at(s, texture[i], uv[0, i], uv[1, i])


@kernel
def texture_lanes(s: Surfaces, texture: Any, uv: Any, out: Any) -> None:
    n = uv.shape[1]
    for i in range(0, n, LANES):
        number, u, v = load(texture, i), load(uv, i), load(uv, n + i)
        blended, nearest = texture_at(s, number, u, v), nearest_texel_at(s, number, u, v)
        for k in range(4):
            store(out, k * n + i, blended[k])
            store(out, (4 + k) * n + i, nearest[k])


@pytest.mark.parametrize("samplers", [(), (6, 16), (9, 15)])
def test_textures_of_lanes_are_those_of_numbers(samplers: tuple[int, ...]) -> None:
    """Inside, below 0, on texel borders and centres, beside 0, and where there is no texel."""
    rng = np.random.default_rng(8)
    texels = rng.integers(0, 256, (3, 5, 4), dtype=np.uint8), rng.integers(0, 256, (8, 8, 4), dtype=np.uint8)
    one = surfaces(tiny.scene_of(tiny.quad((0, 0, 0), (1, 0, 0), (1, 1, 0), (0, 1, 0)), textures=texels))
    one = one._replace(samplers=np.array(samplers, np.int32))
    coordinates = np.concatenate(
        [
            np.arange(-20, 21) / 16,
            np.arange(-10, 11) / 10,
            np.arange(-6, 7) / 6,
            [1e-30, -1e-30, -1e-9, 0.99999994, 1e9, -1e30, np.inf, -np.inf, np.nan],
            rng.normal(size=12) * 3,
        ]
    ).astype(np.float32)
    assert len(coordinates) % LANES == 0
    uv = np.ascontiguousarray(np.reshape(np.meshgrid(coordinates, coordinates), (2, -1)))
    texture = rng.integers(0, 2, uv.shape[1]).astype(np.int32)
    numbers, lanes = np.full((2, 8, uv.shape[1]), np.nan, np.float32)
    texture_numbers(one, texture, uv, numbers)
    texture_lanes(one, texture, uv, lanes)
    assert np.isfinite(numbers).all() and numbers.std() > 0.1
    np.testing.assert_allclose(lanes[:4], numbers[:4], rtol=0, atol=FEW)
    assert np.array_equal(lanes[4:], numbers[4:])  # texels themselves


@kernel
def find_lanes(s: Surfaces, triangle: Any, uv: Any, way: Any, out: Any) -> None:
    n = uv.shape[1]
    for i in range(0, n, LANES):
        x, y, z = load(way, i), load(way, n + i), load(way, 2 * n + i)
        found = everything(s, load(triangle, i), load(uv, i), load(uv, n + i), x, y, z)
        for k in range(5):
            for axis in range(3):
                store(out, (3 * k + axis) * n + i, found[k][axis])


def nasty_room() -> Any:
    """Surfaces of the room with tiny triangles, tilted normals that cancel on every fifth triangle at (1/2, 0), and
    texture coordinates that are negative, on texel borders and not finite."""
    rng, s = np.random.default_rng(9), surfaces(tiny.room())
    n = len(s.corners)
    size = np.tile(np.float32([1, 1e-4, 1e-12, 1e4]), n)[:n, None, None]
    corners = np.ascontiguousarray(s.corners * size)
    a, b, c = (s.corners[:, k].astype(np.float64) for k in range(3))
    geometric = np.cross(b - a, c - a)
    geometric /= np.linalg.norm(geometric, axis=-1, keepdims=True)
    normals = geometric[:, None] + 0.7 * units(rng, 3 * n).T.reshape(n, 3, 3)
    normals = np.ascontiguousarray(normals / np.linalg.norm(normals, axis=-1, keepdims=True), np.float32)
    normals[::5, 1] = -normals[::5, 0]
    uvs = (rng.integers(-16, 17, (n, 3, 2)) / 8).astype(np.float32)
    uvs[::7] += rng.random((len(uvs[::7]), 3, 2), np.float32)
    uvs[::11, 1, 0], uvs[5::11, 0, 1] = np.nan, np.inf
    assert len(s.colours) == n and (s.reflectivity_texture >= 0).any()
    texture = np.where(np.arange(len(s.material)) % 2, 0, s.reflectivity_texture[s.material]).astype(np.int32)
    # one material per triangle, so that textured and plain ones are neighbours
    material = np.arange(n, dtype=np.int32)
    reflectivity, specular = s.reflectivity[s.material], s.specular[s.material]
    specular[::3] = (0.5, 0.25, 0.75)
    return s._replace(
        corners=corners, normals=normals, uvs=uvs, material=material, reflectivity=reflectivity, specular=specular,
        reflectivity_texture=texture, specular_texture=texture[::-1].copy(),
    )  # fmt: skip


def test_what_lanes_find_on_triangles_is_what_numbers_find() -> None:
    rng, s = np.random.default_rng(10), nasty_room()
    n = 64 * LANES
    triangle = rng.integers(0, len(s.corners), n).astype(np.int32)
    triangle[: n // 2].sort()
    uv = np.ascontiguousarray(rng.dirichlet((0.5, 0.5, 0.5), n)[:, :2].T.astype(np.float32))
    cancel = triangle % 5 == 0
    uv[:, cancel] = ((0.5,), (0.0,))
    corner = np.flatnonzero(~cancel)[:99]
    uv[:, corner] = np.float32([[0, 0], [1, 0], [0, 1]])[rng.integers(0, 3, 99)].T
    way = units(rng, n) * np.float32(3)
    numbers, lanes = np.full((2, 5, 3, n), np.nan, np.float32)
    find_numbers(s, triangle, uv, way, numbers)
    find_lanes(s, triangle, uv, way, lanes)
    assert np.isfinite(numbers).all() and all(part.std() > 0.1 for part in numbers[1:])
    off = abs(lanes - numbers)
    largest = abs(s.corners[triangle]).max(axis=(1, 2))
    assert (off[0] <= ULP * largest).all(), "float64 until the last rounding"
    assert (off[1] <= ULP).all(), "float64 until the last rounding"
    np.testing.assert_array_equal(lanes[2][:, cancel], lanes[1][:, cancel])
    np.testing.assert_array_equal(numbers[2][:, cancel], numbers[1][:, cancel])
    weights = np.stack([1 - uv.sum(axis=0, dtype=np.float64), *uv])
    length = np.linalg.norm(np.einsum("kn,nka->na", weights, s.normals[triangle]), axis=1)
    assert length[~cancel].min() > 0.1
    assert (off[2] * length <= FEW)[:, ~cancel].all()
    # three roundings of coordinates up to 4, by 8 texels of contrast 1 in two directions, and those of the product
    assert (off[3:] <= 3 * 2 * ULP * 8 * 2 + FEW).all()


@kernel
def project_numbers(cams: Cameras, k: int, points: Any, pixel: Any, depth: Any) -> None:
    for i in range(points.shape[1]):
        pixel[i], depth[i] = project_to_pixel(cams, k, points[0, i], points[1, i], points[2, i])


@kernel
def project_lanes(cams: Cameras, k: int, points: Any, pixel: Any, depth: Any) -> None:
    n = points.shape[1]
    for i in range(0, n, LANES):
        seen, far = project_to_pixel(cams, k, load(points, i), load(points, n + i), load(points, 2 * n + i))
        store(pixel, i, seen)
        store(depth, i, far)


def projected(cams: Cameras, k: int, points: Any) -> Any:
    """Pixels and depths, (2, n) each: of numbers, of lanes."""
    pixel, depth = fresh(np.int32, (2, points.shape[1])), np.zeros((2, points.shape[1]), np.float32)
    for row, run in enumerate((project_numbers, project_lanes)):
        run(cams, k, points, pixel[row], depth[row])
    return pixel, depth


def two_eyes() -> Cameras:
    """One that looks along -z, one that is turned; 8 pixels of focal length, 24 x 18 pixels."""
    turned, _ = np.linalg.qr(np.random.default_rng(11).normal(size=(3, 3)))
    right, up, forward = (np.float32([e, q]) for e, q in zip(np.diag([1, 1, -1]), turned, strict=True))
    return Cameras(np.zeros((2, 3), np.float32), right, up, forward, 8.0, 24, 18, 0.0)


def test_lanes_on_borders_of_pixels_are_seen_where_numbers_are() -> None:
    """Everything is exact here."""
    x, y = np.meshgrid(np.arange(-14, 18) / 8, np.arange(-11, 12) / 8)
    x, y = x.ravel(), y.ravel()
    at = [np.stack([x * far, y * far, np.full_like(x, -far)]) for far in (1, 2, -1, 0)]
    points = np.ascontiguousarray(np.concatenate(at, axis=1), np.float32)
    points[:, -4:] = [[np.nan, 0, 0, np.inf], [0, np.nan, 0, 0], [-1, -1, np.nan, -1]]
    points[:, 368] = (0, 0, -np.inf)
    assert points.shape[1] % LANES == 0
    pixel, depth = projected(two_eyes(), 0, points)
    np.testing.assert_array_equal(pixel[1], pixel[0])
    np.testing.assert_array_equal(depth[1], depth[0])
    assert set(pixel[0]) == {OUTSIDE, *range(24 * 18)}
    assert (pixel[0, 2 * len(x) :] == OUTSIDE).all()


def test_lanes_are_seen_where_numbers_are() -> None:
    points = np.random.default_rng(12).normal(size=(3, 256 * LANES)).astype(np.float32)
    cams = two_eyes()
    pixel, depth = projected(cams, 1, points)
    length = np.linalg.norm(points, axis=0)
    assert (abs(depth[1] - depth[0]) <= FEW * length).all()
    z = cams.forward[1].astype(np.float64) @ points
    image = np.stack([12 + 8 * (cams.right[1] @ points) / z, 9 - 8 * (cams.up[1] @ points) / z])
    # rounding may move a point in the image by this much; nearer to a pixel's border it may change sides
    moved = 8 * FEW * length / abs(z) * (1 + abs(image - [[12], [9]]) / 8)
    clear = (abs(image - np.round(image)) > moved).all(axis=0) & (abs(z) > FEW * length)
    assert clear.mean() > 0.99 and (pixel[0] != OUTSIDE).mean() > 0.2
    np.testing.assert_array_equal(pixel[1, clear], pixel[0, clear])


@kernel
def store_whole(array: Any, out: Any) -> None:
    for first in range(0, array.size, LANES):
        store(out, first, stored(out, load(array, first)))


def test_halves_are_those_of_numpy_and_never_infinite() -> None:
    rng = np.random.default_rng(5)
    some = rng.normal(size=4096) * 10.0 ** rng.uniform(-9, 6, 4096)
    borders = [0.0, -0.0, 65504, 65519.9, 65520, 1e9, -1e9, 2.0**-24, 2.0**-25, 2.0**-25 * 1.001, 2.0**-14, 6e-5]
    exact = np.concatenate([some, borders, np.ldexp(1.0, np.arange(-30, 17)), np.zeros(5)]).astype(np.float32)
    out = np.empty(len(exact), np.uint16)
    store_whole(exact, out)
    np.testing.assert_array_equal(out, np.clip(exact, -65504, 65504).astype(np.float16).view(np.uint16))
    same = np.empty_like(exact)
    store_whole(exact, same)
    np.testing.assert_array_equal(same, exact)


@pytest.mark.parametrize("array", [np.zeros((32, 2), np.float32)[:, 0], np.zeros(32, np.int64), np.zeros(32, bool)])
def test_arrays_that_lanes_cannot_read_are_refused(array: Any) -> None:
    with pytest.raises(nb.TypingError):
        store_whole(array, np.zeros(32, np.float32))


@kernel
def queue_flagged(mask: Any, reals: Any, numbers: Any, out_reals: Any, out_numbers: Any) -> int:
    found = 0
    for first in range(0, mask.size, LANES):
        flags = load(mask, first) > 0
        append(flags, load(reals, first), out_reals, found)
        append(flags, load(numbers, first), out_numbers, found)
        found += popcount(flags)
    return found


@pytest.mark.parametrize("share", [0.0, 0.1, 0.5, 0.9, 1.0])
def test_a_queue_holds_the_flagged_lanes_in_order(share: float) -> None:
    rng = np.random.default_rng(7)
    n = 256 * LANES
    mask, reals = (rng.random(n) < share).astype(np.int32), rng.normal(size=n).astype(np.float32)
    numbers = rng.integers(-(1 << 31), 1 << 31, n).astype(np.int32)
    out_reals, out_numbers = np.full(n + LANES, 77, np.float32), np.full(n + LANES, 77, np.int32)
    found = queue_flagged(mask, reals, numbers, out_reals, out_numbers)
    assert found == mask.sum()
    np.testing.assert_array_equal(out_reals[:found], reals[mask > 0])
    np.testing.assert_array_equal(out_numbers[:found], numbers[mask > 0])
    assert (out_reals[found + LANES :] == 77).all() and (out_numbers[found + LANES :] == 77).all()


@kernel
def exchange(rows: Any, n: int, out: Any) -> None:
    store_columns(rows, 2, rows.shape[1], n, out, 3, out.shape[1])


@pytest.mark.parametrize("n", [1, 7, 8, 11, 16, 40])
@pytest.mark.parametrize("dtype", [np.float32, np.uint16])
def test_columns_of_a_tile_become_rows(n: int, dtype: Any) -> None:
    rows = np.random.default_rng(3).normal(size=(LANES, 21)).astype(np.float32)
    out = np.full((LANES, 24), 77, dtype)
    exchange(rows, n, out)
    expected, m = np.full_like(out, 77), min(n, LANES)
    columns = rows[:, 2 : 2 + m].T
    expected[:m, 3 : 3 + LANES] = columns if dtype == np.float32 else columns.astype(np.float16).view(np.uint16)
    np.testing.assert_array_equal(out, expected)


@kernel
def add_product(a: Any, b: Any, factor: Any, out: Any) -> None:
    store(out, 0, load(a, 0) + product(load(b, 0), factor))


@pytest.mark.parametrize("dtype", [np.float32, np.float64])
def test_products_are_rounded_before_they_are_added(dtype: Any) -> None:
    b, factor = np.random.default_rng(4).normal(size=LANES).astype(dtype), dtype(1 / 3)
    rounded = b * factor
    out = np.empty(LANES, dtype)
    add_product(-rounded, b, factor, out)  # fused, this is the error of the product
    np.testing.assert_array_equal(out, np.zeros(LANES))


@kernel
def largest(values: Any) -> Any:
    return largest_of_lanes(load(values, 0))


@pytest.mark.parametrize("lane", range(LANES))
def test_the_largest_of_lanes(lane: int) -> None:
    values = np.random.default_rng(5).normal(size=LANES).astype(np.float32)
    values[lane] = 9
    assert largest(values) == 9


@pytest.mark.parametrize(
    ("named", "known"),
    [("x86-64-v4", ["f16c", "avx2", "avx512f"]), ("x86-64-v3", ["f16c", "avx2"]), ("generic", [])],
)
def test_a_named_processor_has_the_instructions_of_its_level(
    named: str, known: list[str], monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(start, "TARGET", named)
    assert [name for name in ("f16c", "avx2", "avx512f") if has_instructions(name)] == known


ROWS, RAYS = 5, 48


@pytest.mark.parametrize("width", [16, 8, 4])
@pytest.mark.parametrize("dtype", [np.float32, np.int32])
def test_sixteen_rays_are_one_packet_or_several(width, dtype, monkeypatch):
    monkeypatch.setattr(access, "packet_width", lambda: width)

    @nb.njit
    def copy(source, target):
        for first in range(0, source.shape[0] * width_of_packets(), 16):
            for row in range(source.shape[1] - 1):
                store_row(target, first, row, load_row(source, first, row))
            store_row(target, first, source.shape[1] - 1, dtype(7))

    # number of each ray and row, laid out by packets
    number = 100 * np.arange(RAYS)[:, None] + np.arange(ROWS)
    source = np.ascontiguousarray(number.reshape(RAYS // width, width, ROWS).transpose(0, 2, 1)).astype(dtype)
    target = np.zeros_like(source)
    copy(source, target)
    assert (target[:, :-1] == source[:, :-1]).all()
    assert (target[:, -1] == 7).all()


@pytest.mark.parametrize("widths", [(4, 8, 16), (4, 8), (4,), ()])
def test_the_widest_native_packets_are_used(widths, monkeypatch):
    monkeypatch.delenv("FRAMEARRAY_PACKETS", raising=False)
    monkeypatch.setattr(library, "embree_properties", lambda: library.EmbreeProperties("", widths))
    assert library.packet_width.__wrapped__() == (widths[-1] if widths else 16)


def test_embree_names_its_widths():
    """With AVX2 only there are no packets of 16, with SSE2 none of 8."""
    program = "from framearray_cli.engine.embree.library import embree_properties as find; print(find().packet_widths)"

    avx2 = python(program, FRAMEARRAY_EMBREE="isa=avx2")
    if avx2 == "()":
        pytest.skip("no such instructions on this processor")
    assert (avx2, python(program, FRAMEARRAY_EMBREE="isa=sse2")) == ("(4, 8)", "(4,)")


# The program, with the flag of coherent rays or without.
PROGRAM = """
import runpy
from framearray_cli.engine.embree import embreescene
embreescene._COHERENT *= {coherent}
runpy.run_module("framearray_cli", run_name="__main__")
"""
CELLS = ("reuse.weights=area", "indirect.method=cells")


def rendered(folder: Path, *settings: str, coherent: bool = True) -> list[Path]:
    """Render the smoke job in packets of 16, 8 and 4 rays; kernels are compiled for one width, so each in a process."""
    folders = [folder / str(width) for width in (16, 8, 4)]
    for out in folders:
        arguments = [part for setting in settings for part in ("--set", setting)]
        program = PROGRAM.format(coherent=int(coherent))
        python(program, "render", "-q", "jobs/smoke.toml", "-o", out, *arguments, FRAMEARRAY_PACKETS=out.name)
    return folders


def files_of(out: Path) -> dict[str, bytes]:
    return {file.name: file.read_bytes() for file in out.glob("smoke.*")}


@pytest.mark.slow
@pytest.mark.parametrize("settings", [(), ("reuse.weights=area",)])
def test_a_small_array_is_the_same_for_every_width(settings, tmp_path):
    """Where triangles meet, Embree may choose another one for another width: the smoke job has no such pixel."""
    found = [files_of(out) for out in rendered(tmp_path, *settings)]
    assert found[0]
    assert found[0] == found[1] == found[2]


@pytest.mark.slow
def test_light_from_cells_is_the_same_for_every_width_but_at_edges(tmp_path):
    """Without the flag of coherent rays all images are equal. With it, of 634,420 gather rays 6 or 16 meet another
    triangle where they pass an edge; the cells are still the same, and few pixels see such a ray."""
    without = [files_of(out) for out in rendered(tmp_path / "without", *CELLS, coherent=False)]
    assert without[0]
    assert without[0] == without[1] == without[2]

    folders = rendered(tmp_path / "with", *CELLS)
    arrays = [read_array(out) for out in folders]
    assert all(arrays)
    cells = [
        {run.cells for run in read_records(out, array.fingerprint).runs}
        for out, array in zip(folders, arrays, strict=True)
    ]
    assert len(cells[0]) == 1 and cells[0] == cells[1] == cells[2]
    names = sorted(file.name for file in folders[0].glob("smoke.*.png"))
    whole, *others = (np.stack([np.asarray(Image.open(out / name), int) for name in names]) for out in folders)
    for other in others:
        assert np.abs(other - whole).max() <= 1
        assert (other != whole).mean() < 256 * 1e-6
