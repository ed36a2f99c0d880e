"""`framearray check`."""

from framearray_cli.render.messages import estimate_lines, warning_lines

from ..describe import check_result
from ..options import JobFile, Json, Output, Sets, Strict, Threads, load_job, refuse_warnings
from ..screen import Screen, err, print_result


def check(
    job_file: JobFile,
    sets: Sets = None,
    threads: Threads = None,
    output: Output = None,
    strict: Strict = False,
    json: Json = False,
) -> None:
    """Validate a job and its scene, and print its size, memory, disk and time, without rendering it."""
    job = load_job(job_file, threads, output, sets)
    with Screen(err) as screen:
        screen.wait("reading the scene and rendering a few small frames")
        from framearray_cli.render.estimate import check as run

        with screen.compiling():
            estimate = run(job)
    warnings = [] if strict else warning_lines(estimate.warnings)
    print_result([*estimate_lines(estimate), *warnings], check_result(estimate))
    if strict:
        refuse_warnings(job_file, estimate.warnings)
