"""Rays that look around for environments: with the drawn direction the same mean, and less noise behind a window."""

from typing import Any

import numpy as np
import pytest
from support import oracle_random, tiny
from support.hits import points
from support.irradiance import FAR, UP, N, P
from support.panoramas import TURNS, arrays, environment, irradiance

from framearray_cli.engine.embree.embreescene import EmbreeScene
from framearray_cli.engine.hits.hits import Hits
from framearray_cli.engine.hits.rays import room_for_tests
from framearray_cli.engine.inputs.lights import LightArrays
from framearray_cli.engine.inputs.panes import Sight
from framearray_cli.engine.inputs.random import AROUND
from framearray_cli.engine.terms.direct import direct
from framearray_cli.engine.terms.looks import LOOKS, look_around, looking
from framearray_cli.scene.paths.placing import cut_suns

RNG = np.random.default_rng(3)
TILTED = np.array([0.48, 0.6, -0.64])


def seen(hits: Hits, lights: LightArrays, triangles: Any = FAR, *, drawn: bool = True, neighbours: bool = True) -> Any:
    """Irradiance (n, channels, n_lights) by looks, and by drawn directions if wanted."""
    n, looked = len(hits.kind), looking(lights)
    out = np.zeros((n, lights.channels, lights.n_lights), np.float32)
    with EmbreeScene(tiny.scene_of(triangles)) as embree:
        rays = room_for_tests(4096, lights.n_lights)
        if drawn:
            direct(hits, n, looked, Sight(embree.tracer), rays, out, neighbours)
        look_around(hits, n, looked, embree.tracer, rays, out)
    return out.astype(np.float64)


@pytest.mark.parametrize("neighbours", [True, False])
@pytest.mark.parametrize("normal", [UP, TILTED])
def test_both_kinds_of_rays_together_have_the_mean_that_quadrature_has(normal: Any, neighbours: bool) -> None:
    pixels = RNG.random((6, 12, 3)) ** 6 * (1.0, 2.0, 4.0)
    found = seen(points(4 * N, P, normal), arrays(environment(pixels, factor=(2.0, 1.0, 0.5))), neighbours=neighbours)
    wanted = np.stack([irradiance(pixels, normal, turn) for turn in TURNS], axis=1) * [[2.0], [1.0], [0.5]]
    mean, error = found.mean(axis=0), found.std(axis=0) / np.sqrt(len(found))
    assert (np.abs(mean - wanted) <= 3.5 * error).all()
    assert (error < 0.01 * wanted).all()


def test_what_looks_add_is_what_the_readable_twin_adds() -> None:
    """Per hit, sum of L cos / (p + n cos / pi) over its looks, in float64."""
    pixels = RNG.random((8, 16, 3)) ** 2
    lights, hits = arrays(environment(pixels)), points(300, P, TILTED)
    found, expected = seen(hits, lights, drawn=False), np.zeros((300, 3, len(TURNS)))
    edges = np.sin(np.linspace(np.pi / 2, -np.pi / 2, 9))
    luminance = pixels.astype(np.float32).astype(np.float64) @ (0.2126, 0.7152, 0.0722)
    flux = (luminance * (edges[:-1] - edges[1:])[:, None]).sum() * 2 * np.pi / 16
    for i in range(300):
        (word,) = oracle_random.bits([int(hits.key[i])], AROUND)
        places = oracle_random.points([word] * LOOKS, range(LOOKS), oracle_random.sequence())
        for d in oracle_random.hemisphere(np.tile(TILTED, (LOOKS, 1)), places):
            cosine = d @ TILTED
            for l, turn in enumerate(np.radians(TURNS)):
                column = int(((np.arctan2(d[0], -d[2]) - turn) / (2 * np.pi) + 0.5) % 1 * 16)
                row = int(np.searchsorted(-edges, -d[1]) - 1)
                p = luminance[row, column] / flux
                expected[i, :, l] += pixels[row, column] * cosine / (p + LOOKS * cosine / np.pi)
    close = np.isclose(found, expected, rtol=2e-4).all(axis=(1, 2))
    assert close.mean() > 0.99, "but for directions at the edge of a texel"


def test_behind_a_window_the_noise_is_less_and_the_mean_is_the_same() -> None:
    """A box with a hole of 0.4 in a side of 2: its floor under a sky of one colour."""
    c, h, w = np.array(P), 1.0, 0.2

    def wall(a: Any, b: Any, *rest: Any) -> Any:
        return tiny.quad(*(c + np.array(corner) for corner in (a, b, *rest)))

    sides = [
        wall((-h, -h, -h), (h, -h, -h), (h, h, -h), (-h, h, -h)),
        wall((-h, -h, h), (h, -h, h), (h, h, h), (-h, h, h)),
        wall((-h, -h, -h), (-h, h, -h), (-h, h, h), (-h, -h, h)),
        wall((-h, h, -h), (h, h, -h), (h, h, h), (-h, h, h)),
        wall((-h, -h, -h), (h, -h, -h), (h, -h, h), (-h, -h, h)),
        wall((h, -h, -h), (h, w, -h), (h, w, h), (h, -h, h)),
        wall((h, w + 0.4, -h), (h, h, -h), (h, h, h), (h, w + 0.4, h)),
        wall((h, w, -h), (h, w + 0.4, -h), (h, w + 0.4, -w), (h, w, -w)),
        wall((h, w, w), (h, w + 0.4, w), (h, w + 0.4, h), (h, w, h)),
    ]
    lights, room = arrays(environment(np.ones((8, 16, 3)))), np.concatenate(sides)
    hits = points(8 * N, P, UP)
    n = len(hits.kind)
    plain = np.zeros((n, lights.channels, lights.n_lights), np.float32)
    with EmbreeScene(tiny.scene_of(room)) as embree:
        direct(hits, n, lights, Sight(embree.tracer), room_for_tests(4096, lights.n_lights), plain, True)
    both = seen(hits, lights, room)
    for found in (plain, both):
        assert 0 < found.mean() < 0.3 * np.pi
    error = np.sqrt(plain.var(axis=0) / n + both.var(axis=0) / n)
    assert (np.abs(plain.mean(axis=0) - both.mean(axis=0)) <= 3.5 * error).all()
    assert both.var() < 0.25 * plain.var()


def test_suns_of_a_map_need_no_looks() -> None:
    pixels = np.full((32, 64, 3), 0.1)
    pixels[8, 20] = 3000.0
    lights = looking(arrays(*cut_suns(environment(pixels), 0)))
    assert sorted((lights.maps.looks > 0).tolist()) == [False, True]
