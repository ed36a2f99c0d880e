"""Arguments and options that several commands share."""

from collections.abc import Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any

import typer

from framearray_cli.base.errors import JobError
from framearray_cli.base.units import MOST_STOPS, MOST_THREADS

from .completions import (
    complete_array,
    complete_axis_places,
    complete_job,
    complete_key,
    complete_light_places,
    complete_places,
)
from .values import THREADS_VARIABLE, number, whole

if TYPE_CHECKING:
    from framearray_cli.job.job import Job

JobFile = Annotated[
    Path, typer.Argument(metavar="JOB", autocompletion=complete_job, help="Job file, TOML.", show_default=False)
]
ArrayFolder = Annotated[
    Path,
    typer.Argument(metavar="OUT", autocompletion=complete_array, help="Output folder of `render`.", show_default=False),
]


def _threads_option(otherwise: str) -> Any:
    """Return the option `--threads`, which an environment variable stands in for.

    Args:
        otherwise: the default without both, in words.
    """
    return typer.Option(
        "--threads",
        envvar=THREADS_VARIABLE,
        parser=whole(1, MOST_THREADS),
        help=f"Threads; default: ${THREADS_VARIABLE}, else {otherwise}.",
        metavar="N",
    )


ThreadsOfVerify = Annotated[int | None, _threads_option("one per core; with --repair the job's to render")]
Threads = Annotated[int | None, _threads_option("the job's, else one per core")]
ThreadsOfNoJob = Annotated[int | None, _threads_option("one per core")]
Output = Annotated[
    str | None,
    typer.Option("--output", "-o", help="Folder for the images, instead of the job's.", metavar="FOLDER"),
]
Sets = Annotated[
    list[str] | None,
    typer.Option(
        "--set",
        help="Replace a key of the job: camera.resolution=[640,480]; may be repeated.",
        autocompletion=complete_key,
        metavar="KEY=VALUE",
    ),
]
Quiet = Annotated[bool, typer.Option("--quiet", "-q", help="Print only errors.")]
Strict = Annotated[bool, typer.Option("--strict", help="Warnings are errors.")]
# `main` looks for it before anything else: a wrong command line ends with a document too.
Json = Annotated[bool, typer.Option("--json", help="Print the result as one JSON document.")]
Force = Annotated[bool, typer.Option("--force", help="Replace an existing file.")]
DryRun = Annotated[
    bool, typer.Option("--dry-run", help="Print what would be written, replaced and removed; change nothing.")
]
Port = Annotated[
    int | None, typer.Option("--port", parser=whole(0, 65535), help="Port of the page; 0: a free one.", metavar="N")
]
Host = Annotated[
    str | None,
    typer.Option(
        "--host",
        help="Serve the page at this address of the machine, 0.0.0.0: all; the printed address has a token.",
        metavar="ADDRESS",
    ),
]
Browser = Annotated[bool | None, typer.Option("--browser/--no-browser", help="Open the page in the browser.")]
Exposure = Annotated[
    float,
    typer.Option(
        "--exposure", parser=number(-MOST_STOPS, MOST_STOPS), help="Stops added to PNG and JPEG.", metavar="STOPS"
    ),
]
Cameras = Annotated[
    str | None,
    typer.Option(
        "--cameras",
        help="Camera positions: 0-47x3, 5,8-11, last, 50%, all; see reference/places.md.",
        autocompletion=complete_places,
        metavar="PLACES",
    ),
]
Light = Annotated[
    str | None,
    typer.Option(
        "--light",
        help="Light positions: 0-47x3, 5,8-11, last, 50%, all; see reference/places.md.",
        autocompletion=complete_light_places,
        metavar="PLACES",
    ),
]
At = Annotated[
    list[str] | None,
    typer.Option(
        "--at",
        help="Positions along another light axis: lamps=0-3; may be repeated.",
        autocompletion=complete_axis_places,
        metavar="AXIS=PLACES",
    ),
]


def load_job(job_file: Path, threads: int | None, output: str | None, sets: Sequence[str] | None = None) -> "Job":
    """Read a job file, or standard input for "-"; options replace its keys."""
    from framearray_cli.base.forms.table import changed
    from framearray_cli.job.read import read_job

    job = with_threads(read_job(job_file, sets or ()), threads)
    if output is None:
        return job
    table = job.output.model_copy(update={"directory": output_path(output).absolute()})  # keep links
    return changed(job, output=table)


def require_rendering() -> None:
    """Check that this machine can trace rays, for the commands that do.

    Raises:
        MissingExtraError: embreex is not installed.
    """
    from framearray_cli.engine.embree.library import require_embree

    require_embree()


def with_threads(job: "Job", threads: int | None) -> "Job":
    """Return the job with another number of threads; None leaves it as it is."""
    if threads is None:
        return job
    from framearray_cli.base.forms.table import changed

    return changed(job, render=changed(job.render, threads=threads))


def refuse_warnings(file: Path | str, warnings: Sequence[str]) -> None:
    """End a strict command if there are warnings.

    Raises:
        JobError: there are.
    """
    if warnings:
        raise JobError(file, warnings)


def output_path(name: str, option: str = "--output") -> Path:
    """Return the path of a file or folder to write."""
    if not name.strip():  # usually an unset shell variable; Path would turn it into "."
        raise typer.BadParameter("expected a name, got none", param_hint=option)
    return Path(name)
