"""Scene -> first job (`init`).

The job renders well at once: with the cameras, lights and animations of the file, or a walk or an orbit found in it.
"""

import os
from pathlib import Path

from framearray_cli.base.errors import OutputError, SceneError
from framearray_cli.base.files import write_bytes

from .model import Start, checked, table_of
from .plan import Wishes, plan_start
from .text import to_text

__all__ = ["Start", "Wishes", "init"]


def init(scene: Path, job_file: Path, wishes: Wishes, *, force: bool = False) -> Start:
    """Write a first job for a scene.

    Args:
        force: take the place of a file that is there.

    Raises:
        SceneError: the scene cannot be read, or nothing can be seen or lit in it.
        JobError: no camera has the name that is wished for.
        OutputError: the job file is there already, or cannot be written.
    """
    if os.path.exists(job_file) and not force:
        raise OutputError(f"{job_file}: is there already; give another name with --output, or --force to replace it")
    if not os.path.exists(scene):
        raise SceneError(f"{scene}: no such scene file")
    start = plan_start(scene, wishes)
    checked(table_of(start), scene)
    write_bytes(job_file, to_text(start, job_file).encode("utf-8"))
    return start
