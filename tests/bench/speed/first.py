"""The first picture of a new user: seconds for `init` and `render --preview`, from an empty home."""

import shutil
import tempfile
from collections.abc import Sequence
from pathlib import Path

import numpy as np
from support import tiny
from support.scenes import Glb

from bench.core.machine import busy
from bench.core.results import Table

from .processes import PROGRAM, environment, seconds_of

BALLS, ROUGHNESS = 15, 64  # 4 * 64^2 triangles per ball: 250,000 with the room


def run(scenes: Sequence[str]) -> Table:
    """Measure the way to the first picture of some scene files, or of a room that is made for it."""
    with tempfile.TemporaryDirectory() as place:
        folder = Path(place)
        files = [Path(scene).resolve() for scene in scenes] or [save_scene(folder / "balls.glb")]
        return {"busy": busy(), "scenes": {file.name: _first_picture(file, folder) for file in files}}


def save_scene(file: Path) -> Path:
    """Save a room with balls in it, of 250,000 triangles."""
    glb = Glb()
    colours = np.random.default_rng(1).uniform(0.2, 0.9, (BALLS + 1, 4)) * [1, 1, 1, 0] + [0, 0, 0, 1]
    walls = tiny.box((-3.0, 0.0, -3.0), (3.0, 2.6, 3.0))[:, ::-1]  # its faces look inwards
    shapes = [walls] + [
        tiny.ball((1.1 * (k % 5 - 2), 0.3 + 0.7 * (k // 5), -2.2 + 0.7 * (k // 5)), 0.3, ROUGHNESS)[0]
        for k in range(BALLS)
    ]
    for k, (corners, colour) in enumerate(zip(shapes, colours, strict=True)):
        positions = corners.reshape(-1, 3).astype(np.float32)
        material = glb.material(f"m{k}", {"baseColorFactor": colour.tolist(), "metallicFactor": 0.0})
        glb.node(glb.mesh(material, positions=positions, faces=np.arange(len(positions), dtype=np.uint16)))
    return glb.save(file)


def _first_picture(scene: Path, folder: Path) -> Table:
    """Return the seconds of both commands, with nothing compiled and then with all kernels."""
    home, work = folder / "home", folder / "work"
    found: Table = {}
    for state in ("empty home", "second time"):
        shutil.rmtree(work, ignore_errors=True)
        for made in (home, work):
            made.mkdir(exist_ok=True)
        variables = environment(HOME=str(home), XDG_CACHE_HOME=str(home / ".cache"))
        init = round(seconds_of((*PROGRAM, "init", str(scene), "-o", "first.toml"), variables, work), 1)
        render = *PROGRAM, "render", "first.toml", "--preview", "-o", "first.png"
        preview = round(seconds_of(render, variables, work), 1)
        found[state] = {"init": init, "preview": preview, "both": round(init + preview, 1)}
    shutil.rmtree(home)
    return found
