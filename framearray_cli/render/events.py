"""Events of a render, in the order in which they happen: the command line prints them, Python yields them."""

from collections.abc import Callable, Iterable, Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Any, TypeAlias

if TYPE_CHECKING:
    from framearray_cli.array.manifest import Manifest
    from framearray_cli.engine.terms.ambient.intensity import Ambient

    from .errortarget import Target


@dataclass(frozen=True, slots=True, kw_only=True)
class Event:
    """Base of all events."""


Report: TypeAlias = Callable[[Event], object]  # receives the events of a render; any thread may call it


@dataclass(frozen=True, slots=True, kw_only=True)
class Started(Event):
    """The inputs were read.

    Attributes:
        name: of the job.
        folder: of the array.
        cameras: number of camera positions.
        images: number in the array, with the images of all groups.
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
    """Something to know: the contents of a scene, chosen settings; `line`: as commands print it."""

    line: str

    @property
    def text(self) -> str:
        """The line without "note: "."""
        return self.line.removeprefix("note: ").strip()


@dataclass(frozen=True, slots=True, kw_only=True)
class Working(Event):
    """Work of unknown length begins; `text` names it."""

    text: str


@dataclass(frozen=True, slots=True, kw_only=True)
class Scanned(Event):
    """The folder was searched for images of an earlier run.

    Attributes:
        kept: number of images that are there and whole.
        wanted: number that this run renders.
        damaged: problems of files that will be rendered again, by file name.
    """

    kept: int
    wanted: int
    damaged: Mapping[str, str]


@dataclass(frozen=True, slots=True, kw_only=True)
class CoarseBegun(Event):
    """Coarse pictures begin to appear; `array` describes the array to come, with a rough ambient light."""

    array: "Manifest"


@dataclass(frozen=True, slots=True, kw_only=True)
class AmbientEstimated(Event):
    """The ambient light was estimated.

    Attributes:
        lowest, highest: mean of I_A over the channels, radiance, at the darkest and brightest light position.
        error: largest relative standard error of a light position.
        paths: number of walks.
        notes: messages for the user.
    """

    lowest: float
    highest: float
    error: float
    paths: int
    notes: tuple[str, ...]

    @classmethod
    def of(cls, ambient: "Ambient") -> "AmbientEstimated":
        """Return the event of an estimate."""
        mean = ambient.intensity.mean(axis=1)
        return cls(
            lowest=float(mean.min()),
            highest=float(mean.max()),
            error=float(ambient.standard_error.max()),
            paths=ambient.paths,
            notes=ambient.notes,
        )


@dataclass(frozen=True, slots=True, kw_only=True)
class KernelsLoaded(Event):
    """All kernels of frames were compiled, or loaded from disk."""


@dataclass(frozen=True, slots=True, kw_only=True)
class Warned(Event):
    """Pictures will be black, clipped or empty; docs/guide/troubleshooting.md lists the warnings."""

    text: str


@dataclass(frozen=True, slots=True, kw_only=True)
class HitsAllotted(Event):
    """Native hits were allotted for the target error of the job."""

    target: "Target"


@dataclass(frozen=True, slots=True, kw_only=True)
class FramesBegun(Event):
    """The first frame begins, and the array has a manifest."""


@dataclass(frozen=True, slots=True, kw_only=True)
class Chunks:
    """A camera path in chunks.

    Attributes:
        each: the cameras of every chunk, in rising order.
        more: additional hits of the halos, relative to a render in one run; 0 for one chunk.
    """

    each: tuple[tuple[int, ...], ...]
    more: float


@dataclass(frozen=True, slots=True, kw_only=True)
class ChunksBegun(Event):
    """The camera path was split into chunks, and workers begin; the array may have no manifest yet."""

    workers: int
    chunks: Chunks


@dataclass(frozen=True, slots=True, kw_only=True)
class TimeLeft(Event):
    """Expected duration of the rest; None: not known yet."""

    seconds: float | None


@dataclass(frozen=True, slots=True, kw_only=True)
class ImagesWritten(Event):
    """Further images are on disk."""

    images: int


@dataclass(frozen=True, slots=True, kw_only=True)
class Progress(Event):
    """Progress of a render from Python, at most ten times per second.

    Attributes:
        written: images on disk, of this run.
        wanted: images that this run renders.
        seconds_left: expected; None: not known yet.
    """

    written: int
    wanted: int
    seconds_left: float | None


@dataclass(frozen=True, slots=True, kw_only=True)
class FrameWritten(Event):
    """All files of a camera position are on disk and recorded, and can be read.

    Attributes:
        camera: c.
        images: number of its images; of a block of light positions, where memory limits a run to blocks.
    """

    camera: int
    images: int


@dataclass(frozen=True, slots=True, kw_only=True)
class Compiling(Event):
    """A kernel is being compiled, as on the first run on a machine: 15 to 30 seconds in all."""


@dataclass(frozen=True, slots=True, kw_only=True)
class Compiled(Event):
    """The first worker that compiled kernels is done."""

    kernels: int
    seconds: float


@dataclass(frozen=True, slots=True, kw_only=True)
class RenderResult:
    """Result of a render.

    Attributes:
        directory: folder of images and manifest.
        finished: whether every image of the array is there.
        written: images of this run; `there`: images on disk; `images`: in the array.
        seconds: of this run; `rays_per_pixel_image`: rays per pixel per image of this run, by kind.
        compile_seconds: time that this run spent compiling, part of `seconds`.
        array_seconds: of all runs that made the array, each until its last image.
        stage_seconds: of all threads that trace and compose, in this run, by stage; writing files is no stage.
        clipped, black: shares of the pixels of all pictures on disk, counted in a part of each; null where not known.
        standard_error: table of the manifest; null unless the job asks for it.
    """

    directory: str
    manifest: str
    finished: bool
    written: int
    there: int
    images: int
    seconds: float
    compile_seconds: float
    array_seconds: float
    stage_seconds: dict[str, float]
    clipped: float | None
    black: float | None
    rays_per_pixel_image: dict[str, float]
    hits_per_pixel: float
    peak_memory_bytes: int
    standard_error: dict[str, Any] | None


@dataclass(frozen=True, slots=True, kw_only=True)
class Finished(Event):
    """The render is done.

    Attributes:
        summary: images, time, rays and memory, as `framearray render --json` prints them.
        notes: about the result.
    """

    summary: RenderResult
    notes: tuple[str, ...]


def ignore(event: Event) -> None:
    """Receive events, and do nothing."""


def note(report: Report, lines: Iterable[str]) -> None:
    """Report lines as notes."""
    for line in lines:
        report(Noted(line=line))
