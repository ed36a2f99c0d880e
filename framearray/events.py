"""Events of a render, in the order in which they happen."""

from dataclasses import dataclass
from pathlib import Path

from framearray_cli.base.errors import FrameArrayError
from framearray_cli.cli.results import RenderResult


class RenderCancelled(FrameArrayError):  # what happened is no error
    """A render was cancelled; finished images stay, and the next run renders the rest."""


@dataclass(frozen=True, slots=True, kw_only=True)
class Event:
    """Base of all events."""


@dataclass(frozen=True, slots=True, kw_only=True)
class Started(Event):
    """The inputs were read.

    Attributes:
        name: of the job.
        folder: of the array.
        cameras: number of camera positions.
        images: number in the array, those of all groups.
        resolution: width and height, pixels.
        triangles: of the scene.
    """

    name: str
    folder: Path
    cameras: int
    images: int
    resolution: tuple[int, int]
    triangles: int


@dataclass(frozen=True, slots=True, kw_only=True)
class Noted(Event):
    """Something to know: what was left out of a scene, which settings were chosen."""

    text: str


@dataclass(frozen=True, slots=True, kw_only=True)
class Warned(Event):
    """Pictures will be black, clipped or empty; docs/guide/troubleshooting.md lists the warnings."""

    text: str


@dataclass(frozen=True, slots=True, kw_only=True)
class Scanned(Event):
    """The folder was searched for images of an earlier run.

    Attributes:
        kept: number of images that are there and whole.
        wanted: number that this run renders.
        damaged: files that will be rendered again.
    """

    kept: int
    wanted: int
    damaged: tuple[str, ...]


@dataclass(frozen=True, slots=True, kw_only=True)
class Compiling(Event):
    """A kernel is being compiled, as on the first run on a machine: ten to twenty seconds in all."""


@dataclass(frozen=True, slots=True, kw_only=True)
class FrameWritten(Event):
    """All files of a camera position are on disk, and can be read.

    Attributes:
        camera: c.
        images: number of its images; where memory limits a run to some light positions at a time, of those.
    """

    camera: int
    images: int


@dataclass(frozen=True, slots=True, kw_only=True)
class Progress(Event):
    """Progress of the render; at most ten per second.

    Attributes:
        written: images on disk, of this run.
        wanted: images that this run renders.
        seconds_left: expected; None: not known yet.
    """

    written: int
    wanted: int
    seconds_left: float | None


@dataclass(frozen=True, slots=True, kw_only=True)
class Finished(Event):
    """The render is done.

    Attributes:
        summary: images, time, rays and memory, as `framearray render --json` prints them.
        notes: about the result.
    """

    summary: RenderResult
    notes: tuple[str, ...]
