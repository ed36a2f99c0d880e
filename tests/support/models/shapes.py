"""Shapes for models, as triangles (n, 3, 3) in metres with y up, fronts outwards, and the files that hold them."""

from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

import numpy as np
import trimesh

from support.scenes import Glb
from support.tiny import patches, quad

METRES = {"m": 1.0, "cm": 0.01, "mm": 0.001, "in": 0.0254, "ft": 0.3048}


@dataclass
class Model:
    """Parts of one material each, by name."""

    parts: dict[str, list[Any]] = field(default_factory=dict)
    colours: dict[str, Any] = field(default_factory=dict)

    def add(self, name: str, colour: Any, *shapes: Any, at: Any = (0.0, 0.0, 0.0), turn_deg: float = 0.0) -> None:
        """Add shapes, turned about the vertical axis and then moved."""
        self.colours[name] = colour
        c, s = np.cos(np.radians(turn_deg)), np.sin(np.radians(turn_deg))
        turned = np.array([[c, 0, -s], [0, 1, 0], [s, 0, c]])
        self.parts.setdefault(name, []).extend(shape @ turned + np.array(at) for shape in shapes)

    def save(self, file: Path, unit: str = "m", up: str = "y") -> Path:
        """Write a GLB, OBJ or STL, whose unit of length is `unit`, with the axis `up` upwards."""
        parts = {name: np.concatenate(shapes) / METRES[unit] for name, shapes in self.parts.items()}
        if up == "z":
            parts = {name: corners @ np.array([[1, 0, 0], [0, 0, 1], [0, -1, 0]]) for name, corners in parts.items()}
        write = {".glb": _save_glb, ".obj": _save_obj, ".stl": _save_stl}[file.suffix]
        write(parts, self.colours, file)
        return file


def _save_glb(parts: dict[str, Any], colours: dict[str, Any], file: Path) -> None:
    glb = Glb()
    for name, corners in parts.items():
        glb.part(name, colours[name], corners)
    glb.save(file)


def _save_obj(parts: dict[str, Any], colours: dict[str, Any], file: Path) -> None:
    lines, n = [f"mtllib {file.stem}.mtl"], 1
    for name, corners in parts.items():
        lines += [f"o {name}", f"usemtl {name}"]
        lines += ["v " + " ".join(f"{x:.7g}" for x in corner) for corner in corners.reshape(-1, 3)]
        lines += [f"f {k} {k + 1} {k + 2}" for k in range(n, n + 3 * len(corners), 3)]
        n += 3 * len(corners)
    file.write_text("\n".join(lines) + "\n")
    materials = [f"newmtl {name}\nKd {' '.join(map(str, colour))}\n" for name, colour in colours.items()]
    file.with_suffix(".mtl").write_text("\n".join(materials))


def _save_stl(parts: dict[str, Any], colours: dict[str, Any], file: Path) -> None:
    corners = np.concatenate(list(parts.values())).reshape(-1, 3)
    trimesh.Trimesh(corners, np.arange(len(corners)).reshape(-1, 3), process=False).export(file)


def block(low: Any, high: Any, *, inwards: bool = False) -> Any:
    """A box, seen from outside or inside."""
    (a, b, c), (d, e, f) = low, high
    faces = [
        quad((a, b, f), (d, b, f), (d, e, f), (a, e, f)),
        quad((d, b, c), (a, b, c), (a, e, c), (d, e, c)),
        quad((d, b, f), (d, b, c), (d, e, c), (d, e, f)),
        quad((a, b, c), (a, b, f), (a, e, f), (a, e, c)),
        quad((a, e, f), (d, e, f), (d, e, c), (a, e, c)),
        quad((a, b, c), (d, b, c), (d, b, f), (a, b, f)),
    ]
    corners = np.concatenate(faces)
    return corners[:, ::-1] if inwards else corners


def wall(start: Any, end: Any, height: float, holes: Any = (), thick: float = 0.12) -> Any:
    """A wall along the floor from start (x, z) to end, with rectangular holes (from, to, bottom, top) along it."""
    start, end = np.array(start, float), np.array(end, float)
    length = float(np.linalg.norm(end - start))
    found, at = [], 0.0
    for first, last, bottom, top in sorted(holes):
        found.append(block((at, 0, -thick / 2), (first, height, thick / 2)))
        if bottom > 0:
            found.append(block((first, 0, -thick / 2), (last, bottom, thick / 2)))
        if top < height:
            found.append(block((first, top, -thick / 2), (last, height, thick / 2)))
        at = last
    found.append(block((at, 0, -thick / 2), (length, height, thick / 2)))
    along = (end - start) / length
    axes = np.array([[along[0], 0, along[1]], [0, 1, 0], [-along[1], 0, along[0]]])
    return np.concatenate(found) @ axes + np.array([start[0], 0, start[1]])


def lathe(profile: Any, n: int = 32) -> Any:
    """A profile (radius, height) turned about the vertical axis; fronts lie to the right of its way."""
    profile = np.array(profile, float)
    turn = 2 * np.pi * np.arange(n + 1) / n
    ring = np.stack([np.cos(turn), np.zeros(n + 1), np.sin(turn)], axis=1)
    corners = patches(profile[:, None, 0, None] * ring + profile[:, None, 1, None] * np.array([0, 1, 0]))
    area = np.linalg.norm(np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0]), axis=1)
    return corners[area > 1e-12 * area.max()]


def drum(radius: float, low: float, high: float, n: int = 20) -> Any:
    """An upright cylinder with both lids."""
    return lathe([(0, low), (radius, low), (radius, high), (0, high)], n)
