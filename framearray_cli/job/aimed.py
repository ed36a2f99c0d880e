"""Keys of sources that shine one way: each says by a direction or by a target which way that is."""

from collections.abc import Sequence
from typing import Protocol

from framearray_cli.base.forms.table import Float3, Place


class AimedKey(Protocol):
    """A key with a position and an aim."""

    @property
    def position(self) -> Float3: ...
    @property
    def direction(self) -> Float3 | None: ...
    @property
    def target(self) -> Float3 | None: ...


def aim_problems(key: AimedKey) -> list[tuple[Place, str]]:
    """Check that a key has one aim, away from its position."""
    problems: list[tuple[Place, str]] = []
    if (key.direction is None) == (key.target is None):
        found = "neither" if key.direction is None else "both"
        problems.append(((), f"expected either `direction` or `target`, got {found}"))
    if key.target is not None and key.target == key.position:
        problems.append((("target",), "expected a point away from `position`, got the same point"))
    return problems


def same_choice_problems(keys: Sequence[AimedKey], *choices: tuple[str, str]) -> list[tuple[Place, str]]:
    """Check that all keys give the same of two values: the first key's."""
    problems: list[tuple[Place, str]] = []
    for one, other in choices:
        chosen = other if getattr(keys[0], one) is None else one
        others = [k for k, key in enumerate(keys) if getattr(key, chosen) is None]
        text = "missing; keys[0] gives it, so every key of this list must"
        problems += [((k, chosen), text) for k in others[:1]]
    return problems
