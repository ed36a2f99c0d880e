"""The path of a movie through a frame array: a TOML file of segments -> (c, l) of each frame.

Notation: a position is a camera or light index that need not be whole; n is the number of indices on its axis.
"""

import math
import re
from fractions import Fraction
from pathlib import Path
from typing import Annotated, Any, TypeAlias

from pydantic import Field, PlainValidator, ValidationError, WithJsonSchema, field_validator, model_validator

from .errors import JobError
from .framerate import frame_rate
from .jobfile import load_toml
from .jobvalues import Table, fail, shown
from .manifest import Manifest
from .problems import problems_of

# An index (negative: from the end), "first", "last", or a percentage of the way from first to last.
IndexPlace: TypeAlias = int | str

MOST_FRAMES = 1_000_000  # eleven hours at 24 frames a second; more is a typing error
MOST_SECONDS = 40_000.0


def _span(value: object) -> tuple[IndexPlace, IndexPlace]:
    """Check a span; one place alone is a span that stays there."""
    ends: list[Any] = value if isinstance(value, list) else [value, value]
    if len(ends) != 2:
        fail([((), f"expected a place, or [from, to], got {shown(value)}")])
    wanted = 'expected an index, "first", "last" or a percentage such as "50%"'
    bad = [((k,), f"{wanted}, got {shown(end)}") for k, end in enumerate(ends) if not _is_place(end)]
    if bad:
        fail(bad if isinstance(value, list) else [((), bad[0][1])])
    return ends[0], ends[1]


def _is_place(value: object) -> bool:
    if isinstance(value, str):
        return value in ("first", "last") or _percent(value) is not None
    return isinstance(value, int) and not isinstance(value, bool)


_PLACE_SCHEMA: dict[str, Any] = {
    "anyOf": [{"type": "integer"}, {"type": "string", "pattern": r"^(first|last|\d{1,3}(\.\d{1,9})? ?%)$"}]
}
Span: TypeAlias = Annotated[
    tuple[IndexPlace, IndexPlace],
    PlainValidator(_span),
    WithJsonSchema(
        {"anyOf": [*_PLACE_SCHEMA["anyOf"], {"type": "array", "items": _PLACE_SCHEMA, "minItems": 2, "maxItems": 2}]}
    ),
]


class Segment(Table):
    """A stretch of the movie in which camera and light each stay or move evenly."""

    frames: int | None = Field(default=None, ge=1, le=MOST_FRAMES, description="Number of frames; or give `seconds`.")
    seconds: float | None = Field(
        default=None, gt=0, le=MOST_SECONDS, description="Length, rounded to whole frames, at least one."
    )
    camera: Span | None = Field(
        default=None, description="A place, or [from, to]. Left out: stays where it was, at first 0."
    )
    light: Span | None = Field(
        default=None, description="A place, or [from, to]. Left out: stays where it was, at first 0."
    )

    @model_validator(mode="after")
    def _one_length(self) -> "Segment":
        if (self.frames is None) == (self.seconds is None):
            fail([((), f"expected either frames or seconds, got {'neither' if self.frames is None else 'both'}")])
        return self

    def n_frames(self, fps: Fraction) -> int:
        """Count the frames of the segment."""
        return self.frames if self.frames is not None else max(1, round(Fraction(self.seconds or 0) * fps))


class MoviePath(Table):
    """What a path file holds."""

    fps: float | None = Field(
        default=None, ge=0.01, le=1000, description="Frames per second; left out: those of the frame array."
    )
    segments: tuple[Segment, ...] = Field(strict=False, description="Played one after another; at least one.")

    @field_validator("segments")
    @classmethod
    def _some(cls, segments: tuple[Segment, ...]) -> tuple[Segment, ...]:
        if not segments:
            fail([((), "expected a list of at least 1 table, got none")])
        return segments


def load_movie_path(file: Path) -> MoviePath:
    """Read a path file.

    Raises:
        JobError: the file is missing or broken; every problem is named.
    """
    try:
        return MoviePath.model_validate(load_toml(file))
    except ValidationError as error:
        raise JobError(file, problems_of(error, MoviePath)) from error


def movie_fps(movie: MoviePath, manifest: Manifest) -> Fraction:
    """Choose the frame rate: that of the path file, else that of the frame array."""
    return frame_rate(movie.fps if movie.fps is not None else manifest.fps)


def frame_list(file: Path, movie: MoviePath, manifest: Manifest) -> list[tuple[int, int]]:
    """List the image [c, l] of each frame.

    A segment shows both ends of its spans. Where it goes on from exactly where the one before ended, it does not show
    that image again: steps are then 1/n of the way instead of 1/(n - 1), and a movement cut in two runs on evenly.

    Args:
        file: the path file, for messages.
        movie: what it holds.
        manifest: of the frame array.

    Returns:
        (c, l) of each frame, in order.

    Raises:
        JobError: a place lies outside of the array; every such place is named.
    """
    fps = movie_fps(movie, manifest)
    problems: list[str] = []
    frames: list[tuple[int, int]] = []
    now = (0.0, 0.0)  # where the last segment ended: camera, light
    for k, segment in enumerate(movie.segments):
        camera = _positions(f"segments[{k}].camera", segment.camera, now[0], manifest.n_cameras, "cameras", problems)
        light = _positions(f"segments[{k}].light", segment.light, now[1], manifest.n_lights, "lights", problems)
        goes_on = frames[-1:] == [(_nearest(camera[0]), _nearest(light[0]))]
        for t in _steps(segment.n_frames(fps), goes_on):
            now = (_between(camera, t), _between(light, t))
            frames.append((_nearest(now[0]), _nearest(now[1])))
    if problems:
        raise JobError(file, problems)
    return frames


def _steps(n: int, goes_on: bool) -> list[float]:
    """Space n frames evenly over [0, 1]: the last is 1; the first is 0, or one step on where 0 was shown before."""
    if goes_on:
        return [(k + 1) / n for k in range(n)]
    return [k / (n - 1) for k in range(n)] if n > 1 else [0.0]


def _between(span: tuple[float, float], t: float) -> float:
    """Find the position t of the way along a span; both ends are exact."""
    return span[1] if t == 1 else span[0] + (span[1] - span[0]) * t


def _nearest(position: float) -> int:
    """Find the nearest index; halves go up."""
    return math.floor(position + 0.5)


def _positions(
    key: str, span: tuple[IndexPlace, IndexPlace] | None, now: float, n: int, noun: str, problems: list[str]
) -> tuple[float, float]:
    """Resolve the two ends of a span; what lies outside of the array is added to `problems`."""
    if span is None:
        return now, now
    ends = []
    for place in span:
        position = _position(place, n)
        if not 0 <= position <= n - 1:
            indices = f"0 to {n - 1}, or -{n} to -1" if n > 1 else "0 or -1"
            problem = f"{key}: expected one of {n} {noun} ({indices}), got {place}"
            if problem not in problems:  # a place that stands for both ends of a span
                problems.append(problem)
            position = 0.0
        ends.append(position)
    return ends[0], ends[1]


def _position(place: IndexPlace, n: int) -> float:
    """Resolve a place on an axis of n indices; the result may lie outside."""
    if isinstance(place, int):
        return float(place + n if place < 0 else place)
    percent = {"first": 0.0, "last": 100.0}.get(place, _percent(place))
    return (n - 1) * (percent or 0.0) / 100


def _percent(text: str) -> float | None:
    """Read "50%" or "12.5 %"; None for anything else and for what is not within 0 and 100."""
    found = re.fullmatch(r"(\d{1,3}(?:\.\d{1,9})?) ?%", text)
    value = float(found[1]) if found else None
    return value if value is not None and value <= 100 else None
