"""Right answers in closed form, each with its derivation.

Notation: P is the shaded point, Q the hit of a ray from it, d their distance, mu the cosine between ray and
normal. Cosine-distributed directions have the density 2 mu in mu; seen from above they are spread evenly over the unit
disc. x = d / d_max is the argument of a falloff rho; R is the reflectivity at Q, R_avg the average one of the job.
"""

import math
from collections.abc import Callable

import numpy as np
from numpy.typing import NDArray
from scipy.integrate import quad

Array = NDArray[np.float64]

TAU = 3.0  # the default steepness of "exponential"


def rho(falloff: str, x: float, tau: float = TAU) -> float:
    """The falloff curve at x = d / d_max, as documented for [obscurance] of a job file; 1 from x = 1 on."""
    if x >= 1:
        return 1.0
    curves: dict[str, Callable[[], float]] = {
        "sqrt": lambda: math.sqrt(x),
        "linear": lambda: x,
        "cbrt": lambda: x ** (1 / 3),
        "exponential": lambda: (1 - math.exp(-tau * x)) / (1 - math.exp(-tau)),
        "constant": lambda: 0.0,
    }
    return curves[falloff]()


def sphere_obscurance(falloff: str, reflectivity: float, k: float, tau: float = TAU) -> float:
    """W inside a sphere of one reflectivity, k = 2 r / d_max.

    From a point of the sphere the chord in a direction of cosine mu is d = 2 r mu, so x = k mu and

        W / R = integral over mu from 0 to 1 of 2 mu rho(k mu).

    With m = min(1, 1/k), the cosine up to which the wall is within range, and rho = 1 beyond:

        power rho = x^p:   2 k^p m^(2 + p) / (2 + p) + 1 - m^2      (sqrt: 0.8 sqrt(k) for k <= 1)
        exponential:       (m^2 - 2 (1 - e^-a (1 + a)) / (tau k)^2) / (1 - e^-tau) + 1 - m^2,  a = tau k m
        constant:          1 - m^2
    """
    m = min(1.0, 1 / k)
    powers = {"sqrt": 1 / 2, "linear": 1.0, "cbrt": 1 / 3}
    if falloff in powers:
        p = powers[falloff]
        near = 2 * k**p * m ** (2 + p) / (2 + p)
    elif falloff == "exponential":
        a = tau * k * m
        near = (m**2 - 2 * (1 - math.exp(-a) * (1 + a)) / (tau * k) ** 2) / (1 - math.exp(-tau))
    else:
        near = 0.0
    return reflectivity * (near + 1 - m**2)


def sphere_obscurance_numerically(falloff: str, reflectivity: float, k: float, tau: float = TAU) -> float:
    """The integral of `sphere_obscurance`, by quadrature."""
    breaks = [1 / k] if k > 1 else None
    return reflectivity * float(quad(lambda mu: 2 * mu * rho(falloff, k * mu, tau), 0, 1, points=breaks)[0])


def wall_share(s: float) -> float:
    """Share of the rays from a point beside a high wall at distance h that hit it within d_max, s = h / d_max.

    Seen from above the directions fill the unit disc evenly; the wall x = h is met at d = h / x for x > 0, so within
    d_max for x > s: a segment of the disc, of area acos(s) - s sqrt(1 - s^2).
    """
    return (math.acos(s) - s * math.sqrt(1 - s * s)) / math.pi


def wall_obscurance(falloff: str, wall: float, average: float, s: float, tau: float = TAU) -> float:
    """W on the floor beside a high wall; see `wall_share`. x has the density (2 / pi) sqrt(1 - x^2) on the disc.

        W = R_wall * integral over x from s to 1 of (2 / pi) sqrt(1 - x^2) rho(s / x) + R_avg (1 - share)

    For `linear` the integral is (2 s / pi) (ln((1 + q) / s) - q) with q = sqrt(1 - s^2).
    """
    near = quad(lambda x: 2 / math.pi * math.sqrt(1 - x * x) * rho(falloff, s / x, tau), s, 1)[0]
    return wall * float(near) + average * (1 - wall_share(s))


def wall_obscurance_linear(wall: float, average: float, s: float) -> float:
    """`wall_obscurance` of the falloff `linear`, in closed form."""
    q = math.sqrt(1 - s * s)
    return wall * 2 * s / math.pi * (math.log((1 + q) / s) - q) + average * (1 - wall_share(s))


def disc_share(radius: float, height: float) -> float:
    """Share of the rays from below the middle of a disc that meet it: the rays with mu above h / sqrt(h^2 + a^2)."""
    return radius**2 / (radius**2 + height**2)


def disc_obscurance(
    falloff: str, disc: float, average: float, radius: float, height: float, d_max: float, tau: float = TAU
) -> float:
    """W below the middle of a disc whose rim is within d_max: d = h / mu, and mu has the density 2 mu.

        W = R_disc * integral over mu from mu_0 to 1 of 2 mu rho(h / (mu d_max)) + R_avg mu_0^2

    with mu_0 = h / sqrt(h^2 + a^2). For `linear` the integral is 2 (h / d_max) (1 - mu_0).
    """
    edge = height / math.hypot(height, radius)
    assert math.hypot(height, radius) <= d_max
    near = quad(lambda mu: 2 * mu * rho(falloff, height / (mu * d_max), tau), edge, 1)[0]
    return disc * float(near) + average * edge**2


def disc_obscurance_linear(disc: float, average: float, radius: float, height: float, d_max: float) -> float:
    """`disc_obscurance` of the falloff `linear`, in closed form."""
    edge = height / math.hypot(height, radius)
    return disc * 2 * height / d_max * (1 - edge) + average * edge**2


def furnace_irradiance(reflectivity: float, power: float = 4 * math.pi, area: float = 4 * math.pi) -> float:
    """Mean irradiance, all bounces, inside a closed body of one reflectivity: power / (area (1 - R)).

    The share R of arriving power is reflected and arrives again: E = power / area * (1 + R + R^2 + ...). In a
    sphere all bounces but the first spread evenly, because each point gives every other point the same irradiance.
    """
    return power / (area * (1 - reflectivity))


def furnace_indirect(reflectivity: float) -> float:
    """Radiance that leaves a point of the furnace, without that of direct light: R / pi * R E (see above)."""
    return reflectivity / math.pi * reflectivity * furnace_irradiance(reflectivity)


def point_irradiance(points: Array, normals: Array, position: Array, intensity: float) -> Array:
    """Irradiance of a point source at (n, 3) points: I cos(theta) / d^2, 0 from behind."""
    to_light = position - points
    square = (to_light**2).sum(axis=1)
    return intensity * np.maximum((normals * to_light).sum(axis=1), 0.0) / square**1.5


def directional_irradiance(normals: Array, direction: Array, irradiance: float) -> Array:
    """Irradiance of a directional source that travels along `direction`: E cos(theta), 0 from behind."""
    towards = -direction / np.linalg.norm(direction)
    return irradiance * np.maximum(normals @ towards, 0.0)


def segment_meets_rectangle(start: Array, way: Array, low: Array, high: Array, height: float, length: Array) -> Array:
    """Whether rays (n, 3) cross the horizontal rectangle low .. high (x, z) at y = height before `length` of `way`."""
    with np.errstate(divide="ignore", invalid="ignore"):
        t = (height - start[:, 1]) / way[:, 1]
        x, z = start[:, 0] + t * way[:, 0], start[:, 2] + t * way[:, 2]
    inside = (low[0] < x) & (x < high[0]) & (low[1] < z) & (z < high[1])
    return inside & (t > 0) & (t < length)
