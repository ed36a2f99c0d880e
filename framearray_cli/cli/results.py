"""What `--json` prints: the result of each command as typed data, and the schema of the document around it.

Numbers have the unit that their name says. A field that a command could not find out is null. Fields are only ever
added; `framearray schema results` prints the JSON Schema that is made of these classes.
"""

from dataclasses import dataclass
from typing import Any

from .array_results import AssembleResult, ExportResult, PageResult, ServerResult, SheetResult
from .machine_report import DoctorResult
from .report_result import ReportResult


@dataclass(frozen=True, slots=True, kw_only=True)
class GroupSize:
    """A group of light sources, and the number of its positions."""

    name: str
    positions: int


@dataclass(frozen=True, slots=True, kw_only=True)
class SceneCounts:
    """What was read from a scene file; `dropped`: triangles left out, by reason."""

    file: str
    triangles: int
    materials: int
    textures: int
    dropped: dict[str, int]


@dataclass(frozen=True, slots=True, kw_only=True)
class StudyDay:
    """A day of a sun study: the light axis, its first and last position, and their local date and time, ISO 8601."""

    axis: str
    first: int
    last: int
    start: str
    stop: str


@dataclass(frozen=True, slots=True, kw_only=True)
class ArraySize:
    """The size of an array.

    Attributes:
        images_per_camera: images of each camera position; with groups those of all groups, and the images of ambient
            light and background.
        images: number in the array.
        resolution: width and height, pixels.
        groups: empty unless the job has groups of sources.
        days: of suns; empty without.
    """

    cameras: int
    images_per_camera: int
    images: int
    resolution: tuple[int, int]
    groups: tuple[GroupSize, ...]
    days: tuple[StudyDay, ...]


@dataclass(frozen=True, slots=True, kw_only=True)
class AmbientLight:
    """The ambient light at the darkest and brightest light position, radiance; its largest relative error."""

    lowest: float
    highest: float
    error: float
    paths: int


@dataclass(frozen=True, slots=True, kw_only=True)
class CheckResult:
    """What `check` found.

    Attributes:
        directory: folder of the images.
        automatic, target: what was chosen for "auto" and samples.error, as in the manifest; null without.
        blocks: number of blocks of light positions that are rendered one after the other.
        rays_together: rays that Embree traces together on this machine: 16, 8 or 4.
    """

    name: str
    directory: str
    scene: SceneCounts
    array: ArraySize
    ambient: AmbientLight
    automatic: dict[str, Any] | None
    target: dict[str, Any] | None
    memory_bytes: int
    free_memory_bytes: int
    blocks: int
    disk_bytes: int
    free_disk_bytes: int
    seconds: float
    rays_together: int


@dataclass(frozen=True, slots=True, kw_only=True)
class RenderResult:
    """What a render did.

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
class PreviewResult:
    """The picture of `render --preview`.

    Attributes:
        preview: the file.
        lights: position along each light axis.
        size: width and height, pixels.
    """

    preview: str
    camera: int
    lights: dict[str, int]
    size: tuple[int, int]


@dataclass(frozen=True, slots=True, kw_only=True)
class DamagedFile:
    """A file that was whole once, relative to the folder of the array."""

    file: str
    problem: str


@dataclass(frozen=True, slots=True, kw_only=True)
class UnfinishedCamera:
    """A camera position that lacks files that were never finished."""

    camera: int
    files: int


@dataclass(frozen=True, slots=True, kw_only=True)
class VerifyResult:
    """What `verify` found, before any repair.

    Attributes:
        whole: whether every file is there and unchanged, and all have light from the same cells.
        files: in the array; `unknown`: whole, but without a checksum to compare them with.
        mixed_cells: whether images have light from different cells, which `--repair` does not mend.
        repaired: what `--repair` rendered; null without.
    """

    directory: str
    name: str
    whole: bool
    files: int
    unknown: int
    mixed_cells: bool
    damaged: tuple[DamagedFile, ...]
    unfinished: tuple[UnfinishedCamera, ...]
    repaired: RenderResult | None = None


@dataclass(frozen=True, slots=True, kw_only=True)
class InitResult:
    """The job that `init` wrote.

    Attributes:
        inside: whether the scene was taken for a room.
        about: what `init` found.
        notes: what of the scene was not understood or was approximated.
    """

    job: str
    scene: str
    cameras: int
    lights: int
    images: int
    inside: bool
    about: tuple[str, ...]
    notes: tuple[str, ...]


@dataclass(frozen=True, slots=True, kw_only=True)
class TemplateResult:
    """The template that `openjd` wrote.

    Attributes:
        template: the file; "-" for standard output.
        chunks: number of chunks of at most `chunk` camera positions.
        more_hits: hits of halos over those of the whole path.
    """

    template: str
    chunks: int
    chunk: int
    more_hits: float


@dataclass(frozen=True, slots=True, kw_only=True)
class Document:
    """One document per command, on standard output, also where the command fails.

    Attributes:
        framearray: version of the program.
        command: its name; "" where the command line names none.
        exit_code: of the process.
        problems: what ended the command; empty if nothing did.
        warnings, notes: as printed on standard error.
        result: of the command; null where it ended before there was one.
    """

    framearray: str
    command: str
    exit_code: int
    problems: tuple[str, ...]
    warnings: tuple[str, ...]
    notes: tuple[str, ...]
    result: Any


@dataclass(frozen=True, slots=True, kw_only=True)
class DryRunResult:
    """What a command would do, of which `--dry-run` does nothing: a line for each thing."""

    would: tuple[str, ...]


# The types of each command's result.
RESULTS: dict[str, tuple[type, ...]] = {
    "init": (InitResult, DryRunResult),
    "check": (CheckResult,),
    "render": (RenderResult, PreviewResult, DryRunResult),
    "verify": (VerifyResult,),
    "assemble": (AssembleResult, DryRunResult),
    "sheet": (SheetResult, DryRunResult),
    "export": (ExportResult, DryRunResult),
    "view": (PageResult, ServerResult),
    "report": (ReportResult,),
    "openjd": (TemplateResult,),
    "doctor": (DoctorResult,),
}
