"""Divide renders as if memory were short."""

from collections.abc import Callable, Sequence
from typing import Any

from framearray_cli.render.division import Division


def in_strips(rows: int) -> Callable[..., Division]:
    """Return a division into strips of some rows, instead of `divide`."""

    def divide(prepared: Any, setup: Any, finished: Any = ()) -> Division:
        height = setup.cams.height
        strips = tuple(range(first, min(first + rows, height)) for first in range(0, height, rows))
        return _division([range(prepared.n_lights)], strips)

    return divide


def in_blocks(*blocks: range) -> Callable[..., Division]:
    """Return a division into blocks of light positions, instead of `divide`."""
    return lambda prepared, setup, finished: _division(blocks, (range(setup.cams.height),))


def _division(blocks: Sequence[range], strips: tuple[range, ...]) -> Division:
    return Division(blocks=list(blocks), strips=strips, memory=0, undivided=0, hits=1.0)
