"""`framearray openjd`."""

import shlex
from pathlib import Path
from typing import Annotated

from framearray_cli.base.files import require_new
from framearray_cli.base.units import MOST_THREADS
from framearray_cli.render.messages import chunks_line

from .. import options as opt
from ..screen import Screen, err, print_result

CHUNK = "Maximum number of camera positions per chunk; default: 8 N_r, at least 16."
THREADS = "Threads per chunk; default: the machine's cores."


def openjd(
    job_file: opt.JobFile,
    target: Annotated[
        str | None, opt.option("--output -o", "Template; default: the job file's name, here.", "FILE")
    ] = None,
    chunk: Annotated[int | None, opt.option("--chunk", CHUNK, "N", opt.whole(1))] = None,
    threads: Annotated[int | None, opt.option("--threads", THREADS, "N", opt.whole(1, MOST_THREADS))] = None,
    force: Annotated[bool, opt.option("--force", "Replace an existing template.")] = False,
    quiet: opt.Quiet = False,
    json: opt.Json = False,
) -> None:
    """Write an Open Job Description template that renders a job in chunks on a farm."""
    job = opt.load_job(job_file, threads, None)
    file = Path(f"{job_file.stem}.openjd.json") if target is None else opt.output_path(target)
    frames = job.camera.frames
    problem = f"expected at most {frames}, the number of camera positions, got {chunk}"
    opt.refuse({"--chunk": chunk is not None and chunk > frames}, problem)
    with Screen(err, quiet=quiet) as screen:
        screen.wait("reading the job")
        from framearray_cli.render.parts.openjd import template, write_template
        from framearray_cli.render.parts.queue import default_size, plan_chunks, resolve_n_r
        from framearray_cli.scene.paths.paths import eyes

        n_r, still = resolve_n_r(job), eyes(job).at_rest
        size = chunk or (frames if still else default_size(frames, n_r))
        chunks = plan_chunks(range(frames), size, n_r, still=still)
        require_new(file, force=force)
        write_template(file, template(job, job_file, file.parent, size, job.render.threads))
    from ..results import TemplateResult

    result = TemplateResult(template=str(file), chunks=len(chunks.each), chunk=size, more_hits=float(chunks.more))
    lines = [chunks_line(chunks), f"{file}; next: openjd run {shlex.quote(str(file))}"]
    print_result(lines, result, quiet=quiet)
