"""Identity of a frame array: all that determines the bytes of its files, as hashes and as a table."""

import json

import numpy as np

from framearray_cli.array.folder import Identity
from framearray_cli.array.manifest_toml import plain
from framearray_cli.array.metadata import metadata_of
from framearray_cli.base.forms.table import Table
from framearray_cli.base.hashing import fingerprint
from framearray_cli.job.method import ObscuranceTable, SamplesTable
from framearray_cli.job.read import job_table

from .prepare import Prepared

_DEFAULTS: dict[str, type[Table]] = {"obscurance": ObscuranceTable, "samples": SamplesTable}


def identity_of(prepared: Prepared) -> Identity:
    """Return the identity of the array that a job renders."""
    job, scene = prepared.job, scene_fingerprint(prepared)
    return Identity(
        name=job.name,
        fingerprint=job_fingerprint(prepared, scene),
        scene=scene,
        job=plain(job_table(job)),
    )


def scene_fingerprint(prepared: Prepared) -> str:
    """Hash the scene as it was read: its triangles, materials and textures; its path is ignored."""
    arrays = (np.ascontiguousarray(array).reshape(-1).view(np.uint8).data for array in prepared.surfaces)
    return fingerprint(prepared.scene.centre.tobytes(), *arrays)


def job_fingerprint(prepared: Prepared, scene: str | None = None) -> str:
    """Hash all that pixels depend on: the job without `output` and `render`, and the scene as it was read.

    Args:
        scene: fingerprint of the scene, if known.
    """
    table = {key: value for key, value in job_table(prepared.job).items() if key not in ("output", "render")}
    for where in ("file", "folders"):
        table["scene"].pop(where, None)
    for section, key in metadata_of(table):
        table[section][key] = _DEFAULTS[section].model_fields[key].default
    scene = scene or scene_fingerprint(prepared)
    return fingerprint(json.dumps(table, sort_keys=True, default=str).encode(), scene.encode())
