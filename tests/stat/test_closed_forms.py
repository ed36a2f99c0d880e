"""Closed forms: against quadrature, and direct light and mirrors against them."""

from pathlib import Path

import numpy as np
import pytest
from numpy.typing import NDArray
from support import closed_forms as forms
from support import ztests
from support.irradiance import seen
from support.stages import Part, box, look, make_job, mirrored, point, quad, repeats, result_of, sun, write_scene
from support.ztests import differing

from framearray_cli.engine.terms.obscurance import FALLOFFS
from framearray_cli.job.job import Job


@pytest.mark.parametrize("k", [0.1, 0.4, 1.0, 3.0, 200.0])
@pytest.mark.parametrize("falloff", FALLOFFS)
def test_chords_of_a_sphere(falloff: str, k: float) -> None:
    closed = forms.sphere_obscurance(falloff, 0.7, k)
    assert closed == pytest.approx(forms.sphere_obscurance_numerically(falloff, 0.7, k), rel=1e-7, abs=1e-12)


def test_the_sphere_has_the_form_that_the_design_gives() -> None:
    r, d_max = 1.3, 4.0
    assert forms.sphere_obscurance("sqrt", 0.5, 2 * r / d_max) == pytest.approx(0.8 * 0.5 * (2 * r / d_max) ** 0.5)


@pytest.mark.parametrize("s", [0.1, 0.5, 0.9])
def test_wall_and_disc_by_linear_falloff(s: float) -> None:
    assert forms.wall_obscurance("linear", 0.7, 0.4, s) == pytest.approx(forms.wall_obscurance_linear(0.7, 0.4, s))
    numeric = forms.disc_obscurance("linear", 0.7, 0.4, 0.8, s, 1.5)
    assert numeric == pytest.approx(forms.disc_obscurance_linear(0.7, 0.4, 0.8, s, 1.5))


def test_limits_of_wall_and_disc() -> None:
    assert forms.wall_share(1.0) == 0  # a wall at d_max is not met within it
    assert forms.wall_share(1e-9) == pytest.approx(0.5)  # one at the foot hides half the sky
    assert forms.disc_share(1.0, 1e-6) == pytest.approx(1.0)


def test_sidak_keeps_the_chance_of_a_family() -> None:
    assert 1 - (1 - ztests.sidak(500)) ** 500 == pytest.approx(ztests.CHANCE)
    assert ztests.sidak_z(1) == pytest.approx(3.0)
    assert ztests.sidak_z(1000) > 4.5


def test_differing_finds_what_differs_and_nothing_else() -> None:
    random = np.random.default_rng(1)
    a, b = random.normal(size=(20, 300)), random.normal(size=(30, 300))
    assert ztests.differing(a, b).max() < 1
    b[:, 7] += 3.0  # some ten standard errors
    assert (ztests.differing(a, b) > 1).nonzero()[0].tolist() == [7]
    assert ztests.differing(np.zeros((5, 1)), np.ones((5, 1)))[0] > 1e4  # values without any spread


def test_off_finds_wrong_means_and_nothing_else() -> None:
    a = np.random.default_rng(2).normal(size=(20, 300))
    right = np.zeros(300)
    assert ztests.off(a, right).max() < 1
    right[7] = 3.0
    assert (ztests.off(a, right) > 1).nonzero()[0].tolist() == [7]
    assert ztests.off(np.zeros((5, 1)), np.ones(1))[0] > 1e4


@pytest.mark.parametrize("test", ["off", "differing"])
def test_pixel_tests_are_as_strict_as_they_say(test: str) -> None:
    """Of 400 families of 50 values each that nothing is wrong with, about CHANCE = 1 in 370 may fail: at most 6.

    More have a chance of 1e-3 (Poisson). A test that is too strict, or that lets too much pass, shows in half of it:
    the largest of 50 deviations is beyond half of what is allowed in more than a tenth of all families.
    """
    rng = np.random.default_rng(3)
    a, b = rng.normal(size=(2, 400, 40, 50))
    worst = np.array(
        [
            ztests.off(x, np.zeros(50)).max() if test == "off" else ztests.differing(x, y).max()
            for x, y in zip(a, b, strict=True)
        ]
    )
    assert (worst > 1).sum() <= 6
    assert 0.1 < (worst > 0.5).mean() < 0.99


def test_z_of_an_estimate_without_error() -> None:
    sure = ztests.estimate(np.ones(10))
    assert sure.z(1.0) == 0
    assert sure.z(1.1) == -np.inf


Array = NDArray[np.float64]

LAMP, SUN = np.array([0.7, 2.2, -0.4]), np.array([0.5, -1.0, 0.3])
LAMP_POWER, SUN_POWER = 3.0, 2.0
LOW, HIGH, HEIGHT = np.array([-0.6, -0.5]), np.array([0.5, 0.7]), 1.1  # a table over the floor, x and z
EDGE = 1e-4  # hits whose shadow ray passes the table's rim this closely count as either lit or not


def table_parts() -> list[Part]:
    """A floor, a sloping board, and a table over the floor."""
    return [
        quad("Floor", [-3, 0, -3], [0, 0, 6], [6, 0, 0]),
        quad("Slope", [-3, 0, -1.5], [6, 0, 0], [0, 2, -1.5]),
        quad("Table", [LOW[0], HEIGHT, LOW[1]], [0, 0, HIGH[1] - LOW[1]], [HIGH[0] - LOW[0], 0, 0]),
    ]


@pytest.fixture(scope="module")
def scene(tmp_path_factory: pytest.TempPathFactory) -> Path:
    return write_scene(tmp_path_factory.mktemp("table"), table_parts())


def job_of(scene: Path, out: Path, lights: list[dict[str, object]], camera: dict[str, object]) -> Job:
    materials = {"Floor": 0.5, "Slope": 0.5, "Table": 0.5}
    return make_job(
        scene, out, materials=materials, camera=camera, lights=lights, samples={"hits": 1}, ambient={"intensity": 0.0}
    )


def shadow(points: Array, way: Array, length: float) -> tuple[Array, Array]:
    """Which points the table shades for certain, and which it may."""
    below = points[:, 1] < HEIGHT - EDGE
    inner = forms.segment_meets_rectangle(points, way, LOW + EDGE, HIGH - EDGE, HEIGHT, np.full(len(points), length))
    outer = forms.segment_meets_rectangle(points, way, LOW - EDGE, HIGH + EDGE, HEIGHT, np.full(len(points), length))
    return inner & below, outer & below


VIEW = {"resolution": [32, 32], "fov": 60.0, "keys": [{"frame": 0, "eye": [0.4, 2.4, 2.9], "target": [0, 0.3, -0.5]}]}


def compared(kind: str, scene: Path, out: Path) -> tuple[Array, Array, Array, Array]:
    """Irradiance of hits, and the right one without shadows; which hits are clear, and which the table shades.

    Left out are hits behind the slope, which no formula knows; the lights stand before it.
    """
    source = point(LAMP, LAMP_POWER) if kind == "point" else sun(SUN, SUN_POWER)
    position, hits, light = seen(job_of(scene, out, [source], VIEW))
    normal = hits.geometric.astype(float)
    if kind == "point":
        right = forms.point_irradiance(position, normal, LAMP, LAMP_POWER)
        shaded, unsure = shadow(position, LAMP - position, 1.0)
    else:
        right = forms.directional_irradiance(normal, SUN, SUN_POWER)
        shaded, unsure = shadow(position, np.tile(-SUN, (len(position), 1)), np.inf)
    behind = position[:, 2] < -1.5 - 1e-3 - position[:, 1] * 1.5 / 2
    return light[:, 0, 0], right, ~unsure & ~behind, shaded & ~behind


@pytest.mark.parametrize("kind", ["point", "directional"])
def test_every_hit(kind: str, scene: Path, tmp_path: Path) -> None:
    got, right, clear, dark = compared(kind, scene, tmp_path)
    assert clear.sum() > 500
    assert dark.sum() > 50  # with and without an occluder
    assert got[clear] == pytest.approx(right[clear], rel=1e-4, abs=1e-7)
    assert (got[dark] == 0).all()
    assert not np.allclose(got[dark], right[dark], rtol=1e-4)  # the occluder matters
    assert not np.allclose(got[clear], 1.001 * right[clear], rtol=1e-4)  # the test can fail


SPOTS = {  # a point of the floor that the table does not shade for either light; one that it does; one of the slope
    "floor": ([1.5, 0.0, 1.0], [0.0, 1.0, 0.0], 1.0),
    "below the table": ([0.0, 0.0, 0.0], [0.0, 1.0, 0.0], 0.0),
    "slope": ([1.2, 1.0, -2.25], [0.0, 0.6, 0.8], 1.0),
}


@pytest.mark.parametrize("spot", SPOTS)
@pytest.mark.parametrize("kind", ["point", "directional"])
def test_one_spot_through_the_whole_program(kind: str, spot: str, scene: Path, tmp_path: Path) -> None:
    """A pixel of a ten-thousandth of a degree: its radiance is R / pi E to 1e-4, in each channel separately."""
    place, normal, free = SPOTS[spot]
    colour = [1.0, 0.5, 0.25]
    source = (
        point(LAMP, [LAMP_POWER * c for c in colour]) if kind == "point" else sun(SUN, [SUN_POWER * c for c in colour])
    )
    camera = look([0.4, 0.9, 2.0], place, fov=0.003)
    image = result_of(job_of(scene, tmp_path, [source], camera)).images[0, 0]
    n = np.array([normal])
    right = (
        forms.point_irradiance(np.array([place]), n, LAMP, LAMP_POWER)
        if kind == "point"
        else forms.directional_irradiance(n, SUN, SUN_POWER)
    )
    expected = 0.5 / np.pi * float(right[0]) * free * np.array(colour)
    assert image.reshape(-1, 3) == pytest.approx(np.tile(expected, (1024, 1)), rel=1e-4, abs=1e-9)
    assert free == 0 or image.mean() != pytest.approx(1.001 * expected.mean(), rel=1e-4)


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
