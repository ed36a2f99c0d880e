"""The cost of an image of the kitchen by what its surfaces are, frame by frame in turns with diffuse ones."""

import json
from pathlib import Path

import numpy as np
from support import ROOT
from support.scenes import glb_of, split_glb

from bench.core.cases import job_named, with_resolution
from bench.core.frames import image_of
from bench.core.machine import describe, quiet
from bench.core.results import Table
from bench.lights.cost import in_turns
from framearray_cli.base.arrays import Float32
from framearray_cli.base.forms.table import changed
from framearray_cli.job.job import Job

KITCHEN = ROOT / "jobs" / "scenes" / "kitchen.glb"
DEPTH = 0.12  # metres from the inner face of the wall to the glass
# Of the windows, as the generator of the scene has them: the wall that each is in, and x or z and y of its lower left
# corner, width and height.
NORTH, EAST = -2.1, 2.8
BASIN_WINDOW = (-0.94, 1.10, 1.95, 1.28)
TABLE_WINDOWS = ((-1.02, 0.32, 1.36, 1.98), (0.58, 0.32, 1.36, 1.98))
CLEAR, GREEN = (1.0, 1.0, 1.0), (0.55, 0.9, 0.6)


def glazed(file: Path, colour: tuple[float, float, float]) -> Path:
    """Write the kitchen with panes of a colour; return the file."""
    tree, binary = split_glb(KITCHEN.read_bytes())
    points = _panes()
    binary += b"\0" * (-len(binary) % 4)
    view = {"buffer": 0, "byteOffset": len(binary), "byteLength": points.nbytes}
    binary += points.tobytes()
    tree["bufferViews"].append(view)
    low, high = points.min(axis=0).tolist(), points.max(axis=0).tolist()
    accessor = {"componentType": 5126, "count": len(points), "type": "VEC3", "min": low, "max": high}
    tree["accessors"].append({"bufferView": len(tree["bufferViews"]) - 1, **accessor})
    smooth = {"baseColorFactor": [*colour, 1], "metallicFactor": 0, "roughnessFactor": 0}
    passes = {"KHR_materials_transmission": {"transmissionFactor": 1.0}}
    tree["materials"].append({"name": "Pane", "pbrMetallicRoughness": smooth, "extensions": passes})
    position = {"POSITION": len(tree["accessors"]) - 1}
    primitive = {"attributes": position, "material": len(tree["materials"]) - 1}
    tree["meshes"].append({"primitives": [primitive]})
    tree["nodes"].append({"mesh": len(tree["meshes"]) - 1})
    tree["scenes"][tree.get("scene", 0)]["nodes"].append(len(tree["nodes"]) - 1)
    tree["buffers"][0]["byteLength"] = len(binary)
    tree.setdefault("extensionsUsed", []).extend(passes)
    file.write_bytes(glb_of(json.dumps(tree).encode(), binary))
    return file


def _panes() -> Float32:
    """(n, 3) corners of two triangles per window."""
    x, y, width, height = BASIN_WINDOW
    quads = [_quad((x, y, NORTH - DEPTH), (width, 0, 0), (0, height, 0))]
    quads += [_quad((EAST + DEPTH, y, z), (0, 0, width), (0, height, 0)) for z, y, width, height in TABLE_WINDOWS]
    return np.concatenate(quads)


def _quad(corner: tuple[float, ...], along: tuple[float, ...], up: tuple[float, ...]) -> Float32:
    a, u, v = (np.array(vector, np.float32) for vector in (corner, along, up))
    return np.array([a, a + u, a + u + v, a, a + u + v, a + v], np.float32)


JOB = "kitchen-gloss"
DIFFUSE, FILE, CLEAR_PANES, GREEN_PANES = "diffuse", "as the job has them", "and clear panes", "and green panes"
FRAMES, QUICK_FRAMES, PLACE = 9, 1, 0.4
RESOLUTION, QUICK_RESOLUTION = (320, 240), (48, 36)
SHOWN = (5, 3)  # camera and light position of the picture
PARTS = {f"cost-{method}": method for method in ("obscurance", "cells")}


def jobs_of(method: str, quick: bool, folder: Path) -> dict[str, Job]:
    """The job with each kind of surfaces."""
    job = with_resolution(job_named(JOB, False), QUICK_RESOLUTION if quick else RESOLUTION)
    job = changed(job, indirect=changed(job.indirect, method=method))
    panes = {name: glazed(folder / f"{name.split()[-2]}.glb", colour)
             for name, colour in ((CLEAR_PANES, CLEAR), (GREEN_PANES, GREEN))}  # fmt: skip
    return {
        DIFFUSE: changed(job, scene=changed(job.scene, surfaces="diffuse", materials={})),
        FILE: job,
        **{name: changed(job, scene=changed(job.scene, file=file)) for name, file in panes.items()},
    }


def measure(part: str, quick: bool, folder: Path, patience: float = 0.0) -> Table:
    """Measure a part: surfaces -> medians over frames; `ratio` is over diffuse ones, frame by frame."""
    jobs, share = jobs_of(PARTS[part], quick, folder), quiet(patience)
    found = in_turns(part, jobs, QUICK_FRAMES if quick else FRAMES, PLACE)
    images = {name: image_of(job, *SHOWN) for name, job in jobs.items()}
    np.savez(folder / f"gloss-{part}.npz", **images)  # type: ignore[arg-type]
    return {"machine": describe(), "resolution": list(RESOLUTION), "busy": share, "surfaces": found}
