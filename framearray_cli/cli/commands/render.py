"""`framearray render`."""

from collections.abc import Sequence
from contextlib import suppress
from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer

from framearray_cli.array.places import read_indices
from framearray_cli.base.errors import OutputError
from framearray_cli.base.units import MOST_THREADS, agree, counted, size
from framearray_cli.render.messages import (
    ambient_lines,
    chunks_line,
    on_disk_lines,
    scene_lines,
    settings_lines,
    summary_lines,
    target_lines,
    warning_lines,
    workers_text,
)
from framearray_cli.render.parts.progress import PartEvents
from framearray_cli.render.progress import ambient_figures

from ..document import outcome
from ..options import (
    At,
    Cameras,
    DryRun,
    JobFile,
    Json,
    Light,
    Output,
    Quiet,
    Sets,
    Strict,
    Threads,
    load_job,
    refuse_warnings,
)
from ..screen import Screen, err, print_result, print_would
from ..values import whole
from .preview import preview_on_screen, refuse_conflicts

if TYPE_CHECKING:
    from framearray_cli.array.integrity import OnDisk
    from framearray_cli.engine.terms.ambient.estimate import Ambient
    from framearray_cli.job.job import Job
    from framearray_cli.render.automatic.choose import AutoSettings
    from framearray_cli.render.parts.chunks import Chunks
    from framearray_cli.render.parts.run import WorkerOptions
    from framearray_cli.render.prepare import Prepared
    from framearray_cli.render.progress import AmbientFigures
    from framearray_cli.render.target.pilot import Target

    from ..results import RenderResult

LITTLE_SPACE = 64 * 1024 * 1024  # bytes; with less, a full disk is the likely cause of an error
FEW_FILES = 100  # fewer than a run has open, and leaves free when it fails


def render(
    job_file: JobFile,
    threads: Threads = None,
    output: Output = None,
    sets: Sets = None,
    cameras: Cameras = None,
    preview: Annotated[
        bool,
        typer.Option(
            "--preview",
            help="Render only one small picture, within seconds, beside the folder; --cameras and --light choose it.",
        ),
    ] = False,
    light: Light = None,
    at: At = None,
    workers: Annotated[
        int | None,
        typer.Option(
            "--workers", parser=whole(1, MOST_THREADS), help="Processes that render parts side by side.", metavar="N"
        ),
    ] = None,
    dask: Annotated[
        str | None,
        typer.Option("--dask", help="Dask scheduler whose workers render: tcp://host:8786.", metavar="ADDRESS"),
    ] = None,
    chunk: Annotated[
        int | None,
        typer.Option(
            "--chunk", parser=whole(1), help="Positions per part, at most; with --workers or --dask.", metavar="N"
        ),
    ] = None,
    strict: Strict = False,
    restart: Annotated[bool, typer.Option("--restart", help="Remove the frame array in the folder first.")] = False,
    dry_run: DryRun = False,
    force: Annotated[bool, typer.Option("--force", help="With --preview: replace an existing picture.")] = False,
    quiet: Quiet = False,
    json: Json = False,
) -> None:
    """Render every image of a job into a folder, with a manifest; skip those that are there."""
    others = {
        "--workers": workers,
        "--dask": dask,
        "--chunk": chunk,
        "--restart": restart,
        "--strict": strict,
        "--dry-run": dry_run,
    }
    refuse_conflicts(preview, others, {"--light": light, "--at": at, "--force": force})
    job = load_job(job_file, threads, None if preview else output, sets)
    if preview:
        preview_on_screen(job, output, cameras=cameras, light=light, at=at or (), force=force, quiet=quiet)
        return
    chosen = None if cameras is None else sorted(read_indices("--cameras", cameras, job.camera.frames))
    options = _worker_options(workers, dask, chunk)
    if dry_run:
        print_planned(job, restart=restart, cameras=chosen)
        return
    render_on_screen(job, quiet=quiet, strict=strict, restart=restart, cameras=chosen, options=options)


def print_planned(job: "Job", *, restart: bool, cameras: Sequence[int] | None) -> None:
    """Print what a render would do."""
    from framearray_cli.render.dry_run import plan_render, planned_lines

    with Screen(err) as screen:
        screen.wait("reading the scene and the output folder")
        with screen.compiling():
            planned = plan_render(job, restart=restart, cameras=cameras)
    print_would(planned_lines(planned, job))


def _worker_options(workers: int | None, dask: str | None, chunk: int | None) -> "WorkerOptions | None":
    """Return the options of the workers that render; None: this process renders."""
    if workers and dask is not None:
        raise typer.BadParameter("expected either --workers or --dask", param_hint="--workers")
    if not workers and dask is None:
        if chunk:
            raise typer.BadParameter("needs --workers or --dask", param_hint="--chunk")
        return None
    if dask is not None and not dask.strip():  # usually an unset shell variable
        raise typer.BadParameter("expected an address, got none", param_hint="--dask")
    from framearray_cli.render.parts.run import WorkerOptions

    return WorkerOptions(workers=workers or 1, address=dask, chunk=chunk)


def render_on_screen(
    job: "Job",
    *,
    quiet: bool,
    strict: bool = False,
    restart: bool = False,
    cameras: Sequence[int] | None = None,
    options: "WorkerOptions | None" = None,
    repairs: bool = False,
) -> "RenderResult | None":
    """Render, show the progress on the screen, and print the summary; return the result if `--json` wants it.

    Args:
        repairs: whether damaged files were listed already.
    """
    with Screen(err, quiet=quiet) as screen:
        screen.wait("reading the scene")
        # first: in the other order Python takes and returns memory thousands of times while numba loads, for 0.13 s
        from framearray_cli.render.render import render as run  # isort: skip
        from framearray_cli.render.beside import offer_for

        offer_for(job)
        events = RenderingEvents(screen, job, strict=strict, repairs=repairs)
        try:
            with screen.compiling():
                if options is None:
                    summary = run(job, events, restart=restart, cameras=cameras)
                else:
                    from framearray_cli.render.parts.run import render_in_parts

                    summary = render_in_parts(job, events, options, restart=restart, cameras=cameras)
        except BaseException as error:
            if isinstance(error, OutputError):
                _add_space(error, job.output.directory)
            if screen.done:
                done = f"{screen.done:,} of {counted(screen.total, 'image')} {agree(screen.done, 'was', 'were')}"
                error.add_note(f"{done} written to {job.output.directory}; the same command goes on with the rest")
            raise
    result = None
    if outcome.wanted:
        from ..describe import render_result  # takes long to import

        result = render_result(summary, job, screen.compile_seconds)
    print_result(summary_lines(summary, events.printed, job), result, quiet=quiet)
    return result


class RenderingEvents(PartEvents):
    """Print the scene, then the ambient light, then a progress bar.

    Attributes:
        printed: notes that were printed.
    """

    def __init__(self, screen: Screen, job: "Job", *, strict: bool = False, repairs: bool = False) -> None:
        self._screen, self._job, self._strict, self._repairs = screen, job, strict, repairs
        self._total = 0
        self.printed: tuple[str, ...] = ()

    def prepared(self, prepared: "Prepared") -> None:
        self._screen.say(scene_lines(prepared))
        self._screen.wait("reading the output folder")

    def removed(self, files: int) -> None:
        if files:
            self._screen.say([f"removed {counted(files, 'file')} of the frame array in {self._job.output.directory}"])

    def rewriting(self, files: int) -> None:
        if files:
            rate = f"output.fps is {self._job.output.fps:g} now"
            self._screen.say([f"{rate}: rewriting the headers of {counted(files, 'file')}, whose pixels stay"])

    def keeping_compression(self, compression: str) -> None:
        line = f"output.compression is {compression} now: files that are there keep theirs, which holds the same pixels"
        self._screen.say([line])

    def resolved(self, settings: "AutoSettings") -> None:
        self._screen.say(settings_lines(settings))

    def scanning(self, files: int) -> None:
        self._screen.wait(f"comparing {counted(files, 'file')} with {agree(files, 'its checksum', 'their checksums')}")

    def scanned(self, on_disk: "OnDisk", wanted: int) -> None:
        self._total = wanted
        self._screen.say(on_disk_lines(on_disk, wanted, damaged=not self._repairs))
        self._screen.wait("estimating the ambient light")

    def planned(self, ambient: "Ambient") -> None:
        self._screen.say(ambient_lines(ambient_figures(ambient)))
        self.printed = ambient.notes
        self._screen.wait("loading kernels")

    def loaded(self) -> None:
        self._screen.compiled()
        self._screen.wait("preparing frames")

    def tracing(self) -> None:
        self._screen.count("rendering", self._total, "image", timed=True)

    def expected(self, seconds: float | None) -> None:
        self._screen.expect(seconds)

    def warned(self, warnings: tuple[str, ...]) -> None:
        if self._strict:
            refuse_warnings(self._job.file or self._job.name, warnings)
        self._screen.say(warning_lines(warnings))

    def allotted(self, target: "Target") -> None:
        self._screen.say(target_lines(target))

    def written(self, images: int) -> None:
        self._screen.advance(images)

    def starting_workers(self) -> None:
        self._screen.wait("starting workers")

    def awaiting_workers(self, address: str | None) -> None:
        self._screen.say([f"waiting for workers of {address or 'this machine'}"])

    def chunked(self, workers: int, chunks: "Chunks") -> None:
        self._screen.say([f"{workers_text(workers)}, {chunks_line(chunks)}"])
        self._screen.count("rendering", self._total, "image", timed=True)

    def ambient_known(self, figures: "AmbientFigures") -> None:
        self._screen.say(ambient_lines(figures))

    def target_known(self, target: "Target") -> None:
        self._screen.say(target_lines(target))

    def compiling(self) -> None:
        self._screen.say(["workers compile kernels for their machines"])

    def compiled(self, kernels: int, seconds: float) -> None:
        self._screen.report_compiled(kernels, seconds)


def _add_space(error: OutputError, folder: Path) -> None:
    """Add to an error how little space is left on the disk that could not be written to."""
    from framearray_cli.array.folder import free_files, free_space

    with suppress(OSError):  # that disk may have gone
        if (free := free_space(folder)) < LITTLE_SPACE:
            error.add_note(f"{size(free)} are free on that disk")
        if (files := free_files(folder)) is not None and files < FEW_FILES:
            error.add_note(f"that disk takes {counted(files, 'more file')} (inodes)")
