"""Arguments and options that several commands share."""

import os
import re
from collections.abc import Callable, Mapping, Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any, TypeVar

import typer

from framearray_cli.base.errors import JobError
from framearray_cli.base.files import LONGEST_PATH, absolute
from framearray_cli.base.forms.toml import STDIN, load_kind, require_scene
from framearray_cli.base.forms.words import bound_text, range_text, shown
from framearray_cli.base.units import MOST_STOPS, MOST_THREADS

if TYPE_CHECKING:
    from framearray_cli.job.job import Job
    from framearray_cli.tools.mixing import SumOptions

_Number = TypeVar("_Number", int, float)
THREADS_VARIABLE = "FRAMEARRAY_THREADS"  # in the environment; an option stands above it, a job below


def whole(least: int, most: int | None = None) -> Callable[[object], int]:
    """Return a parser of whole numbers within bounds."""
    return _parser(int, "a whole number", least, most)


def number(least: float, most: float | None = None) -> Callable[[object], float]:
    """Return a parser of numbers within bounds."""
    return _parser(float, "a number", least, most)


def _parser(
    kind: Callable[[str], _Number], noun: str, least: _Number, most: _Number | None
) -> Callable[[object], _Number]:
    bounds = f"of at least {bound_text(least)}" if most is None else range_text(least, most)
    expected = f"{noun} {bounds}"

    def parse(value: object) -> _Number:
        try:
            found = kind(str(value))
        except ValueError:
            raise refusal(expected, value) from None
        if not found >= least or (most is not None and not found <= most) or found == float("inf"):
            raise refusal(expected, int(found) if found == found // 1 else found)
        return found

    return parse


def choice(*names: str) -> dict[str, Any]:
    """Return what `typer.Option` needs for one of some words: parser, metavar and completion."""

    def parse(value: object) -> str:
        if value not in names:
            raise refusal(f"{', '.join(names[:-1])} or {names[-1]}", value)
        return str(value)

    def complete(incomplete: str) -> list[str]:
        return [name for name in names if name.startswith(incomplete)]

    return {"parser": parse, "metavar": "|".join(names), "autocompletion": complete}


def refusal(expected: str, value: object) -> typer.BadParameter:
    """Make the error of a value that does not fit."""
    return typer.BadParameter(f"expected {expected}, got {shown(value)}")


def refuse(given: Mapping[str, object], problem: str) -> None:
    """Refuse the first of some options that is given; values that are not are empty or false."""
    for name in (name for name, value in given.items() if value):
        raise typer.BadParameter(problem, param_hint=name)


def option(
    names: str, text: str, metavar: str | None = None, parser: Callable[[object], Any] | None = None, **more: Any
) -> Any:
    """Return an option of the command line.

    Args:
        names: "--output -o".
        text: its line on a help screen.
        metavar: the value in a word; None for a flag.
    """
    return typer.Option(*names.split(), help=text, metavar=metavar, parser=parser, **more)


def _threads_option(otherwise: str) -> Any:
    """Return the option `--threads`, which an environment variable stands in for.

    Args:
        otherwise: the default without both, in words.
    """
    text = f"Threads; default: ${THREADS_VARIABLE}, else {otherwise}."
    return option("--threads", text, "N", whole(1, MOST_THREADS), envvar=THREADS_VARIABLE)


def _places_option(name: str, text: str) -> Any:
    return option(name, f"{text}: 0-47x3, 5,8-11, last, 50%, all; see reference/conventions.md.", "PLACES")


MOST_TURN = 100_000.0  # degrees
MOST_SOFT = 100_000.0  # light positions
STOPS = number(-MOST_STOPS, MOST_STOPS)

JobFile = Annotated[Path, typer.Argument(metavar="JOB", help="Job file, TOML.")]
ArrayFolder = Annotated[Path, typer.Argument(metavar="OUT", help="Output folder of `render`.")]
ThreadsOfVerify = Annotated[int | None, _threads_option("one per core; with --repair the job's to render")]
Threads = Annotated[int | None, _threads_option("the job's, else one per core")]
ThreadsOfNoJob = Annotated[int | None, _threads_option("one per core")]
Output = Annotated[str | None, option("--output -o", "Folder for the images, instead of the job's.", "FOLDER")]
Sets = Annotated[
    list[str] | None,
    option("--set", "Replace a key of the job: camera.resolution=[640,480]; may be repeated.", "KEY=VALUE"),
]


def _read_folder(value: object) -> Path:
    """Read a folder that exists."""
    folder = Path(str(value)).absolute()
    if not folder.is_dir():
        raise refusal("a folder", value)
    return folder


FOLDER = "Folder from which the scene may read files, besides its own; may be repeated."
Folders = Annotated[list[Path] | None, option("--folder", FOLDER, "FOLDER", _read_folder)]
Quiet = Annotated[bool, option("--quiet -q", "Print only errors.")]
Strict = Annotated[bool, option("--strict", "Warnings are errors.")]
# `main` looks for it before anything else: a wrong command line ends with a document too.
Json = Annotated[bool, option("--json", "Print the result as one JSON document.")]
Force = Annotated[bool, option("--force", "Replace an existing file.")]
Port = Annotated[int | None, option("--port", "Port of the page; 0: a free one.", "N", whole(0, 65535))]
SERVED = "Serve the page at this address of the machine, 0.0.0.0: all; the printed address has a token."
Host = Annotated[str | None, option("--host", SERVED, "ADDRESS")]
Browser = Annotated[bool | None, option("--browser/--no-browser", "Open the page in the browser.")]
Exposure = Annotated[float, option("--exposure", "Stops added to PNG and JPEG.", "STOPS", STOPS)]
Cameras = Annotated[str | None, _places_option("--cameras", "Camera positions")]
Light = Annotated[str | None, _places_option("--light", "Light positions")]
At = Annotated[
    list[str] | None,
    option("--at", "Positions along another light axis: lamps=0-3; may be repeated.", "AXIS=PLACES"),
]
Environment = Annotated[
    Path | None,
    option("--environment", "Light by this panorama (EXR, HDR) instead of light positions.", "FILE"),
]
Rotate = Annotated[
    str | None,
    option("--rotate", "Rotation of the panorama, degrees; 0-360 turns it during a movie.", "DEGREES"),
]
Soft = Annotated[float | None, option("--soft", "Mean of N light positions instead of one.", "N", number(1, MOST_SOFT))]

Stops = Annotated[float, option("--exposure", "Stops added to movies, PNG and JPEG.", "STOPS", STOPS)]
_VIEW = "View: srgb, neutral, agx, aces, or a view of the configuration in $OCIO."
View = Annotated[str, option("--view", _VIEW, "VIEW")]
Label = Annotated[bool, option("--label", "Write camera and light index into each picture.")]
Text = Annotated[str, option("--text", "Write a text such as {date} {time}; see guide/movies.md.", "TEMPLATE")]
Layers = Annotated[bool, option("--layers", "EXR with the light of each group and the layers in every file.")]
Blend = Annotated[bool, option("--blend", "Blend between light positions.")]


def load_job(
    job_file: Path,
    threads: int | None,
    output: str | None,
    sets: Sequence[str] | None = None,
    folders: Sequence[Path] | None = None,
) -> "Job":
    """Read a job file, or standard input for "-"; options replace its keys, and add folders of the scene."""
    from framearray_cli.job.read import read_job, with_options

    job = read_job(job_file, sets or ())
    return with_options(job, threads, None if output is None else output_path(output), folders or ())


def require_rendering(job_file: Path | None = None, sets: Sequence[str] | None = None) -> None:
    """Check that this machine can trace rays, for the commands that do.

    Args:
        job_file: looked for first, as that takes less time.
        sets: replace keys of the job, whose scene is looked for as well; None: it is not.

    Raises:
        JobError: the job is missing.
        SceneError: its scene is missing, or of an unknown format.
        MissingExtraError: embreex is not installed.
    """
    plain = sets is not None and "scene" not in str(sets) and os.path.isfile(job_file or "")  # no pipe
    if job_file not in (None, STDIN) and (plain or not os.path.exists(job_file)):
        match load_kind(job_file, "job"):
            case {"scene": {"file": str(name)}} if name.isprintable() and 0 < len(name.strip()) <= LONGEST_PATH:
                require_scene(absolute(Path(name), job_file.absolute()), "; paths are relative to the job file")
    from framearray_cli.engine.embree.library import require_embree

    require_embree()


def output_path(name: str, option: str = "--output") -> Path:
    """Return the path of a file or folder to write."""
    # usually an unset shell variable; Path would turn it into "."
    refuse({option: not name.strip()}, "expected a name, got none")
    return Path(name)


def sum_options(
    environment: Path | None, rotate: str | None, soft: float | None, *, moves: bool = False
) -> "SumOptions":
    """Read the options of sums.

    Args:
        moves: whether pictures follow one another, so that the map may turn.

    Raises:
        JobError: the rotation is no number of degrees, or a range where nothing moves.
    """
    from framearray_cli.tools.mixing import SumOptions

    turn = _read_turn(rotate, moves=moves) if rotate is not None else (0.0, 0.0)
    if rotate is not None and environment is None:
        raise JobError("--rotate", ["expected --environment next to it"])
    return SumOptions(environment=environment, rotate=turn, soft=soft)


def _read_turn(text: str, *, moves: bool) -> tuple[float, float]:
    """Read "30", or "0-360" in a movie."""
    degrees = r"([+-]?\d{1,6}(?:\.\d{1,6})?)"
    found = re.fullmatch(rf"\s*{degrees}(?:\s*-\s*{degrees})?\s*", text, re.ASCII)
    wanted = "degrees such as 30, or 0-360" if moves else "degrees such as 30"
    if not found or (found[2] is not None and not moves):
        raise JobError("--rotate", [f"expected {wanted}, got {shown(text)}"])
    first = float(found[1])
    last = float(found[2]) if found[2] is not None else first
    if max(abs(first), abs(last)) > MOST_TURN:
        raise JobError("--rotate", [f"expected at most {MOST_TURN:.0f} degrees, got {shown(text)}"])
    return first, last
