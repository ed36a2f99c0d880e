"""The command line: each command parses, calls one function, prints. Only this file ends the process."""

import sys
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any, NoReturn

import typer
from rich.console import Console

from . import __version__
from .errors import FrameArrayError, JobError
from .screen import ProgressBar, duration, say, size

if TYPE_CHECKING:
    from .job import Job
    from .prepare import Prepared
    from .render import Summary
    from .terms.ambient import Ambient

INTERRUPTED = 130  # what shells expect of a program that Ctrl-C ended

app = typer.Typer(
    name="framearray",
    help="Render frame arrays: every image of an animated camera under every position of an animated light.",
    no_args_is_help=True,
    pretty_exceptions_enable=False,
    add_completion=False,
)
out, err = Console(), Console(stderr=True)

JobFile = Annotated[Path, typer.Argument(metavar="JOB", help="Job file, TOML.", show_default=False)]
Threads = Annotated[int | None, typer.Option(min=1, help="Threads; default: the job's, else one for each core.")]
Output = Annotated[Path | None, typer.Option("--output", "-o", help="Folder for the images, instead of the job's.")]
Quiet = Annotated[bool, typer.Option("--quiet", "-q", help="Print nothing but errors.")]


def _version(wanted: bool) -> None:
    if wanted:
        print(f"framearray {__version__}")
        raise typer.Exit


@app.callback()
def _options(
    version: Annotated[
        bool, typer.Option("--version", callback=_version, is_eager=True, help="Print the version.")
    ] = False,
) -> None:
    pass


@app.command()
def render(job_file: JobFile, threads: Threads = None, output: Output = None, quiet: Quiet = False) -> None:
    """Render every (camera, light) image of a job into a folder, with a manifest."""
    from .render import Listener
    from .render import render as run

    job = _job(job_file, threads, output)

    class Screen(Listener):
        """Prints the scene, then the ambient light, then a progress bar."""

        bar: ProgressBar | None = None

        def prepared(self, prepared: "Prepared") -> None:
            if not quiet:
                say(out, _scene_lines(prepared))
            self.total = prepared.n_cameras * prepared.n_lights

        def planned(self, ambient: "Ambient") -> None:
            if not quiet:
                say(out, _ambient_lines(ambient))
            self.bar = ProgressBar(out, "rendering", self.total, "image", quiet=quiet)
            self.bar.__enter__()

        def written(self, images: int) -> None:
            if self.bar is not None:
                self.bar.advance(images)

        def close(self) -> None:
            if self.bar is not None:
                self.bar.__exit__(None, None, None)

    screen = Screen()
    try:
        summary = run(job, screen)
    finally:
        screen.close()
    if not quiet:
        say(out, _summary_lines(summary, job))


@app.command()
def check(job_file: JobFile, threads: Threads = None, output: Output = None) -> None:
    """Validate a job and its scene, and tell its size, memory, disk and time, without rendering it."""
    from .check import check as run

    job = _job(job_file, threads, output)
    estimate = run(job)
    n_c, n_l = estimate.prepared.n_cameras, estimate.prepared.n_lights
    width, height = job.camera.resolution
    say(out, _scene_lines(estimate.prepared))
    say(out, _ambient_lines(estimate.ambient))
    say(
        out,
        [
            f"array: {n_c} cameras x {n_l} lights = {n_c * n_l:,} images of {width} x {height}",
            f"memory: about {size(estimate.memory)} for the frames under way, {size(estimate.available)} free",
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
        Path,
        typer.Option(
            "--output", "-o", help="movie.mp4 (.mov, .mkv, .webm) or a sequence: frame.####.png", show_default=False
        ),
    ],
    exposure: Annotated[float, typer.Option(help="Stops added to movies, PNG and JPEG.")] = 0.0,
    quiet: Quiet = False,
) -> None:
    """Cut a movie or an image sequence out of a frame array."""
    from .assemble import assemble as run

    bars: list[ProgressBar] = []

    def progress(done: int, total: int) -> None:
        if not bars:
            bars.append(ProgressBar(out, "assembling", total, "frame", quiet=quiet))
            bars[0].__enter__()
        bars[0].advance()

    try:
        result = run(array, path_file, target, exposure=exposure, progress=progress)
    finally:
        for bar in bars:
            bar.__exit__(None, None, None)
    if not quiet:
        rate = f"{float(result.fps):g} frames a second"
        say(out, [f"{result.target}: {result.n_frames} frames from {result.n_images} images, {rate}"])


@app.command()
def schema() -> None:
    """Print the JSON Schema of job files, for editors that complete and check them."""
    import json

    from .jobfile import job_schema

    print(json.dumps(job_schema(), indent=2))


def _job(job_file: Path, threads: int | None, output: Path | None) -> "Job":
    """Read a job file; options replace what it says."""
    from .jobfile import read_job

    job = read_job(job_file)
    updates: dict[str, Any] = {}
    if threads is not None:
        updates["render"] = job.render.model_copy(update={"threads": threads})
    if output is not None:
        updates["output"] = job.output.model_copy(update={"directory": output.absolute()})
    return job.model_copy(update=updates)


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


def _summary_lines(summary: "Summary", job: "Job") -> list[str]:
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
        *(f"note: {note}" for note in summary.notes),
        f"images and manifest: {job.output.directory}",
    ]


def _fail(lines: list[str], code: int) -> NoReturn:
    say(err, lines)
    sys.exit(code)


def main() -> None:
    """Run the command line and turn errors into messages and exit codes."""
    try:
        app(standalone_mode=True)
    except JobError as error:
        n = len(error.problems)
        _fail([*str(error).splitlines(), f"{n} problem{'s' if n > 1 else ''}; nothing was rendered."], error.exit_code)
    except FrameArrayError as error:
        _fail(str(error).splitlines(), error.exit_code)
    except KeyboardInterrupt:
        _fail(["interrupted; the images that were finished are kept"], INTERRUPTED)
