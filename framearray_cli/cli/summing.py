"""Options of sums over light positions, which `assemble`, `sheet` and `export` share."""

import re
from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer

from framearray_cli.base.errors import JobError
from framearray_cli.base.forms.words import shown

from .values import number

if TYPE_CHECKING:
    from framearray_cli.tools.mixing import SumOptions

MOST_TURN = 100_000.0  # degrees
MOST_SOFT = 100_000.0  # light positions

Environment = Annotated[
    Path | None,
    typer.Option("--environment", help="Light by this panorama (EXR, HDR) instead of light positions.", metavar="FILE"),
]
Rotate = Annotated[
    str | None,
    typer.Option(
        "--rotate", help="Rotation of the panorama, degrees; 0-360 turns it during a movie.", metavar="DEGREES"
    ),
]
Soft = Annotated[
    float | None,
    typer.Option("--soft", parser=number(1, MOST_SOFT), help="Mean of N light positions instead of one.", metavar="N"),
]
Weights = Annotated[
    Path | None,
    typer.Option("--weights", help="Sum of all light positions with the weights of a CSV file.", metavar="FILE"),
]


def sum_options(
    environment: Path | None, rotate: str | None, soft: float | None, weights: Path | None, *, moves: bool = False
) -> "SumOptions":
    """Read the options of sums.

    Args:
        moves: whether pictures follow one another, so that the map may turn.

    Raises:
        JobError: the rotation is no number of degrees, or a range where nothing moves.
    """
    from framearray_cli.tools.mixing import SumOptions

    turn = _read_turn(rotate, moves=moves) if rotate is not None else (0.0, 0.0)
    if rotate is not None and environment is None:
        raise JobError("--rotate", ["expected --environment beside it"])
    return SumOptions(environment=environment, rotate=turn, soft=soft, weights=weights)


def _read_turn(text: str, *, moves: bool) -> tuple[float, float]:
    """Read "30", or "0-360" in a movie."""
    degrees = r"([+-]?\d{1,6}(?:\.\d{1,6})?)"
    found = re.fullmatch(rf"\s*{degrees}(?:\s*-\s*{degrees})?\s*", text, re.ASCII)
    wanted = "degrees such as 30, or 0-360" if moves else "degrees such as 30"
    if not found or (found[2] is not None and not moves):
        raise JobError("--rotate", [f"expected {wanted}, got {shown(text)}"])
    first = float(found[1])
    last = float(found[2]) if found[2] is not None else first
    if max(abs(first), abs(last)) > MOST_TURN:
        raise JobError("--rotate", [f"expected at most {MOST_TURN:.0f} degrees, got {shown(text)}"])
    return first, last
