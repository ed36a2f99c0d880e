"""A second process that compiles a job's kernels while the first one renders; see `engine/kernels/second_process.py`.

It calls the kernels of a job in a tiny room of its own: first those that the first process needs last, for no hits,
then the others, as far as they are left.
"""

import json
import sys
import tempfile
from collections.abc import Mapping
from pathlib import Path
from typing import Any

import numpy as np

from framearray_cli.engine.frames.no_hits import (
    frame_without_hits,
    load_direct,
    load_gathering,
    load_mirrors,
    load_outer,
    load_textures,
)
from framearray_cli.engine.frames.pool import TracePool
from framearray_cli.engine.frames.setup import FrameSetup
from framearray_cli.engine.images.window import Window
from framearray_cli.engine.kernels.second_process import end_with_parent, offer
from framearray_cli.engine.terms.ambient.intensity import Ambient
from framearray_cli.job.job import Job
from framearray_cli.job.read import job_of_table, job_table

from .plan import frame_setup, plan_work
from .prepare import Prepared, open_embree, prepare
from .trial import load_kernels
from .writer import image_format

# A box as an OBJ file.
_ROOM = """usemtl mirror
v -2 -2 -2
v -2 -2 2
v -2 2 -2
v -2 2 2
v 2 -2 -2
v 2 -2 2
v 2 2 -2
v 2 2 2
f 1 2 4 3
f 5 7 8 6
f 1 5 6 2
f 3 4 8 7
f 1 3 7 5
usemtl wall
f 2 6 8 4
"""
_MATERIALS = {"mirror": {"reflectivity": 0.1, "specular": 0.8}}
_GLOSS = {"wall": {"reflectivity": 0.5, "roughness": 0.4, "metallic": 0.0}}  # where surfaces follow the file
_JOB: dict[str, Any] = {
    "name": "room",
    "camera": {
        "resolution": [16, 12],
        "frames": 2,
        "keys": [{"frame": c, "eye": [1, 0.2 * c, 0.6], "target": [0, 0, 0]} for c in range(2)],
    },
    "light": {"sources": [{"type": "point", "keys": [{"frame": 0, "position": [0, 1, 0], "intensity": 4}]}]},
    "obscurance": {"range": 1},
}
# Tables of a job that the choice of kernels may depend on; all others come from the room.
_KEPT = ("samples", "reuse", "indirect", "ambient", "output")
NO_TABLES: Mapping[str, Any] = {}
FLOATS = {"output": {"format": "png"}}  # for images that are composed as float32
_FEW = 4096  # walks that sample the cells of the room


def tables_for(job: Job) -> dict[str, Any]:
    """The tables of a job that decide which kernels it needs."""
    table = job_table(job)
    found = {name: table[name] for name in _KEPT if name in table}
    found["scene"] = {"surfaces": job.scene.surfaces}
    found["output"].pop("sun_hours", None)  # the room has no sun
    return found


def offer_for(job: Job, more: Mapping[str, Any] = NO_TABLES) -> None:
    """Have a second process compile kernels for a job, should any be missing; not for one that wants one thread.

    Args:
        more: tables that replace the job's.
    """
    if job.render.threads != 1:
        offer_beside(tables_for(job) | dict(more))


def offer_beside(tables: dict[str, Any]) -> None:
    """Have a second process compile kernels for jobs with these tables, should any be missing."""
    offer("from framearray_cli.render.precompile import main; main()", [json.dumps(tables)])


def main() -> None:
    """Compile the kernels of the job whose tables are the argument, until all are there or the parent ends."""
    end_with_parent()
    compile_for(json.loads(sys.argv[1]))


def compile_for(tables: dict[str, Any]) -> None:
    """Compile the kernels for jobs with these tables."""
    with tempfile.TemporaryDirectory(ignore_cleanup_errors=True) as name:
        prepared = prepare(room_job(tables, Path(name)))
        with open_embree(prepared) as embree:
            setup = frame_setup(prepared, embree, np.zeros(3, np.float32))
            if prepared.job.indirect.method == "cells":
                load_gathering(setup)
            load_direct(setup)
            load_textures(setup)
            _load_composing(prepared, setup)
            load_outer(setup)
            load_mirrors(setup)
            load_kernels(prepared, *plan_work(prepared, embree))


def room_job(tables: dict[str, Any], folder: Path) -> Job:
    """Write a room into a folder; return a job for it with these tables."""
    (folder / "room.obj").write_text(_ROOM)
    surfaces = tables.get("scene", {}).get("surfaces", "diffuse")
    materials = _MATERIALS | (_GLOSS if surfaces == "file" else {})
    scene = {"file": str(folder / "room.obj"), "surfaces": surfaces, "materials": materials}
    table = _JOB | tables | {"scene": scene}
    if "samples" in table.get("indirect", {}):
        table["indirect"] = {key: value for key, value in table["indirect"].items() if key != "cell"} | {
            "samples": _FEW
        }
    return job_of_table(table, folder / "room.toml", folder / "out")


def _load_composing(prepared: Prepared, setup: FrameSetup) -> None:
    """Load or compile what makes images from hits."""
    cams, n_lights = setup.cams, setup.lights.n_lights
    halves = image_format(prepared.job).composes_halves
    images = np.empty((n_lights, cams.height, cams.width, 3), np.float16 if halves else np.float32)
    zero = np.zeros((n_lights, 3), np.float32)
    no_ambient = Ambient(intensity=zero, standard_error=np.zeros(n_lights), reflectivity=zero[0], paths=0, rays=0)
    with TracePool(setup, 1) as pool:
        window = Window(setup, no_ambient, pool)
        for c in setup.eyes_of(0):
            window.add(frame_without_hits(setup, c))
        window.compose(0, images, setup.eyes_of(0))
