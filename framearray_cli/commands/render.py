"""`framearray render`."""

from collections.abc import Sequence
from contextlib import suppress
from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer

from ..compiling import compile_clock
from ..errors import OutputError
from ..screen import Screen, out, say, size
from ..wording import (
    ambient_lines,
    chunks_line,
    on_disk_lines,
    scene_lines,
    settings_lines,
    summary_lines,
    target_lines,
    workers_text,
)
from .options import MOST_THREADS, JobFile, Output, Quiet, Threads, frames_of, read

if TYPE_CHECKING:
    from ..auto import AutoSettings
    from ..job import Job
    from ..parts.chunks import Chunks
    from ..parts.run import WorkerOptions
    from ..prepare import Prepared
    from ..progress import AmbientFigures
    from ..resume import OnDisk
    from ..target import Target
    from ..terms.ambient import Ambient

LITTLE_SPACE = 64 * 1024 * 1024  # bytes; with less, a full disk is the likely reason of an error
FEW_FILES = 100  # fewer than a run has open, and leaves when it fails


def render(
    job_file: JobFile,
    threads: Threads = None,
    output: Output = None,
    cameras: Annotated[
        str | None,
        typer.Option("--cameras", help="Some frames of the camera path: 0-47, 0-47x3, 5,8-11.", metavar="RANGE"),
    ] = None,
    workers: Annotated[
        int | None,
        typer.Option(
            "--workers", min=1, max=MOST_THREADS, help="Processes that render parts side by side.", metavar="N"
        ),
    ] = None,
    dask: Annotated[
        str | None,
        typer.Option("--dask", help="Dask scheduler whose workers render: tcp://host:8786.", metavar="ADDRESS"),
    ] = None,
    chunk: Annotated[
        int | None,
        typer.Option("--chunk", min=1, help="Frames of a part, with --workers or --dask.", metavar="N"),
    ] = None,
    restart: Annotated[bool, typer.Option("--restart", help="Remove the frame array in the folder first.")] = False,
    quiet: Quiet = False,
) -> None:
    """Render every (camera, light) image of a job into a folder, with a manifest, or what is missing of them there."""
    job = read(job_file, threads, output)
    chosen = None if cameras is None else frames_of(cameras, job.camera.frames)
    render_shown(job, quiet=quiet, restart=restart, cameras=chosen, options=_worker_options(workers, dask, chunk))


def _worker_options(workers: int | None, dask: str | None, chunk: int | None) -> "WorkerOptions | None":
    """Which workers render; None: this process does."""
    if workers and dask is not None:
        raise typer.BadParameter("expected either --workers or --dask", param_hint="--workers")
    if not workers and dask is None:
        if chunk:
            raise typer.BadParameter("goes with --workers and --dask", param_hint="--chunk")
        return None
    if dask is not None and not dask.strip():  # most often a shell variable that is not set
        raise typer.BadParameter("expected an address, got none", param_hint="--dask")
    from ..parts.run import WorkerOptions

    return WorkerOptions(workers=workers or 1, address=dask, chunk=chunk)


def render_shown(
    job: "Job",
    *,
    quiet: bool,
    restart: bool = False,
    cameras: Sequence[int] | None = None,
    options: "WorkerOptions | None" = None,
) -> None:
    """Render, and show on the screen what goes on."""
    with Screen(out, quiet=quiet) as screen:
        screen.wait("reading the scene")
        from ..parts.progress import PartEvents
        from ..progress import ambient_figures
        from ..render import render as run

        class Shown(PartEvents):
            """Prints the scene, then the ambient light, then a progress bar."""

            told: tuple[str, ...] = ()

            def prepared(self, prepared: "Prepared") -> None:
                screen.say(scene_lines(prepared))
                screen.wait("looking at the output folder")

            def removed(self, files: int) -> None:
                if files:
                    screen.say([f"removed {files:,} files of the frame array in {job.output.directory}"])

            def resolved(self, settings: "AutoSettings") -> None:
                screen.say(settings_lines(settings))

            def scanning(self, files: int) -> None:
                screen.wait(f"looking whether {files:,} files are whole")

            def scanned(self, on_disk: "OnDisk", wanted: int) -> None:
                self.total = wanted
                screen.say(on_disk_lines(on_disk, wanted))
                screen.wait("estimating the ambient light")

            def planned(self, ambient: "Ambient") -> None:
                screen.say(ambient_lines(ambient_figures(ambient)))
                self.told = ambient.notes
                screen.count("rendering", self.total, "image")

            def allotted(self, target: "Target") -> None:
                screen.say(target_lines(target))

            def written(self, images: int) -> None:
                screen.advance(images)

            def starting_workers(self) -> None:
                screen.wait("starting workers")

            def awaiting_workers(self, address: str | None) -> None:
                screen.say([f"waiting for workers of {address or 'this machine'}"])

            def cut(self, workers: int, chunks: "Chunks") -> None:
                screen.say([f"{workers_text(workers)}, {chunks_line(chunks)}"])
                screen.count("rendering", self.total, "image")

            def ambient_known(self, figures: "AmbientFigures") -> None:
                screen.say(ambient_lines(figures))

            def target_known(self, target: "Target") -> None:
                screen.say(target_lines(target))

            def compiling(self) -> None:
                screen.compiling()

        shown = Shown()
        try:
            with compile_clock(screen.compiling):
                if options is None:
                    summary = run(job, shown, restart=restart, cameras=cameras)
                else:
                    from ..parts.run import render_in_parts

                    summary = render_in_parts(job, shown, options, restart=restart, cameras=cameras)
        except BaseException as error:
            if isinstance(error, OutputError):
                _add_space(error, job.output.directory)
            if screen.done:
                done = f"{screen.done:,} of {screen.total:,} images were written to {job.output.directory}"
                error.add_note(f"{done}; the same command goes on with the rest")
            raise
    if not quiet:
        say(out, summary_lines(summary, shown.told, job))


def _add_space(error: OutputError, folder: Path) -> None:
    """Say it where little space is left on the disk that could not be written to."""
    from ..outfolder import free_files, free_space

    with suppress(OSError):  # that disk may have gone
        if (free := free_space(folder)) < LITTLE_SPACE:
            error.add_note(f"{size(free)} are free on that disk")
        if (files := free_files(folder)) is not None and files < FEW_FILES:
            error.add_note(f"that disk takes {files} more files (inodes)")
