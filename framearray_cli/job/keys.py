"""Key frames: rules for the keys of cameras and of light sources."""

from collections.abc import Sequence
from itertools import pairwise
from math import hypot
from typing import Protocol

from framearray_cli.base.forms.table import Float3, Place

MOST_EYES = 100_000  # an hour at 24 frames per second; more is a typing error


class KeyFrame(Protocol):
    """A table of values at one frame."""

    @property
    def frame(self) -> int: ...


def key_problems(keys: Sequence[KeyFrame], directions: str, *optional: str) -> list[tuple[Place, str]]:
    """Check keys against each other: their order, values that only some of them give, turns by half a circle."""
    problems: list[tuple[Place, str]] = []
    for i, (before, key) in enumerate(pairwise(keys), start=1):
        if key.frame <= before.frame:
            text = f"expected more than {before.frame}, the frame of the key before, got {key.frame}"
            problems.append(((i, "frame"), text))
        a, b = getattr(before, directions, None), getattr(key, directions, None)
        if a and b and key.frame > before.frame + 1 and _opposite(a, b):  # neighbours have nothing between them
            text = "expected less than half a turn from the key before, got the opposite direction; add a key between"
            problems.append(((i, directions), text))
    for name in optional:
        given = [i for i, key in enumerate(keys) if getattr(key, name, None) is not None]
        if given and len(given) < len(keys):
            missing = next(i for i in range(len(keys)) if i not in given)
            problems.append(((missing, name), f"missing; keys[{given[0]}] gives it, so every key of this list must"))
    return problems


def _opposite(a: Float3, b: Float3) -> bool:
    """Whether two directions are so close to opposite that there is no shortest turn between them."""
    return a[0] * b[0] + a[1] * b[1] + a[2] * b[2] <= -hypot(*a) * hypot(*b) * (1 - 1e-8)  # 1e-8: within 0.01 degrees


def late_key_problems(keys: Sequence[KeyFrame], frames: int) -> list[tuple[Place, str]]:
    """Check that no key lies beyond the last frame; with `frames` = 0 the last key is the last frame."""
    late = [(i, key.frame) for i, key in enumerate(keys) if frames and key.frame >= frames]
    return [((i, "frame"), f"expected at most {frames - 1} (frames = {frames}), got {frame}") for i, frame in late]
