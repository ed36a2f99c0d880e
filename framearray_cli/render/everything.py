"""A tiny room with all features of scenes, lights and output: rendering it loads or compiles every kernel.

`framearray compile` renders it, and so do wheels with machine code come about.
"""

import base64
import json
import tempfile
from functools import cache
from importlib import import_module
from pathlib import Path
from pkgutil import walk_packages
from typing import Any

import numpy as np

from framearray_cli.array.images import ImageFormat, write_image
from framearray_cli.engine.kernels.second_process import end_with_parent
from framearray_cli.job.read import job_of_table

from .render import render

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
_BODY = {"KHR_materials_volume": {"thicknessFactor": 1.0, "attenuationDistance": 1.0}}
# Each material on a cube: its size and place.
_CUBES: dict[str, tuple[dict[str, Any], float, tuple[float, float, float]]] = {
    "wall": ({"normalTexture": _PICTURE, "pbrMetallicRoughness": _DARK}, 2.0, (0, 0, 0)),
    "mirror": ({"pbrMetallicRoughness": {"metallicFactor": 1.0, "roughnessFactor": 0.0}}, 0.3, (-0.6, -0.6, 0)),
    "gloss": ({"pbrMetallicRoughness": {"metallicFactor": 0.5, "roughnessFactor": 0.4}}, 0.3, (0.2, -0.6, 0)),
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
_LAYERS = dict.fromkeys(("layers", "alpha", "position", "uv", "cryptomatte"), True)
_FEW = 4096  # walks that sample the cells
# Jobs that need all kernels between them, the second without glass.
_JOBS: list[dict[str, Any]] = [
    {"indirect": {"samples": _FEW, "cell": 0.5}, "samples": {"halves": True}, "output": _LAYERS},
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
        "ambient": {"method": "fit", "paths": _FEW},
        "obscurance": {"falloff": "exponential"},
        "reuse": {"weights": "average"},
        "output": {"sun_hours": True, "format": "png"},
    },
    {"indirect": {"exact": True}, "samples": {"error": 9.0, "most_hits": 1, "obscurance": 1}},
]


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
            scene = folder / f"{k}.gltf"
            scene.write_text(_room(glass=k != 1))
            table = {
                "name": "room",
                "camera": _CAMERA,
                "light": {"sources": [*_LAMPS, sky]},
                "scene": {"file": str(scene), "surfaces": "file"},
            }
            render(job_of_table(table | tables, folder / "room.toml", folder / str(k)))


def main() -> None:
    """Compile everything in a second process, until all is there or the parent ends."""
    end_with_parent()
    compile_everything(backwards=True)


def _room(*, glass: bool) -> str:
    """Return the room as a glTF file, with or without glass."""
    cubes = {name: cube for name, cube in _CUBES.items() if glass or name not in ("body", "pane")}
    uv = _CORNERS[:, :2] / 2 + 0.5
    parts = [_CORNERS.tobytes(), uv.astype(np.float32).tobytes(), _TRIANGLES.tobytes()]
    starts = np.cumsum([0, *map(len, parts)]).tolist()
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
        "buffers": [{"uri": _data("application/octet-stream", b"".join(parts)), "byteLength": starts[-1]}],
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


def _data(kind: str, data: bytes) -> str:
    return f"data:{kind};base64,{base64.b64encode(data).decode()}"
