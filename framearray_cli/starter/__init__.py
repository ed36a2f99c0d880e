"""Scene -> first job (`init`).

The job can be rendered as it is, with the cameras, lights and animations of the file, or with a walk or orbit that the
starter chooses.
"""

import os
from pathlib import Path

from framearray_cli.base.errors import SceneError
from framearray_cli.base.files import require_new, write_bytes
from framearray_cli.base.forms.toml import mistaken
from framearray_cli.render.precompile import FLOATS
from framearray_cli.render.precompile import offer_beside as offer

from .model import INDIRECT, Format, Start, StartOptions, SunOption, table_of, validate_job
from .plan import plan_start
from .staged import install_environment, maps_for, planned_panorama
from .text import to_text

__all__ = ["STDOUT", "Format", "Start", "StartOptions", "SunOption", "init", "offer_beside", "planned_files", "to_text"]

STDOUT = Path("-")


def init(scene: Path, job_file: Path, options: StartOptions, *, force: bool = False) -> Start:
    """Write a first job for a scene; the job, and the folder of its images, have the name of the file.

    Args:
        job_file: the file; STDOUT: nothing is written, and `to_text` gives the job for the current folder. An
            environment of the file is left out then, as its panorama would have no place.
        force: replace an existing file.

    Raises:
        SceneError: the scene cannot be read, or nothing in it can be seen or lit.
        JobError: no camera has the name in the options, or the sun never rises.
        OutputError: the job file, or the panorama of an environment next to it, exists already or cannot be written.
    """
    _check_files(scene, job_file, force=force)
    if job_file == STDOUT:
        start = plan_start(scene, scene.stem, options)
        validate_job(table_of(start), scene)
        return start
    with maps_for(scene, job_file, force=force) as maps:
        start = plan_start(scene, job_file.stem, options, maps)
        validate_job(table_of(start), scene)
        start = install_environment(start, maps)
        write_bytes(job_file, to_text(start, job_file).encode("utf-8"))
    return start


def offer_beside() -> None:
    """Have a second process compile kernels that a first job needs, should any be missing."""
    offer({"scene": {"surfaces": "file"}, "indirect": {"method": INDIRECT}} | FLOATS)


def planned_files(scene: Path, job_file: Path, *, force: bool = False) -> list[Path]:
    """Name the files that `init` would write, which may be there; none on standard output.

    Raises:
        SceneError: the scene cannot be read.
        OutputError: the job file, or the panorama of an environment next to it, exists already.
    """
    _check_files(scene, job_file, force=force)
    if job_file == STDOUT:
        return []
    panorama = planned_panorama(scene, job_file, force=force)
    return [job_file, *([] if panorama is None else [panorama])]


def _check_files(scene: Path, job_file: Path, *, force: bool) -> None:
    """Refuse a scene that is none, and a job file that is there.

    Raises:
        SceneError: there is no such scene file.
        OutputError: the job file exists already.
    """
    if problem := mistaken(scene, "scene"):
        raise SceneError(f"{scene}: {problem}")
    if job_file != STDOUT:
        require_new(job_file, force=force)
    if not os.path.exists(scene):
        raise SceneError(f"{scene}: no such scene file")
