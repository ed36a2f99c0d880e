"""The same model far from the origin, as files have it: in a node's transform, or in the numbers of a text format.

Coordinates of 1e7 have steps of 1 in float32. Node transforms and text hold float64, whose steps there are 2e-9.
"""

from pathlib import Path
from typing import Any

import numpy as np
import pytest
from support import tiny
from support.pictures import FLIPPED, differing, pictures, walk
from support.scenes import Glb

from framearray_cli.scene.scene import load_scene

FAR = (1e7, -1e7, 1e7)


def room() -> Any:
    """All triangles of the tiny room, corners as float32 holds them: (n, 3, 3)."""
    parts = tiny.room_meshes(mirrors=False, textured=False).parts
    return np.concatenate([part.corners for part in parts]).astype(np.float32).astype(np.float64)


def node(file: Path, at: Any) -> None:
    """A GLB: float32 corners about the origin, below a node that moves them."""
    glb, points = Glb(), room().reshape(-1, 3)
    mesh = glb.mesh(positions=points.astype(np.float32), faces=np.arange(len(points), dtype=np.uint16))
    glb.node(mesh, translation=list(at))
    glb.save(file)


def matrix(file: Path, at: Any) -> None:
    """A GLB with two nodes, one above the other, the upper one with a matrix: half the way each."""
    glb, points = Glb(), room().reshape(-1, 3)
    mesh = glb.mesh(positions=points.astype(np.float32), faces=np.arange(len(points), dtype=np.uint16))
    half = [x / 2 for x in at]
    inner = glb.add("nodes", {"mesh": mesh, "translation": half})
    glb.node(matrix=[1, 0, 0, 0, 0, 1, 0, 0, 0, 0, 1, 0, *half, 1], children=[inner])
    glb.save(file)


def obj(file: Path, at: Any) -> None:
    corners = room() + np.array(at)
    lines = [f"v {x!r} {y!r} {z!r}" for x, y, z in corners.reshape(-1, 3).tolist()]
    lines += [f"f {i} {i + 1} {i + 2}" for i in range(1, 3 * len(corners), 3)]
    file.write_text("\n".join(lines) + "\n")


def ply(file: Path, at: Any) -> None:
    corners = room() + np.array(at)
    head = ["ply", "format ascii 1.0", f"element vertex {3 * len(corners)}"]
    head += [f"property double {axis}" for axis in "xyz"]
    head += [f"element face {len(corners)}", "property list uchar int vertex_index", "end_header"]
    rows = [f"{x!r} {y!r} {z!r}" for x, y, z in corners.reshape(-1, 3).tolist()]
    rows += [f"3 {i} {i + 1} {i + 2}" for i in range(0, 3 * len(corners), 3)]
    file.write_text("\n".join(head + rows) + "\n")


WRITERS = {"node": (node, "glb"), "matrix": (matrix, "glb"), "obj": (obj, "obj"), "ply": (ply, "ply")}


def picture(folder: Path, kind: str, at: Any) -> Any:
    write, suffix = WRITERS[kind]
    file = folder / f"{kind}.{suffix}"
    write(file, at)
    return pictures(walk(at=at), load_scene(file))


@pytest.mark.parametrize("kind", WRITERS)
def test_a_model_ten_million_away_gives_the_picture_of_the_model_at_the_origin(kind: str, tmp_path: Path) -> None:
    here, there = picture(tmp_path, kind, (0.0, 0.0, 0.0)), picture(tmp_path, kind, FAR)
    assert here.mean() > 0.01
    assert differing(there, here) < FLIPPED


def test_a_model_whose_corners_are_float32_is_another_one_there(tmp_path: Path) -> None:
    """The test above can fail: corners that were rounded to float32 at 1e7 are a scene of steps of 1."""
    rounded = (room() + np.array(FAR)).astype(np.float32).astype(np.float64)
    here = picture(tmp_path, "node", (0.0, 0.0, 0.0))
    assert differing(pictures(walk(at=FAR), tiny.scene_of(rounded)), here) > 10 * FLIPPED
