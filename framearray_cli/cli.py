"""The command line: each command parses, calls one function, prints. Errors end the process here alone."""

import io
import sys
from collections.abc import Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any, NoReturn

import typer

from . import __version__
from .compiling import compile_clock
from .errors import FrameArrayError, JobError, OutputError
from .interrupts import Stopped, forget, listen
from .screen import Screen, err, out, say, size
from .wording import ambient_lines, estimate_lines, report_lines, scene_lines, summary_lines

if TYPE_CHECKING:
    from .auto import Choice
    from .job import Job
    from .prepare import Prepared
    from .report.case import Case
    from .target import Target
    from .terms.ambient import Ambient

OUT_OF_MEMORY = 2  # the job asks for more than the machine has
LITTLE_SPACE = 64 * 1024 * 1024  # bytes; with less, a full disk is the likely reason of an error
MOST_THREADS = 1024  # as in the job file

app = typer.Typer(
    name="framearray",
    help="Render frame arrays: every image of an animated camera under every position of an animated light.",
    pretty_exceptions_enable=False,
    add_completion=False,
    rich_markup_mode=None,  # plain text, also in a log file
)

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
                screen.say(scene_lines(prepared))
                screen.wait("estimating the ambient light")
                self.total = prepared.n_cameras * prepared.n_lights

            def removed(self, files: int) -> None:
                if files:
                    screen.say([f"removed {files:,} files of the frame array in {job.output.directory}"])

            def settled(self, choice: "Choice") -> None:
                screen.say(choice.lines())

            def planned(self, ambient: "Ambient") -> None:
                screen.say(ambient_lines(ambient))
                self.told = ambient.notes
                screen.count("rendering", self.total, "image")

            def aimed(self, target: "Target") -> None:
                screen.say(target.lines())

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
        say(out, summary_lines(summary, shown.told, job))


@app.command()
def check(job_file: JobFile, threads: Threads = None, output: Output = None) -> None:
    """Validate a job and its scene, and tell its size, memory, disk and time, without rendering it."""
    job = _job(job_file, threads, output)
    with Screen(out) as screen:
        screen.wait("reading the scene and rendering a few small frames")
        from .check import check as run

        with compile_clock(screen.compiling):
            estimate = run(job)
    say(out, estimate_lines(estimate))


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
                screen.say(scene_lines(case.prepared))

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
        say(out, report_lines(made))


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


def _place(name: str) -> Path:
    """A file or folder to write to."""
    if not name.strip():  # most often a shell variable that is not set; Path would make "." of it
        raise typer.BadParameter("expected a name, got none", param_hint="--output")
    return Path(name)


def _problems(error: JobError, outcome: str) -> list[str]:
    n = len(error.problems)
    return [*str(error).splitlines(), f"{n} problem{'s' if n > 1 else ''}; {outcome}."]


def _fail(lines: Sequence[str], code: int) -> NoReturn:
    say(err, lines)
    sys.exit(code)


def main(arguments: Sequence[str] | None = None) -> None:
    """Run the command line and turn errors into messages and exit codes."""
    listen()
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
        forget()
        _fail([stopped.word, *_notes(stopped)], stopped.exit_code)


def _notes(error: BaseException) -> list[str]:
    return list(getattr(error, "__notes__", ()))
