"""`framearray render`."""

from collections.abc import Sequence
from contextlib import suppress
from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer

from ..compiling import compile_clock
from ..errors import OutputError
from ..screen import Screen, out, say, size
from ..wording import ambient_lines, found_lines, scene_lines, summary_lines
from .options import MOST_THREADS, JobFile, Output, Quiet, Threads, frames_of, read

if TYPE_CHECKING:
    from ..auto import Choice
    from ..job import Job
    from ..parts.run import Hands
    from ..prepare import Prepared
    from ..resume import Found
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
    render_shown(job, quiet=quiet, restart=restart, cameras=chosen, hands=_hands(workers, dask, chunk))


def _hands(workers: int | None, dask: str | None, chunk: int | None) -> "Hands | None":
    """Who renders; None: this process."""
    if workers and dask is not None:
        raise typer.BadParameter("expected either --workers or --dask", param_hint="--workers")
    if not workers and dask is None:
        if chunk:
            raise typer.BadParameter("goes with --workers and --dask", param_hint="--chunk")
        return None
    if dask is not None and not dask.strip():  # most often a shell variable that is not set
        raise typer.BadParameter("expected an address, got none", param_hint="--dask")
    from ..parts.run import Hands

    return Hands(workers=workers or 1, address=dask, chunk=chunk)


def render_shown(
    job: "Job",
    *,
    quiet: bool,
    restart: bool = False,
    cameras: Sequence[int] | None = None,
    hands: "Hands | None" = None,
) -> None:
    """Render, and show on the screen what goes on."""
    with Screen(out, quiet=quiet) as screen:
        screen.wait("reading the scene")
        from ..render import Listener
        from ..render import render as run

        class Shown(Listener):
            """Prints the scene, then the ambient light, then a progress bar."""

            told: tuple[str, ...] = ()

            def prepared(self, prepared: "Prepared") -> None:
                screen.say(scene_lines(prepared))
                screen.wait("looking at the output folder")

            def removed(self, files: int) -> None:
                if files:
                    screen.say([f"removed {files:,} files of the frame array in {job.output.directory}"])

            def settled(self, choice: "Choice") -> None:
                screen.say(choice.lines())

            def looking(self, files: int) -> None:
                screen.wait(f"looking whether {files:,} files are whole")

            def found(self, found: "Found", wanted: int) -> None:
                self.total = wanted
                screen.say(found_lines(found, wanted))
                screen.wait("estimating the ambient light")

            def planned(self, ambient: "Ambient") -> None:
                screen.say(ambient_lines(ambient))
                self.told = ambient.notes
                screen.count("rendering", self.total, "image")

            def aimed(self, target: "Target") -> None:
                screen.say(target.lines())

            def written(self, images: int) -> None:
                screen.advance(images)

            def waits(self, what: str) -> None:
                screen.wait(what)

            def handed_out(self, line: str) -> None:
                screen.say([line])
                screen.count("rendering", self.total, "image")

            def heard(self, lines: Sequence[str]) -> None:
                screen.say(lines)

            def compiling(self) -> None:
                screen.compiling()

        shown = Shown()
        try:
            with compile_clock(screen.compiling):
                if hands is None:
                    summary = run(job, shown, restart=restart, cameras=cameras)
                else:
                    from ..parts.run import render_in_parts

                    summary = render_in_parts(job, shown, hands, restart=restart, cameras=cameras)
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
