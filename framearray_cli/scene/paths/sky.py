"""Skies: radiance of the sky and of the ground around a scene, by the height of the sun.

A map has the azimuth of the sun in its middle column. Its upper half is the sky without the sun, its lower half the
ground. The sky is one of the 15 types of [CIE03] or its traditional overcast sky, the all-weather sky of [Perez93], or
the coloured clear sky of [Preetham99].
"""

from dataclasses import dataclass
from typing import TypeAlias

import numpy as np

from framearray_cli.base.arrays import Float64
from framearray_cli.base.colour import LUMINANCE, RGB_FROM_XYZ
from framearray_cli.base.units import LUMENS_PER_WATT

ROWS = 90  # of a map: texels of 2 degrees
FINER = 3  # points per side of a texel, whose mean it holds
EFFICACY = 110.0  # lumens per watt of daylight: the sun has less, the sky more [Perez90]
HIGHEST = np.radians(87)  # of the sun in the brightness of zeniths, which has no bound
TURBIDITY = 2.45  # of clear air
Types: TypeAlias = tuple[float, float, float, float, float]

# Gradation a, b and indicatrix c, d, e of the standard skies, by their numbers [CIE03].
_CIE: dict[int, Types] = {
    1: (4.0, -0.70, 0, -1.0, 0), 2: (4.0, -0.70, 2, -1.5, 0.15), 3: (1.1, -0.8, 0, -1.0, 0),
    4: (1.1, -0.8, 2, -1.5, 0.15), 5: (0, -1.0, 0, -1.0, 0), 6: (0, -1.0, 2, -1.5, 0.15),
    7: (0, -1.0, 5, -2.5, 0.30), 8: (0, -1.0, 10, -3.0, 0.45), 9: (-1.0, -0.55, 2, -1.5, 0.15),
    10: (-1.0, -0.55, 5, -2.5, 0.30), 11: (-1.0, -0.55, 10, -3.0, 0.45), 12: (-1.0, -0.32, 10, -3.0, 0.45),
    13: (-1.0, -0.32, 16, -3.0, 0.30), 14: (-1.0, -0.15, 16, -3.0, 0.30), 15: (-1.0, -0.15, 24, -2.8, 0.15),
}  # fmt: skip
NUMBERS = {"clear": 12, "intermediate": 7, "overcast": 16}
# Bounds of clearness, and a row of a, b, c, d, e for each range: four numbers each, of 1, Z, brightness and both.
_CLEARNESS = (1.065, 1.23, 1.5, 1.95, 2.8, 4.5, 6.2)
_PEREZ = np.array([
    [1.3525, -0.2576, -0.2690, -1.4366, -0.7670, 0.0007, 1.2734, -0.1233, 2.8, 0.6004, 1.2375, 1.0,
     1.8734, 0.6297, 0.9738, 0.2809, 0.0356, -0.1246, -0.5718, 0.9938],
    [-1.2219, -0.7730, 1.4148, 1.1016, -0.2054, 0.0367, -3.9128, 0.9156, 6.975, 0.1774, 6.4477, -0.1239,
     -1.5798, -0.5081, -1.7812, 0.1080, 0.2624, 0.0672, -0.2190, -0.4285],
    [-1.1, -0.2515, 0.8952, 0.0156, 0.2782, -0.1812, -4.5, 1.1766, 24.7219, -13.0812, -37.7, 34.8438,
     -5.0, 1.5218, 3.9229, -2.6204, -0.0156, 0.1597, 0.4199, -0.5562],
    [-0.5484, -0.6654, -0.2672, 0.7117, 0.7234, -0.6219, -5.6812, 2.6297, 33.3389, -18.3, -62.25, 52.0781,
     -3.5, 0.0016, 1.1477, 0.1062, 0.4659, -0.3296, -0.0876, -0.0329],
    [-0.6, -0.3566, -2.5, 2.325, 0.2937, 0.0496, -5.6812, 1.8415, 21.0, -4.7656, -21.5906, 7.2492,
     -3.5, -0.1554, 1.4062, 0.3988, 0.0032, 0.0766, -0.0656, -0.1294],
    [-1.0156, -0.3670, 1.0078, 1.4051, 0.2875, -0.5328, -3.85, 3.375, 14.0, -0.9999, -7.1406, 7.5469,
     -3.4, -0.1078, -1.0750, 1.5702, -0.0672, 0.4016, 0.3017, -0.4844],
    [-1.0, 0.0211, 0.5025, -0.5119, -0.3, 0.1922, 0.7023, -1.6317, 19.0, -5.0, 1.2438, -1.9094,
     -4.0, 0.0250, 0.3844, 0.2656, 1.0468, -0.3788, -2.4517, 1.4656],
    [-1.05, 0.0289, 0.4260, 0.3590, -0.3250, 0.1156, 0.7781, 0.0025, 31.0625, -14.5, -46.1148, 55.375,
     -7.2312, 0.4050, 13.35, 0.6234, 1.5, -0.6426, 1.8564, 0.5636],
]).reshape(-1, 5, 4)  # fmt: skip
# Rows a to e of Y, x and y by turbidity, and of the zenith's x and y by turbidity and Z [Preetham99].
_COLOURED = np.array([
    [[0.1787, -1.4630], [-0.3554, 0.4275], [-0.0227, 5.3251], [0.1206, -2.5771], [-0.0670, 0.3703]],
    [[-0.0193, -0.2592], [-0.0665, 0.0008], [-0.0004, 0.2125], [-0.0641, -0.8989], [-0.0033, 0.0452]],
    [[-0.0167, -0.2608], [-0.0950, 0.0092], [-0.0079, 0.2102], [-0.0441, -1.6537], [-0.0109, 0.0529]],
])  # fmt: skip
_ZENITH = np.array([
    [[0.00166, -0.00375, 0.00209, 0], [-0.02903, 0.06377, -0.03202, 0.00394], [0.11693, -0.21196, 0.06052, 0.25886]],
    [[0.00275, -0.00610, 0.00317, 0], [-0.04214, 0.08970, -0.04153, 0.00516], [0.15346, -0.26756, 0.06670, 0.26688]],
])  # fmt: skip


@dataclass(frozen=True, slots=True, kw_only=True)
class SkyModel:
    """The sky at one light position; strengths are of light, see `LUMENS_PER_WATT`.

    Attributes:
        name: a number of `_CIE`, 16, "perez" or "preetham".
        height: of the sun, radians, above 0.
        diffuse: (3,) irradiance of a level surface by the sky, W/m2; None: by the model.
        direct: irradiance of a surface that faces the sun, W/m2; with "perez", and for the ground.
        scaled: True if `direct` goes with the model's own diffuse light, and changes with `diffuse`.
        solar: watts of sunlight per watt of light, over the day's `orbit`, for "perez".
        turbidity: of the air; `albedo`: reflectivity of the ground.
    """

    name: int | str
    height: float
    diffuse: Float64 | None = None
    direct: float = 0.0
    scaled: bool = False
    solar: float = LUMENS_PER_WATT / EFFICACY
    turbidity: float = TURBIDITY
    albedo: float = 0.2

    def radiance(self, elevation: Float64, azimuth: Float64) -> Float64:
        """Radiance of the sky in some directions, (..., 3).

        Args:
            elevation: above the horizon, radians; `azimuth`: from the sun, radians; of one shape.
        """
        cosine = np.sin(elevation) * np.sin(self.height)
        cosine = cosine + np.cos(elevation) * np.cos(self.height) * np.cos(azimuth)
        up, angle = np.maximum(np.sin(elevation), 1e-4), np.arccos(np.clip(cosine, -1, 1))
        if self.name == "preetham":
            return self._coloured(up, angle)
        grey = self._perez(up, angle) if self.name == "perez" else self._standard(up, angle)
        return np.asarray(grey[..., None] * np.ones(3))

    def _standard(self, up: Float64, angle: Float64) -> Float64:
        """Radiance of a standard sky, by the brightness of its zenith [Karayel84]."""
        number = int(self.name)
        height, clear = min(self.height, HIGHEST), number > 10 and number < 16
        dull = 8.6 * np.sin(height) + 0.123  # kcd/m2
        bright = (1.376 * self.turbidity - 1.81) * np.tan(height) + 0.38
        zenith = bright if clear else dull if number < 7 or number == 16 else (bright + dull) / 2
        if number == 16:
            return np.asarray(zenith * 1000 / LUMENS_PER_WATT * (1 + 2 * up) / 3)
        form, far = _CIE[number], np.pi / 2 - self.height
        level = _scatter(form, np.ones(1), np.full(1, far), np.exp(form[3] * np.pi / 2))[0]
        values = _scatter(form, up, angle, np.exp(form[3] * np.pi / 2))
        return np.asarray(zenith * 1000 / LUMENS_PER_WATT / level * values)

    def _perez(self, up: Float64, angle: Float64) -> Float64:
        """Relative radiance of the all-weather sky."""
        far = np.pi / 2 - self.height
        assert self.diffuse is not None
        diffuse = max(float(self.diffuse @ LUMINANCE), 1e-9)
        bent = 1.041 * far**3
        clearness = ((diffuse + self.direct) / diffuse + bent) / (1 + bent)
        mass = 1 / (np.sin(self.height) + 0.15 * (93.885 - np.degrees(far)) ** -1.253)
        dim = float(np.clip(diffuse * self.solar * mass / 1367, 0.2 if 1.065 < clearness < 2.8 else 0.01, 0.6))
        row = int(np.searchsorted(_CLEARNESS, clearness, side="right"))
        a, b, c, d, e = _PEREZ[row] @ [1, far, dim, dim * far]
        if row == 0:
            (c1, c2, c3, c4), (d1, d2, d3, d4) = _PEREZ[0, 2:4]
            c = np.exp((dim * (c1 + c2 * far)) ** c3) - c4
            d = -np.exp(dim * (d1 + d2 * far)) + d3 + dim * d4
        b = min(b, -0.02)  # beyond measured skies the fit has no bound at the horizon, or a black zenith
        a = max(a, -0.95 * np.exp(-b))
        return np.maximum(_scatter((a, b, c, d, e), up, angle), 0)

    def _coloured(self, up: Float64, angle: Float64) -> Float64:
        """Radiance of the clear sky in colour."""
        t, far = self.turbidity, np.pi / 2 - self.height
        bright = (4.0453 * t - 4.9710) * np.tan((4 / 9 - t / 120) * (np.pi - 2 * far)) - 0.2155 * t + 2.4192
        zenith = [bright * 1000 / LUMENS_PER_WATT, *([t * t, t, 1] @ _ZENITH @ [far**3, far**2, far, 1])]
        forms = [tuple(rows @ [t, 1]) for rows in _COLOURED]
        one, sun = np.ones(1), np.full(1, far)
        lum, x, y = (k * _scatter(f, up, angle) / _scatter(f, one, sun)[0] for k, f in zip(zenith, forms, strict=True))
        lum = np.maximum(lum, 0)
        xyz = np.stack([x / y * lum, lum, (1 - x - y) / y * lum], axis=-1)
        return np.asarray(np.maximum(xyz @ np.array(RGB_FROM_XYZ).T, 0))

    def map(self) -> tuple[Float64, Float64]:
        """Return the map, (ROWS, 2 ROWS, 3) radiance, and (3,) the irradiance of a level surface by the sky."""
        n = ROWS // 2
        elevation = (np.arange(n * FINER)[::-1] + 0.5) * (np.pi / 2 / (n * FINER))
        azimuth = ((np.arange(2 * ROWS * FINER) + 0.5) / (ROWS * FINER) - 1) * np.pi
        fine = self.radiance(*np.meshgrid(elevation, azimuth, indexing="ij")) * np.cos(elevation)[:, None, None]
        sums = fine.reshape(n, FINER, 2 * ROWS, FINER, 3).sum(axis=(1, 3))
        sky = sums / (np.cos(elevation).reshape(n, FINER).sum(axis=1) * FINER)[:, None, None]
        edges = np.sin(np.linspace(np.pi / 2, 0, n + 1)) ** 2
        level = ((edges[:-1] - edges[1:])[:, None] * sky.mean(axis=1)).sum(axis=0) * np.pi
        direct = self.direct * np.ones(3)
        if self.diffuse is not None:  # by channel where the sky has all of them, else by luminance
            share = self.diffuse / level if self.name != "preetham" else self.diffuse / (level @ LUMINANCE)
            sky, level, direct = sky * share, level * share, direct * share if self.scaled else direct
        ground = self.albedo / np.pi * (level + direct * np.sin(self.height))
        return np.concatenate([sky, np.broadcast_to(ground, sky.shape)]), level


def _scatter(form: Types, up: Float64, angle: Float64, less: float = 0.0) -> Float64:
    """Gradation by the cosine `up` from the zenith times indicatrix by the angle from the sun."""
    a, b, c, d, e = form
    return np.asarray((1 + a * np.exp(b / up)) * (1 + c * (np.exp(d * angle) - less) + e * np.cos(angle) ** 2))


def orbit(day: int) -> float:
    """Irradiance by the sun above the air on a day of the year, over its mean [Spencer71, shortened]."""
    return float(1 + 0.0334 * np.cos(2 * np.pi * (day - 3) / 365.25))


def clear_sun(height: Float64) -> Float64:
    """Irradiance by a sun in clear air, W/m2 of light, by its height, radians; 102,000 lux high up [Karayel84]."""
    strength = 102e3 / LUMENS_PER_WATT * (1.147 - 0.147 / np.maximum(np.sin(height), 0.16))
    return np.asarray(np.where(height > 0, strength, 0.0))
