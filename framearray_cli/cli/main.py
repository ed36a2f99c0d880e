"""The command line: its commands, and the only place where errors become messages and exit codes."""

import io
import re
import sys
from collections.abc import Callable, Sequence
from contextlib import suppress
from typing import Annotated, Any, cast

import typer

from framearray_cli import __version__
from framearray_cli.base.errors import FrameArrayError, JobError, OutputError, ReaderGoneError
from framearray_cli.base.files import REMEDIES, reason
from framearray_cli.base.platform import Stopped, set_alarm, stopped_by
from framearray_cli.base.units import counted

from .commands.assemble import assemble
from .commands.check import check
from .commands.doctor import compile, doctor
from .commands.export import export
from .commands.init import init
from .commands.render import render
from .commands.report import report
from .commands.schemas import schema
from .commands.sheet import sheet
from .commands.still import still
from .commands.verify import verify
from .commands.view import view
from .document import outcome
from .screen import err, print_document, print_result, say
from .signals import listen

OUT_OF_MEMORY = 2  # the job needs more than the machine has
NO_THREADS = "can't start new thread"  # the text of Python's error
# What problems of a job, a path file or options mean for a command, where that needs words.
OUTCOMES = {
    **dict.fromkeys(("render", "report"), "nothing was rendered"),
    **dict.fromkeys(("assemble", "init", "export", "sheet", "still"), "nothing was written"),
    "check": "the job cannot be rendered",
}

# Lines around the problems of a command, which its document leaves out.
_IS_FRAME = re.compile(rf"[\d,]+ problems?(; ({'|'.join(set(OUTCOMES.values()))}))?\.$|Usage: |`framearray|$")

# What Python adds to an error that passes through a codec.
_OF_A_CODEC = re.compile("(en|de)coding with '.*' codec failed")

# typer brings its own copy of click since 0.26: UsageError is a base of the one class that all versions export.
UsageError = cast("type[Exception]", typer.BadParameter.__mro__[1])
WIDE = 100  # columns of a help screen, at most


# In the order of use: a command, a summary that fits in one line of the list of commands, and an example.
PAGES: tuple[tuple[Callable[..., None], str, str], ...] = (
    (init, "Write a first job for a scene.", "framearray init room.glb"),
    (check, "Check a job; estimate its memory, disk and time.", "framearray check room.toml"),
    (render, "Render a job into a frame array.", "framearray render room.toml --output out/room"),
    (verify, "Find damaged and missing files of an array.", "framearray verify out/room --repair"),
    (view, "Walk through an array in the browser.", "framearray view out/room"),
    (assemble, "Cut a movie out of an array.", "framearray assemble out/room walk -o walk.mp4"),
    (still, "Make a picture out of an array.", "framearray still out/room --light 50% -o still.png"),
    (sheet, "Draw a contact sheet of an array.", "framearray sheet out/room -o sheet.jpg"),
    (export, "Export an array for other tools.", "framearray export out/room -f nerfstudio -o room-nerf"),
    (report, "Measure speed and error of settings.", "framearray report room.toml --vary samples.hits=1,2,4"),
    (schema, "Print the JSON Schema of files.", "framearray schema > job.schema.json"),
    (compile, "Compile all kernels now, for later commands.", "framearray compile"),
    (doctor, "Report versions, processor, memory and extras.", "framearray doctor"),
)

app = typer.Typer(
    name="framearray",
    help="Render frame arrays: every image of an animated camera under every position of an animated light.",
    epilog="First steps: framearray init room.glb; framearray render room.toml; framearray view out/room",
    context_settings={"help_option_names": ["-h", "--help"], "max_content_width": WIDE},
    pretty_exceptions_enable=False,
    rich_markup_mode=None,  # plain text, also in a log file
)

for command, summary, example in PAGES:
    app.command(short_help=summary, epilog=f"Example: {example}")(command)


def _version(wanted: bool) -> None:
    if wanted:
        print_result([f"framearray {__version__}"])
        raise typer.Exit


@app.callback()
def _options(
    context: typer.Context,
    version: Annotated[
        bool, typer.Option("--version", "-V", callback=_version, is_eager=True, help="Print the version.")
    ] = False,
) -> None:
    context.ensure_object(list).append(context.invoked_subcommand)


def main(arguments: Sequence[str] | None = None) -> None:
    """Run the command line and turn errors into messages and exit codes."""
    listen()
    for stream in (sys.stdout, sys.stderr):
        if isinstance(stream, io.TextIOWrapper):  # do not fail on a file name that the terminal cannot show
            stream.reconfigure(errors="backslashreplace")
    arguments = list(sys.argv[1:] if arguments is None else arguments)
    outcome.begin(arguments)
    running: list[str] = []  # the command, once it is known
    lines: list[str] = []
    try:
        ended = app(arguments or ["--help"], prog_name="framearray", obj=running, standalone_mode=False)
        exit_code = ended if isinstance(ended, int) else 0  # of `typer.Exit`
    except SystemExit as end:  # of typer itself
        if isinstance(end.__context__, BrokenPipeError):
            sys.exit(ReaderGoneError.exit_code)
        raise
    except UsageError as error:
        problem, usage = _usage_problem(error)
        lines, exit_code = [*usage, f"Error: {problem}"], JobError.exit_code
    except (FrameArrayError, MemoryError, Stopped, RuntimeError, OSError) as error:
        lines, exit_code = ending(error, running[0] if running else "")
    with suppress(OutputError, ReaderGoneError, OSError):  # a terminal that was closed
        say(err, lines)
    if outcome.wanted and (lines or outcome.result is not None):
        exit_code = _print_document(running[0] if running else "", exit_code, lines)
    if exit_code:
        sys.exit(exit_code)


def _usage_problem(error: Any) -> tuple[str, list[str]]:
    """Return what is wrong with a command line, and lines on how to use the command."""
    usage = error.ctx and [error.ctx.get_usage(), f"`{error.ctx.command_path} --help` shows more.", ""]
    return error.format_message(), usage or []


def _print_document(command: str, exit_code: int, lines: Sequence[str]) -> int:
    """Print the JSON document of a command; return the exit code, another one where it cannot be printed."""
    problems = [line for line in lines if not _IS_FRAME.match(line)]
    try:
        print_document(command, exit_code, problems)
    except FrameArrayError as error:
        with suppress(OutputError, ReaderGoneError, OSError):
            say(err, str(error).splitlines())
        return exit_code or error.exit_code
    return exit_code


def ending(error: BaseException, command: str) -> tuple[list[str], int]:
    """Return the lines to print about an error that ends a command, and the exit code; raise any other error again."""
    # callers add them to the error; Python does, too, where a signal comes amid the work of a codec
    notes = [note for note in getattr(error, "__notes__", ()) if not _OF_A_CODEC.fullmatch(note)]
    if isinstance(error, JobError):
        return _problem_lines(error, OUTCOMES.get(command))
    if isinstance(error, FrameArrayError):
        return [*str(error).splitlines(), *notes], error.exit_code
    if isinstance(error, MemoryError):
        less = (
            "a render takes less with a smaller resolution or n_r, or fewer lights; `framearray check` prints how much"
        )
        return [f"not enough memory; {less}", *notes], OUT_OF_MEMORY
    if stopped := stopped_by(error):
        set_alarm(0.0)
        return [stopped.word, *notes], stopped.exit_code
    if NO_THREADS in str(error):
        limits = "`ulimit -u`, `ulimit -v` or a container's limit"
        line = f"no more threads can be started; --threads 1 takes the fewest; the limit may be {limits}"
        return [line, *notes], OUT_OF_MEMORY
    if isinstance(error, OSError) and error.errno in REMEDIES:  # of a library: it may meet the limit anywhere
        place = f"{error.filename}: " if error.filename else ""  # a pipe or a socket has no name
        return [f"{place}{reason(error)}", *notes], OutputError.exit_code
    raise error


def _problem_lines(error: JobError, outcome: str | None) -> tuple[list[str], int]:
    """List the problems of a job file, a path file or options, their number, and their outcome."""
    more = re.fullmatch(r"and ([\d,]+) more problems?", error.problems[-1])
    n = len(error.problems) - 1 + int(more[1].replace(",", "")) if more else len(error.problems)
    lines = [f"{error.file}: {problem}".replace("\n", "\\n") for problem in error.problems]
    return [*lines, f"{counted(n, 'problem')}{f'; {outcome}' if outcome else ''}."], error.exit_code
