"""`framearray check`."""

from typing import TYPE_CHECKING

from framearray_cli.base.errors import JobError
from framearray_cli.render.messages import size_lines

from .. import options as opt
from ..screen import Screen, err, print_result

if TYPE_CHECKING:
    from framearray_cli.render.events import Event


def check(
    job_file: opt.JobFile,
    sets: opt.Sets = None,
    threads: opt.Threads = None,
    output: opt.Output = None,
    folders: opt.Folders = None,
    strict: opt.Strict = False,
    json: opt.Json = False,
) -> None:
    """Validate a job and its scene, and print its size, memory, disk and time, without rendering it."""
    opt.require_rendering(job_file, sets or ())
    job = opt.load_job(job_file, threads, output, sets, folders)
    with Screen(err) as screen:
        screen.show(size_lines(job))  # before the scene is read: a wrong number is seen at once
        screen.wait("reading the scene")
        from framearray_cli.render.estimate import check as run
        from framearray_cli.render.estimate import cost_lines
        from framearray_cli.render.events import Working
        from framearray_cli.render.precompile import offer_for

        from ..rendering import event_lines

        offer_for(job)

        def report(event: "Event") -> None:
            if isinstance(event, Working):
                screen.wait(event.text)
            elif lines := event_lines(event):
                screen.show(lines)

        with screen.compiling():
            estimate = run(job, report)
    warnings = [] if strict else [f"warning: {warning}" for warning in estimate.warnings]
    from ..results import check_result

    print_result([*cost_lines(estimate), *warnings], check_result(estimate))
    if strict and estimate.warnings:
        raise JobError(job_file, estimate.warnings)
