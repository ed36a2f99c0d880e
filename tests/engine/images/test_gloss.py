"""Gloss in images: lobes against sums, and glossy surfaces behind thin glass."""

from dataclasses import dataclass, replace
from typing import Any

import numpy as np
import pytest
from support import gloss_twin, tiny
from support import gloss_twin as twin
from support.glass_twin import PANES, Floor, Pane, floor_job, floor_with, picture
from support.kept import irradiance_of, packed
from support.tiny import ball

from framearray_cli.engine.features.gloss import ALPHA, METAL, OF_MIRRORS, POINT, SHADING, Gloss
from framearray_cli.engine.frames.frame import FrameHits
from framearray_cli.engine.frames.pool import TracePool
from framearray_cli.engine.frames.records import HitRecords, HitsByPixel
from framearray_cli.engine.frames.setup import FrameSetup
from framearray_cli.engine.hits.row import OBSCURANCE, REFLECTIVITY
from framearray_cli.engine.images.window import Window
from framearray_cli.engine.inputs.gloss import STEPS, albedo_table
from framearray_cli.engine.loop import ready_frames
from framearray_cli.engine.terms.ambient.intensity import Ambient
from framearray_cli.scene.files import Material
from framearray_cli.scene.scene import Scene, build_scene


def point(*keys: tuple[list[float], list[float]]) -> Any:
    """A point at the first and last of three light positions."""
    frames = (0, 2)
    return {
        "type": "point",
        "keys": [{"frame": f, "position": p, "intensity": i} for f, (p, i) in zip(frames, keys, strict=True)],
    }


# Each source has a channel of its own.
LIGHTS = {
    "frames": 3,
    "sources": [
        point(([-0.9, 2.2, 0.3], [8.0, 0.0, 0.0]), ([0.7, 1.9, 0.6], [6.0, 0.0, 0.0])),
        point(([0.9, 1.8, 0.5], [0.0, 3.0, 0.0]), ([0.2, 1.9, 1.0], [0.0, 3.0, 0.0])),
        {"type": "directional", "keys": [{"frame": 0, "direction": [-0.6, -1.0, -0.3], "irradiance": [0.0, 0.0, 2.0]}]},
    ],
}


def glossy_room(**options: Any) -> Scene:
    """The tiny room with gloss of every kind: rough and smooth, metal and not, by a texture, coated, and mirrors."""
    meshes = tiny.room_meshes(**options)
    rough = ((0.6, 0.0), (0.9, 0.5, 0.5, 0.3), (0.25, 0.0), (0.45, 1.0, 1.0, 0.2), (0.0, 0.0), (0.0, 0.0))
    keys = ("roughness", "metallic", "coat", "coat_roughness")
    materials = [
        replace(m, **dict(zip(keys, values, strict=False))) for m, values in zip(meshes.materials, rough, strict=False)
    ]
    materials[tiny.FLOOR] = replace(materials[tiny.FLOOR], gloss_texture=0)
    return build_scene(replace(meshes, materials=tuple(materials)), {})


def albedos(alpha: Any, mu: Any, base: Any, metal: Any, even: Any = 1.0) -> Any:
    """A(v) of hits, (n, 3), by the table of the program, with a share of what the coat reflects."""
    row = (np.sqrt(alpha) - 0.1) / 0.9 * (STEPS - 1)
    column = np.sqrt(mu) * (STEPS - 1)
    i, k = (np.clip(at.astype(int), 0, STEPS - 2) for at in (row, column))
    a, b = (row - i)[:, None], (column - k)[:, None]
    table = np.moveaxis(albedo_table().astype(np.float64), 0, -1)
    upper, lower = ((1 - b) * table[i + d, k] + b * table[i + d, k + 1] for d in (0, 1))
    face_on, edge, through = ((1 - a) * upper + a * lower).T[:, :, None]
    f0 = 0.04 * (1 - metal[:, None]) + metal[:, None] * base
    reflected = np.reshape(even, (-1, 1)) * (f0 * face_on + edge)
    return (1 - metal[:, None]) * base * (1 - f0 - (1 - f0) * through) + reflected


def decoded(gloss: Any) -> tuple[Any, Any, Any]:
    """Metal, and weight and alpha of clear coats, of what is kept of hits, (n,) each."""
    code = -1 - gloss[:, METAL].view(np.int32).astype(np.int64)
    coated, digits = code >= 0, np.stack([code // 2**20, code // 2**10 % 2**10, code % 2**10])
    rough, coat, metal = np.where(coated, digits, 0) / np.array([[2040], [1020], [1020]])
    return np.where(coated, metal, gloss[:, METAL]).astype(np.float64), coat, np.maximum(rough, 0.1) ** 2


def kept_gloss(setup: FrameSetup, records: HitRecords, *, mirrored: bool = False) -> Any:
    """Packed column of glossy hits, (n, columns)."""
    column = setup.packed_column(mirrored=mirrored)
    assert column is not None
    return packed(records, column)


def radiance(setup: FrameSetup, ambient: Ambient, records: HitRecords, eye: Any, mirrored: bool) -> Any:
    """What hits send to an eye, (n, n_lights, 3): each source has a channel of its own."""
    with np.errstate(invalid="ignore"):  # keys and bits are no numbers
        row, gloss = records.row.astype(np.float64), kept_gloss(setup, records, mirrored=mirrored)
        (metal, coat, over), gloss = decoded(gloss), gloss.astype(np.float64)
    known = gloss[:, ALPHA, None] > 0  # of what does not shine nothing is kept
    tint = np.where(known, gloss[:, -3:], 1.0) if mirrored else np.ones((len(row), 3))
    base = np.divide(row[:, REFLECTIVITY : REFLECTIVITY + 3], tint, out=np.zeros_like(tint), where=tint > 0)
    p, m = gloss[:, POINT : POINT + 3], np.where(known, gloss[:, SHADING : SHADING + 3], (0.0, 0.0, 1.0))
    v = gloss[:, -OF_MIRRORS:-3] if mirrored else eye - p
    v = np.where(known, v, (0.0, 0.0, 1.0))
    v = v / np.linalg.norm(v, axis=1, keepdims=True)
    alpha = gloss[:, ALPHA]
    shines = alpha > 0
    # the program does not let shading normals face away from the viewer
    mu = (m * v).sum(1)
    left = 1 - coat * (0.04 + 0.96 * (1 - np.clip(mu, 1e-4, 1)) ** 5)
    shines_well = shines & (mu > 0.02)
    found, irradiance = np.zeros((len(row), setup.lights.n_lights, 3)), irradiance_of(records, setup.stored)
    for s in range(3):
        for l in range(setup.lights.n_lights):
            at = setup.lights.vector[s, :, l].astype(np.float64)
            d = -np.broadcast_to(at, p.shape) if setup.lights.kind[s] == 1 else at - p
            d = d / np.linalg.norm(d, axis=1, keepdims=True)
            e = irradiance[:, s, l].astype(np.float64)
            f = np.stack(
                [
                    left[i] * twin.brdf(base[i], metal[i], alpha[i], m[i], v[i], d[i])[s]
                    + coat[i] * twin.brdf(0.0, 0.0, over[i], m[i], v[i], d[i])[0]
                    if shines[i]
                    else base[i, s] / np.pi
                    for i in range(len(row))
                ]
            )
            found[:, l, s] = e * f
    even, albedo = mirrored or not setup.feature(Gloss).follows, 0.0
    for lobe, share, colour, m_of in ((alpha, left, base, metal), (over, coat, 0 * base, 0 * metal)):
        e = np.ones(len(row)) if even else np.clip((lobe - 0.16) / 0.09, 0, 1)
        albedo += share[:, None] * albedos(np.maximum(lobe, 0.01), np.clip(mu, 1e-4, 1), colour, m_of, e)
    reflected = np.where(shines[:, None], albedo, base)
    indirect = reflected * row[:, OBSCURANCE : OBSCURANCE + 3]
    found += indirect[:, None] * ambient.intensity[None]
    constant = row[:, 4:7] * np.divide(reflected, base, out=np.ones_like(base), where=shines[:, None] & (base > 0))
    return found * tint[:, None] + constant[:, None], shines_well | ~shines


def means(places: HitsByPixel, values: Any, weights: Any, n: int) -> Any:
    """Sums of w values and of w in every pixel."""
    pixel = np.repeat(np.arange(n), np.diff(places.start))
    order = places.order[: len(pixel)]
    total, weight = np.zeros((n, *values.shape[1:])), np.zeros(n)
    np.add.at(total, pixel, values[order] * weights[order][:, None, None])
    np.add.at(weight, pixel, weights[order])
    return total, weight


class Kept(Window):
    """A window that keeps every eye's hits."""

    def __init__(self, *args: Any) -> None:
        super().__init__(*args)
        self.all: dict[int, FrameHits] = {}

    def add(self, frame: FrameHits) -> None:
        super().add(frame)
        self.all[frame.eye] = frame

    def drop(self, j: int, needed: int) -> None:
        """Keep all."""


# Slow cases have kernels or long renders of their own; a case of each test stays in the default run.
SLOW = pytest.mark.slow


@pytest.mark.parametrize("depth", [pytest.param(0, marks=SLOW), 3])
def test_every_pixel_is_what_the_text_says(depth: int):
    job = tiny.job(
        camera=tiny.walk(2, resolution=[12, 9]), light=LIGHTS, reuse={"n_r": 1, "weights": "balance"},
        scene={"background": [0.2, 0.3, 0.4]}, obscurance={"outside": "background", "range": 1.5},
        samples={"hits": 2}, specular={"depth": depth},
    )  # fmt: skip
    shape = (3, 9, 12, 3)
    with tiny.planned(tiny.prepared(job, glossy_room())) as (setup, ambient), TracePool(setup, 2) as pool:
        window = Kept(setup, ambient, pool)
        images = [
            window.compose(j, np.empty(shape, np.float32)).images for j in ready_frames(window, setup, range(2), pool)
        ]
        n, checked = setup.n_pixels, 0
        for j in range(2):
            eye, total, weight, sure = setup.cams.position[j].astype(np.float64), 0.0, 0.0, np.ones(n, bool)
            for frame in (window.all[k] for k in setup.eyes_of(j)):
                values, well = radiance(setup, ambient, frame.records, eye, mirrored=False)
                sums = means(frame.places[j], values, frame.seen_in(j)["weight"].astype(np.float64), n)
                total, weight = total + sums[0], weight + sums[1]
                sure &= means(frame.places[j], (~well)[:, None, None] + 0.0, np.ones(len(well)), n)[0][:, 0, 0] == 0
            expected = total / weight[:, None, None]
            own = window.all[j]
            if own.mirrored is not None and own.mirror_places is not None:
                values, well = radiance(setup, ambient, own.mirrored, eye, mirrored=True)
                sums, _ = means(own.mirror_places, values, np.ones(len(values)), n)
                sure &= means(own.mirror_places, (~well)[:, None, None] + 0.0, np.ones(len(well)), n)[0][:, 0, 0] == 0
                expected += sums / own.mirror_hits.sum(axis=0)[:, None, None]
            assert (own.mirrored is None) == (depth == 0)
            found = np.moveaxis(images[j].reshape(3, n, 3), 0, 1)
            np.testing.assert_allclose(found[sure], expected[sure], rtol=2e-3, atol=2e-5)
            checked += sure.sum()
        assert checked > n  # of two frames
        coats = [decoded(kept_gloss(setup, frame.records))[1] for frame in window.all.values()]
        found = np.concatenate(coats)  # the floor's by a texture
        assert (found == 1.0).any() and len(np.unique(found[found < 0.5])) > 9
        assert sum((kept_gloss(setup, frame.records)[:, ALPHA] > 0).sum() for frame in window.all.values()) > n


@pytest.mark.parametrize("metal", [0.0, 1.0])
@pytest.mark.parametrize("roughness", [0.1, 0.3, 0.5, 0.77, 1.0])
def test_albedo_of_the_table(roughness: float, metal: float):
    for mu in (1.0, 0.72, 0.4, 0.11):
        base = np.array([[0.9, 0.5, 0.1]])
        found = albedos(np.array([roughness**2]), np.array([mu]), base, np.array([metal]))
        expected = twin.albedo(base[0], metal, roughness**2, mu)
        np.testing.assert_allclose(found[0], expected, rtol=0.01, atol=2e-3)


@pytest.mark.parametrize("method", ["obscurance", pytest.param("cells", marks=SLOW)])
def test_a_ball_in_even_light_shows_its_albedo(method: str):
    """A furnace: nothing but a ball under a sky of 1. Smooth normals differ from those of its facets, so it is fine."""
    corners, normals = ball((0, 0, 0), 1.0, 60)
    for roughness, metal, coat in ((0.3, 1.0, 0.0), (0.7, 0.0, 0.0), (0.7, 0.5, 1.0)):
        material = coated_material(roughness, metal, coat, 0.4)
        job = tiny.job(
            camera={"resolution": [9, 9], "fov": 40.0, "keys": [{"frame": 0, "eye": [0, 0, 3], "target": [0, 0, 0]}]},
            scene={"background": [1.0, 1.0, 1.0]}, obscurance={"outside": "background", "range": 1.0},
            samples={"hits": 8}, light={"frames": 1, "sources": [
                {"type": "point", "keys": [{"frame": 0, "position": [0, 0, 5], "intensity": [0.0, 0.0, 0.0]}]}]},
            indirect={"method": method, **({"samples": 4096} if method == "cells" else {})}, specular={"depth": 0},
        )  # fmt: skip
        inputs = tiny.prepared(job, tiny.scene_of(corners, material, normals=normals))
        image = tiny.render_frames(inputs).images[0, 0]
        # the middle pixel sees normals within 5 degrees of the view
        expected = coated_albedo(metal, roughness, 0.999, coat, 0.4)
        np.testing.assert_allclose(image[4, 4], expected, rtol=0.01)


def coated_material(roughness: float, metal: float, coat: float, coat_roughness: float) -> Material:
    more = {"metallic": metal, "coat": coat, "coat_roughness": coat_roughness}
    return Material(name="Paint", reflectivity=(0.9, 0.6, 0.3), roughness=roughness, **more)


def coated_albedo(metal: float, roughness: float, mu: float, coat: float, coat_roughness: float) -> Any:
    """The share of even light that `coated_material` sends to a viewer."""
    left = 1 - coat * (0.04 + 0.96 * (1 - mu) ** 5)
    under = twin.albedo(np.array([0.9, 0.6, 0.3]), metal, roughness**2, mu)
    return left * under + coat * twin.albedo(0.0, 0.0, coat_roughness**2, mu)


@pytest.mark.parametrize(
    ("roughness", "metal", "coat", "coat_roughness", "height"),
    [
        (0.3, 0.0, 0.0, 0.0, 3.0),
        (0.3, 0.0, 1.0, 0.1, 3.0),
        *(
            pytest.param(*case, marks=SLOW)
            for case in (
                (0.1, 1.0, 0.0, 0.0, 3.0), (0.45, 1.0, 0.0, 0.0, 3.0), (0.45, 0.0, 0.0, 0.0, 3.0),
                (1.0, 1.0, 0.0, 0.0, 3.0), (0.4, 1.0, 1.0, 0.1, 3.0), (1.0, 0.0, 0.5, 0.2, 0.6),
                (0.3, 1.0, 0.5, 0.45, 0.6), (0.6, 0.5, 1.0, 0.7, 3.0),
            )
        ),
    ],
)  # fmt: skip
def test_rays_of_lobes_bring_the_albedo_of_even_light(
    roughness: float, metal: float, coat: float, coat_roughness: float, height: float
):
    """A furnace: all rays of a plane leave, into a sky of 1, so pixels hold their weights."""
    material = coated_material(roughness, metal, coat, coat_roughness)
    job = tiny.job(
        camera={"resolution": [16, 16], "fov": 2.0, "keys": [{"frame": 0, "eye": [3, height, 0], "target": [0, 0, 0]}]},
        scene={"background": [1.0, 1.0, 1.0]}, obscurance={"outside": "background", "range": 1.0},
        samples={"hits": 16}, light={"frames": 1, "sources": [
            {"type": "point", "keys": [{"frame": 0, "position": [0, 5, 0], "intensity": [0.0, 0.0, 0.0]}]}]},
    )  # fmt: skip
    plane = tiny.quad((-9, 0, 9), (9, 0, 9), (9, 0, -9), (-9, 0, -9))
    pixels = tiny.render_frames(tiny.prepared(job, tiny.scene_of(plane, material))).images[0, 0].reshape(-1, 3)
    expected = coated_albedo(metal, roughness, height / np.hypot(3, height), coat, coat_roughness)
    error = pixels.std(axis=0, ddof=1) / np.sqrt(len(pixels))
    assert (np.abs(pixels.mean(axis=0) - expected) < 3.5 * error + 3e-3 * expected).all()


def test_threads_and_blocks_of_lights_change_no_bit():
    reuse = {"n_r": 1, "weights": "balance"}
    job = tiny.job(camera=tiny.walk(3), light=LIGHTS, reuse=reuse, samples={"halves": True})
    inputs = tiny.prepared(job, glossy_room())
    with tiny.planned(inputs) as (setup, ambient):
        renders = []
        for threads, lights in ((1, range(3)), (3, range(3)), (2, range(1)), (2, range(1, 3))):
            part = setup.for_block(lights)
            with TracePool(part, threads) as pool:
                renders.append(tiny.frames_of(part, ambient.at(lights), pool))
    for one, three, first, rest in zip(*renders, strict=True):
        assert np.array_equal(one.images, three.images)
        assert np.array_equal(one.differences, three.differences)
        assert np.array_equal(one.images, np.concatenate([first.images, rest.images]))


def test_a_scene_without_gloss_keeps_nothing_of_it():
    with tiny.planned(tiny.prepared(tiny.job())) as (setup, _):
        assert setup.feature(Gloss) is None
        assert "gloss" not in setup.empty_records(5)


BASE, ROUGHNESS, METALLIC = (0.8, 0.6, 0.4), 0.7, 0.5
COAT_ROUGHNESS = 0.6
# Direction and irradiance of each sun at each light position.
SUNS = [
    [((0.25, -1.0, 0.55), (3.0, 2.5, 2.0)), ((-0.35, -1.0, 0.45), (2.0, 2.5, 1.0))],
    [((-0.1, -0.8, 0.7), (1.0, 0.5, 2.0)), ((0.1, -1.0, -0.3), (1.0, 2.0, 3.0))],
]


@dataclass(frozen=True)
class GlossyFloor(Floor):
    """A floor of metal and roughness, with a clear coat; `reflectivity` is its base colour."""

    coat: float = 0.5

    def seen(self, origin: Any, way: Any) -> tuple[Any, Any]:
        """`Floor.seen` with the BRDF of the glTF specification instead of reflectivity / pi."""
        light, t = super().seen(origin, way)
        viewer = -way / np.linalg.norm(way, axis=1, keepdims=True)
        sun = np.broadcast_to(-np.array(self.sun) / np.linalg.norm(self.sun), way.shape)
        up = np.broadcast_to([0.0, 1.0, 0.0], way.shape)
        with np.errstate(all="ignore"):
            f = gloss_twin.brdf(self.reflectivity, METALLIC, ROUGHNESS**2, up, viewer, sun)
            f *= 1 - self.coat * (0.04 + 0.96 * (1 - viewer[:, 1:2]) ** 5)
            f += self.coat * gloss_twin.brdf(0.0, 0.0, COAT_ROUGHNESS**2, up, viewer, sun)
        return np.where(np.isfinite(t)[:, None], light * f * np.pi / np.array(self.reflectivity), 0.0), t


CAMERAS = {
    "perspective": {"fov": 60.0},
    "orthographic": {"type": "orthographic", "height": 2.6},
    "panorama": {"type": "panorama", "resolution": [80, 40]},
}


def expected(inputs: Any, pane: Pane, j: int, l: int, coat: float) -> tuple[Any, Any]:
    """`picture` at light position l."""
    return picture(inputs, j, [GlossyFloor(BASE, *sun[l], [pane], coat=coat) for sun in SUNS], 0.04)


@pytest.mark.slow  # gloss and glass together have kernels of their own, which take half a minute to compile
@pytest.mark.parametrize(
    ("name", "n_r", "weights", "camera"),
    [
        ("sheet", 2, "balance", "perspective"),
        ("sheet", 0, "balance", "perspective"),
        ("body", 2, "balance", "perspective"),
        ("sheet", 2, "area", "perspective"),
        ("sheet", 2, "balance", "orthographic"),
        ("body", 2, "balance", "orthographic"),
        ("body", 2, "balance", "panorama"),
    ],
)
def test_glossy_floor_behind_a_pane(name: str, n_r: int, weights: str, camera: str) -> None:
    """Light through the pane, the view through it and what it mirrors, of two suns at two light positions."""
    pane = PANES[name]
    few = camera == "panorama"  # of its pixels see the pane, and fewer are even under a coat
    coat = 0.0 if few else 0.5
    shine = {"roughness": ROUGHNESS, "metallic": METALLIC, "coat": coat, "coat_roughness": COAT_ROUGHNESS}
    scene = floor_with(pane, reflectivity=BASE, **shine)
    inputs = tiny.prepared(floor_job(SUNS, n_r, weights, **CAMERAS[camera]), scene)
    images = tiny.render_frames(inputs, threads=2).images
    for l in range(2):
        wanted, even = expected(inputs, pane, 2, l, coat)
        found = images[2, l]
        assert even.mean() > (0.1 if few else 0.3)
        off = np.abs(found[even] / wanted[even] - 1)
        # the twin's rays miss edges that cross a corner of a pixel; `area` counts hits beyond it, too
        assert (off < 0.01).all(axis=1).mean() > 0.95
        assert np.median(off) < 2e-3
        # light that is coloured like that without glass would be off
        bare, _ = expected(inputs, replace(pane, colour=(1.0, 1.0, 1.0)), 2, l, coat)
        assert (np.abs(bare[even] / wanted[even] - 1).max(axis=1) > 0.05).mean() > (0.02 if few else 0.1)
