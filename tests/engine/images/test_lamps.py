"""Visible lamps: how many pixels they cover, what hides them, mirrors, and halves that cannot hold them.

A closed form gives the area that a shape covers in the picture. Each of the pixels at its edge has the mean of SAMPLES
rays that hit or miss, a variance of at most 1 / 4 / SAMPLES.
"""

from pathlib import Path
from typing import Any

import numpy as np
import pytest
from support import tiny
from support.mixed import dark_sources

from framearray_cli.engine.frames.pool import TracePool
from framearray_cli.engine.images.lamps import SAMPLES
from framearray_cli.job.job import Job
from framearray_cli.render.frames import draw_visible
from framearray_cli.render.plan import frame_setup
from framearray_cli.render.prepare import open_embree
from framearray_cli.scene.files import Material, Meshes, Part
from framearray_cli.scene.files.model import PaneGlass
from framearray_cli.scene.scene import Scene, build_scene

SIZE = (64, 48)
FOCAL = 24 / np.tan(np.radians(20))
MIRROR = Material(name="Mirror", reflectivity=(0.0, 0.0, 0.0), specular=(0.5, 0.25, 1.0))
DOWN = {"direction": [0, 0, 1], "power": np.pi}  # towards the eye, of intensity 1 along the normal


def wall(z: float, material: Material | None = None, side: float = 9.0) -> Scene:
    return tiny.scene_of(tiny.quad((-side, -side, z), (side, -side, z), (side, side, z), (-side, side, z)), material)


def drawn(
    source: dict[str, Any], scene: Scene, *beside: dict[str, Any], dtype: Any = np.float32, lens: Any = None
) -> tuple[Any, int]:
    """What the eye at the origin sees of a lamp, looking along -z: an image per light position; and what is beyond.

    Args:
        beside: sources that eyes do not see.
    """
    keys = [{"frame": 0, "eye": [0, 0, 0], "target": [0, 0, -1]}]
    camera = {"resolution": list(SIZE), "keys": keys, **(lens or {"fov": 40.0})}
    light = {"sources": [source | {"visible": True}, *beside]}
    job = Job.model_validate(tiny.table() | {"camera": camera, "light": light})
    inputs = tiny.prepared(job, scene)
    width, height = job.camera.resolution
    with open_embree(inputs) as embree:
        setup = frame_setup(inputs, embree, np.zeros(3, np.float32))  # no other light, whose kernels take a minute
        images = np.zeros((inputs.n_lights, height, width, 3), dtype)
        with TracePool(setup, 2) as pool:
            return images, draw_visible(inputs, setup, 0, range(inputs.n_lights), images, pool)


def lamp(kind: str, **key: Any) -> dict[str, Any]:
    return {"type": kind, "keys": [{"frame": 0} | key]}


def check_area(image: Any, radiance: float, expected: float, edge: float) -> None:
    """Compare the covered area with a closed form, pixels, to 3 standard errors at most.

    Args:
        edge: length of the outline, pixels; it crosses at most 4 / pi pixels per pixel of length, on average.
    """
    covered = image / radiance
    assert covered.max() <= 1 + 1e-5
    assert abs(covered.sum() - expected) < 3 * np.sqrt(4 / np.pi * edge / 4 / SAMPLES)


def test_a_sphere_covers_its_outline_with_its_radiance() -> None:
    image = drawn(lamp("point", position=[0, 0, -2], radius=0.4, intensity=[1, 2, 3]), wall(-3))[0][0]
    radius = FOCAL * np.tan(np.arcsin(0.2))
    for channel, intensity in enumerate((1, 2, 3)):
        check_area(image[..., channel], intensity / (np.pi * 0.4**2), np.pi * radius**2, 2 * np.pi * radius)
    assert image[0, 0].max() == 0


def test_a_sun_is_seen_where_nothing_hides_it() -> None:
    sun = lamp("directional", direction=[0, 0, 1], irradiance=2, angle=10)
    radius, radiance = FOCAL * np.tan(np.radians(5)), 2 / (np.pi * np.sin(np.radians(5)) ** 2)
    check_area(drawn(sun, wall(3))[0][0, ..., 0], radiance, np.pi * radius**2, 2 * np.pi * radius)
    assert drawn(sun, wall(-3))[0].max() == 0


@pytest.mark.parametrize("flush", [False, True])
def test_panels_cover_their_projection(flush: bool) -> None:
    """A panel may lie on a wall, and is then seen."""
    scene = wall(-2 if flush else -3)
    image = drawn(lamp("rect", position=[0.1, 0, -2], width=0.5, height=0.3, **DOWN), scene)[0][0, ..., 1]
    scale = FOCAL / 2
    check_area(image, 1 / 0.15, 0.15 * scale**2, 1.6 * scale)
    disc = drawn(lamp("disc", position=[0.1, 0, -2], radius=0.25, **DOWN), scene)[0][0, ..., 1]
    check_area(disc, 1 / (np.pi * 0.25**2), np.pi * (0.25 * scale) ** 2, 0.5 * np.pi * scale)


def test_a_panel_is_seen_from_its_bright_sides() -> None:
    away = {"position": [0, 0, -2], "width": 0.5, "height": 0.3, "direction": [0, 0, -1], "power": np.pi}
    assert drawn(lamp("rect", **away), wall(-3))[0].max() == 0
    both = drawn(lamp("rect", **away) | {"two_sided": True}, wall(-3))[0]
    assert both.max() == pytest.approx(0.5 / 0.15)


def test_a_wall_hides_a_lamp_and_a_lamp_stays_where_it_is() -> None:
    """Behind a wall nothing is drawn; along its path the lamp moves to the right, and stops shining."""
    keys = [{"frame": k, "position": [0.3 * k, 0, -2], "intensity": 2 - k, "radius": 0.1} for k in (0, 1, 2)]
    assert drawn({"type": "point", "keys": keys}, wall(-1))[0].max() == 0
    images, _ = drawn({"type": "point", "keys": keys}, wall(-3))
    columns = [(image[..., 0].sum(axis=0) @ np.arange(64)) / image[..., 0].sum() for image in images[:2]]
    np.testing.assert_allclose(columns, [31.5, 31.5 + FOCAL * 0.3 / 2], atol=0.2)
    assert images[0].sum() == pytest.approx(2 * images[1].sum(), rel=0.03) and images[2].max() == 0


@pytest.mark.parametrize(("z", "passes"), [(-1.0, True), (-2.5, False)])
def test_glass_before_a_lamp_dims_it(z: float, passes: bool) -> None:
    """A pane behind the lamp does not."""
    colour, side = (0.5, 0.25, 0.8), 4.0
    pane = tiny.quad((-side, -side, z), (side, -side, z), (side, side, z), (-side, side, z))
    back = tiny.quad((-9, -9, -3), (9, -9, -3), (9, 9, -3), (-9, 9, -3))
    materials = (Material(name="Back"), Material(name="Pane", glass=PaneGlass(colour=colour, ior=1.0, covers=True)))
    parts = (Part(material=0, corners=back), Part(material=1, corners=pane))
    scene = build_scene(Meshes(parts=parts, materials=materials, textures=(), dropped={}, notes=()), {})
    source = lamp("point", position=[0, 0, -2], radius=0.4, intensity=[1, 1, 1])
    behind, bare = drawn(source, scene)[0][0], drawn(source, wall(-3))[0][0]
    np.testing.assert_allclose(behind, bare * (colour if passes else 1.0), rtol=1e-5)


def test_a_mirror_shows_the_lamp_behind_the_eye_in_its_tint() -> None:
    image = drawn(lamp("point", position=[0, 0, 1], radius=0.5, intensity=1), wall(-2, MIRROR))[0][0]
    radius, radiance = FOCAL * np.tan(np.arcsin(0.5 / 5)), 1 / (np.pi * 0.5**2)
    for channel, tint in enumerate(MIRROR.specular):
        check_area(image[..., channel], tint * radiance, np.pi * radius**2, 2 * np.pi * radius)


def test_a_spot_is_as_bright_as_its_cone_towards_the_eye(tmp_path: Path) -> None:
    """Half way between the cones, in cosines, a spot has a quarter of its intensity."""
    angle = np.degrees(np.arccos((np.cos(np.radians(10)) + np.cos(np.radians(30))) / 2))
    way = [np.sin(np.radians(angle)), 0, np.cos(np.radians(angle))]
    spot = lamp("spot", position=[0, 0, -2], direction=way, inner=10, outer=30, radius=0.2, intensity=1)
    middle = drawn(spot, wall(-3), *dark_sources(tmp_path))[0][0, 23:25, 31:33]  # a degree on each side, which cancels
    assert middle.mean() == pytest.approx(0.25 / (np.pi * 0.2**2), rel=0.01)


def test_halves_are_cut_and_counted() -> None:
    bright = lamp("point", position=[0, 0, -2], radius=0.05, intensity=1000)
    images, beyond = drawn(bright, wall(-3), dtype=np.float16)
    assert images.max() == 65504 and beyond == (images == 65504).sum() > 0
    assert drawn(bright, wall(-3))[1] == 0


@pytest.mark.slow  # other cameras have kernels of their own
def test_parallel_rays_see_a_lamp_in_its_own_size_at_any_distance() -> None:
    """A sphere beside the axis, a panel before a wall, and a mirror behind which the sphere is seen once more."""
    lens = {"type": "orthographic", "height": 2.4}
    pixels = SIZE[1] / 2.4
    sphere = lamp("point", position=[0.7, 0.3, -2], radius=0.4, intensity=1)
    for scene in (wall(-3), tiny.scene_of(tiny.box((9, 9, 9), (10, 10, 10)))):  # the sky behind it
        image = drawn(sphere, scene, lens=lens)[0][0, ..., 0]
        radius = 0.4 * pixels
        check_area(image, 1 / (np.pi * 0.4**2), np.pi * radius**2, 2 * np.pi * radius)
        rows, columns = np.nonzero(image)
        assert columns.mean() + 0.5 == pytest.approx(SIZE[0] / 2 + 0.7 * pixels, abs=0.2)
        assert rows.mean() + 0.5 == pytest.approx(SIZE[1] / 2 - 0.3 * pixels, abs=0.2)
    panel = lamp("rect", position=[0, 0, -2], width=1.0, height=0.5, **DOWN)
    check_area(drawn(panel, wall(-3), lens=lens)[0][0, ..., 0], 1 / 0.5, 0.5 * pixels**2, 3 * pixels)
    behind = lamp("point", position=[0.2, 0, 1], radius=0.3, intensity=1)
    shown = drawn(behind, wall(-3, MIRROR), lens=lens)[0][0] / (1 / (np.pi * 0.3**2)) / [0.5, 0.25, 1.0]
    for channel in range(3):
        check_area(shown[..., channel], 1.0, np.pi * (0.3 * pixels) ** 2, 2 * np.pi * 0.3 * pixels)
    sun = {"type": "directional", "keys": [{"frame": 0, "direction": [0.01, 0, 1], "irradiance": 1.0, "angle": 2.0}]}
    sky = drawn(sun, tiny.scene_of(tiny.box((-0.5, -9, -4), (9, 9, -3))), lens=lens)[0][0, ..., 0]
    assert sky[:, :21].min() > 0 and sky[:, 23:].max() == 0, "the sun fills all of the sky that parallel rays see"


@pytest.mark.slow  # other cameras have kernels of their own
@pytest.mark.parametrize("position", [(0, 0, -2), (1.9, 0.3, 0.2), (0.1, -0.2, 2.0), (0.3, 1.9, -0.2)])
def test_a_panorama_sees_lamps_on_all_sides(position: tuple[float, float, float]) -> None:
    lens = {"type": "panorama", "resolution": [96, 48]}
    image = drawn(lamp("point", position=position, radius=0.4, intensity=1), wall(-3), lens=lens)[0][0, ..., 0]
    # the cone of the sphere, in the picture
    n = 16
    x, y = (np.arange(n * 96) + 0.5) / n / 96, (np.arange(n * 48) + 0.5) / n / 48
    around, lift = 2 * np.pi * (x[None] - 0.5), np.pi * (0.5 - y[:, None])
    ways = np.stack(
        np.broadcast_arrays(np.cos(lift) * np.sin(around), np.sin(lift), -np.cos(lift) * np.cos(around)), -1
    )
    distance = np.linalg.norm(position)
    inside = ways @ position / distance > np.sqrt(1 - (0.4 / distance) ** 2)
    covered = inside.reshape(48, n, 96, n).mean(axis=(1, 3))
    edge = np.pi / 4 * ((covered > 0) & (covered < 1)).sum()
    check_area(image, 1 / (np.pi * 0.4**2), covered.sum(), edge)
    assert np.abs(image * np.pi * 0.4**2 - covered).max() < 6 * np.sqrt(0.25 / SAMPLES)
