"""Skies against their published formulas, restated, and against other programs where these are installed."""

import math
from datetime import UTC, datetime
from importlib.util import find_spec
from pathlib import Path

import numpy as np
import pytest
from support.weather import write_weather

from framearray_cli.base.units import LUMENS_PER_WATT
from framearray_cli.job.rowfile import RowFileError
from framearray_cli.scene.paths.placing import sky_patches
from framearray_cli.scene.paths.sky import SkyModel, clear_sun, orbit
from framearray_cli.scene.paths.weather import read_weather

HEIGHTS = [math.radians(h) for h in (1, 5, 12, 20, 30, 40, 50, 60, 75, 88)]
AZIMUTH, ELEVATION, _ = sky_patches(1)  # the 145 patches of Tregenza's sky, the sun in the north
# a to e of some standard skies, from the standard's table.
STANDARD = {
    1: (4, -0.7, 0, -1, 0), 3: (1.1, -0.8, 0, -1, 0), 5: (0, -1, 0, -1, 0), 8: (0, -1, 10, -3, 0.45),
    10: (-1, -0.55, 5, -2.5, 0.3), 12: (-1, -0.32, 10, -3, 0.45), 13: (-1, -0.32, 16, -3, 0.3),
    15: (-1, -0.15, 24, -2.8, 0.15),
}  # fmt: skip


def patches(model: SkyModel) -> np.ndarray:
    """Luminance of the middles of the patches, cd/m2."""
    return model.radiance(ELEVATION, np.radians(AZIMUTH)).mean(axis=-1) * LUMENS_PER_WATT


def chi(elevation: float, azimuth_deg: float, height: float) -> float:
    """Angle from the sun, by the law of cosines."""
    cosine = math.cos(math.radians(azimuth_deg)) * math.cos(elevation) * math.cos(height)
    return math.acos(max(-1.0, min(1.0, cosine + math.sin(elevation) * math.sin(height))))


@pytest.mark.parametrize("number", STANDARD)
@pytest.mark.parametrize("height", HEIGHTS)
def test_standard_skies(number: int, height: float) -> None:
    """Ratios to the zenith, by the formula of the standard."""
    a, b, c, d, e = STANDARD[number]

    def of(elevation: float, angle: float) -> float:
        gradation = 1 + a * math.exp(b / max(math.sin(elevation), 1e-4))
        return gradation * (1 + c * (math.exp(d * angle) - math.exp(d * math.pi / 2)) + e * math.cos(angle) ** 2)

    right = [
        of(el, chi(el, az, height)) / of(math.pi / 2, math.pi / 2 - height)
        for el, az in zip(ELEVATION, AZIMUTH, strict=True)
    ]
    found = patches(SkyModel(name=number, height=height))
    np.testing.assert_allclose(found / found[-1], right, rtol=1e-4)


@pytest.mark.parametrize("height", HEIGHTS)
def test_the_traditional_overcast_sky(height: float) -> None:
    found = patches(SkyModel(name=16, height=height))
    zenith = 8600 * math.sin(min(height, math.radians(87))) + 123
    np.testing.assert_allclose(found, zenith * (1 + 2 * np.sin(ELEVATION)) / 3, rtol=1e-4)
    _, level = SkyModel(name=16, height=height).map()
    np.testing.assert_allclose(level * LUMENS_PER_WATT, 7 / 9 * np.pi * zenith, rtol=1e-3)  # closed form


@pytest.mark.parametrize("height", HEIGHTS)
@pytest.mark.parametrize("turbidity", [2.0, 4.0])
def test_the_coloured_sky(height: float, turbidity: float) -> None:
    """Luminance over the zenith's, and the zenith's own, by the formulas of the paper."""
    t, sun = turbidity, math.pi / 2 - height
    a, b, c = 0.1787 * t - 1.4630, -0.3554 * t + 0.4275, -0.0227 * t + 5.3251
    d, e = 0.1206 * t - 2.5771, -0.0670 * t + 0.3703

    def f(zenith: float, angle: float) -> float:
        return (1 + a * math.exp(b / max(math.cos(zenith), 1e-4))) * (
            1 + c * math.exp(d * angle) + e * math.cos(angle) ** 2
        )

    chi0 = (4 / 9 - t / 120) * (math.pi - 2 * sun)
    bright = 1000 * ((4.0453 * t - 4.9710) * math.tan(chi0) - 0.2155 * t + 2.4192)
    right = [
        bright * f(math.pi / 2 - el, chi(el, az, height)) / f(0, sun) for el, az in zip(ELEVATION, AZIMUTH, strict=True)
    ]
    sky = SkyModel(name="preetham", height=height, turbidity=t)
    rgb = sky.radiance(ELEVATION, np.radians(AZIMUTH))
    inside = (rgb > 0).all(axis=-1)  # others were clipped to Rec. 709
    luminance = rgb @ [0.2126, 0.7152, 0.0722] * LUMENS_PER_WATT
    np.testing.assert_allclose(luminance[inside], np.array(right)[inside], rtol=1e-4)


@pytest.mark.parametrize(("direct", "diffuse"), [(0, 80), (60, 120), (250, 200), (500, 150), (800, 100), (900, 60)])
@pytest.mark.parametrize("height", [0.2, 0.6, 1.1])
def test_the_all_weather_sky(direct: float, diffuse: float, height: float) -> None:
    """A level surface receives the diffuse irradiance that was given, and brightness follows the sun."""
    sky = SkyModel(name="perez", height=height, diffuse=np.full(3, float(diffuse)), direct=direct, solar=1.0)
    texels, level = sky.map()
    np.testing.assert_allclose(level, diffuse, rtol=1e-9)
    edges = np.sin(np.linspace(np.pi / 2, 0, len(texels) // 2 + 1)) ** 2
    found = np.pi * ((edges[:-1] - edges[1:]) @ texels[: len(texels) // 2, :, 0].mean(axis=1))
    np.testing.assert_allclose(found, diffuse, rtol=1e-6)
    ground = 0.2 / np.pi * (diffuse + direct * math.sin(height))
    np.testing.assert_allclose(texels[len(texels) // 2 :], ground, rtol=1e-6)
    near = sky.radiance(np.array([height]), np.array([0.1]))[0, 0]
    away = sky.radiance(np.array([height]), np.array([np.pi]))[0, 0]
    assert (near > 2 * away) if direct > 200 else near > 0.9 * away


@pytest.mark.skipif(not find_spec("pyradiance"), reason="pyradiance is not installed")
@pytest.mark.parametrize(("direct", "diffuse"), [(60, 120), (250, 200), (500, 150), (800, 100)])
def test_the_all_weather_sky_against_radiance(direct: float, diffuse: float) -> None:
    """The five coefficients as gendaylit prints them, for the height of the sun that it has."""
    import pyradiance

    text = pyradiance.gendaylit(datetime(2026, 6, 21, 10), 48.1, -11.6, -15, dirnorm=direct, diffhor=diffuse)
    words = (text.decode() if isinstance(text, bytes) else text).split()
    values = [float(word) for word in words[words.index("perezlum.cal") + 3 :][:10]]
    height = math.asin(values[9])
    solar = 1 / orbit(172)
    sky = SkyModel(name="perez", height=height, diffuse=np.full(3, float(diffuse)), direct=direct, solar=solar)
    a, b, c, d, e = values[2:7]
    angles = np.array([chi(el, az, height) for el, az in zip(ELEVATION, AZIMUTH, strict=True)])
    right = (1 + a * np.exp(b / np.maximum(np.sin(ELEVATION), 1e-2))) * (
        1 + c * np.exp(d * angles) + e * np.cos(angles) ** 2
    )
    found = patches(sky)
    np.testing.assert_allclose(found / found[-1], right / right[-1], rtol=2e-3)


@pytest.mark.parametrize("diffuse", [1, 10, 49, 150, 400])
@pytest.mark.parametrize("direct", [0, 3, 24, 118, 300, 1000])
@pytest.mark.parametrize("height", HEIGHTS)
def test_the_all_weather_sky_has_light_in_any_weather(direct: float, diffuse: float, height: float) -> None:
    """Also where the published fit has none, or no bound: there gendaylit has negative radiances, or an error."""
    sky = SkyModel(name="perez", height=height, diffuse=np.full(3, float(diffuse)), direct=direct, solar=1.0)
    texels, level = sky.map()
    assert np.isfinite(texels).all()
    assert (texels >= 0).all()
    np.testing.assert_allclose(level, diffuse, rtol=1e-9)
    assert texels[0].min() > 1e-3 * diffuse / np.pi, "the zenith is not black"


def test_the_sun_in_clear_air() -> None:
    found = clear_sun(np.radians([-5.0, 5.0, 60.0])) * LUMENS_PER_WATT
    np.testing.assert_allclose(
        found, [0, 102e3 * (1.147 - 0.147 / 0.16), 102e3 * (1.147 - 0.147 / math.sin(math.pi / 3))]
    )


def test_weather_files(tmp_path: Path) -> None:
    weather = read_weather(write_weather(tmp_path / "w.epw"))
    assert (weather.latitude, weather.longitude, weather.zone) == (48.1, 11.6, 1.0)
    times = [datetime(2026, 6, 21, hour, minute, tzinfo=UTC) for hour, minute in ((2, 0), (5, 0), (11, 0))]
    np.testing.assert_allclose(weather.at(times), [[0, 25e3, 50e3], [0, 10e3, 20e3]])  # UTC + 1
    leap = [datetime(2028, 2, 29, 5, tzinfo=UTC), datetime(2028, 2, 29, 6, tzinfo=UTC)]
    np.testing.assert_allclose(weather.at(leap)[0], [0, 25e3])


@pytest.mark.parametrize("missing", ["999999,999999", "9999,9999", "-1,-1", "50000,999999", "0,0", "nan,nan"])
def test_weather_without_illuminance(missing: str, tmp_path: Path) -> None:
    weather = read_weather(write_weather(tmp_path / "w.epw", **{",50000,20000": f",{missing}"}))
    assert weather.light.max(axis=1).tolist() == [500 * 110.0, 180 * 110.0]


@pytest.mark.parametrize(
    ("changes", "words"),
    [
        ({"LOCATION": "PLACE"}, "expected a weather file"),
        ({",48.1,": ",north,"}, "expected a weather file"),
        ({",48.1,": ",nan,"}, "expected a weather file"),
        ({",1.0,": ",60,"}, "expected a weather file"),
        ({"LOCATION": "x" * 150_000}, "got another kind of text: field larger"),
        ({"1999,7,4,12": "1999,7,4,inf"}, "expected numbers"),
        ({"1999,6,": "x,6,"}, "expected 8760 hours, got 8040"),
        ({"1999,7,4,12": "1999,7,4,noon"}, "expected numbers"),
    ],
)
def test_broken_weather_files(changes: dict[str, str], words: str, tmp_path: Path) -> None:
    with pytest.raises(RowFileError, match=words):
        read_weather(write_weather(tmp_path / "w.epw", **changes))
