"""Movies without a path file: the eye walks, the light moves, or both, once from first to last."""

from dataclasses import dataclass
from typing import Literal, TypeAlias

from ..errors import JobError
from ..manifest import MAIN_AXIS, Manifest
from .pathfile import MoviePath, Segment
from .places import IndexPlace, positions, read_place

Kind: TypeAlias = Literal["walk", "light", "diagonal"]


@dataclass(frozen=True, slots=True, kw_only=True)
class Sweep:
    """One movement from first to last.

    Attributes:
        kind: what moves: "walk" the camera, "light" the light along all its axes, "diagonal" both.
        at: where stays what does not move, as in a path file.
        seconds: how long it takes; None: as many frames as there are images on the way.
    """

    kind: Kind
    at: str = "first"
    seconds: float | None = None


def swept(sweep: Sweep, manifest: Manifest) -> MoviePath:
    """Write a movement as a path.

    Raises:
        JobError: `at` is no place, or lies outside of the array.
    """
    stays = _stays(sweep, manifest)
    moves: tuple[IndexPlace, ...] = ("first", "last")
    camera = stays if sweep.kind == "light" else moves
    light = stays if sweep.kind == "walk" else moves
    n_light = max(manifest.axes.values())
    n = {"walk": manifest.n_cameras, "light": n_light, "diagonal": max(manifest.n_cameras, n_light)}[sweep.kind]
    segment = Segment(
        frames=n if sweep.seconds is None else None,
        seconds=sweep.seconds,
        camera=camera,
        light=light if MAIN_AXIS in manifest.axes else None,
        axes={name: light for name in manifest.axes if name != MAIN_AXIS},
    )
    return MoviePath(segments=(segment,))


def _stays(sweep: Sweep, manifest: Manifest) -> tuple[IndexPlace]:
    """Read the place of what stays, and look whether the array has it."""
    try:
        place = read_place(sweep.at)
    except ValueError as error:
        raise JobError("--at", [str(error)]) from error
    problems: list[str] = []
    axes = {"camera": manifest.n_cameras} if sweep.kind == "light" else dict(manifest.axes)
    for name, n in axes.items() if sweep.kind != "diagonal" else ():
        positions("--at", (place,), n, f"{name}s" if name in ("camera", MAIN_AXIS) else f"places of {name}", problems)
    if problems:
        raise JobError("--at", [problem.removeprefix("--at: ") for problem in problems])
    return (place,)
