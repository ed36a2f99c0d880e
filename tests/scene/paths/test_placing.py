"""Where domes, grids and positions in the axes of a picture put the light."""

from typing import Any

import numpy as np
import pytest
from support import tiny

from framearray_cli.base.errors import JobError
from framearray_cli.job.job import Job
from framearray_cli.scene.paths.lightpath import LightPath, carry_across
from framearray_cli.scene.paths.paths import eyes, lights
from framearray_cli.scene.paths.placing import dome_directions


def path(frames: int | None = None, camera: dict[str, Any] | None = None, **source: Any) -> LightPath:
    light: dict[str, Any] = {"sources": [source]} | ({"frames": frames} if frames else {})
    table = tiny.table(**({"camera": camera} if camera else {})) | {"light": light}
    return lights(Job.model_validate(table)).sources[0]


@pytest.mark.parametrize("whole", [False, True])
@pytest.mark.parametrize("top", [(0.0, 1.0, 0.0), (1.0, -2.0, 0.3)])
def test_a_dome_is_even(whole: bool, top: tuple[float, float, float]) -> None:
    n = 500
    found = dome_directions(n, np.array(top), whole=whole)
    np.testing.assert_allclose(np.linalg.norm(found, axis=1), 1, atol=1e-12)
    heights = found @ (np.array(top) / np.linalg.norm(top))
    least = -1 if whole else 0
    np.testing.assert_allclose(heights, 1 - (np.arange(n) + 0.5) * (1 - least) / n, atol=1e-12)
    # Moments of an even spread: the mean is along the axis, half the radius up on a hemisphere.
    np.testing.assert_allclose(found.mean(axis=0), (1 + least) / 2 * np.array(top) / np.linalg.norm(top), atol=0.01)
    # A square lattice of n points on this area has the distance sqrt(area / n); the spiral keeps 3/4 of it.
    apart = np.sort(np.linalg.norm(found[:, None] - found[None], axis=-1), axis=1)[:, 1]
    assert apart.min() > 0.75 * np.sqrt((4 if whole else 2) * np.pi / n)


def test_points_of_a_dome_lie_around_the_target() -> None:
    found = path(type="dome", positions=7, target=[1, 2, 3], radius=2.5, intensity=[1, 2, 3], color="3200 K")
    assert found.kind == "point"
    assert len(found.vector) == 7
    np.testing.assert_allclose(np.linalg.norm(found.vector - [1, 2, 3], axis=1), 2.5)
    assert (found.vector[:, 1] > 2).all()
    assert found.intensity[0] @ (np.array([0.2126, 0.7152, 0.0722]) / [1, 2, 3]) == pytest.approx(1)


def test_directions_of_a_dome_come_from_above_and_stay_at_the_last() -> None:
    found = path(frames=5, type="dome", positions=3, irradiance=2)
    assert found.kind == "directional"
    assert (found.vector[:, 1] < 0).all()
    np.testing.assert_array_equal(found.vector[3:], found.vector[[2, 2]])
    np.testing.assert_array_equal(found.intensity, 2.0)


def test_a_spot_follows_its_target_or_turns() -> None:
    keys = [{"frame": 2 * k, "position": [0, 2, 0], "target": [2 * k, 0, 0], "intensity": 5} for k in (0, 1)]
    found = path(type="spot", keys=[key | {"inner": 10, "outer": 20 + 10 * key["frame"]} for key in keys])
    np.testing.assert_allclose(found.cone.axis, [[0, -1, 0], np.array([1, -2, 0]) / 5**0.5, [2**-0.5, -(2**-0.5), 0]])
    np.testing.assert_allclose(found.cone.angles_deg, [[10, 20], [10, 30], [10, 40]])
    assert found.table(2) == {
        "type": "spot", "position": [0.0, 2.0, 0.0], "intensity": [5.0] * 3,
        "direction": pytest.approx([2**-0.5, -(2**-0.5), 0.0]), "inner": 10.0, "outer": pytest.approx(40.0),
    }  # fmt: skip
    turned = path(
        type="spot", keys=[{"frame": k, "position": [0, 2, 0], "direction": [k, -1, 0], "intensity": 5} for k in (0, 1)]
    )
    np.testing.assert_allclose(turned.at([1]).cone.axis, [[2**-0.5, -(2**-0.5), 0]])


def test_a_spot_in_the_axes_of_the_picture_is_the_spot_in_those_of_the_scene() -> None:
    """The camera looks along -x: what is right of it lies towards -z; the origin is its target."""
    camera = {"keys": [{"frame": 0, "eye": [4, 1, 2], "target": [1, 1, 2]}]}
    key = {"frame": 0, "position": [1, 0, 2], "target": [1, 1, 0], "intensity": 5}
    found = path(camera=camera, type="spot", space="camera", scale=0.5, keys=[key])
    np.testing.assert_allclose(found.vector, [[1 + 1, 1, 2 - 0.5]], atol=1e-12)
    np.testing.assert_allclose(found.cone.axis, [np.array([-2, 1, 0]) / 5**0.5], atol=1e-12)
    aimed = RECT | {"frame": 0, "direction": [0, 0, -1], "up": [0, 1, 0], "power": 1.0}
    panel = path(camera=camera, type="rect", space="camera", keys=[aimed]).panel
    np.testing.assert_allclose(panel.axis, [[-1, 0, 0]], atol=1e-12)
    np.testing.assert_allclose(panel.half_axes[1] / 0.25, [[0, 1, 0]], atol=1e-12)


def test_a_spot_that_meets_its_target_is_an_error() -> None:
    keys = [{"frame": 4 * k, "position": [k, 0, 0], "target": [1 - k, 0, 0], "intensity": 5} for k in (0, 1)]
    with pytest.raises(JobError, match=r"light.sources\[0\]: expected a target away from the spot, got .* frame 2"):
        path(type="spot", keys=keys)


RECT = {"position": [0, 2, 0], "width": 2.0, "height": 0.5}


def test_the_strength_of_a_panel_is_that_along_its_normal() -> None:
    """A panel of radiance L shines L A along its normal, and pi L A in all, twice that with two sides."""
    aim = {"frame": 0, "direction": [0, -2, 0]}
    np.testing.assert_allclose(path(type="rect", keys=[RECT | aim | {"radiance": [1, 2, 3]}]).intensity[0], [1, 2, 3])
    np.testing.assert_allclose(
        path(type="rect", keys=[RECT | aim | {"power": 3, "color": [1, 0, 1]}]).intensity[0],
        np.multiply(3 / np.pi, [1, 0, 1]),
    )
    both = path(type="rect", two_sided=True, keys=[RECT | aim | {"power": 3}])
    np.testing.assert_allclose(both.intensity[0], 3 / (2 * np.pi))
    disc = path(type="disc", keys=[{"position": [0, 2, 0], "radius": 0.5, "radiance": 4} | aim])
    np.testing.assert_allclose(disc.intensity[0], np.pi)
    assert disc.table(0) == {
        "type": "disc", "position": [0.0, 2.0, 0.0], "intensity": [pytest.approx(np.pi)] * 3,
        "direction": [0.0, -1.0, 0.0], "radius": 0.5, "two_sided": False,
    }  # fmt: skip
    assert path(type="rect", keys=[RECT | aim | {"power": 1}]).table(0)["across"] == [1.0, 0.0, 0.0]


@pytest.mark.parametrize(
    ("strength", "units", "per_unit"),
    [("power", "W", 1), ("power", "lm", 1 / 683), ("radiance", "W/(m2 sr)", 1), ("radiance", "cd/m2", 1 / 683)],
)
def test_a_panel_has_photometric_units(strength: str, units: str, per_unit: float) -> None:
    """The light of a panel is its power, pi times the intensity along its normal, and its area is 1."""
    keys = [RECT | {"frame": 0, "direction": [0, -2, 0], strength: 3.0}]
    found = path(type="rect", units=units, keys=keys).intensity[0]
    np.testing.assert_allclose(found, 3 * per_unit / (np.pi if strength == "power" else 1))


def test_a_panel_changes_size_and_strength_along_its_keys() -> None:
    keys = [
        RECT | {"frame": 2 * k, "target": [2 * k, 0, 0], "radiance": 2 + 2 * k, "width": 1.0 + 2 * k} for k in (0, 1)
    ]
    found = path(type="rect", keys=keys)
    np.testing.assert_allclose(found.panel.sides[:, 0], [1, 2, 3])
    np.testing.assert_allclose(found.intensity[:, 0], [2 * 0.5, 3 * 1, 4 * 1.5])
    np.testing.assert_allclose(found.at([1]).panel.axis, [np.array([1, -2, 0]) / 5**0.5])


def test_axes_of_a_panel_move_smoothly_and_without_turning() -> None:
    """Over the zenith and back: neighbours differ by the turn of the normal, and all axes stay at right angles."""
    turn = np.linspace(0, 2 * np.pi, 200)
    axis = np.stack([np.sin(turn), np.cos(turn), 0.1 * np.sin(3 * turn)], axis=1)
    axis /= np.linalg.norm(axis, axis=1, keepdims=True)
    across = carry_across(axis, np.array([0.0, 1.0, 0.0]))
    np.testing.assert_allclose((across * axis).sum(axis=1), 0, atol=1e-12)
    np.testing.assert_allclose(np.linalg.norm(across, axis=1), 1)
    steps = [np.linalg.norm(np.diff(vectors, axis=0), axis=1) for vectors in (across, axis)]
    assert (steps[0] <= steps[1] + 1e-12).all()
    np.testing.assert_allclose(
        carry_across(np.array([(0, 0, 1.0), (0, 0, -1)]), np.array([0, 1.0, 0])), [(1, 0, 0)] * 2
    )


def test_up_turns_a_panel_and_must_lie_across_it() -> None:
    keys = [RECT | {"frame": 0, "direction": [0, -1, 0], "power": 1, "up": [1, 5, 0]}]
    np.testing.assert_allclose(path(type="rect", keys=keys).panel.half_axes[1], [[0.25, 0, 0]], atol=1e-12)
    with pytest.raises(JobError, match=r"light.sources\[0\]: expected an `up` across .* frame 0"):
        path(type="rect", keys=[keys[0] | {"up": [0, 3, 0]}])


def test_positions_in_the_axes_of_the_first_picture() -> None:
    camera = {"keys": [{"frame": 0, "eye": [3, 1, 0.5], "target": [0, 1, 0.5]}]}
    keys = [{"frame": 0, "position": [1, 2, 3], "intensity": 1}]
    found = path(camera=camera, type="point", space="camera", scale=2, keys=keys)
    np.testing.assert_allclose(found.vector, [[6, 5, -1.5]], atol=1e-12)  # right is -z, up y, towards the camera x
    centred = path(camera=camera, type="point", space="camera", center=[1, 1, 1], keys=keys)
    np.testing.assert_allclose(centred.vector, [[4, 3, 0]], atol=1e-12)
    keys = [{"frame": 0, "direction": [0, 0, -1], "irradiance": 1}]
    turned = path(camera=camera, type="directional", space="camera", keys=keys)
    np.testing.assert_allclose(turned.vector, [[-1, 0, 0]], atol=1e-12)
    look = eyes(tiny.job(camera=camera)).world_from_camera[0, :3, 2]
    np.testing.assert_allclose(turned.vector[0], -look, atol=1e-12)


def test_center_and_scale_in_the_axes_of_the_scene() -> None:
    keys = [{"frame": 0, "position": [1, 2, 3], "intensity": 1}]
    np.testing.assert_allclose(path(type="point", scale=2, center=[1, 0, 0], keys=keys).vector, [[3, 4, 6]])
    np.testing.assert_allclose(path(type="point", keys=keys).vector, [[1, 2, 3]])
