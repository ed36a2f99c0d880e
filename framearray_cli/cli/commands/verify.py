"""`framearray verify`."""

import shlex
from typing import TYPE_CHECKING, Annotated

import typer

from framearray_cli.base.errors import CheckError
from framearray_cli.base.memory import available_cores
from framearray_cli.base.units import agree, counted

from .. import options as opt
from ..screen import Screen, err, print_result

if TYPE_CHECKING:
    from framearray_cli.array.integrity import Verification
    from framearray_cli.render.events import RenderResult

    from ..results import VerifyResult


MOST_DAMAGED = 20  # files listed by name


def verify(
    array: opt.ArrayFolder,
    repair: Annotated[
        bool, opt.option("--repair", "Render missing and damaged images again, from the job in the manifest.")
    ] = False,
    threads: opt.ThreadsOfVerify = None,
    quiet: opt.Quiet = False,
    json: opt.Json = False,
) -> None:
    """Check that every image of a frame array is there, whole and unchanged."""
    from framearray_cli.array.integrity import verify as run

    with Screen(err, quiet=quiet) as screen:
        found = run(array, threads or available_cores(), screen.counter("verifying", "file"))
    repairs = repair and not found.mixed_cells
    lines = verified_lines(found, repairs=repairs)
    if not found.wrong or not repairs:
        print_result(lines, verify_result(found), quiet=quiet and found.whole)
        if not found.whole:
            raise typer.Exit(CheckError.exit_code)
        return
    from framearray_cli.array.manifest import FILE_NAME
    from framearray_cli.job.read import job_of_table, with_options

    from .render import render_on_screen

    opt.require_rendering()
    print_result(lines, verify_result(found), quiet=quiet)
    folder = found.manifest.directory
    job = with_options(job_of_table(found.manifest.job, folder / FILE_NAME, folder.absolute()), threads)
    print_result([], verify_result(found, render_on_screen(job, quiet=quiet, repairs=True)))


def verify_result(found: "Verification", repaired: "RenderResult | None" = None) -> "VerifyResult":
    """Describe what `verify` found."""
    from ..results import DamagedFile, UnfinishedCamera, VerifyResult

    return VerifyResult(
        directory=str(found.manifest.directory),
        name=found.manifest.name,
        whole=found.whole,
        files=found.files,
        unknown=found.unknown,
        mixed_cells=bool(found.mixed_cells),
        damaged=tuple(DamagedFile(file=name, problem=problem) for name, problem in found.damaged),
        unfinished=tuple(UnfinishedCamera(camera=c, files=n) for c, n in found.unfinished().items()),
        repaired=repaired,
    )


def verified_lines(found: "Verification", *, repairs: bool = False) -> list[str]:
    """List damaged files by name, then unfinished cameras by ranges, and sum up; a remedy, unless it is at work."""
    from framearray_cli.array.places import brief_frames_text

    folder, damaged = found.manifest.directory, found.damaged
    lines = [f"{folder / name}: {problem}" for name, problem in damaged[:MOST_DAMAGED]]
    if len(damaged) > MOST_DAMAGED:
        more = len(damaged) - MOST_DAMAGED
        lines.append(f"{counted(more, 'more file')} {agree(more, 'is', 'are')} missing or damaged")
    unfinished = found.unfinished()
    each = found.files // found.manifest.n_cameras
    for what, cameras in (
        ("never begun", [c for c, n in unfinished.items() if n == each]),
        ("never finished", [c for c, n in unfinished.items() if n < each]),
    ):
        if cameras:
            left = sum(unfinished[c] for c in cameras)
            were = f"{agree(len(cameras), 'camera', 'cameras')} {brief_frames_text(cameras)}: {what}"
            lines.append(f"{were}, {left:,} of {counted(each * len(cameras), 'file')} {agree(left, 'is', 'are')} left")
    if found.unknown:
        have = agree(found.unknown, "has", "have")
        unknown = f"{counted(found.unknown, 'file')} {agree(found.unknown, 'is', 'are')}"
        lines.append(f"note: {unknown} whole, but {have} no checksum to compare with")
    if found.mixed_cells:
        lines.append(f"{folder}: {found.mixed_cells}")
        if not found.wrong:
            return lines
    return [*lines, _sum_up(found, len(damaged), sum(unfinished.values()), repairs=repairs)]


def _sum_up(found: "Verification", damaged: int, left: int, *, repairs: bool) -> str:
    """Word the result in one line, with the remedy."""
    repair = f"`framearray verify --repair {shlex.quote(str(found.manifest.directory))}`"
    if not damaged and not left:
        name = found.manifest.name
        return f"{counted(found.files, 'file')} of {name} {agree(found.files, 'is', 'are')} whole"
    files = counted(found.files, "file")
    if not damaged:
        some = f"{left:,} of {files} {agree(left, 'was', 'were')}"
        return f"{some} never finished" + ("" if repairs else f"; `framearray render JOB` or {repair} goes on")
    more = f", {left:,} {agree(left, 'was', 'were')} never finished" if left else ""
    again = "" if repairs else f"; {repair} renders them again"
    return f"{damaged:,} of {files} {agree(damaged, 'is', 'are')} missing or damaged{more}{again}"
