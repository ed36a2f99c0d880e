"""A movie's path through a frame array: a TOML file of segments, or one movement that options describe.

See docs/guide/movies.md. A span of a path is a place where the camera or the light stays, or places that it passes
through in even steps. `array/places.py` has the notation; n is the number of indices on an axis. A text that
names several places, such as "0-47" or "first-last", passes through all of them.
"""

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from fractions import Fraction
from pathlib import Path
from typing import Annotated, Any, Literal, TypeAlias

from pydantic import (
    Field,
    ModelWrapValidatorHandler,
    PlainValidator,
    ValidationError,
    WithJsonSchema,
    field_validator,
    model_validator,
)

from framearray_cli.array.manifest import MAIN_AXIS, Manifest
from framearray_cli.array.places import (
    ALL_PLACES,
    CAMERA_AXIS,
    PART,
    WANTED_PLACE,
    IndexPlace,
    is_notation,
    is_place,
    outside_problem,
    parse_places,
    position_of,
)
from framearray_cli.base.errors import JobError
from framearray_cli.base.forms.problems import MOST_PROBLEMS, problems_of
from framearray_cli.base.forms.table import Place, Problems, Table, check_with, fail
from framearray_cli.base.forms.toml import load_kind
from framearray_cli.base.forms.words import shown
from framearray_cli.base.units import LEAST_FPS, MOST_FPS, MOST_SECONDS

from ..axes import given_places
from .lightcurves import Degrees, Intensity, LightChange, Width

Ease: TypeAlias = Literal["linear", "in", "out", "in-out"]
_PLACES_PATTERN = rf"^({ALL_PLACES}|{PART}(, ?{PART})*)$".replace("?:", "")  # JSON Schema knows plain groups
_PLACE_SCHEMA: dict[str, Any] = {"anyOf": [{"type": "number"}, {"type": "string", "pattern": _PLACES_PATTERN}]}
MOST_FRAMES = 1_000_000  # eleven hours at 24 frames per second; more is a typing error
MOST_LOOPS = 10_000
Mode: TypeAlias = Literal["nearest", "blend"]
SweepKind: TypeAlias = Literal["walk", "light", "diagonal"]


# The share of the way at a share of the time: 0 at 0, 1 at 1, never falling. "in" accelerates evenly from rest, "out"
# brakes evenly to rest, "in-out" does both (the cubic 3 t^2 - 2 t^3), "linear" keeps its speed.
EASES: dict[Ease, Callable[[float], float]] = {
    "linear": lambda t: t,
    "in": lambda t: t * t,
    "out": lambda t: 1 - (1 - t) * (1 - t),
    "in-out": lambda t: t * t * (3 - 2 * t),
}


def _check_span(value: object) -> tuple[IndexPlace, ...]:
    """Check a span; a single place is a span that stays there."""
    many = isinstance(value, list | tuple)
    places: Any = value if many else [value]
    if not places:
        fail([((), "expected a place, or a list of places, got an empty list")])
    bad = [((k,), f"{WANTED_PLACE}, got {shown(place)}") for k, place in enumerate(places) if not _is_part(place)]
    if bad:
        fail(bad if many else [((), bad[0][1])])
    return tuple(places)


def _is_part(value: object) -> bool:
    """Return whether a value is a place, or a text that names several."""
    return is_notation(value) if isinstance(value, str) else is_place(value)


Span: TypeAlias = Annotated[
    tuple[IndexPlace, ...],
    PlainValidator(_check_span),
    WithJsonSchema({"anyOf": [*_PLACE_SCHEMA["anyOf"], {"type": "array", "items": _PLACE_SCHEMA, "minItems": 1}]}),
]


def resolve_span(key: str, span: Sequence[IndexPlace], n: int, axis: str, problems: list[str]) -> tuple[float, ...]:
    """Find the positions of a span's places on an axis of n indices.

    Args:
        key: where the span stands, for messages.
        axis: its name: "camera", "light" or another light axis.
        problems: receives a line for each place outside the axis.
    """
    found: list[float] = []
    for place in span:
        try:
            if isinstance(place, str):
                found += parse_places(place, n, axis, fractions=True)
            elif 0 <= position_of(place, n) <= n - 1:
                found.append(position_of(place, n))
            else:
                raise ValueError(outside_problem(place, n, axis))
        except ValueError as error:
            found.append(0.0)
            if (problem := f"{key}: {error}") not in problems:
                problems.append(problem)
    return tuple(found)


def interpolate_span(span: Sequence[float], u: float) -> float:
    """Interpolate linearly between positions at even steps of u from 0 to 1, where the result is exact."""
    last = len(span) - 1
    if u == 1 or not last:
        return span[-1]
    k = min(int(u * last), last - 1)
    return span[k] + (span[k + 1] - span[k]) * (u * last - k)


class Segment(Table):
    """A stretch of the movie in which camera and light each stay or move."""

    frames: int | None = Field(default=None, ge=1, le=MOST_FRAMES, description="Number of frames; or give `seconds`.")
    seconds: float | None = Field(
        default=None, gt=0, le=MOST_SECONDS, description="Length, rounded to whole frames, at least one."
    )
    camera: Span | None = Field(
        default=None, description="A place, or a list of places at even times. Left out: stays, at first at 0."
    )
    light: Span | None = Field(default=None, description="Places of the light along the first axis, as for `camera`.")
    axes: dict[str, Span] = Field(default={}, description="Places along further light axes, by name, as for `camera`.")
    ease: Ease = Field(default="linear", description="Start and end of the movement.")
    hold: float = Field(
        default=0.0, ge=0, le=MOST_SECONDS, description="Seconds that the last picture stays, added to the length."
    )
    reverse: bool = Field(default=False, description="Played backwards.")
    loops: int | None = Field(
        default=None, ge=1, le=MOST_LOOPS, description="Number of passes; 1, or 2 if back and forth."
    )
    back_and_forth: bool = Field(default=False, description="Every second time it is played the other way round.")
    positions: Mode | None = Field(default=None, description="Overrides `positions` of the whole movie.")

    @model_validator(mode="wrap")
    @classmethod
    def _check_keys_together(cls, value: object, check: ModelWrapValidatorHandler["Segment"]) -> "Segment":
        """Check rules between keys along with the keys themselves, so that all problems are reported at once."""
        table: dict[str, Any] = value if isinstance(value, dict) else {"frames": 1}
        problems: list[tuple[Place, str]] = []
        lengths = [key for key in ("frames", "seconds") if table.get(key) is not None]
        if len(lengths) == 2 or not (lengths or table.keys() - cls.model_fields.keys()):  # a misspelled key may be one
            found = "both" if lengths else "neither"
            problems.append(((), f"expected either frames or seconds, got {found}"))
        if isinstance(axes := table.get("axes"), dict) and MAIN_AXIS in axes:
            problems.append((("axes", MAIN_AXIS), f"expected it outside of axes: {MAIN_AXIS} = ..."))
        return check_with(problems, value, check)

    @property
    def n_passes(self) -> int:
        """The number of passes through the segment."""
        return self.loops if self.loops is not None else 2 if self.back_and_forth else 1

    def n_frames(self, fps: Fraction) -> int:
        """Count the frames of one pass."""
        return self.frames if self.frames is not None else max(1, round(Fraction(self.seconds or 0) * fps))

    def n_held(self, fps: Fraction) -> int:
        """Count the frames for which the last picture is held."""
        return round(Fraction(self.hold) * fps)


class EnvironmentChange(Table):
    """An environment map instead of the light positions of the first axis."""

    file: str = Field(
        min_length=1, max_length=1000, description="Panorama, EXR or HDR; relative to the folder of the path file."
    )
    rotate: Degrees = Field(
        default=0.0, validate_default=True, description="Degrees that it is turned clockwise, as seen from above."
    )
    intensity: Intensity = Field(default=1.0, validate_default=True, description="Factor of its light.")


class MoviePath(Table):
    """A path file."""

    fps: float | None = Field(
        default=None, ge=LEAST_FPS, le=MOST_FPS, description="Frames per second; left out: from the frame array."
    )
    positions: Mode = Field(default="nearest", description="Picture between two light positions.")
    segments: tuple[Segment, ...] = Field(strict=False, description="Played one after another; at least one.")
    groups: dict[str, LightChange] = Field(default={}, description="Changes of the light of groups, by name.")
    ambient: LightChange | None = Field(default=None, description="Change of the ambient light.")
    environment: EnvironmentChange | None = Field(
        default=None, description="An environment instead of the light positions of the first axis."
    )
    soft: Width | None = Field(default=None, description="Number of light positions whose mean replaces one.")

    def problems(self) -> Problems:
        """Check that light positions are summed in one way."""
        if self.environment is not None and self.soft is not None:
            yield ("soft",), "expected either environment or soft, got both"

    @field_validator("segments")
    @classmethod
    def _some(cls, segments: tuple[Segment, ...]) -> tuple[Segment, ...]:
        if not segments:
            fail([((), "expected a list of at least 1 table, got none")])
        return segments


def load_movie_path(file: Path, also: Callable[[dict[str, Any]], list[str]] | None = None) -> MoviePath:
    """Read a path file.

    Args:
        also: finds further problems in the tables of a file that has some, so that all are reported at once.

    Raises:
        JobError: the file is missing or broken; the message names every problem.
    """
    table = load_kind(file, "movie path")
    try:
        return MoviePath.model_validate(table)
    except ValidationError as error:
        problems = problems_of(error, MoviePath, MOST_PROBLEMS)
        more = also(table) if also and len(problems) <= MOST_PROBLEMS else []
        raise JobError(file, [*more, *problems]) from error


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
        still: one picture: one place of everything.
    """

    kind: SweepKind | None = None
    cameras: str | None = None
    light: str | None = None
    at: tuple[str, ...] = ()
    seconds: float | None = None
    turns: bool = False
    still: bool = False


def sweep_path(sweep: Sweep, manifest: Manifest, note: Callable[[str], None] = lambda text: None) -> MoviePath:
    """Make the path of a sweep.

    Args:
        note: called with the true time of a light position that was named by another.

    Raises:
        JobError: a place is none, or lies outside the array; a still has several; nothing moves, and there is no
            `kind`; or only an environment moves, and there are no `seconds`.
    """
    sizes = {CAMERA_AXIS: manifest.n_cameras, **manifest.axes}
    moving = {"walk": [CAMERA_AXIS], "light": [*manifest.axes], "diagonal": [*sizes], None: []}[sweep.kind]
    named = {} if sweep.cameras is None else {CAMERA_AXIS: ("--camera" if sweep.still else "--cameras", sweep.cameras)}
    named |= given_places(manifest, sweep.light, sweep.at, note)
    lengths = {name: n if name in moving else 1 for name, n in sizes.items()}
    spans: dict[str, tuple[IndexPlace, ...]] = {
        name: ("first", "last") if name in moving else ("first",) for name in sizes
    }
    for name, (option, text) in named.items():
        spans[name], problems = (text,), list[str]()
        lengths[name] = len(resolve_span(option, spans[name], sizes[name], name, problems))
        if problems:
            raise JobError(option, [problem.removeprefix(f"{option}: ") for problem in problems])
        if sweep.still and lengths[name] > 1:
            raise JobError(option, [f"expected one place, as a still is one picture, got {lengths[name]}"])
    n_frames = max(lengths.values())
    if sweep.kind is None and n_frames == 1 and sweep.turns:
        if sweep.seconds is None:
            raise JobError("--seconds", ["missing; expected the length of the movie, as only the environment moves"])
    elif sweep.kind is None and n_frames == 1 and not sweep.still:
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
