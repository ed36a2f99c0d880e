"""The curve rho(d) of obscurances [FA eq. 1]: how open a surface at distance d leaves a point."""

import math

import numpy as np

from framearray_cli.base.arrays import Float32, Real

from ..kernels.kernel import inlined
from ..kernels.simd import LANES, load, sqrt, store

SQRT, LINEAR, CBRT, EXPONENTIAL, CONSTANT = range(5)
FALLOFFS = {"sqrt": SQRT, "linear": LINEAR, "cbrt": CBRT, "exponential": EXPONENTIAL, "constant": CONSTANT}


@inlined
def rho(falloff: int, tau: Real, x: Real) -> Real:
    """The falloff curve at x = d / d_max, rising from 0 (0 for `constant`) at 0 to 1 at 1."""
    if falloff == SQRT:
        return np.float32(np.sqrt(x))
    if falloff == LINEAR:
        return x
    if falloff == CBRT:
        return np.float32(x ** np.float32(1.0 / 3.0))
    if falloff == EXPONENTIAL:
        return np.float32(math.expm1(-tau * x) / math.expm1(-tau))
    return np.float32(0.0)


@inlined
def rho_of_lanes(falloff: int, tau: Real, x: Real, room: Float32, at: int) -> Real:
    """`rho` of sixteen numbers; curves without a lane version go one by one through `room`, at flat offset `at`."""
    curve: Real = x
    if falloff == SQRT:
        curve = sqrt(x)
    elif falloff != LINEAR:
        store(room, at, x)
        flat = room.reshape(room.size)
        for i in range(at, at + LANES):
            flat[i] = rho(falloff, tau, flat[i])
        curve = load(room, at)
    return curve
