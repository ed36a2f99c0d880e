"""What decides every byte of a frame array's files, as hashes and as a table."""

import json

import numpy as np

from framearray_cli.array.folder import Identity
from framearray_cli.array.manifest_toml import plain
from framearray_cli.base.hashing import fingerprint
from framearray_cli.job.read import job_table

from .prepare import Prepared


def identity_of(prepared: Prepared) -> Identity:
    """What decides every byte of the files of a job."""
    job, scene = prepared.job, scene_fingerprint(prepared)
    return Identity(
        name=job.name,
        fingerprint=job_fingerprint(prepared, scene),
        scene=scene,
        job=plain(job_table(job)),
    )


def scene_fingerprint(prepared: Prepared) -> str:
    """Hash the scene as it was read: its triangles, materials and textures; where the file lies plays no part."""
    arrays = (np.ascontiguousarray(array).reshape(-1).view(np.uint8).data for array in prepared.surfaces)
    return fingerprint(prepared.scene.centre.tobytes(), *arrays)


def job_fingerprint(prepared: Prepared, scene: str | None = None) -> str:
    """Hash whatever the pixels depend on: the job without its output and machine, and the scene as it was read.

    Args:
        scene: its fingerprint, where it is known.
    """
    table = {key: value for key, value in job_table(prepared.job).items() if key not in ("output", "render")}
    for where in ("file", "folders"):
        table["scene"].pop(where, None)
    scene = scene or scene_fingerprint(prepared)
    return fingerprint(json.dumps(table, sort_keys=True, default=str).encode(), scene.encode())
