"""Direct light at each hit against the formula, and at one point through the whole program."""

from dataclasses import dataclass
from pathlib import Path

import numpy as np
import pytest
from numpy.typing import NDArray
from support import closed_forms as forms
from support.irradiance import seen
from support.stages import Part, look, make_job, point, quad, result_of, sun, write_scene

from framearray_cli.job.job import Job

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


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class Lit:
    """Hits as the program found them, in world coordinates, and the irradiance it computed, (n, n_lights)."""

    position: Array
    normal: Array
    irradiance: Array


def hits_of(job: Job) -> Lit:
    """Find the eye's hits and their direct irradiance by the program's kernels, as its frame loop does."""
    position, hits, irradiance = seen(job)
    return Lit(position=position, normal=hits.geometric.astype(float), irradiance=irradiance[:, 0])


def shadow(points: Array, way: Array, length: float) -> tuple[Array, Array]:
    """Which points the table shades for certain, and which it may."""
    below = points[:, 1] < HEIGHT - EDGE
    inner = forms.segment_meets_rectangle(points, way, LOW + EDGE, HIGH - EDGE, HEIGHT, np.full(len(points), length))
    outer = forms.segment_meets_rectangle(points, way, LOW - EDGE, HIGH + EDGE, HEIGHT, np.full(len(points), length))
    return inner & below, outer & below


VIEW = {"resolution": [32, 32], "fov": 60.0, "keys": [{"frame": 0, "eye": [0.4, 2.4, 2.9], "target": [0, 0.3, -0.5]}]}


def compared(kind: str, scene: Path, out: Path) -> tuple[Lit, Array, Array, Array]:
    """Hits and the right irradiance without shadows; which of them are clear, and which the table shades."""
    source = point(LAMP, LAMP_POWER) if kind == "point" else sun(SUN, SUN_POWER)
    lit = hits_of(job_of(scene, out, [source], VIEW))
    if kind == "point":
        right = forms.point_irradiance(lit.position, lit.normal, LAMP, LAMP_POWER)
        shaded, unsure = shadow(lit.position, LAMP - lit.position, 1.0)
    else:
        right = forms.directional_irradiance(lit.normal, SUN, SUN_POWER)
        shaded, unsure = shadow(lit.position, np.tile(-SUN, (len(lit.position), 1)), np.inf)
    behind = slope_hides(lit)
    return lit, right, ~unsure & ~behind, shaded & ~behind


@pytest.mark.parametrize("kind", ["point", "directional"])
def test_every_hit(kind: str, scene: Path, tmp_path: Path) -> None:
    lit, right, clear, dark = compared(kind, scene, tmp_path)
    assert clear.sum() > 500
    assert dark.sum() > 50  # with and without an occluder
    got = lit.irradiance[:, 0]
    assert got[clear] == pytest.approx(right[clear], rel=1e-4, abs=1e-7)
    assert (got[dark] == 0).all()
    assert not np.allclose(got[dark], right[dark], rtol=1e-4)  # the occluder matters
    assert not np.allclose(got[clear], 1.001 * right[clear], rtol=1e-4)  # the test can fail


def slope_hides(lit: Lit) -> Array:
    """Hits behind the slope, which is left out of the formula; the lights stand before it."""
    return lit.position[:, 2] < -1.5 - 1e-3 - lit.position[:, 1] * 1.5 / 2


def test_two_sources_add_up(scene: Path, tmp_path: Path) -> None:
    lamp, sunlight = point(LAMP, LAMP_POWER), sun(SUN, SUN_POWER)
    both, one, other = (hits_of(job_of(scene, tmp_path, s, VIEW)) for s in ([lamp, sunlight], [lamp], [sunlight]))
    assert both.irradiance == pytest.approx(one.irradiance + other.irradiance, rel=1e-6)


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
