"""The filter of indirect light against plain means, and what it leaves alone."""

from typing import Any

import numpy as np
import pytest

from framearray_cli.base.arrays import with_room
from framearray_cli.engine.hits.hits import SURFACE, Hits, empty_hits
from framearray_cli.engine.hits.native import pixel_order
from framearray_cli.engine.terms.cells.gather import LIGHT
from framearray_cli.engine.terms.cells.smooth import room_for_smoothing, smooth_light

WIDTH, HEIGHT, LIGHTS = 24, 20, 5


def hits_of(per_pixel: int, rng: Any) -> tuple[Hits, int]:
    """Hits of a picture: a floor, with a box in its middle half a unit above it, and a wall at the right."""
    order = pixel_order(WIDTH, HEIGHT)
    groups = [order[first : first + 16] for first in range(0, len(order), 16)]
    pixel = np.concatenate([np.tile(group, per_pixel) for group in groups])
    n = len(pixel)
    hits = empty_hits(n)
    x, y = pixel % WIDTH, pixel // WIDTH
    boxed, wall = (abs(x - 10) < 4) & (abs(y - 9) < 4), x >= 18
    place = np.stack([x, 0.5 * boxed, y], 1) + rng.uniform(-0.4, 0.4, (n, 3)) * [1, 0, 1]
    place[wall] = np.stack([np.full(n, 18.0), x - 18.0, y], 1)[wall] + rng.uniform(-0.4, 0.4, (wall.sum(), 3)) * [
        0,
        1,
        1,
    ]
    hits.position[:], hits.geometric[:] = place, np.where(wall[:, None], [-1, 0, 0], [0, 1, 0])
    hits.shading[:], hits.kind[:], hits.pixel[:] = hits.geometric, SURFACE, pixel
    hits.reflectivity[:] = rng.uniform(0.2, 0.9, (n, 3)) * (rng.random((n, 1)) > 0.05)  # some reflect nothing
    hits.half[:] = np.concatenate([np.repeat(np.arange(per_pixel) % 2, len(group)) for group in groups])
    return hits, n


def rows_of(n: int, rng: Any) -> tuple[Any, Any, Any]:
    """Rows of light and of constant light, and 1 / length of rays."""
    light = with_room((n, LIGHT + LIGHTS), np.float32)
    light[:] = rng.uniform(0.0, 2.0, light.shape)
    light[rng.random(n) < 0.1, 3:] = 0.0  # no light
    return light, rng.uniform(0, 1, (n, 3)).astype(np.float32), rng.uniform(0.01, 0.05, n).astype(np.float32)


def smoothed(hits: Hits, n: int, passes: int, light: Any, constant: Any, closeness: Any) -> tuple[Any, Any]:
    """What the kernel makes of copies."""
    out, same = with_room(light.shape, np.float32), constant.copy()
    out[:] = light
    smooth_light(hits, n, WIDTH, HEIGHT, passes, closeness, room_for_smoothing(LIGHTS), out, same)
    return out, same


class Twin:
    """The same by plain loops over pairs of hits."""

    def __init__(self, hits: Hits, n: int, closeness: Any) -> None:
        self.hits, self.n = hits, n
        self.x, self.y = hits.pixel % WIDTH, hits.pixel // WIDTH
        self.ordinal = np.array([(hits.pixel[:k] == hits.pixel[k]).sum() for k in range(n)])
        self.close = np.zeros(n)
        self.close = np.array([closeness[self.around(k, 1)].mean() if self.bright(k) else 0.0 for k in range(n)])

    def bright(self, k: int) -> bool:
        return bool((self.hits.reflectivity[k] > 0).any())

    def around(self, k: int, step: int) -> list[int]:
        """The hits that mix with hit k."""
        found = [k]
        near = (abs(self.x - self.x[k]) % step == 0) & (abs(self.x - self.x[k]) <= step)
        near &= (abs(self.y - self.y[k]) % step == 0) & (abs(self.y - self.y[k]) <= step)
        for j in np.flatnonzero(near & (self.hits.pixel != self.hits.pixel[k]) & (self.ordinal == self.ordinal[k])):
            way = (self.hits.position[j] - self.hits.position[k]).astype(np.float64)
            sines = [abs(way @ self.hits.geometric[i]) / np.linalg.norm(way) for i in (j, k)]
            flat = max(sines) <= 0.2 and self.hits.shading[j] @ self.hits.shading[k] >= 0.9
            beside = np.linalg.norm(way) * (self.close[j] + self.close[k]) / 2 <= 0.2
            if self.bright(j) and self.hits.half[j] == self.hits.half[k] and flat and beside:
                found.append(int(j))
        return found

    def smoothed(self, passes: int, light: Any, constant: Any) -> tuple[Any, Any]:
        light, constant = light.astype(np.float64), constant.astype(np.float64)
        for step in (1, 3, 9)[:passes]:
            full = np.concatenate([light[:, :3] * light[:, 3:4], light[:, 3:]], axis=1)
            mean, same = full.copy(), constant.copy()
            for k in filter(self.bright, range(self.n)):
                rows = self.around(k, step)
                mean[k], same[k] = full[rows].mean(axis=0), constant[rows].mean(axis=0)
            hue = np.divide(mean[:, :3], mean[:, 3:4], out=np.zeros_like(mean[:, :3]), where=mean[:, 3:4] > 0)
            bright = np.array([self.bright(k) for k in range(self.n)])[:, None]
            light = np.where(bright, np.concatenate([hue, mean[:, 3:]], axis=1), light)
            constant = np.where(bright, same, constant)
        return light, constant


@pytest.mark.parametrize(("passes", "per_pixel"), [(1, 1), (2, 2), (3, 3)])
def test_hits_get_the_mean_of_their_surface(passes: int, per_pixel: int) -> None:
    rng = np.random.default_rng(passes)
    hits, n = hits_of(per_pixel, rng)
    light, constant, closeness = rows_of(n, rng)
    found, same = smoothed(hits, n, passes, light, constant, closeness)
    twin = Twin(hits, n, closeness)
    expected, expected_same = twin.smoothed(passes, light, constant)
    assert np.mean([len(twin.around(k, 1)) for k in range(n)]) > 5
    np.testing.assert_allclose(found, expected, rtol=64 * 2.0**-24, atol=1e-6)
    np.testing.assert_allclose(same, expected_same, rtol=64 * 2.0**-24)


def test_no_pass_changes_no_bit() -> None:
    rng = np.random.default_rng(5)
    hits, n = hits_of(2, rng)
    light, constant, closeness = rows_of(n, rng)
    found, same = smoothed(hits, n, 0, light, constant, closeness)
    np.testing.assert_array_equal(found, light)
    np.testing.assert_array_equal(same, constant)


def test_halves_stay_apart() -> None:
    """Light that only even samples have stays in even samples."""
    rng = np.random.default_rng(6)
    hits, n = hits_of(2, rng)
    light, constant, closeness = rows_of(n, rng)
    light[hits.half[:n] == 1, 3:] = 0.0
    found, _ = smoothed(hits, n, 2, light, constant, closeness)
    assert (found[hits.half[:n] == 1, 3:] == 0).all() and found[hits.half[:n] == 0, 3:].mean() > 0.1


def test_light_near_to_what_it_comes_from_stays_sharp() -> None:
    rng = np.random.default_rng(7)
    hits, n = hits_of(1, rng)
    light, constant, closeness = rows_of(n, rng)
    found, _ = smoothed(hits, n, 2, light, constant, closeness * 1000)
    np.testing.assert_allclose(found[:, 3:], light[:, 3:], rtol=1e-6)
