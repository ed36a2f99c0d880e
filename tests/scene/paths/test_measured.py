"""Lamps with a file: their intensity by the rules of LM-63, their turns along a path, and units."""

from pathlib import Path
from typing import Any

import numpy as np
import pytest
from pydantic import ValidationError
from support import tiny
from support.iesfiles import DOWN, TILT, VARIANTS, ies
from support.lightjobs import read_lit

from framearray_cli.base.errors import JobError
from framearray_cli.job.ies import Photometry, read_photometry
from framearray_cli.scene.paths.lightpath import LightPath
from framearray_cli.scene.paths.paths import lights
from framearray_cli.scene.paths.profiles import read_web

RNG = np.random.default_rng(9)


def placed(folder: Path, text: str, *keys: dict[str, Any], **source: Any) -> LightPath:
    (folder / "lamp.ies").write_bytes(text.encode())
    kind = "spot" if "target" in keys[0] or "direction" in keys[0] else "point"
    frames = [{"frame": k, "position": [0.0, 2.0, 0.0]} | key for k, key in enumerate(keys)]
    lamp = {"type": kind, "ies": str(folder / "lamp.ies"), "keys": frames}
    return lights(tiny.job(light={"sources": [lamp | source]})).sources[0]


def candela(found: Photometry, down: float, ahead: float, left: float) -> float:
    """Into a direction, by the file's angles: those that it leaves out are mirror images of others."""
    if found.kind == "B":
        vertical, horizontal = np.degrees(np.arctan2(ahead, down)), np.degrees(np.arcsin(-left))
        vertical = abs(vertical) if found.vertical_deg[0] == 0 else vertical
        horizontal = abs(horizontal) if found.horizontal_deg[0] == 0 else horizontal
    else:
        vertical, horizontal = np.degrees(np.arccos(down)), np.degrees(np.arctan2(left, ahead)) % 360
        first, last = found.horizontal_deg[0], found.horizontal_deg[-1]
        if first == 90:
            horizontal = horizontal if 90 <= horizontal <= 270 else (180 - horizontal) % 360
        elif last == 90:
            horizontal = min(horizontal % 180, 180 - horizontal % 180)
        elif last == 180:
            horizontal = min(horizontal, 360 - horizontal)
        elif last == 0:
            horizontal = 0.0
    v, h = np.array(found.vertical_deg), np.array(found.horizontal_deg)
    if not (v[0] <= vertical <= v[-1] and h[0] <= horizontal <= h[-1]):
        return 0.0
    rows = [np.interp(vertical, v, row) for row in found.candela]
    return float(np.interp(horizontal, h, rows)) * found.factor


@pytest.mark.parametrize("name", VARIANTS)
def test_a_hanging_lamp_of_any_file_shines_as_the_file_says(name: str, tmp_path: Path) -> None:
    """By its table with `up`, which is the direction of horizontal angle 0; against the clock from above is type C."""
    path = placed(tmp_path, VARIANTS[name], {"up": [0.0, 0.0, 1.0]})
    assert path.profile is not None
    web, found = path.profile.web, read_photometry(tmp_path / "lamp.ies")
    np.testing.assert_allclose(path.profile.axis[0], [0, -1, 0])
    np.testing.assert_allclose(path.profile.zero[0], [0, 0, 1], atol=1e-12)
    ways = RNG.normal(size=(300, 3))
    ways /= np.linalg.norm(ways, axis=1, keepdims=True)
    pole, zero, side = path.profile.frames[0]
    polar, around = np.degrees(np.arccos(ways @ pole)), np.degrees(np.arctan2(ways @ side, ways @ zero))
    for k, (x, y, z) in enumerate(ways):
        rows = [np.interp(polar[k], web.polar_deg, row, 0, 0) for row in web.share]
        share = rows[0] if len(rows) == 1 else np.interp(around[k], web.around_deg, rows, 0, 0)
        wanted = candela(found, -y, z, x)  # from above z goes to x against the clock
        assert share * web.candela == pytest.approx(wanted, rel=1e-9, abs=1e-9 * web.candela)
    assert path.intensity[0] == pytest.approx([web.candela / 683] * 3)
    mean = np.mean([candela(found, *way) for way in sphere()])
    assert web.flux * web.candela == pytest.approx(4 * np.pi * mean, rel=5e-3)


def sphere() -> Any:
    """Many directions, each for the same solid angle."""
    z, turn = np.meshgrid((np.arange(160) + 0.5) / 80 - 1, (np.arange(100) + 0.5) / 50 * np.pi)
    r = np.sqrt(1 - z * z)
    return np.stack([z, r * np.cos(turn), r * np.sin(turn)], axis=-1).reshape(-1, 3)


def test_a_lamp_that_turns_carries_its_profile_along(tmp_path: Path) -> None:
    """Without `up` it does not turn about its own axis: from one position to the next by the shortest way."""
    keys = [{"frame": 0, "direction": [0.0, -1.0, 0.0]}, {"frame": 2, "direction": [1.0, 0.0, 0.0]}]
    path = placed(tmp_path, ies(), *keys)
    assert path.profile is not None
    axis, zero = path.profile.axis, path.profile.zero
    np.testing.assert_allclose(zero[0], [1, 0, 0], atol=1e-9)
    np.testing.assert_allclose(zero[2], [0, 1, 0], atol=1e-9)
    assert np.abs((axis * zero).sum(axis=1)).max() < 1e-9
    np.testing.assert_allclose(zero[1], [2**-0.5, 2**-0.5, 0], atol=1e-9)
    with pytest.raises(
        JobError, match="expected an `up` across the direction of the lamp, got one along it at frame 0"
    ):
        placed(tmp_path, ies(), {"direction": [0.0, -1.0, 0.0], "up": [0.0, 2.0, 0.0]})


def test_factors_of_tilted_lamps_are_left_out_with_a_note(tmp_path: Path) -> None:
    path = placed(tmp_path, ies(tilt=TILT), {"direction": [0.0, -1.0, 0.0]})
    assert path.intensity[0, 0] == pytest.approx(1500 / 683)
    assert path.profile is not None and path.profile.web.note.endswith(".ies: factors of tilted lamps are left out")


def test_intensity_is_the_largest_of_a_file_and_lumens_are_all_of_its_light(tmp_path: Path) -> None:
    for units, wanted in ((None, 5.0), ("W/sr", 5.0), ("cd", 5 / 683)):
        more = {} if units is None else {"units": units}
        assert placed(tmp_path, ies(), {"intensity": 5.0}, **more).intensity[0] == pytest.approx([wanted] * 3)
    path = placed(tmp_path, ies(), {"intensity": 800.0, "color": [1.0, 0.5, 0.25]}, units="lm")
    assert path.profile is not None
    assert path.profile.web.flux * path.intensity[0] * 683 == pytest.approx([800, 400, 200])
    own = [placed(tmp_path, ies(), {}, **more).intensity[0, 0] for more in ({}, {"units": "cd"}, {"units": "lm"})]
    assert own == pytest.approx([1500 / 683] * 3)


KEY = {"frame": 0, "position": [0.0, 2.0, 0.0], "intensity": 3.0}
AIM = {"direction": [0.0, -1.0, 0.3]}
LAMP, SPOT = {"type": "point", "keys": [KEY]}, {"type": "spot", "keys": [KEY | AIM]}
BEAM = {"type": "spot", "keys": [KEY | AIM | {"inner": float(np.degrees(0.5)), "outer": float(np.degrees(0.9))}]}
CONE = 2 * np.pi * (1 - np.cos(0.5) + (np.cos(0.5) - np.cos(0.9)) / 3)
SKY = {"type": "directional", "keys": [AIM | {"frame": 0, "irradiance": 3.0}]}
DOME = {"type": "dome", "positions": 4}
LAMPS, FAR = DOME | {"radius": 2.0, "intensity": 3.0}, DOME | {"irradiance": 3.0}


@pytest.mark.parametrize(
    ("source", "units", "per_unit"),
    [
        (LAMP, "W/sr", 1),
        (LAMP, "cd", 1 / 683),
        (LAMP, "lm", 1 / (683 * 4 * np.pi)),
        (SPOT, "cd", 1 / 683),
        (BEAM, "lm", 1 / 683 / CONE),
        (SKY, "lux", 1 / 683),
        (SKY, "W/m2", 1),
        (LAMPS, "lm", 1 / (683 * 4 * np.pi)),
        (LAMPS, "cd", 1 / 683),
        (FAR, "lux", 1 / 683),
        (FAR, "W/m2", 1),
    ],
)
def test_units_are_those_of_photometry(source: dict[str, Any], units: str, per_unit: float) -> None:
    (path,) = lights(tiny.job(light={"frames": 4, "sources": [source | {"units": units}]})).sources
    np.testing.assert_allclose(path.intensity, 3 * per_unit)


def test_units_of_a_dome_that_are_of_other_light() -> None:
    for more, wanted in (
        ({"irradiance": 3.0, "units": "lm"}, '"W/m2" or "lux" with `irradiance`, got "lm"'),
        ({"radius": 2.0, "intensity": 3.0, "units": "lux"}, '"W/sr" or "cd" or "lm" with `intensity`, got "lux"'),
    ):
        with pytest.raises(ValidationError, match=f"expected {wanted}"):
            tiny.job(light={"sources": [DOME | more]})


def test_a_measured_lamp_at_the_positions_of_a_file(tmp_path: Path) -> None:
    """The photometry of one file from the places, targets and strengths of another, as from the same keys."""
    (tmp_path / "lamp.ies").write_text(ies(DOWN, [0, 60, 120, 180]))
    spots = "x,y,z,target_x,target_y,target_z,intensity\n0,2,0,0,0,2,5\n1,2,0,0,0,0,6\n"
    (tmp_path / "spots.csv").write_text(spots)
    (tmp_path / "lamps.csv").write_text("x,y,z\n0,2,0\n1,2,0\n")
    up = [0.0, 0.0, 1.0]
    sources: list[dict[str, Any]] = [
        {"type": "spot", "ies": "lamp.ies", "file": "spots.csv"},
        {"type": "point", "ies": "lamp.ies", "file": "lamps.csv", "up": up},
    ]
    spot, lamp = lights(read_lit(tmp_path, *sources)).sources
    at = [{"position": [0.0, 2.0, 0.0]}, {"position": [1.0, 2.0, 0.0]}]
    aims = [{"target": [0.0, 0.0, 2.0], "intensity": 5.0}, {"target": [0.0, 0.0, 0.0], "intensity": 6.0}]
    text = (tmp_path / "lamp.ies").read_text()
    by_keys = placed(tmp_path, text, *(place | aim for place, aim in zip(at, aims, strict=True)))
    hanging = placed(tmp_path, text, *(place | {"up": up} for place in at))
    for found, wanted in ((spot, by_keys), (lamp, hanging)):
        assert found.profile is not None and wanted.profile is not None
        assert found.profile.web.digest == wanted.profile.web.digest
        np.testing.assert_array_equal(found.vector, [place["position"] for place in at])
        np.testing.assert_allclose(found.intensity, wanted.intensity[:2])
        np.testing.assert_allclose(found.profile.axis, wanted.profile.axis[:2], atol=1e-12)
        np.testing.assert_allclose(found.profile.zero, wanted.profile.zero[:2], atol=1e-12)
    assert spot.intensity[:, 0] == pytest.approx([5, 6])
    brightest = max(map(max, read_photometry(tmp_path / "lamp.ies").candela))
    assert lamp.intensity[:, 0] == pytest.approx([brightest / 683] * 2)


def test_positions_say_the_file_and_how_the_lamp_is_turned(tmp_path: Path) -> None:
    table = placed(tmp_path, ies(), {"target": [0.0, 0.0, 2.0]}).table(0)
    assert table["ies"] == "lamp.ies" and table["type"] == "spot"
    np.testing.assert_allclose(table["direction"], [0, -(2**-0.5), 2**-0.5])
    assert table["intensity"] == pytest.approx([1500 / 683] * 3)
    hanging = placed(tmp_path, ies(), {}).table(0)
    assert hanging["type"] == "spot" and hanging["direction"] == [0, -1, 0]
    digests = {read_web(tmp_path / "lamp.ies").digest}
    (tmp_path / "lamp.ies").write_text(ies(multiplier=2))
    assert len(digests | {read_web(tmp_path / "lamp.ies").digest}) == 2
