"""How a movement starts and ends: the share of the way that is done after a share t of the time."""

from typing import Literal, TypeAlias

Ease: TypeAlias = Literal["linear", "in", "out", "in-out"]


def eased(t: float, ease: Ease) -> float:
    """Find the share of the way at time t; 0 at 0, 1 at 1, never backwards.

    "in" starts from rest and speeds up evenly, "out" slows down evenly to rest, "in-out" does both (the cubic
    3 t^2 - 2 t^3), "linear" is even.

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
