"""The TOML file of a movie's path through a frame array: segments, light; see docs/guide/movies.md."""

from collections.abc import Callable
from fractions import Fraction
from pathlib import Path
from typing import Any, Literal, TypeAlias

from pydantic import Field, ModelWrapValidatorHandler, ValidationError, field_validator, model_validator

from framearray_cli.array.manifest import MAIN_AXIS, Manifest
from framearray_cli.base.errors import JobError
from framearray_cli.base.forms.kinds import load_kind
from framearray_cli.base.forms.problems import MOST_PROBLEMS, problems_of
from framearray_cli.base.forms.table import Place, Table, check_with, fail
from framearray_cli.base.units import LEAST_FPS, MOST_FPS, MOST_SECONDS, frame_rate

from ..spans import Span
from .curves import NOT_TURNED, ONE, Degrees, Files, Intensity, LightChange, Width
from .easing import Ease

MOST_FRAMES = 1_000_000  # eleven hours at 24 frames per second; more is a typing error
MOST_LOOPS = 10_000

Mode: TypeAlias = Literal["nearest", "blend"]


class Segment(Table):
    """A stretch of the movie in which camera and light each stay or move."""

    frames: int | None = Field(default=None, ge=1, le=MOST_FRAMES, description="Number of frames; or give `seconds`.")
    seconds: float | None = Field(
        default=None, gt=0, le=MOST_SECONDS, description="Length, rounded to whole frames, at least one."
    )
    camera: Span | None = Field(
        default=None, description="A place, or a list of places at even times. Left out: stays, at first at 0."
    )
    light: Span | None = Field(default=None, description="Likewise.")
    axes: dict[str, Span] = Field(default={}, description="The same for further light axes, by name.")
    ease: Ease = Field(default="linear", description="How the movement starts and ends.")
    hold: float = Field(
        default=0.0, ge=0, le=MOST_SECONDS, description="Seconds that the last picture stays, added to the length."
    )
    reverse: bool = Field(default=False, description="Played backwards.")
    loops: int | None = Field(
        default=None, ge=1, le=MOST_LOOPS, description="How often it is played; 1, or 2 if back and forth."
    )
    back_and_forth: bool = Field(default=False, description="Every second time it is played the other way round.")
    positions: Mode | None = Field(default=None, description="In place of that of the whole movie.")

    @model_validator(mode="wrap")
    @classmethod
    def _check_keys_together(cls, value: object, check: ModelWrapValidatorHandler["Segment"]) -> "Segment":
        """Check what concerns several keys beside the keys themselves, so that all problems are reported at once."""
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


class EnvironmentLight(Table):
    """An environment map in place of the light positions of the first axis."""

    file: str = Field(
        min_length=1, max_length=1000, description="Panorama, EXR or HDR; relative to the folder of the path file."
    )
    rotate: Degrees = Field(default=NOT_TURNED, description="Degrees that it is turned clockwise, as seen from above.")
    intensity: Intensity = Field(default=ONE, description="Factor of its light.")


class MoviePath(Table):
    """A path file."""

    fps: float | None = Field(
        default=None, ge=LEAST_FPS, le=MOST_FPS, description="Frames per second; left out: those of the frame array."
    )
    positions: Mode = Field(default="nearest", description="What is shown between two light positions.")
    segments: tuple[Segment, ...] = Field(strict=False, description="Played one after another; at least one.")
    groups: dict[str, LightChange] = Field(default={}, description="Changes of the light of groups, by name.")
    ambient: LightChange | None = Field(default=None, description="Change of the ambient light.")
    environment: EnvironmentLight | None = Field(
        default=None, description="An environment in place of the light positions of the first axis."
    )
    soft: Width | None = Field(default=None, description="Number of light positions whose mean takes the place of one.")
    weights: Files | None = Field(
        default=None,
        description="CSV file with the weight of each light position of the first axis; relative to the folder of the "
        "path file. Between two key frames both files count.",
    )

    @model_validator(mode="after")
    def _one_sum(self) -> "MoviePath":
        given = [key for key in ("environment", "soft", "weights") if getattr(self, key) is not None]
        if len(given) > 1:
            fail([((given[1],), f"expected either {given[0]} or {given[1]}, got both")])
        return self

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


def movie_fps(movie: MoviePath, manifest: Manifest) -> Fraction:
    """Return the frame rate of the path file, or else of the frame array."""
    return frame_rate(movie.fps if movie.fps is not None else manifest.fps)
