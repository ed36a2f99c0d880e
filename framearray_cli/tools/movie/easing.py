"""Easing: the share of a movement's way after a share t of its time."""

from typing import Literal, TypeAlias

Ease: TypeAlias = Literal["linear", "in", "out", "in-out"]


def eased_share(t: float, ease: Ease) -> float:
    """Return the share of the way at time t: 0 at 0, 1 at 1, never falling.

    "in" accelerates evenly from rest, "out" brakes evenly to rest, "in-out" does both (the cubic 3 t^2 - 2 t^3),
    "linear" keeps its speed.

    Args:
        t: share of the time, 0 to 1.
    """
    match ease:
        case "in":
            return t * t
        case "out":
            return 1 - (1 - t) * (1 - t)
        case "in-out":
            return t * t * (3 - 2 * t)
        case "linear":
            return t
