"""Jobs from files, tables or objects, and what they would cost."""

import os
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any, TypeAlias

from framearray_cli.array.manifest_toml import plain
from framearray_cli.base.errors import JobError
from framearray_cli.base.forms.words import shown
from framearray_cli.base.units import MOST_THREADS
from framearray_cli.cli.results import CheckResult, check_result
from framearray_cli.job.job import Job
from framearray_cli.job.read import job_from_table, read_job, with_options

from .arguments import arguments_named

JobSource: TypeAlias = str | os.PathLike[str] | Mapping[str, Any] | Job


@dataclass(frozen=True, slots=True, kw_only=True)
class Checked(CheckResult):
    """Contents and costs of a job, as `framearray check --json` prints it.

    Attributes:
        warnings: pictures that would be black, clipped or empty; memory or disk that may not be enough.
    """

    warnings: tuple[str, ...]


def load_job(
    job: JobSource,
    *,
    output: str | os.PathLike[str] | None = None,
    threads: int | None = None,
    sets: str | Sequence[str] = (),
) -> Job:
    """Return a checked job.

    Args:
        job: a job file; the tables of one, with file names relative to the current folder; or a `Job`.
        output: folder for the images, instead of the job's.
        threads: instead of the job's.
        sets: "KEY=VALUE" texts that replace keys, as `framearray render --set` takes them; one, or several.

    Raises:
        JobError: it cannot be read or has problems; the error lists all of them.
        ValueError: `sets` come with a `Job`.
    """
    sets = [sets] if isinstance(sets, str) else sets
    if isinstance(job, Job):
        if sets:
            raise ValueError("sets: expected none next to a Job, whose keys were checked")
        found = job
    elif isinstance(job, Mapping):
        found = job_from_table(plain(job), sets)
    else:
        found = read_job(Path(job), sets)
    whole = isinstance(threads, int) and not isinstance(threads, bool)
    if threads is not None and not (whole and 1 <= threads <= MOST_THREADS):
        raise JobError("threads", [f"expected a whole number from 1 to {MOST_THREADS}, got {shown(threads)}"])
    return with_options(found, threads, None if output is None else Path(output))


@arguments_named()
def check(job: JobSource, *, threads: int | None = None, sets: str | Sequence[str] = ()) -> Checked:
    """Validate a job and its scene, and estimate its size, memory, disk space and time; no image is written.

    Args:
        job, threads, sets: as in `render`.

    Raises:
        JobError, SceneError: the job cannot be rendered.
        OutputError: its folder holds a manifest that cannot be read.
    """
    checked = load_job(job, threads=threads, sets=sets)
    from framearray_cli.render.estimate import check as estimate_job
    from framearray_cli.render.precompile import offer_for

    offer_for(checked)
    estimate = estimate_job(checked)
    result = check_result(estimate)
    return Checked(**{key: getattr(result, key) for key in result.__slots__}, warnings=estimate.warnings)
