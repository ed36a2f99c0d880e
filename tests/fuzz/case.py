"""A case: one broken or extreme input, and the command that reads it."""

from collections.abc import Callable, Iterator
from dataclasses import dataclass
from pathlib import Path
from random import Random
from typing import TypeAlias

from .outcome import Outcome

Arguments: TypeAlias = tuple[str | Path, ...]


def _nothing(outcome: Outcome) -> str | None:
    return None


@dataclass(frozen=True, kw_only=True)
class Case:
    """One input.

    Attributes:
        arguments: of the program: a command and what follows it.
        mutation: what was done to the input, in a few words; cases are counted by it.
        folder: holds all files that the case reads and writes; removed when the case ended well, kept when it did not.
        before: called in the process of the command, first; for limits, or another working directory.
        isolated: whether it needs a process of its own; others share one with those that follow.
        accepted: called after a case that was accepted: what was done, in a word.
        wrong: called afterwards, however the command ended: what else is wrong, or None.
    """

    arguments: Arguments
    mutation: str
    folder: Path
    before: Callable[[], None] = lambda: None
    isolated: bool = True
    accepted: Callable[[], str] = lambda: "accepted"
    wrong: Callable[[Outcome], str | None] = _nothing


# Each kind of input is a module with `cases(rng, folder)`: it yields cases one by one, each with a folder of its own
# below `folder`, for as long as it is asked. An isolated case has run before the next one is made.
Cases: TypeAlias = Callable[[Random, Path], Iterator[Case]]
