"""Tiny rooms whose rendering loads or compiles kernels: all, or what a job needs, in a second process.

The second process (`engine/kernels/second_process.py`) calls the kernels of a job for no hits: first those that take
longest and that the first process needs last, then the others, as far as they are left. `framearray compile` renders a
room with all features of scenes, lights and output, and so do wheels with machine code come about.
"""

import base64
import json
import sys
import tempfile
from collections.abc import Callable, Mapping
from contextlib import suppress
from functools import cache, partial
from importlib import import_module
from pathlib import Path
from pkgutil import walk_packages
from typing import Any

import numpy as np

from framearray_cli.array.images import ImageFormat, write_image
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
from framearray_cli.engine.kernels.second_process import KernelTakenError, end_with_parent, offer, without_waiting
from framearray_cli.engine.terms.ambient.intensity import Ambient
from framearray_cli.job.job import KEYS_BY_FILE, Job
from framearray_cli.job.read import job_of_table, job_table

from .features import EVERY_LAYER, EVERY_PROPERTY
from .plan import frame_setup, plan_work
from .prepare import Prepared, open_embree, prepare
from .render import render
from .rows import image_format
from .trial import load_kernels

# Corners of a cube from -1 to 1, and its triangles.
_CORNERS = np.array([(x, y, z) for x in (-1, 1) for y in (-1, 1) for z in (-1, 1)], np.float32)
_TRIANGLES = np.array(
    [(0, 1, 3), (0, 3, 2), (4, 6, 7), (4, 7, 5), (0, 4, 5), (0, 5, 1),
     (2, 3, 7), (2, 7, 6), (0, 2, 6), (0, 6, 4), (1, 5, 7), (1, 7, 3)], np.uint16,
)  # fmt: skip
# Pixels of red and blue, one of them transparent, as PNG.
_PIXELS = "iVBORw0KGgoAAAANSUhEUgAAAAIAAAACCAYAAABytg0kAAAAEklEQVR42mP4z8AAQkAMpEEsAD7TBvoR83PuAAAAAElFTkSuQmCC"
_PICTURE = {"index": 0}
_DARK = {"baseColorFactor": [0.2, 0.2, 0.2, 1.0], "roughnessFactor": 1.0, "metallicFactor": 0.0}  # short paths
_GLASS = {"KHR_materials_transmission": {"transmissionFactor": 1.0}, "KHR_materials_ior": {"ior": 1.5}}
_COAT = {"KHR_materials_clearcoat": {"clearcoatFactor": 1.0}}
_BODY = {"KHR_materials_volume": {"thicknessFactor": 1.0, "attenuationDistance": 1.0}}
# Each material on a cube: its size and place.
_CUBES: dict[str, tuple[dict[str, Any], float, tuple[float, float, float]]] = {
    "wall": ({"normalTexture": _PICTURE, "pbrMetallicRoughness": _DARK}, 2.0, (0, 0, 0)),
    "mirror": ({"pbrMetallicRoughness": {"metallicFactor": 1.0, "roughnessFactor": 0.0}}, 0.3, (-0.6, -0.6, 0)),
    "gloss": (
        {"pbrMetallicRoughness": {"metallicFactor": 0.5, "roughnessFactor": 0.4}, "extensions": _COAT},
        0.3, (0.2, -0.6, 0),
    ),
    "body": ({"extensions": _GLASS | _BODY}, 0.2, (0.0, 0.1, 0.2)),
    "pane": ({"extensions": _GLASS}, 0.2, (-0.6, 0.2, 0.2)),
    "mask": (
        {"alphaMode": "MASK", "pbrMetallicRoughness": {"baseColorTexture": _PICTURE, "metallicFactor": 0.0}},
        0.2, (0.5, 0.2, 0.0),
    ),
    "lamp": ({"emissiveFactor": [1, 1, 1]}, 0.2, (0.6, 0.7, -0.4)),
}  # fmt: skip
_PLACE = {"frame": 0, "position": [0, 1, 0.8]}
_LAMPS: list[dict[str, Any]] = [
    {"type": "point", "keys": [_PLACE | {"intensity": 4, "radius": 0.1}]},
    {"type": "spot", "keys": [_PLACE | {"intensity": 4, "direction": [0, -1, 0]}]},
    {"type": "rect", "visible": True,
     "keys": [_PLACE | {"radiance": 4, "direction": [0, -1, 0], "width": 0.1, "height": 0.1}]},
]  # fmt: skip
_SUN: list[dict[str, Any]] = [
    {"type": "sun", "latitude": 50, "longitude": 8, "date": "2026-06-21", "timezone": 1, "start": "11:00",
     "stop": "13:00", "irradiance": 5},
]  # fmt: skip
_CAMERA = {
    "resolution": [16, 12],
    "frames": 2,
    "keys": [{"frame": c, "eye": [0, 0.2 * c, 1.6], "target": [0, 0, 0]} for c in range(2)],
}
_FEW = 4096  # walks that sample the cells
# Jobs that need all kernels between them, the second without glass.
_JOBS: list[dict[str, Any]] = [
    {"indirect": {"samples": _FEW, "cell": 0.5}, "samples": {"halves": True}, "output": EVERY_LAYER},
    {
        "camera": {**_CAMERA, "type": "orthographic", "height": 2},
        "indirect": {"method": "obscurance"},
        "samples": {"halves": True},
        "ambient": {"paths": _FEW},
        "reuse": {"weights": "balance"},
    },
    {
        "light": {"sources": _SUN, "frames": 2},
        "indirect": {"method": "obscurance"},
        "ambient": {"paths": _FEW},
        "obscurance": {"falloff": "exponential"},
        "reuse": {"weights": "average"},
        "output": {"sun_hours": True, "format": "png"},
    },
    {"indirect": {"exact": True}, "samples": {"error": 9.0, "most_hits": 1, "obscurance": 1}},
]
# A job for the kernels of another job, and its materials if surfaces do not follow the file.
_JOB: dict[str, Any] = {
    "name": "room",
    "camera": _CAMERA,
    "light": {"sources": _LAMPS[:1]},
}
# Tables of a job that the choice of kernels may depend on; all others come from the room.
_KEPT = ("samples", "reuse", "indirect", "ambient", "output")
NO_TABLES: Mapping[str, Any] = {}
FLOATS = {"output": {"format": "png"}}  # for images that are composed as float32


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


def offer_beside(tables: dict[str, Any] | None) -> None:
    """Have a second process compile kernels for jobs with these tables, None: all, should any be missing."""
    offer("from framearray_cli.render.precompile import main; main()", [json.dumps(tables)] if tables else [])


def main() -> None:
    """Compile the kernels of the job whose tables are the argument, without one all, until the parent ends."""
    end_with_parent()
    if sys.argv[1:]:
        compile_for(json.loads(sys.argv[1]))
    else:
        compile_everything(backwards=True)


def compile_for(tables: dict[str, Any]) -> None:
    """Compile the kernels for jobs with these tables."""
    with tempfile.TemporaryDirectory(ignore_cleanup_errors=True) as name:
        prepared = prepare(room_job(tables, Path(name)))
        with open_embree(prepared) as embree:
            setup = frame_setup(prepared, embree, np.zeros(3, np.float32))
            gathering = [load_gathering] if prepared.job.indirect.method == "cells" else []
            steps: list[Callable[[FrameSetup], None]] = [*gathering, load_direct, load_textures]
            steps += [partial(_load_composing, prepared), load_outer, load_mirrors]
            for step in steps:
                with suppress(KernelTakenError), without_waiting():
                    step(setup)
            load_kernels(prepared, *plan_work(prepared, embree))


@cache
def all_kernels() -> tuple[str, ...]:
    """Return the names of all kernels of the program."""
    engine = import_module("framearray_cli.engine")
    modules = [import_module(found.name) for found in walk_packages(engine.__path__, f"{engine.__name__}.")]
    return tuple(
        f"{module.__name__}.{name}"
        for module in modules
        for name, value in vars(module).items()
        if hasattr(value, "overloads") and value.__module__ == module.__name__
    )


def compile_everything(*, backwards: bool = False) -> None:
    """Load or compile all kernels, by rendering the jobs of a tiny room.

    Args:
        backwards: begin with the last job, as a second process does.
    """
    with tempfile.TemporaryDirectory(ignore_cleanup_errors=True) as name:
        folder = Path(name)
        write_image(folder / "sky.exr", np.ones((8, 16, 3), np.float32), ImageFormat())
        sky = {"type": "environment", "file": str(folder / "sky.exr"), "keys": [{"frame": 0}]}
        for k, tables in list(enumerate(_JOBS))[:: -1 if backwards else 1]:
            own = {"light": {"sources": [*_LAMPS, sky]}} | tables
            scene = {"surfaces": "file", "materials": EVERY_PROPERTY}
            render(_job(own, scene, folder / str(k), *(("body", "pane") if k == 1 else ())))


def room_job(tables: dict[str, Any], folder: Path) -> Job:
    """Write a small room into a folder; return a job for it that needs the kernels of jobs with these tables."""
    surfaces = tables.get("scene", {}).get("surfaces", "diffuse")
    materials = {
        name: {key: value for key, value in keys.items() if surfaces == "file" or key not in KEYS_BY_FILE}
        for name, keys in EVERY_PROPERTY.items()
    }
    scene = {"surfaces": surfaces, "materials": materials}
    if "samples" in (indirect := tables.get("indirect", {})):
        few = {key: value for key, value in indirect.items() if key != "cell"} | {"samples": _FEW}
        tables = tables | {"indirect": few}
    return _job(tables, scene, folder, "body", "pane", "mask")


def _job(tables: dict[str, Any], scene: dict[str, Any], folder: Path, *without: str) -> Job:
    """Write a room without some of its cubes into a folder; return a job for it with these tables."""
    folder.mkdir(exist_ok=True)
    file = folder / "room.gltf"
    file.write_text(_room(*without))
    return job_of_table(_JOB | tables | {"scene": {"file": str(file)} | scene}, folder / "room.toml", folder / "out")


def _room(*without: str) -> str:
    """Return the room as a glTF file, without some of its cubes."""
    cubes = {name: cube for name, cube in _CUBES.items() if name not in without}
    uv = _CORNERS[:, :2] / 2 + 0.5
    parts = [_CORNERS.tobytes(), uv.astype(np.float32).tobytes(), _TRIANGLES.tobytes()]
    starts, buffer = np.cumsum([0, *map(len, parts)]).tolist(), base64.b64encode(b"".join(parts)).decode()
    views = [
        {"buffer": 0, "byteOffset": start, "byteLength": len(part)} for start, part in zip(starts, parts, strict=False)
    ]
    accessors = [
        {"bufferView": 0, "componentType": 5126, "count": 8, "type": "VEC3", "min": [-1] * 3, "max": [1] * 3},
        {"bufferView": 1, "componentType": 5126, "count": 8, "type": "VEC2"},
        {"bufferView": 2, "componentType": 5123, "count": _TRIANGLES.size, "type": "SCALAR"},
    ]
    attributes, n = {"POSITION": 0, "TEXCOORD_0": 1}, range(len(cubes))
    document = {
        "asset": {"version": "2.0"},
        "buffers": [{"uri": f"data:application/octet-stream;base64,{buffer}", "byteLength": starts[-1]}],
        "bufferViews": views,
        "accessors": accessors,
        "images": [{"uri": f"data:image/png;base64,{_PIXELS}"}],
        "textures": [{"source": 0}],
        "materials": [{"name": name, **material} for name, (material, _, _) in cubes.items()],
        "meshes": [{"primitives": [{"attributes": attributes, "indices": 2, "material": k}]} for k in n],
        "nodes": [
            {"mesh": k, "scale": [size] * 3, "translation": place} for k, (_, size, place) in enumerate(cubes.values())
        ],
        "scenes": [{"nodes": list(n)}],
        "scene": 0,
    }
    return json.dumps(document)


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
