"""Mirrors: what one shows is the mirrored scene; two that face each other show it again and again."""

from pathlib import Path

import numpy as np
import pytest
from numpy.typing import NDArray
from support import closed_forms as forms
from support.stages import Part, box, look, make_job, mirrored, point, quad, repeats, result_of, sun, write_scene
from support.ztests import differing

Array = NDArray[np.float64]

# All that is diffuse, and the mirror, reflect one half, so that the average reflectivity is the same in both scenes.
HALF = 0.5
RANGE = 0.5  # no object is so near to the mirror that it obscures: the mirrored scene has no mirror


def things(shift: float = 0.0) -> list[Part]:
    """A floor with a box and a board on it, in front of the mirror plane z = 0, behind the eye."""
    return [
        quad("Thing", [-3, 0, 0.6], [0, 0, 4], [6, 0, 0]),
        *box("Thing", [-0.7 + shift, 0, 1.2], [-0.1 + shift, 0.8, 1.7]),
        quad("Thing", [0.2, 0, 1.1], [0.7, 0, 0.5], [0, 0.9, 0.2]),
    ]


def images_of(parts: list[Part], folder: Path, seed: int, side: float, mirror: float | None) -> Array:
    """48 independent images of one view, (48, values), by lamp and sun; `side` is -1 in the mirrored scene."""
    folder.mkdir()
    materials: dict[str, object] = {"Thing": HALF}
    if mirror is not None:
        materials["Mirror"] = {"reflectivity": 0.0, "specular": mirror}
    job = make_job(
        write_scene(folder, parts), folder / "out", materials=materials, seed=seed,
        camera={"resolution": [16, 12]} | repeats([0.1, 1.2, 0.5], [0, 0.5, -1.0], 48, fov=50.0),
        lights=[point([0.5, 1.8, side * 1.2], [1.0, 0.7, 0.4]), sun([0.3, -1.0, side * -0.4], [0.2, 0.3, 0.5])],
        samples={"hits": 6, "obscurance": 4}, obscurance={"range": RANGE}, ambient={"intensity": 0.4},
    )  # fmt: skip
    return result_of(job).images.reshape(48, -1)


def shown_and_mirrored(folder: Path) -> tuple[Array, Array]:
    """Independent images of what a mirror shows, and of the mirrored scene."""
    mirror = quad("Mirror", [-3, -3, 0], [6, 0, 0], [0, 6, 0])
    shown = images_of([*things(), mirror], folder / "mirror", 1, 1.0, HALF)
    return shown, images_of([mirrored(part) for part in things()], folder / "scene", 2, -1.0, None)


def test_a_mirror_shows_the_mirrored_scene(tmp_path: Path) -> None:
    shown, scene = shown_and_mirrored(tmp_path)
    assert (scene.mean(axis=0) > 0).mean() > 0.7
    assert differing(shown, HALF * scene).max() < 1
    assert differing(shown, 0.51 * scene).max() > 1  # the test can fail: by a tint that is wrong by 2 %
    moved = images_of([mirrored(part) for part in things(0.03)], tmp_path / "moved", 3, -1.0, None)
    assert differing(shown, HALF * moved).max() > 1  # and by a box that stands 3 cm further


GAP, TOP, CEILING = 2.0, 1.0, 1.5  # two mirrors of height TOP stand GAP apart below a ceiling
BOUNCES = (1, 2, 3, 5)
TINTS = np.array([[0.9, 0.6, 0.3], [0.5, 0.8, 1.0]])


def facing_parts() -> list[Part]:
    """Mirrors at z = 0 and z = GAP, and a ceiling over them."""
    return [
        quad("Near", [-2, -1, 0], [4, 0, 0], [0, 1 + TOP, 0]),
        quad("Far", [-2, -1, GAP], [4, 0, 0], [0, 1 + TOP, 0]),
        quad("Ceiling", [-3, CEILING, -9], [6, 0, 0], [0, 0, 18]),
    ]


@pytest.fixture(scope="module")
def facing(tmp_path_factory: pytest.TempPathFactory) -> Path:
    return write_scene(tmp_path_factory.mktemp("facing"), facing_parts())


def unfolded(bounces: int) -> tuple[list[float], float]:
    """A target for an eye in the middle, looking at the mirror z = 0, so that its ray leaves after some bounces; and z
    of where it meets the ceiling.

    Unfolded, the ray goes straight; along z it meets mirrors after GAP / 2, 3 GAP / 2, ... It rises by TOP halfway
    between the last one it meets and the next, and ends after CEILING / slope. Folded back, odd numbers of bounces
    leave it on its way to larger z.
    """
    slope = TOP / (bounces * GAP)
    last = (bounces - 0.5) * GAP
    beyond = CEILING / slope - last
    return [0.0, slope, GAP / 2 - 1.0], beyond if bounces % 2 else GAP - beyond


def facing_image(scene: Path, out: Path, bounces: int, depth: int) -> tuple[Array, Array]:
    """Mean radiance of a spot of the ceiling behind some mirrors, found and right; mirrors are followed to a depth."""
    target, z = unfolded(bounces)
    lamp = np.array([0.3, 1.2, 0.8])  # between the mirrors' top and the ceiling: nothing shades it
    job = make_job(
        scene, out, camera=look([0, 0, GAP / 2], target, fov=0.001),
        materials={
            "Near": {"reflectivity": 0.0, "specular": TINTS[0].tolist()},
            "Far": {"reflectivity": 0.0, "specular": TINTS[1].tolist()},
            "Ceiling": HALF,
        },
        lights=[point(lamp, 2.0)], specular={"depth": depth}, ambient={"intensity": 0.0},
    )  # fmt: skip
    place, normal = np.array([[0.0, CEILING, z]]), np.array([[0.0, -1.0, 0.0]])
    tint = TINTS[0] ** ((bounces + 1) // 2) * TINTS[1] ** (bounces // 2)
    right = tint * HALF / np.pi * float(forms.point_irradiance(place, normal, lamp, 2.0)[0])
    # a pixel sees a thousandth of a unit of the far ceiling; the mean over all pixels is that of their middle
    return result_of(job).images[0, 0].mean(axis=(0, 1)), right


@pytest.mark.parametrize("bounces", BOUNCES)
def test_facing_mirrors(bounces: int, facing: Path, tmp_path: Path) -> None:
    found, right = facing_image(facing, tmp_path / "all", bounces, bounces)
    assert found == pytest.approx(right, rel=1e-4)
    found, _ = facing_image(facing, tmp_path / "less", bounces, bounces - 1)
    assert (found == 0).all()  # one bounce more than is followed stays black


def test_tints_differ_by_depth() -> None:
    """The expected values differ by tint and depth, so the test above can fail."""
    tints = [TINTS[0] ** ((b + 1) // 2) * TINTS[1] ** (b // 2) for b in BOUNCES]
    for i, a in enumerate(tints):
        for b in tints[:i]:
            assert not np.allclose(a, b, rtol=1e-3)
