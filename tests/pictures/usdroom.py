"""A room in USD, with materials, lights and a camera that moves, to be rendered by `init` and `render` without an edit.

PYTHONPATH=tests python tests/pictures/usdroom.py room.usda
framearray init room.usda
framearray render room.toml
"""

import sys
from pathlib import Path
from typing import Any

import numpy as np
from PIL import Image
from support.program import complete
from support.usdfiles import bind, coordinates, mesh, new_stage, preview, pxr, save

from framearray_cli.array.images import read_image
from framearray_cli.array.manifest import image_path
from framearray_cli.array.manifest_toml import read_manifest
from framearray_cli.base.arrays import Float32

WIDE, HIGH, LONG = 5.0, 2.8, 6.0  # metres
FRAMES = 24
BOARDS = "boards.png"
SHOWN = {2: 3, 12: 12, 21: 20}  # camera positions: position of the lamp


def scene(file: Path) -> Path:
    """Write the room, and the image of its floor beside it."""
    stage = new_stage(file)
    stage.SetStartTimeCode(0)
    stage.SetEndTimeCode(FRAMES - 1)
    pxr().UsdGeom.SetStageMetersPerUnit(stage, 1.0)
    _boards(file.parent / BOARDS)
    _walls(stage)
    _things(stage)
    _lights(stage)
    _camera(stage)
    return save(stage)


def images(folder: Path) -> list[Float32]:
    """Let `init` and `render` make pictures of it, (h, w, 3) radiance each, the lamp elsewhere in each."""
    job = folder / "room.toml"
    complete("init", scene(folder / "room.usda"), "-o", job)
    complete("render", "-q", job, "--cameras", ",".join(map(str, SHOWN)))
    manifest = read_manifest(folder / "out" / "room")
    return [read_image(image_path(manifest, c, l)) for c, l in SHOWN.items()]


def _boards(file: Path) -> None:
    """Write planks of wood, each of its own colour."""
    rng = np.random.default_rng(5)
    tint = rng.uniform(0.7, 1.2, (1, 8, 1)).repeat(32, axis=1) * rng.uniform(0.95, 1.05, (256, 256, 1))
    tint[:, ::32] *= 0.5
    Image.fromarray((np.clip(tint * [150, 105, 70], 0, 255)).astype(np.uint8)).save(file)


def _walls(stage: Any) -> None:
    x, y, z = WIDE / 2, HIGH, LONG / 2
    white, red, green = (
        preview(stage, name, diffuseColor=colour, roughness=0.9)
        for name, colour in (("White", (0.75, 0.73, 0.7)), ("Red", (0.65, 0.2, 0.15)), ("Green", (0.2, 0.4, 0.28)))
    )
    floor = mesh(stage, "/World/Floor", [(-x, 0, z), (x, 0, z), (x, 0, -z), (-x, 0, -z)])
    coordinates(floor, [(0, 0), (3, 0), (3, 4), (0, 4)])
    bind(floor.GetPrim(), preview(stage, "Boards", diffuseColor=(BOARDS, "rgb"), roughness=0.35))
    sides = {
        "Ceiling": ([(-x, y, -z), (x, y, -z), (x, y, z), (-x, y, z)], white),
        "Back": ([(-x, 0, -z), (x, 0, -z), (x, y, -z), (-x, y, -z)], white),
        "Front": ([(x, 0, z), (-x, 0, z), (-x, y, z), (x, y, z)], white),
        "Left": ([(-x, 0, z), (-x, 0, -z), (-x, y, -z), (-x, y, z)], red),
        "Right": ([(x, 0, -z), (x, 0, z), (x, y, z), (x, y, -z)], green),
    }
    for name, (points, material) in sides.items():
        bind(mesh(stage, f"/World/{name}", points).GetPrim(), material)


def _things(stage: Any) -> None:
    geom = pxr().UsdGeom
    looks = {
        "Table": {"diffuseColor": (0.5, 0.36, 0.22), "roughness": 0.5},
        "Steel": {"diffuseColor": (0.9, 0.88, 0.85), "metallic": 1.0, "roughness": 0.15},
        "Clay": {"diffuseColor": (0.75, 0.35, 0.2), "roughness": 0.7},
        "Blue": {"diffuseColor": (0.1, 0.2, 0.5), "roughness": 0.2},
    }
    materials = {name: preview(stage, name, **inputs) for name, inputs in looks.items()}
    things = (
        (geom.Cube, "Table", "Table", (0.0, 0.35, -1.0), (0.9, 0.35, 0.5), {"Size": 2.0}),
        (geom.Sphere, "Ball", "Steel", (0.4, 0.95, -1.0), (1, 1, 1), {"Radius": 0.25}),
        (geom.Cone, "Cone", "Clay", (-0.35, 0.95, -1.0), (1, 1, 1), {"Radius": 0.2, "Height": 0.5, "Axis": "Y"}),
        (geom.Cylinder, "Drum", "Blue", (1.5, 0.4, 0.1), (1, 1, 1), {"Radius": 0.35, "Height": 0.8, "Axis": "Y"}),
    )
    for kind, name, look, place, scale, values in things:
        found = kind.Define(stage, f"/World/{name}")
        for key, value in values.items():
            getattr(found, f"Create{key}Attr")(value)
        found.AddTranslateOp().Set(place)
        found.AddScaleOp().Set(scale)
        bind(found.GetPrim(), materials[look])


def _lights(stage: Any) -> None:
    """A panel under the ceiling, and a warm lamp that is carried along the back wall."""
    lux = pxr().UsdLux
    panel = lux.RectLight.Define(stage, "/World/Panel")
    for key, value in {"Width": 1.6, "Height": 0.8, "Intensity": 12.0}.items():
        getattr(panel, f"Create{key}Attr")(value)
    panel.AddTranslateOp().Set((0.0, HIGH - 0.05, 0.5))
    panel.AddRotateXOp().Set(-90.0)  # a panel of USD shines along -z
    lamp = lux.SphereLight.Define(stage, "/World/Lamp")
    for key, value in {"Radius": 0.08, "Intensity": 120.0, "Color": (1.0, 0.65, 0.35)}.items():
        getattr(lamp, f"Create{key}Attr")(value)
    move = lamp.AddTranslateOp()
    for frame, x in ((0, -1.8), (FRAMES - 1, 1.8)):
        move.Set((x, 1.6, -2.5), frame)


def _camera(stage: Any) -> None:
    camera = pxr().UsdGeom.Camera.Define(stage, "/World/Camera")
    camera.CreateFocalLengthAttr(22.0)
    move, turn = camera.AddTranslateOp(), camera.AddRotateYOp()
    for frame, x, angle in ((0, -0.9, -12.0), (FRAMES - 1, 0.9, 12.0)):
        move.Set((x, 1.4, 2.8), frame)
        turn.Set(angle, frame)


if __name__ == "__main__":
    scene(Path(sys.argv[1]).absolute())
