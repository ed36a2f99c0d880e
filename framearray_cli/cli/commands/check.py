"""`framearray check`."""

from framearray_cli.render.messages import estimate_lines, warning_lines

from ..options import JobFile, Output, Sets, Strict, Threads, load_job, refuse_warnings
from ..screen import Screen, err, print_result, say


def check(
    job_file: JobFile, sets: Sets = None, threads: Threads = None, output: Output = None, strict: Strict = False
) -> None:
    """Validate a job and its scene, and print its size, memory, disk and time, without rendering it."""
    job = load_job(job_file, threads, output, sets)
    with Screen(err) as screen:
        screen.wait("reading the scene and rendering a few small frames")
        from framearray_cli.render.estimate import check as run

        with screen.compiling():
            estimate = run(job)
    print_result(estimate_lines(estimate))
    if strict:
        refuse_warnings(job_file, estimate.warnings)
    say(err, warning_lines(estimate.warnings))
