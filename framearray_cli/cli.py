"""The command line: each command parses, calls one function, prints. Only this file ends the process."""

import io
import os
import signal
import sys
import threading
from collections.abc import Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any, NoReturn

import typer
from rich.console import Console

from . import __version__
from .compiling import compile_clock, is_compiling
from .errors import FrameArrayError, JobError, OutputError
from .screen import Screen, duration, say, size

if TYPE_CHECKING:
    from types import FrameType

    from .auto import Choice
    from .job import Job
    from .prepare import Prepared
    from .render import Summary
    from .report import Report
    from .report.case import Case
    from .terms.ambient import Ambient

OUT_OF_MEMORY = 2  # the job asks for more than the machine has
LITTLE_SPACE = 64 * 1024 * 1024  # bytes; with less, a full disk is the likely reason of an error
PATIENCE = 1.0  # seconds that threads get to end by themselves after a signal
# Callbacks from C and optional imports, in which every exception is caught.
FORGETFUL = ("numba", "llvmlite", "importlib", "_frozen_importlib", "_frozen_importlib_external")
MOST_THREADS = 1024  # as in the job file

app = typer.Typer(
    name="framearray",
    help="Render frame arrays: every image of an animated camera under every position of an animated light.",
    pretty_exceptions_enable=False,
    add_completion=False,
    rich_markup_mode=None,  # plain text, also in a log file
)
out, err = Console(), Console(stderr=True)

JobFile = Annotated[Path, typer.Argument(metavar="JOB", help="Job file, TOML.", show_default=False)]
Threads = Annotated[
    int | None,
    typer.Option(
        "--threads", min=1, max=MOST_THREADS, help="Threads; default: the job's, else one for each core.", metavar="N"
    ),
]
Output = Annotated[
    str | None,
    typer.Option("--output", "-o", help="Folder for the images, instead of the job's.", metavar="FOLDER"),
]
Quiet = Annotated[bool, typer.Option("--quiet", "-q", help="Print nothing but errors.")]


class Stopped(BaseException):
    """A signal asked the program to end, as Ctrl-C does."""

    def __init__(self, signum: int) -> None:
        super().__init__(signum)
        # what shells expect of a program that a signal ended
        self.exit_code = 128 + signum
        self.word = "interrupted" if signum == signal.SIGINT else "terminated"


def _version(wanted: bool) -> None:
    if wanted:
        say(out, [f"framearray {__version__}"])
        raise typer.Exit


@app.callback()
def _options(
    version: Annotated[
        bool, typer.Option("--version", callback=_version, is_eager=True, help="Print the version.")
    ] = False,
) -> None:
    pass


@app.command()
def render(
    job_file: JobFile,
    threads: Threads = None,
    output: Output = None,
    restart: Annotated[bool, typer.Option("--restart", help="Remove the frame array in the folder first.")] = False,
    quiet: Quiet = False,
) -> None:
    """Render every (camera, light) image of a job into a folder, with a manifest."""
    job = _job(job_file, threads, output)
    with Screen(out, quiet=quiet) as screen:
        screen.wait("reading the scene")
        from .outfolder import free_space
        from .render import Listener
        from .render import render as run

        class Shown(Listener):
            """Prints the scene, then the ambient light, then a progress bar."""

            def prepared(self, prepared: "Prepared") -> None:
                screen.say(_scene_lines(prepared))
                screen.wait("estimating the ambient light")
                self.total = prepared.n_cameras * prepared.n_lights

            def removed(self, files: int) -> None:
                if files:
                    screen.say([f"removed {files:,} files of the frame array in {job.output.directory}"])

            def settled(self, choice: "Choice") -> None:
                screen.say(choice.lines())

            def planned(self, ambient: "Ambient") -> None:
                screen.say(_ambient_lines(ambient))
                self.told = ambient.notes
                screen.count("rendering", self.total, "image")

            def written(self, images: int) -> None:
                screen.advance(images)

        shown = Shown()
        try:
            with compile_clock(screen.compiling):
                summary = run(job, shown, restart=restart)
        except BaseException as error:
            if isinstance(error, OutputError) and (free := free_space(job.output.directory)) < LITTLE_SPACE:
                error.add_note(f"{size(free)} are free on that disk")
            if screen.done:
                done = f"{screen.done:,} of {screen.total:,} images are in {job.output.directory}"
                error.add_note(f"{done}; its manifest says that it is not finished")
            raise
    if not quiet:
        say(out, _summary_lines(summary, shown.told, job))


@app.command()
def check(job_file: JobFile, threads: Threads = None, output: Output = None) -> None:
    """Validate a job and its scene, and tell its size, memory, disk and time, without rendering it."""
    job = _job(job_file, threads, output)
    with Screen(out) as screen:
        screen.wait("reading the scene and rendering a few small frames")
        from .check import check as run

        with compile_clock(screen.compiling):
            estimate = run(job)
    n_c, n_l = estimate.prepared.n_cameras, estimate.prepared.n_lights
    width, height = job.camera.resolution
    say(out, _scene_lines(estimate.prepared))
    say(out, estimate.choice.lines() if estimate.choice else [])
    say(out, _ambient_lines(estimate.ambient))
    say(
        out,
        [
            f"array: {n_c:,} cameras x {n_l:,} lights = {n_c * n_l:,} images of {width} x {height}",
            f"memory: about {size(estimate.memory)}, {size(estimate.available)} free{_blocks(estimate.blocks)}",
            f"disk: about {size(estimate.disk)} in {job.output.directory}, {size(estimate.free)} free",
            f"time: about {duration(estimate.seconds)} on this machine",
            *(f"warning: {warning}" for warning in estimate.warnings),
        ],
    )


@app.command()
def assemble(
    array: Annotated[Path, typer.Argument(metavar="OUT", help="Folder that `render` wrote.", show_default=False)],
    path_file: Annotated[Path, typer.Argument(metavar="PATH", help="Movie path, TOML.", show_default=False)],
    target: Annotated[
        str,
        typer.Option(
            "--output",
            "-o",
            help="movie.mp4 (.mov, .mkv, .webm) or a sequence: frame.####.png",
            metavar="FILE",
            show_default=False,
        ),
    ],
    exposure: Annotated[
        float,
        typer.Option("--exposure", min=-64, max=64, help="Stops added to movies, PNG and JPEG.", metavar="STOPS"),
    ] = 0.0,
    quiet: Quiet = False,
) -> None:
    """Cut a movie or an image sequence out of a frame array."""
    from .assemble import assemble as run

    with Screen(out, quiet=quiet) as screen:

        def progress(done: int, total: int) -> None:
            if not screen.total:
                screen.count("assembling", total, "frame")
            screen.advance()

        try:
            result = run(array, path_file, _place(target), exposure=exposure, progress=progress)
        except JobError as error:
            _fail(_problems(error, "nothing was written"), error.exit_code)
    if not quiet:
        rate = f"{float(result.fps):g} frames a second"
        say(out, [f"{result.target}: {result.n_frames} frames from {result.n_images} images, {rate}"])


@app.command()
def report(
    job_file: JobFile,
    folder: Annotated[
        Path | None,
        typer.Option("--output", "-o", help="Folder of the report; default: beside the images.", metavar="FOLDER"),
    ] = None,
    camera: Annotated[
        list[int] | None, typer.Option("--camera", help="A camera to look at; may be repeated.", metavar="C")
    ] = None,
    light: Annotated[
        list[int] | None, typer.Option("--light", help="A light position to look at; may be repeated.", metavar="L")
    ] = None,
    vary: Annotated[
        list[str] | None,
        typer.Option(
            "--vary", help="Values of a setting to try: samples.hits=1,2,4; may be repeated.", metavar="KEY=VALUES"
        ),
    ] = None,
    error: Annotated[
        list[float] | None,
        typer.Option(
            "--error", min=1e-6, help="RMSE to find the cheapest settings for: 0.05; may be repeated.", metavar="E"
        ),
    ] = None,
    times: Annotated[
        float, typer.Option("--times", min=1, help="Samples of a reference over those of a picture.", metavar="N")
    ] = 100.0,
    threads: Threads = None,
    quiet: Quiet = False,
) -> None:
    """Measure what each setting of a job buys and costs: speed against error, as a page with tables and plots."""
    job = _job(job_file, threads, None)
    with Screen(out, quiet=quiet) as screen:
        screen.wait("reading the scene")
        from . import report as reporting

        class Shown(reporting.Listener):
            """Prints the scene, then a progress bar."""

            def opened(self, case: "Case") -> None:
                screen.say(_scene_lines(case.prepared))

            def planned(self, references: int, settings: int) -> None:
                screen.count("measuring", references + settings, "step")

            def done(self) -> None:
                screen.advance()

        wish = reporting.Wish(
            cameras=camera or (),
            lights=light or (),
            vary=dict(reporting.read_vary(option, job) for option in vary or ()),
            errors=error or (),
            times=times,
        )
        place = folder.absolute() if folder else job.output.directory.with_name(f"{job.output.directory.name}-report")
        with compile_clock(screen.compiling):
            made = reporting.make_report(job, place, wish, Shown())
        reporting.write_report(made)
    if not quiet:
        say(out, _report_lines(made))


@app.command()
def schema() -> None:
    """Print the JSON Schema of job files, for editors that complete and check them."""
    import json

    from .jobfile import job_schema

    say(out, json.dumps(job_schema(), indent=2).splitlines())


def _job(job_file: Path, threads: int | None, output: str | None) -> "Job":
    """Read a job file; options replace what it says."""
    from .jobfile import read_job

    job = read_job(job_file)
    updates: dict[str, Any] = {}
    if threads is not None:
        updates["render"] = job.render.model_copy(update={"threads": threads})
    if output is not None:
        updates["output"] = job.output.model_copy(update={"directory": _place(output).absolute()})
    return job.model_copy(update=updates)


def _blocks(n: int) -> str:
    return f"; the lights are rendered in {n} blocks, one after the other" if n > 1 else ""


def _place(name: str) -> Path:
    """A file or folder to write to."""
    if not name.strip():  # most often a shell variable that is not set; Path would make "." of it
        raise typer.BadParameter("expected a name, got none", param_hint="--output")
    return Path(name)


def _scene_lines(prepared: "Prepared") -> list[str]:
    from .scene import report_lines

    return report_lines(prepared.scene.report, prepared.job.scene.file)


def _ambient_lines(ambient: "Ambient") -> list[str]:
    mean = ambient.intensity.mean(axis=1)
    error = ambient.standard_error.max()
    known = f"standard error at most {error:.1%}, {ambient.paths:,} paths" if error > 0 else "fixed, or nothing arrives"
    return [
        f"ambient light: I_A {mean.min():.4g} to {mean.max():.4g} ({known})",
        *(f"  note: {note}" for note in ambient.notes),
    ]


def _summary_lines(summary: "Summary", told: Sequence[str], job: "Job") -> list[str]:
    """What a render took.

    Args:
        told: notes that were printed before.
    """
    kinds = summary.rays_per_pixel_image
    mirrors = sum(n for kind, n in kinds.items() if "mirror" in kind or kind == "pilot")
    rays = sum(kinds.values()) - mirrors - kinds["ambient"]
    rate = sum(summary.rays.values()) / summary.seconds / 1e6
    beside = f" + {mirrors:.2f} for mirrors" if mirrors else ""
    each = f"{1e3 * summary.seconds / summary.images:.1f} ms an image"
    return [
        f"{summary.images:,} images in {duration(summary.seconds)}: {each}, "
        f"{summary.images / summary.seconds:.1f} images a second",
        f"{rays:.2f} rays a pixel an image{beside}, {rate:.1f} Mrays/s, "
        f"{summary.hits:.1f} hits a pixel, peak memory {size(summary.peak_memory)}",
        *_error_lines(summary),
        *(f"note: {note}" for note in summary.notes if note not in told),
        f"images and manifest: {job.output.directory}",
    ]


def _error_lines(summary: "Summary") -> list[str]:
    """How noisy the images are, where the job asks."""
    found = summary.standard_error
    if not found:
        return []
    where = f"camera {found['camera']}, light {found['light']}"
    return [
        f"standard error {found['rms']:.3g}, {found['relative']:.1%} of the mean radiance; "
        f"the largest of an image {found['largest']:.3g} ({where})"
    ]


def _report_lines(made: "Report") -> list[str]:
    """What a report found: the job's own settings, and the cheapest ones for some errors."""
    from .report import advice_lines

    own = made.measured[0]
    lines = [f"as the job says: {own.ms:.3g} ms an image before writing, RMSE {own.quality.rmse:.1%}"]
    for one in made.advice:
        found = f"{one.best.named.name}, {one.best.ms:.3g} ms an image" if one.best else "nothing that was tried"
        lines += [f"for an RMSE of {one.error:.1%}: {found}", *(f"  {line}" for line in advice_lines(one.best, made))]
    return [*lines, f"report: {made.folder / 'index.html'}"]


def _problems(error: JobError, outcome: str) -> list[str]:
    n = len(error.problems)
    return [*str(error).splitlines(), f"{n} problem{'s' if n > 1 else ''}; {outcome}."]


def _fail(lines: Sequence[str], code: int) -> NoReturn:
    say(err, lines)
    sys.exit(code)


def _stop(signum: int, frame: "FrameType | None") -> None:
    """Turn a signal into an exception, so that everything is tidied up; a second signal ends the process at once."""
    signal.signal(signum, signal.SIG_DFL)
    if is_compiling():  # that cannot be stopped, and would be waited for
        timer = threading.Timer(PATIENCE, _leave, [Stopped(signum)])
        timer.daemon = True
        timer.start()
    if hasattr(signal, "setitimer"):
        signal.signal(signal.SIGALRM, lambda _, frame: _interrupt(signum, frame))
    _interrupt(signum, frame)


def _interrupt(signum: int, frame: "FrameType | None") -> None:
    """Raise `Stopped`, unless that would be forgotten now; then in a moment, and again should it be forgotten."""
    busy = False
    while frame is not None and not busy:
        busy = frame.f_globals.get("__name__", "").partition(".")[0] in FORGETFUL
        frame = frame.f_back
    if hasattr(signal, "setitimer"):
        signal.setitimer(signal.ITIMER_REAL, 0.02 if busy else 2 * PATIENCE)
        if busy:
            return
    raise Stopped(signum)


def _leave(stopped: Stopped) -> None:
    """End the process whatever its threads are doing."""
    out.show_cursor()
    say(err, [stopped.word])
    os._exit(stopped.exit_code)


def main(arguments: Sequence[str] | None = None) -> None:
    """Run the command line and turn errors into messages and exit codes."""
    for name in ("SIGINT", "SIGTERM", "SIGHUP"):
        if hasattr(signal, name):  # Windows lacks the last
            signal.signal(getattr(signal, name), _stop)
    for stream in (sys.stdout, sys.stderr):
        if isinstance(stream, io.TextIOWrapper):  # a file name that the terminal cannot show is no reason to fail
            stream.reconfigure(errors="backslashreplace")
    arguments = sys.argv[1:] if arguments is None else arguments
    try:
        app(list(arguments) or ["--help"], prog_name="framearray")
    except JobError as error:
        _fail(_problems(error, "nothing was rendered"), error.exit_code)
    except FrameArrayError as error:
        _fail([*str(error).splitlines(), *_notes(error)], error.exit_code)
    except MemoryError as error:
        less = "a smaller resolution, n_r or fewer lights take less; `framearray check` tells how much a job needs"
        _fail([f"not enough memory; {less}", *_notes(error)], OUT_OF_MEMORY)
    except Stopped as stopped:
        if hasattr(signal, "setitimer"):
            signal.setitimer(signal.ITIMER_REAL, 0)
        _fail([stopped.word, *_notes(stopped)], stopped.exit_code)


def _notes(error: BaseException) -> list[str]:
    return list(getattr(error, "__notes__", ()))
