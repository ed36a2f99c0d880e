"""`framearray verify`."""

from typing import TYPE_CHECKING, Annotated

import typer

from framearray_cli.base.errors import CheckError
from framearray_cli.base.memory import RENDER_NEEDS, available_cores, require_address_space

from ..options import ArrayFolder, Quiet, Threads, with_threads
from ..screen import Screen, out, say

if TYPE_CHECKING:
    from framearray_cli.array.integrity import Verification


def verify(
    array: ArrayFolder,
    repair: Annotated[
        bool, typer.Option("--repair", help="Render what is missing or damaged again, from the job in the manifest.")
    ] = False,
    threads: Threads = None,
    quiet: Quiet = False,
) -> None:
    """Check that every image of a frame array is there, whole and unchanged."""
    from framearray_cli.array.integrity import verify as run

    with Screen(out, quiet=quiet) as screen:
        found = run(array, threads or available_cores(), screen.counter("verifying", "file"))
    lines = verified_lines(found)
    if not found.wrong or not repair:
        if found.wrong:
            raise CheckError("\n".join(lines))
        if not quiet:
            say(out, lines)
        return
    from framearray_cli.array.manifest import FILE_NAME
    from framearray_cli.job.read import job_of_table

    from .render import render_on_screen

    require_address_space(RENDER_NEEDS)
    if not quiet:
        say(out, lines)
    folder = found.manifest.directory
    render_on_screen(
        with_threads(job_of_table(found.manifest.job, folder / FILE_NAME, folder.absolute()), threads), quiet=quiet
    )


def verified_lines(found: "Verification") -> list[str]:
    """List the files of an array that are missing or damaged, by name, and sum up."""
    folder, n = found.manifest.directory, len(found.wrong)
    lines = [f"{folder / name}: {problem}" for name, problem in found.wrong]
    if found.unknown:
        lines.append(f"note: {found.unknown:,} files are whole, but have no checksum to compare them with")
    if not n:
        return [*lines, f"{found.files:,} files of {found.manifest.name} are whole"]
    advice = "`framearray verify --repair` renders them again"
    return [*lines, f"{n:,} of {found.files:,} files are missing or damaged; {advice}"]
