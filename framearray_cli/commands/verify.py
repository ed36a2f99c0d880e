"""`framearray verify`."""

from pathlib import Path
from typing import Annotated

import typer

from framearray_cli.base.errors import CheckError
from framearray_cli.base.memory import RENDERS, available_cores, require_address_space
from framearray_cli.screen import Screen, out, say
from framearray_cli.wording import verified_lines

from .options import Quiet, Threads, with_threads


def verify(
    array: Annotated[Path, typer.Argument(metavar="OUT", help="Folder that `render` wrote.", show_default=False)],
    repair: Annotated[
        bool, typer.Option("--repair", help="Render what is missing or damaged again, from the job in the manifest.")
    ] = False,
    threads: Threads = None,
    quiet: Quiet = False,
) -> None:
    """Look whether every image of a frame array is there, whole and unchanged."""
    from framearray_cli.array.integrity import verify as run

    with Screen(out, quiet=quiet) as screen:

        def progress(done: int, total: int) -> None:
            if not screen.total:
                screen.count("verifying", total, "file")
            screen.advance()

        found = run(array, threads or available_cores(), progress)
    lines = verified_lines(found)
    if not found.wrong or not repair:
        if found.wrong:
            raise CheckError("\n".join(lines))
        if not quiet:
            say(out, lines)
        return
    from framearray_cli.array.manifest import FILE_NAME
    from framearray_cli.job.read import job_of_table

    from .render import render_shown

    require_address_space(RENDERS)
    if not quiet:
        say(out, lines)
    folder = found.manifest.directory
    render_shown(
        with_threads(job_of_table(found.manifest.job, folder / FILE_NAME, folder.absolute()), threads), quiet=quiet
    )
