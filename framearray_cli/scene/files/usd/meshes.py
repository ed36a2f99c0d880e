"""USD meshes -> triangles: polygons, values of all interpolations, subsets of faces, and the simple solids."""

from dataclasses import dataclass, replace
from typing import Any

import numpy as np
from numpy.typing import NDArray

from framearray_cli.base.arrays import Float32, Float64

from ..assets import Limit
from ..geometry import Ears, triangulate
from ..materials import clean_colours
from ..model import Notes
from .usdcore import usd

CORNER_BYTES = 200  # memory per corner of a face while a mesh is read
Indices = NDArray[np.int64]
ROUND = 64  # sides of what is round


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class Surface:
    """A surface as triangles between the corners of its faces.

    Attributes:
        points: (c, 3) position of each corner.
        triangles: (f, 3) numbers of corners, counter-clockwise from the front.
        face: (f,) number of the face that each triangle is a part of.
        normals: (c, 3) or None.
        colours: (c, 3) linear display colours, or None.
        corner_points, counts: (c,) and (faces,), by which other values are found.
        outside: the number of faces left out, as a point of theirs does not exist.
    """

    points: Float64
    triangles: Indices
    face: Indices
    corner_points: Indices
    counts: Indices
    n_points: int
    normals: Float64 | None = None
    colours: Float32 | None = None
    outside: int = 0


def read_surface(prim: Any, time: Any, limit: Limit, ears: Ears, notes: Notes) -> Surface | None:
    """Read a mesh or a solid; None without faces."""
    if prim.GetTypeName() != "Mesh":
        return _solid(prim, time, notes)
    geom = usd().UsdGeom
    mesh = geom.Mesh(prim)
    name = prim.GetName()
    points = numbers(mesh.GetPointsAttr().Get(time), 3)
    counts = np.array(mesh.GetFaceVertexCountsAttr().Get(time) or [], np.int64)
    indices = np.array(mesh.GetFaceVertexIndicesAttr().Get(time) or [], np.int64)
    limit.take("corners", CORNER_BYTES * len(indices))
    counts, indices = _whole_faces(counts, indices)
    triangles, face, outside = _triangles(mesh, points, counts, indices, ears, time)
    if not len(triangles):
        return None
    if mesh.GetOrientationAttr().Get(time) == "leftHanded":
        triangles = triangles[:, ::-1]
    if mesh.GetSubdivisionSchemeAttr().Get(time) != "none":
        notes.add("subdivision surfaces are shown as their cages", name)
    safe = np.clip(indices, 0, max(len(points) - 1, 0))
    bare = Surface(
        points=points[safe],
        triangles=triangles,
        face=face,
        corner_points=safe,
        counts=counts,
        n_points=len(points),
        outside=outside,
    )
    api = geom.PrimvarsAPI(prim)
    smooth = api.GetPrimvar("normals")
    if smooth and smooth.HasValue():
        normals = at_corners(bare, primvar_values(smooth, time, 3), smooth.GetInterpolation())
    else:
        values = mesh.GetNormalsAttr().Get(time)
        normals = None if values is None else at_corners(bare, numbers(values, 3), mesh.GetNormalsInterpolation())
    return replace(bare, normals=normals, colours=_colours(bare, api, time, notes, name))


def numbers(values: Any, width: int) -> Float64:
    """(n, width) of an array of USD; empty for none."""
    found = np.array([] if values is None else values, np.float64)
    return found.reshape(-1, width) if found.size % width == 0 else np.zeros((0, width))


def primvar_values(primvar: Any, time: Any, width: int) -> Float64:
    """(n, width) values of a primvar, its indices followed."""
    return numbers(primvar.ComputeFlattened(time), width)


def at_corners(surface: Surface, values: Float64, interpolation: str) -> Float64 | None:
    """(c, width) values at the corners of faces; None where there is another number of them than there should be."""
    if interpolation == "constant":
        return np.repeat(values[:1], len(surface.corner_points), axis=0) if len(values) else None
    if interpolation == "uniform":
        return np.repeat(values, surface.counts, axis=0) if len(values) == len(surface.counts) else None
    if interpolation in ("vertex", "varying"):
        return values[surface.corner_points] if len(values) == surface.n_points else None
    return values if len(values) == len(surface.corner_points) else None


def texture_coordinates(prim: Any, surface: Surface, name: str, time: Any) -> Float64 | None:
    """(c, 2) texture coordinates of a primvar, v upwards; None where the mesh has none of that name."""
    primvar = usd().UsdGeom.PrimvarsAPI(prim).FindPrimvarWithInheritance(name)
    if not primvar or not primvar.HasValue():
        return None
    return at_corners(surface, primvar_values(primvar, time, 2), primvar.GetInterpolation())


def _colours(surface: Surface, api: Any, time: Any, notes: Notes, name: str) -> Float32 | None:
    primvar = api.FindPrimvarWithInheritance("displayColor")
    if not primvar or not primvar.HasValue():
        return None
    opacity = api.FindPrimvarWithInheritance("displayOpacity")
    if opacity and opacity.HasValue() and (primvar_values(opacity, time, 1) < 1).any():
        notes.add("the opacity of display colours is left out", name)
    found = at_corners(surface, primvar_values(primvar, time, 3), primvar.GetInterpolation())
    return None if found is None else clean_colours(found, notes)


def _whole_faces(counts: Indices, indices: Indices) -> tuple[Indices, Indices]:
    """Cut both to the faces whose corners are all there."""
    counts = counts[: int(np.argmax(counts < 0))] if (counts < 0).any() else counts
    ends = np.cumsum(counts)
    whole = int((ends <= len(indices)).sum())
    return counts[:whole], indices[: int(ends[whole - 1]) if whole else 0]


def _triangles(
    mesh: Any, points: Float64, counts: Indices, indices: Indices, ears: Ears, time: Any
) -> tuple[Indices, Indices, int]:
    """(f, 3) corner numbers, (f,) face numbers in the order of faces, and the number of faces outside."""
    starts = np.cumsum(counts) - counts
    bad = (indices < 0) | (indices >= len(points))
    touched = np.add.reduceat(np.append(bad, False), starts) > 0 if len(starts) else np.zeros(0, bool)
    touched &= counts > 0
    holes = np.array(mesh.GetHoleIndicesAttr().Get(time) or [], np.int64)
    kept = (counts >= 3) & ~touched
    kept[holes[(holes >= 0) & (holes < len(counts))]] = False
    triangles, face = [np.zeros((0, 3), np.int64)], [np.zeros(0, np.int64)]
    for k in np.unique(counts[kept]):
        faces = np.flatnonzero(kept & (counts == k))
        corners = starts[faces, None] + np.arange(k)  # (m, k)
        local = triangulate(points[indices[corners]], ears)  # (m, k - 2, 3)
        triangles.append(np.take_along_axis(corners[:, None, :], local, axis=2).reshape(-1, 3))
        face.append(np.repeat(faces, k - 2))
    found, owner = np.concatenate(triangles), np.concatenate(face)
    order = np.argsort(owner, kind="stable")
    return found[order], owner[order], int((touched & (counts >= 3)).sum())


def _solid(prim: Any, time: Any, notes: Notes) -> Surface | None:
    """A cube, sphere, cylinder, cone, capsule or plane as triangles."""
    import trimesh

    def value(name: str, default: float) -> float:
        found = prim.GetAttribute(name).Get(time)
        return default if found is None else abs(float(found))

    kind = str(prim.GetTypeName()).removesuffix("_1")
    radius, tall = value("radius", 0.5), value("height", 1.0)
    if prim.GetTypeName().endswith("_1"):
        radius = max(value("radiusTop", 0.5), value("radiusBottom", 0.5))
        notes.add("solids with two radii have the larger one at both ends", prim.GetName())
    if not (np.isfinite([radius, tall]).all() and radius > 0):
        return None
    smooth = None
    if kind == "Cube":
        shape = trimesh.creation.box([value("size", 2.0)] * 3)
    elif kind == "Sphere":
        shape = trimesh.creation.uv_sphere(radius, count=[ROUND // 2, ROUND])
        smooth = np.asarray(shape.vertices, np.float64)
    elif kind == "Cylinder":
        shape = trimesh.creation.cylinder(radius, tall, sections=ROUND)
    elif kind == "Cone":
        shape = trimesh.creation.cone(radius, tall, sections=ROUND)
        shape.apply_translation([0, 0, -tall / 2])
    elif kind == "Capsule":
        shape = trimesh.creation.capsule(tall, radius, count=[ROUND // 2, ROUND])
        shape.apply_translation([0, 0, -tall / 2])
    else:
        x, y = value("width", 2.0) / 2, value("length", 2.0) / 2
        shape = trimesh.Trimesh([[-x, -y, 0], [x, -y, 0], [x, y, 0], [-x, y, 0]], [[0, 1, 2], [0, 2, 3]], process=False)
    turn = (
        AXES.get(str(prim.GetAttribute("axis").Get(time) or "Z"), AXES["Z"])
        if kind not in ("Cube", "Sphere")
        else AXES["Z"]
    )
    vertices = np.asarray(shape.vertices, np.float64)[:, turn]
    corners = np.asarray(shape.faces, np.int64).reshape(-1)
    n = len(corners) // 3
    bare = Surface(
        points=vertices[corners],
        triangles=np.arange(3 * n).reshape(-1, 3),
        face=np.arange(n),
        normals=None if smooth is None else smooth[corners],
        corner_points=corners,
        counts=np.full(n, 3),
        n_points=len(vertices),
    )
    return replace(bare, colours=_colours(bare, usd().UsdGeom.PrimvarsAPI(prim), time, notes, prim.GetName()))


# Where the x, y and z of a solid whose axis is z go, without turning it inside out.
AXES = {"X": [2, 0, 1], "Y": [1, 2, 0], "Z": [0, 1, 2]}
