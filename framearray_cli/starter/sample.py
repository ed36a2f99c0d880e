"""Points in a box and directions on a sphere, evenly spread and deterministic."""

import numpy as np

from framearray_cli.base.arrays import Float64

GOLDEN_TURN = np.pi * (3 - np.sqrt(5))  # radians; the turn that fills a circle most evenly
# 1 / g^k of the root g of x^4 = x + 1: the sequence R3 of [Roberts18].
R3 = 1.2207440846057596 ** -np.arange(1.0, 4.0)


def points_in(low: Float64, high: Float64, n: int) -> Float64:
    """(n, 3) points in a box."""
    return np.asarray(low + (high - low) * ((0.5 + np.arange(1, n + 1)[:, None] * R3) % 1.0))


def directions_around(n: int) -> Float64:
    """(n, 3) unit directions."""
    k = np.arange(n) + 0.5
    height = 1 - 2 * k / n
    level = np.sqrt(1 - height**2)
    turn = k * GOLDEN_TURN
    return np.stack([level * np.cos(turn), height, level * np.sin(turn)], axis=1)


def level_directions(n: int, up: int) -> Float64:
    """(n, 3) unit directions around the up axis, evenly spread; the first points to the front of a model.

    The front is +z in a scene with y up, as in glTF, and -y in one with z up.
    """
    turn = 2 * np.pi * np.arange(n) / n
    found = np.zeros((n, 3))
    found[:, 0] = np.sin(turn)
    found[:, 2 if up == 1 else 1] = np.cos(turn) * (1 if up == 1 else -1)
    return found
