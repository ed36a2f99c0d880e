"""The JSON document of `--json`: the result of each command as typed data, and the schema of the document around it.

Numbers have the unit that their name says. A field that a command could not find out is null. Fields are only ever
added; `framearray schema results` prints the JSON Schema that is made of these classes.
"""

from dataclasses import dataclass, fields
from typing import TYPE_CHECKING, Any

from framearray_cli.engine.embree.library import packet_width
from framearray_cli.render.events import AmbientEstimated, RenderResult
from framearray_cli.tools import AssembleResult, ExportResult, SheetResult

if TYPE_CHECKING:
    from framearray_cli.render.estimate import Estimate


@dataclass(frozen=True, slots=True, kw_only=True)
class PageResult:
    """The page that `view --export` wrote; `pictures`: prepared; `damaged`: images that could not be read."""

    directory: str
    size_bytes: int
    pictures: int
    damaged: int


@dataclass(frozen=True, slots=True, kw_only=True)
class ServerResult:
    """The address of the page that `view` shows; the document is printed when it opens, and the command goes on."""

    url: str
    pictures: int


@dataclass(frozen=True, slots=True, kw_only=True)
class ReportResult:
    """Result of `report`; `page`: file to open in a browser; `table`: the figures, as in `table.toml` next to it."""

    directory: str
    page: str
    table: dict[str, Any]


@dataclass(frozen=True, slots=True, kw_only=True)
class GroupSize:
    """A group of light sources, and the number of its positions."""

    name: str
    positions: int


@dataclass(frozen=True, slots=True, kw_only=True)
class SceneCounts:
    """Contents of a scene file; `dropped`: triangles left out, by reason."""

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
        images_per_camera: images of each camera position; with groups of all groups, and the images of ambient
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
    """Result of `check`.

    Attributes:
        directory: folder of the images.
        automatic, target: what was chosen for "auto" and samples.error, as in the manifest; null without.
        parts: number of strips of rows, times blocks of light positions, that are rendered one after the other.
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
    parts: int
    disk_bytes: int
    free_disk_bytes: int
    seconds: float
    rays_together: int


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
    """Result of `verify`, before any repair.

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
class KernelCache:
    """Compiled kernels of this version; `folder` is null, and `problem` says why, where they cannot be kept.

    Attributes:
        processor: that kernels are compiled for, in LLVM's words.
        kernels, size_bytes: in the folder.
        ready_made, ready_made_bytes: in the package, for this processor.
    """

    processor: str
    folder: str | None
    kernels: int
    size_bytes: int
    ready_made: int
    ready_made_bytes: int
    problem: str | None


@dataclass(frozen=True, slots=True, kw_only=True)
class CompileResult:
    """Result of `compile`; `compiled`: kernels that were not there."""

    compiled: int
    seconds: float
    kernels: KernelCache


# The types of each command's result.
RESULTS: dict[str, tuple[type, ...]] = {
    "init": (InitResult,),
    "check": (CheckResult,),
    "render": (RenderResult, PreviewResult),
    "verify": (VerifyResult,),
    "assemble": (AssembleResult,),
    "still": (AssembleResult,),
    "sheet": (SheetResult,),
    "export": (ExportResult,),
    "view": (PageResult, ServerResult),
    "report": (ReportResult,),
    "compile": (CompileResult,),
}


def check_result(estimate: "Estimate") -> CheckResult:
    """Describe what `check` found."""
    from framearray_cli.base.sundays import sun_days

    prepared, figures = estimate.prepared, AmbientEstimated.of(estimate.ambient)
    report = prepared.scene.report
    return CheckResult(
        name=prepared.job.name,
        directory=str(prepared.job.output.directory),
        scene=SceneCounts(
            file=str(prepared.job.scene.file),
            triangles=report.triangles,
            materials=report.materials,
            textures=report.textures,
            dropped=dict(report.dropped),
        ),
        array=ArraySize(
            cameras=prepared.n_cameras,
            images_per_camera=prepared.n_lights,
            images=prepared.n_cameras * prepared.n_lights,
            resolution=prepared.job.camera.resolution,
            groups=tuple(GroupSize(name=one.name, positions=len(one.positions)) for one in prepared.lights.groups),
            days=tuple(
                StudyDay(
                    axis=axis,
                    first=day.lights[0],
                    last=day.lights[-1],
                    start=day.moments[0].isoformat(),
                    stop=day.moments[-1].isoformat(),
                )
                for axis, moments in prepared.job.light.moments.items()
                for day in sun_days(moments)
            ),
        ),
        ambient=AmbientLight(**{field.name: getattr(figures, field.name) for field in fields(AmbientLight)}),
        automatic=estimate.settings.table() if estimate.settings else None,
        target=estimate.target.table() if estimate.target else None,
        memory_bytes=int(estimate.memory),
        free_memory_bytes=int(estimate.available),
        parts=len(estimate.division.blocks) * len(estimate.division.strips),
        disk_bytes=int(estimate.disk),
        free_disk_bytes=int(estimate.free),
        seconds=float(estimate.seconds),
        rays_together=packet_width(),
    )
