"""Movies without a path file: the eye walks, the light moves, or both, once from first to last."""

from dataclasses import dataclass
from typing import Literal, TypeAlias

from framearray_cli.array.manifest import MAIN_AXIS, Manifest
from framearray_cli.base.errors import JobError
from framearray_cli.base.forms.words import shown

from ..places import IndexPlace, positions, read_place
from .pathfile import MoviePath, Segment

Kind: TypeAlias = Literal["walk", "light", "diagonal"]


@dataclass(frozen=True, slots=True, kw_only=True)
class Sweep:
    """One movement from first to last.

    Attributes:
        kind: what moves: "walk" the camera, "light" the light along all its axes, "diagonal" both.
        at: where stays what does not move: places as in a path file; "AXIS=PLACE" is for one light axis alone.
        seconds: how long it takes; None: as many frames as there are images on the way.
    """

    kind: Kind
    at: tuple[str, ...] = ()
    seconds: float | None = None


def swept(sweep: Sweep, manifest: Manifest) -> MoviePath:
    """Write a movement as a path.

    Raises:
        JobError: `at` is no place, or lies outside of the array.
    """
    moves: tuple[IndexPlace, ...] = ("first", "last")
    sizes = {"camera": manifest.n_cameras, **manifest.axes}
    staying = {"walk": list(manifest.axes), "light": ["camera"], "diagonal": []}[sweep.kind]
    spans = dict.fromkeys(sizes, moves) | _stays(sweep, {name: sizes[name] for name in staying})
    n_frames = max(n for name, n in sizes.items() if name not in staying)
    segment = Segment(
        frames=n_frames if sweep.seconds is None else None,
        seconds=sweep.seconds,
        camera=spans.pop("camera"),
        light=spans.pop(MAIN_AXIS, None),
        axes=spans,
    )
    return MoviePath(segments=(segment,))


def _stays(sweep: Sweep, sizes: dict[str, int]) -> dict[str, tuple[IndexPlace, ...]]:
    """Read where each axis stays, and look whether it has that place.

    Args:
        sizes: of the axes that stay, by name.
    """
    stays: dict[str, IndexPlace] = dict.fromkeys(sizes, "first")
    problems: list[str] = []
    for text in sorted(
        sweep.at, key=lambda text: "=" in text
    ):  # what is said of one axis goes over what is said of all
        name, equals, place = text.rpartition("=")
        if equals and name not in sizes:
            problems.append(f"expected PLACE, or AXIS=PLACE with one of {', '.join(sizes)}, got {shown(text)}")
            continue
        try:
            stays |= dict.fromkeys([name] if equals else sizes, read_place(place))
        except ValueError as error:
            problems.append(str(error))
    for name, n in sizes.items():
        found: list[str] = []
        positions(
            "--at", (stays[name],), n, f"{name}s" if name in ("camera", MAIN_AXIS) else f"places of {name}", found
        )
        problems += [problem.removeprefix("--at: ") for problem in found]
    if problems:
        raise JobError("--at", problems)
    return {name: (place,) for name, place in stays.items()}
