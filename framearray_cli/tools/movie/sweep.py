"""Movies without a path file: camera, light or both move once, from first to last or along the places named."""

from dataclasses import dataclass
from typing import Literal, TypeAlias

from framearray_cli.array.manifest import MAIN_AXIS, Manifest
from framearray_cli.array.places import CAMERA_AXIS, IndexPlace
from framearray_cli.base.errors import JobError

from ..axes import given_places
from ..spans import resolve_span
from .pathfile import MoviePath, Segment

SweepKind: TypeAlias = Literal["walk", "light", "diagonal"]


@dataclass(frozen=True, slots=True, kw_only=True)
class Sweep:
    """One movement.

    Attributes:
        kind: what moves from first to last unless it is named below: "walk" the camera, "light" the light along all its
            axes, "diagonal" both; None: nothing.
        cameras, light: places that the camera passes through, and the light along the first axis; None: as `kind` says.
        at: "AXIS=PLACES" for other light axes.
        seconds: length; None: one frame per image on the way.
        turns: an environment turns meanwhile, so that nothing else needs to move.
    """

    kind: SweepKind | None = None
    cameras: str | None = None
    light: str | None = None
    at: tuple[str, ...] = ()
    seconds: float | None = None
    turns: bool = False


def sweep_path(sweep: Sweep, manifest: Manifest) -> MoviePath:
    """Make the path of a sweep.

    Raises:
        JobError: a place is none, or lies outside the array; nothing moves, and no `kind` says what should; or only an
            environment moves, and no `seconds` says how long.
    """
    sizes = {CAMERA_AXIS: manifest.n_cameras, **manifest.axes}
    moving = {"walk": [CAMERA_AXIS], "light": [*manifest.axes], "diagonal": [*sizes], None: []}[sweep.kind]
    named = {} if sweep.cameras is None else {CAMERA_AXIS: ("--cameras", sweep.cameras)}
    named |= given_places(manifest, sweep.light, sweep.at)
    lengths = {name: n if name in moving else 1 for name, n in sizes.items()}
    spans: dict[str, tuple[IndexPlace, ...]] = {
        name: ("first", "last") if name in moving else ("first",) for name in sizes
    }
    for name, (option, text) in named.items():
        spans[name], problems = (text,), list[str]()
        lengths[name] = len(resolve_span(option, spans[name], sizes[name], name, problems))
        if problems:
            raise JobError(option, [problem.removeprefix(f"{option}: ") for problem in problems])
    n_frames = max(lengths.values())
    if sweep.kind is None and n_frames == 1 and sweep.turns:
        if sweep.seconds is None:
            raise JobError("--seconds", ["missing; expected the length of the movie, as only the environment moves"])
    elif sweep.kind is None and n_frames == 1:
        option = next(iter(named.values()), ("--cameras", ""))[0]
        raise JobError(option, ["expected several places, such as 0-last or all, as nothing else moves"])
    segment = Segment(
        frames=n_frames if sweep.seconds is None else None,
        seconds=sweep.seconds,
        camera=spans.pop(CAMERA_AXIS),
        light=spans.pop(MAIN_AXIS, None),
        axes=spans,
    )
    return MoviePath(segments=(segment,))
