"""The command line: its commands, and how errors become messages and exit codes; they end the process here alone."""

import io
import sys
from collections.abc import Sequence
from typing import Annotated

import typer

from . import __version__
from .commands.assemble import assemble
from .commands.check import check
from .commands.export import export
from .commands.init import init
from .commands.openjd import openjd
from .commands.options import fail, notes, problems
from .commands.render import render
from .commands.report import report
from .commands.schema import schema
from .commands.sheet import sheet
from .commands.verify import verify
from .commands.view import view
from .errors import FrameArrayError, JobError
from .interrupts import Stopped, forget, listen, stopped_by
from .limits import READS, RENDERS, require_address_space
from .screen import out, say

OUT_OF_MEMORY = 2  # the job asks for more than the machine has
NO_THREADS = "can't start new thread"  # what Python says
RENDERING = ("render", "check", "init", "report")  # commands that may trace rays

app = typer.Typer(
    name="framearray",
    help="Render frame arrays: every image of an animated camera under every position of an animated light.",
    pretty_exceptions_enable=False,
    add_completion=False,
    rich_markup_mode=None,  # plain text, also in a log file
)

for command in (render, check, verify, init, assemble, view, sheet, export, openjd, report, schema):
    app.command()(command)


def _version(wanted: bool) -> None:
    if wanted:
        say(out, [f"framearray {__version__}"])
        raise typer.Exit


@app.callback()
def _options(
    context: typer.Context,
    version: Annotated[
        bool, typer.Option("--version", callback=_version, is_eager=True, help="Print the version.")
    ] = False,
) -> None:
    if context.invoked_subcommand != "schema":
        require_address_space(RENDERS if context.invoked_subcommand in RENDERING else READS)


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
        fail(problems(error, "nothing was rendered"), error.exit_code)
    except FrameArrayError as error:
        fail([*str(error).splitlines(), *notes(error)], error.exit_code)
    except MemoryError as error:
        less = (
            "a render takes less with a smaller resolution or n_r, or fewer lights; `framearray check` tells how much"
        )
        fail([f"not enough memory; {less}", *notes(error)], OUT_OF_MEMORY)
    except (Stopped, RuntimeError) as error:
        stopped = stopped_by(error)
        if stopped is None and NO_THREADS in str(error):
            limits = "`ulimit -u`, `ulimit -v` or a container's limit"
            fail(
                [
                    f"no more threads can be started; --threads 1 takes the fewest; the limit may be {limits}",
                    *notes(error),
                ],
                OUT_OF_MEMORY,
            )
        if stopped is None:
            raise
        forget()
        fail([stopped.word, *notes(error)], stopped.exit_code)
