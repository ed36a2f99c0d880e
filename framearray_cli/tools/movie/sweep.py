"""Movies without a path file: the camera, the light, or both move once from first to last."""

from collections.abc import Mapping
from dataclasses import dataclass
from typing import Literal, TypeAlias

from framearray_cli.array.manifest import MAIN_AXIS, Manifest
from framearray_cli.array.places import CAMERA_AXIS, IndexPlace, read_place
from framearray_cli.base.errors import JobError
from framearray_cli.base.forms.words import shown

from ..axes import axes_of_groups
from ..spans import resolve_span
from .pathfile import MoviePath, Segment

SweepKind: TypeAlias = Literal["walk", "light", "diagonal"]


@dataclass(frozen=True, slots=True, kw_only=True)
class Sweep:
    """One movement from first to last.

    Attributes:
        kind: what moves: "walk" the camera, "light" the light along all its axes, "diagonal" both.
        at: where the rest stays: places as in a path file; "AXIS=PLACE" applies to one light axis only.
        seconds: length; None: one frame per image on the way.
    """

    kind: SweepKind
    at: tuple[str, ...] = ()
    seconds: float | None = None


def sweep_path(sweep: Sweep, manifest: Manifest) -> MoviePath:
    """Make the path of a sweep.

    Raises:
        JobError: `at` is no place, or lies outside the array.
    """
    moves: tuple[IndexPlace, ...] = ("first", "last")
    sizes = {CAMERA_AXIS: manifest.n_cameras, **manifest.axes}
    staying = {"walk": list(manifest.axes), "light": [CAMERA_AXIS], "diagonal": []}[sweep.kind]
    stays = _read_stays(sweep, {name: sizes[name] for name in staying}, axes_of_groups(manifest))
    spans = dict.fromkeys(sizes, moves) | stays
    n_frames = max(n for name, n in sizes.items() if name not in staying)
    segment = Segment(
        frames=n_frames if sweep.seconds is None else None,
        seconds=sweep.seconds,
        camera=spans.pop(CAMERA_AXIS),
        light=spans.pop(MAIN_AXIS, None),
        axes=spans,
    )
    return MoviePath(segments=(segment,))


def _read_stays(sweep: Sweep, sizes: Mapping[str, int], groups: Mapping[str, str]) -> dict[str, tuple[IndexPlace, ...]]:
    """Read where each axis stays, and check that it has that place.

    Args:
        sizes: the number of indices of each axis that stays, by name.
        groups: the axis of each group of sources, whose name may stand for that of the axis.
    """
    stays: dict[str, IndexPlace] = dict.fromkeys(sizes, "first")
    problems: list[str] = []
    for text in sorted(sweep.at, key=lambda text: "=" in text):  # a place for one axis overrides one for all
        name, equals, place = text.rpartition("=")
        name = name if name in sizes else groups.get(name, name)
        if equals and name not in sizes:
            problems.append(f"expected PLACE, or AXIS=PLACE with one of {', '.join(sizes)}, got {shown(text)}")
            continue
        try:
            stays |= dict.fromkeys([name] if equals else sizes, read_place(place))
        except ValueError as error:
            problems.append(str(error))
    for name, n in sizes.items():
        found: list[str] = []
        resolve_span("--at", (stays[name],), n, name, found)
        problems += [problem.removeprefix("--at: ") for problem in found]
    if problems:
        raise JobError("--at", problems)
    return {name: (place,) for name, place in stays.items()}
