"""W and sky light at one point, seen by many pixels, against closed forms: through the whole program.

A camera with a field of view of a hundredth of a degree sees one point; each pixel is an independent estimate of its
radiance R (I_A W + S). I_A is fixed to 1, and the light gives nothing.
"""

from pathlib import Path

import pytest
from support import closed_forms as forms
from support.stages import FURNACE, Part, disc, look, make_job, quad, result_of, write_scene
from support.ztests import Estimate, estimate

from framearray_cli.engine.terms.obscurance import FALLOFFS

SAMPLES = {"hits": 2, "obscurance": 32}
GROUND, SKY = 0.6, 2.5
RADIUS, HEIGHT = 0.8, 0.5  # of the disc
BELOW = {"eye": [0.3, 0.25, 0.1], "target": [0.0, 0.0, 0.0]}  # an eye between ground and disc


def indirect(
    scene: Path, out: Path, *, materials: dict[str, float], eye: list[float], target: list[float],
    obscurance: dict[str, object], background: float = 0.0, average: float,
) -> Estimate:  # fmt: skip
    """R (I_A W + S) with I_A = 1, over 1024 independent pixels that see the target; checks the average reflectivity."""
    job = make_job(
        scene, out, materials=materials, camera=look(eye, target), samples=SAMPLES, obscurance=obscurance,
        ambient={"intensity": 1.0}, background=background,
    )  # fmt: skip
    result = result_of(job)
    assert result.ambient.reflectivity == pytest.approx(average, rel=1e-5)
    return estimate(result.images[..., 0])


def sphere(out: Path, falloff: str, k: float) -> tuple[Estimate, float]:
    """Indirect radiance inside a sphere with 2 r / d_max = k: found, and right."""
    found = indirect(
        FURNACE, out, materials={"Wall": 0.7}, eye=[0.1, 0.0, 0.2], target=[0.3, -0.5, -0.81], average=0.7,
        obscurance={"range": 2 / k, "falloff": falloff},
    )  # fmt: skip
    return found, 0.7 * forms.sphere_obscurance(falloff, 0.7, k)


def beside_wall(scene: Path, out: Path, falloff: str) -> tuple[Estimate, float]:
    """Indirect radiance of the floor at half the range from the wall: found, and right."""
    found = indirect(
        scene, out, materials={"Floor": GROUND, "Wall": GROUND}, eye=[-0.2, 1, 0], target=[0, 0, 0],
        average=GROUND, obscurance={"range": 1.0, "falloff": falloff},
    )  # fmt: skip
    return found, GROUND * forms.wall_obscurance(falloff, GROUND, GROUND, s=0.5)


def under_disc(scene: Path, out: Path, falloff: str) -> tuple[Estimate, float]:
    """Indirect radiance of the ground below the disc, all of it within range: found, and right."""
    found = indirect(
        scene, out, materials={"Ground": GROUND, "Disc": GROUND}, **BELOW, average=GROUND,
        obscurance={"range": 1.2, "falloff": falloff},
    )  # fmt: skip
    return found, GROUND * forms.disc_obscurance(falloff, GROUND, GROUND, RADIUS, HEIGHT, 1.2)


def under_disc_and_sky(scene: Path, out: Path) -> tuple[Estimate, float]:
    """The same where rays past the disc bring a sky of radiance SKY: found, and right."""
    found = indirect(
        scene, out, materials={"Ground": GROUND, "Disc": GROUND}, **BELOW, average=GROUND, background=SKY,
        obscurance={"range": 1.2, "falloff": "sqrt", "outside": "background"},
    )  # fmt: skip
    w = forms.disc_obscurance("sqrt", GROUND, 0.0, RADIUS, HEIGHT, 1.2)  # what meets nothing is sky, not average
    return found, GROUND * (w + SKY * (1 - forms.disc_share(RADIUS, HEIGHT)))


@pytest.mark.parametrize("k", [0.4, 1.0, 3.0])  # 2 r / d_max: the whole sphere within range, just so, and not so
@pytest.mark.parametrize("falloff", FALLOFFS)
def test_inside_a_sphere(falloff: str, k: float, tmp_path: Path) -> None:
    got, right = sphere(tmp_path, falloff, k)
    if falloff == "constant" and k <= 1:
        assert got.mean == 0 == right  # no ray is free
    else:
        assert abs(got.z(right)) < 3
        assert got.error < 0.005 * right
        assert abs(got.z(1.03 * right)) > 3  # the test can fail


def corner_parts() -> list[Part]:
    """A floor y = 0 and a wall x = 0.5, far larger than the range of 1."""
    floor = quad("Floor", [-3, 0, -3], [6, 0, 0], [0, 0, 6])
    return [floor, quad("Wall", [0.5, 0, -3], [0, 3, 0], [0, 0, 6])]


@pytest.fixture(scope="module")
def corner(tmp_path_factory: pytest.TempPathFactory) -> Path:
    return write_scene(tmp_path_factory.mktemp("corner"), corner_parts())


@pytest.mark.parametrize("falloff", FALLOFFS)
def test_beside_a_wall(falloff: str, corner: Path, tmp_path: Path) -> None:
    got, right = beside_wall(corner, tmp_path, falloff)
    assert abs(got.z(right)) < 3
    assert abs(got.z(GROUND * GROUND)) > 3  # a wall that obscures nothing
    assert abs(got.z(GROUND * forms.wall_obscurance(falloff, GROUND, GROUND, s=0.53))) > 3  # one that is farther off


def test_colour_bleeds_from_the_wall(corner: Path, tmp_path: Path) -> None:
    """The wall's reflectivity counts where it is met, the average one elsewhere: all three differ here."""
    job = make_job(
        corner, tmp_path, materials={"Floor": 0.3, "Wall": [0.9, 0.5, 0.1]}, camera=look([-0.2, 1, 0], [0, 0, 0]),
        samples=SAMPLES, obscurance={"range": 1.0, "falloff": "linear"}, ambient={"intensity": 1.0},
    )  # fmt: skip
    result = result_of(job)
    for channel, wall in enumerate((0.9, 0.5, 0.1)):
        average = float(result.ambient.reflectivity[channel])
        assert abs(average - wall) + abs(average - 0.3) > 0
        got = estimate(result.images[..., channel])
        assert abs(got.z(0.3 * forms.wall_obscurance_linear(wall, average, s=0.5))) < 3
        assert abs(got.z(0.3 * forms.wall_obscurance_linear(0.7, average, s=0.5))) > 3


def parasol_parts() -> list[Part]:
    """A ground plane, and a disc over its middle."""
    return [quad("Ground", [-3, 0, -3], [6, 0, 0], [0, 0, 6]), disc("Disc", [0, HEIGHT, 0], RADIUS)]


@pytest.fixture(scope="module")
def parasol(tmp_path_factory: pytest.TempPathFactory) -> Path:
    return write_scene(tmp_path_factory.mktemp("parasol"), parasol_parts())


@pytest.mark.parametrize("falloff", FALLOFFS)
def test_under_a_disc(falloff: str, parasol: Path, tmp_path: Path) -> None:
    got, right = under_disc(parasol, tmp_path, falloff)
    assert abs(got.z(right)) < 3
    assert abs(got.z(GROUND * forms.disc_obscurance(falloff, GROUND, GROUND, RADIUS, 1.05 * HEIGHT, 1.2))) > 3


def test_under_a_disc_and_the_sky(parasol: Path, tmp_path: Path) -> None:
    """Rays past the disc bring the background itself, L = R (I_A W + S)."""
    got, right = under_disc_and_sky(parasol, tmp_path)
    assert abs(got.z(right)) < 3
    assert abs(got.z(right + GROUND * SKY * 0.02)) > 3


def test_the_disc_beyond_the_range_has_the_average_reflectivity(parasol: Path, tmp_path: Path) -> None:
    """With `outside = "background"` a ray that meets a surface beyond d_max is neither sky nor obscured."""
    got = indirect(
        parasol, tmp_path, materials={"Ground": GROUND, "Disc": GROUND}, **BELOW, average=GROUND, background=SKY,
        obscurance={"range": HEIGHT / 2, "falloff": "sqrt", "outside": "background"},
    )  # fmt: skip
    share = forms.disc_share(RADIUS, HEIGHT)
    assert abs(got.z(GROUND * (share * GROUND + SKY * (1 - share)))) < 3
    assert abs(got.z(GROUND * (share * 0.5 * GROUND + SKY * (1 - share)))) > 3


@pytest.fixture(scope="module")
def plane(tmp_path_factory: pytest.TempPathFactory) -> Path:
    parts: list[Part] = [quad("Ground", [-3, 0, -3], [6, 0, 0], [0, 0, 6])]
    return write_scene(tmp_path_factory.mktemp("plane"), parts)


@pytest.mark.parametrize(("outside", "right"), [("background", GROUND * SKY), ("average", GROUND * GROUND)])
def test_under_open_sky(outside: str, right: float, plane: Path, tmp_path: Path) -> None:
    """Every ray escapes: all pixels are equal, and right to rounding."""
    got = indirect(
        plane, tmp_path, materials={"Ground": GROUND}, eye=[0.3, 1, 0], target=[0, 0, 0], average=GROUND,
        background=SKY, obscurance={"range": 1.2, "outside": outside},
    )  # fmt: skip
    assert got.mean == pytest.approx(right, rel=1e-5)
    assert got.error < 1e-6
