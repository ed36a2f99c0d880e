"""USD -> parts: every surface that its default scene shows, at each of its places, as triangles.

Places come from the hierarchy, instances, point instancers, visibility and purpose. Surfaces are polygon meshes with
values of all interpolations and subsets of faces, and the simple solids.
"""

from collections.abc import Iterator
from dataclasses import dataclass, field, replace
from pathlib import Path
from typing import Any, TypeAlias

import numpy as np

from framearray_cli.base.arrays import Float32, Float64
from framearray_cli.base.errors import SceneError

from ..assets import Assets, Limit
from ..geometry import Indices, Mesh, place_mesh, tangents_within, triangulate
from ..materials import PlacedMaterial, TexturePlaces, clean_colours, default_material, join_meshes
from ..model import Material, Meshes, Notes, Part
from ..textures import TextureTable
from .materials import ST, UsdMaterial
from .stage import count_lights
from .usdcore import matrix, opened, scene_time, usd

FACE_CORNER_BYTES = 200  # memory per corner of a face while a mesh is read
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


def read_surface(prim: Any, time: Any, limit: Limit, notes: Notes) -> Surface | None:
    """Read a mesh or a solid; None without faces."""
    if prim.GetTypeName() != "Mesh":
        return _solid(prim, time, notes)
    geom = usd().UsdGeom
    mesh = geom.Mesh(prim)
    name = prim.GetName()
    points = numbers(mesh.GetPointsAttr().Get(time), 3)
    counts = np.array(mesh.GetFaceVertexCountsAttr().Get(time) or [], np.int64)
    indices = np.array(mesh.GetFaceVertexIndicesAttr().Get(time) or [], np.int64)
    limit.take("corners", FACE_CORNER_BYTES * len(indices))
    counts, indices = _whole_faces(counts, indices)
    triangles, face, outside = _triangles(mesh, points, counts, indices, time, notes)
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
        normals = primvar_values(bare, smooth, time, 3)
    else:
        values = mesh.GetNormalsAttr().Get(time)
        normals = None if values is None else at_corners(bare, numbers(values, 3), mesh.GetNormalsInterpolation())
    return replace(bare, normals=normals, colours=_colours(bare, api, time, notes, name))


def numbers(values: Any, width: int) -> Float64:
    """(n, width) of an array of USD; empty for none."""
    found = np.array([] if values is None else values, np.float64)
    return found.reshape(-1, width) if found.size % width == 0 else np.zeros((0, width))


def primvar_values(surface: Surface, primvar: Any, time: Any, width: int) -> Float64 | None:
    """(c, width) values of a primvar at the corners of faces; None without, or with another number than it should."""
    if not primvar or not primvar.HasValue():
        return None
    return at_corners(surface, numbers(primvar.ComputeFlattened(time), width), primvar.GetInterpolation())


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
    return primvar_values(surface, primvar, time, 2)


def _colours(surface: Surface, api: Any, time: Any, notes: Notes, name: str) -> Float32 | None:
    found = primvar_values(surface, api.FindPrimvarWithInheritance("displayColor"), time, 3)
    if found is None:
        return None
    opacity = api.FindPrimvarWithInheritance("displayOpacity")
    if opacity and opacity.HasValue() and (numbers(opacity.ComputeFlattened(time), 1) < 1).any():
        notes.add("the opacity of display colours is left out", name)
    return clean_colours(found, notes)


def _whole_faces(counts: Indices, indices: Indices) -> tuple[Indices, Indices]:
    """Cut both to the faces whose corners are all there."""
    counts = counts[: int(np.argmax(counts < 0))] if (counts < 0).any() else counts
    ends = np.cumsum(counts)
    whole = int((ends <= len(indices)).sum())
    return counts[:whole], indices[: int(ends[whole - 1]) if whole else 0]


def _triangles(
    mesh: Any, points: Float64, counts: Indices, indices: Indices, time: Any, notes: Notes
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
        local = triangulate(points[indices[corners]], notes)  # (m, k - 2, 3)
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
    axis = "Z" if kind in ("Cube", "Sphere") else str(prim.GetAttribute("axis").Get(time))
    vertices = np.asarray(shape.vertices, np.float64)[:, AXES.get(axis, AXES["Z"])]
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


Matrices: TypeAlias = Float64  # (n, 4, 4)
PLACE_BYTES = 1000  # memory per place of a mesh
MOST_LEVELS = 200  # of prims below one another
SHOWN = ("default", "render")  # purposes that pictures show
SURFACES = ("Mesh", "Cube", "Sphere", "Cylinder", "Cone", "Capsule", "Plane", "Cylinder_1", "Capsule_1")
LEFT_OUT = {
    "BasisCurves": "curves are left out",
    "NurbsCurves": "curves are left out",
    "HermiteCurves": "curves are left out",
    "Points": "points are left out",
    "NurbsPatch": "NURBS patches are left out; export polygons",
    "TetMesh": "tetrahedra are left out",
    "Volume": "volumes are left out",
}


@dataclass(slots=True, kw_only=True)
class PlacedMesh:
    """A surface and where it stands.

    Attributes:
        prim: a mesh or another surface; for instances the first one found, whose materials all share.
        places: (n, 4, 4) `world_from_mesh` each.
        paths: of the prims that stand there; all places of an instancer have the path of its prototype.
    """

    prim: Any
    places: list[Matrices] = field(default_factory=list)
    paths: list[str] = field(default_factory=list)

    @property
    def world_from_mesh(self) -> Float64:
        """(n, 4, 4)."""
        return np.concatenate(self.places)

    @property
    def names(self) -> list[str]:
        """The path at each place; only one where all are the same."""
        found = [path for path, places in zip(self.paths, self.places, strict=True) for _ in range(len(places))]
        return found if len(set(self.paths)) > 1 else found[:1]


@dataclass(frozen=True, slots=True, kw_only=True)
class _Visit:
    prim: Any
    places: Float64  # (n, 4, 4) of the parent
    above: tuple[str, ...]  # prototypes on the way down
    level: int = 0


def placed_meshes(stage: Any, limit: Limit, notes: Notes) -> list[PlacedMesh]:
    """List every surface that pictures of the stage show, with all of its places, in the order of the stage.

    Raises:
        SceneError: an instancer holds itself, or there are more places than memory.
    """
    library = usd()
    time = scene_time(stage)
    found: dict[tuple[str, str], PlacedMesh] = {}
    waiting = [_Visit(prim=stage.GetPseudoRoot(), places=np.eye(4)[None], above=())]
    while waiting:
        visit = waiting.pop()
        prim, places = visit.prim, visit.places
        imageable = library.UsdGeom.Imageable(prim)
        if not prim.IsPseudoRoot():
            # visibility is inherited, so each step looks at its own
            if imageable and imageable.GetVisibilityAttr().Get(time) == "invisible":
                continue
            places = _placed(prim, places, time)
            _note(prim, notes)
        if prim.GetTypeName() == "PointInstancer":
            waiting += reversed(list(_instances(prim, places, visit, time, limit, notes)))
            continue
        if prim.GetTypeName() in SURFACES and imageable.ComputePurpose() in SHOWN:
            limit.take("places", PLACE_BYTES * len(places))
            placed = found.setdefault(_identity(prim), PlacedMesh(prim=prim))
            placed.places.append(places)
            placed.paths.append(str(prim.GetPath()))
        children = prim.GetFilteredChildren(library.Usd.TraverseInstanceProxies())
        if visit.level >= MOST_LEVELS:
            raise SceneError(f"{prim.GetPath()}: expected at most {MOST_LEVELS} prims below one another")
        waiting += [
            _Visit(prim=child, places=places, above=visit.above, level=visit.level + 1) for child in reversed(children)
        ]
    return list(found.values())


def _identity(prim: Any) -> tuple[str, str]:
    """Identity of a surface: its place in a prototype, and the material bound from outside, if any."""
    shared = prim.GetPrimInPrototype() if prim.IsInstanceProxy() else prim
    material = bound_material(prim)
    return str(shared.GetPath()), str(material.GetPath()) if material else ""


def bound_material(prim: Any) -> Any:
    """The material that a prim is bound to, for previews or for all purposes before that for final pictures."""
    api = usd().UsdShade.MaterialBindingAPI(prim)
    return api.ComputeBoundMaterial("preview")[0] or api.ComputeBoundMaterial("full")[0]


def _placed(prim: Any, places: Float64, time: Any) -> Float64:
    """(n, 4, 4) places of a prim from its parent's."""
    xformable = usd().UsdGeom.Xformable(prim)
    if not xformable:
        return places
    if xformable.GetResetXformStack():
        places = np.eye(4)[None]
    local = xformable.GetLocalTransformation(time)
    with np.errstate(all="ignore"):  # the scene counts and drops what is not finite
        return np.asarray(places @ matrix(local))


def _instances(prim: Any, places: Float64, visit: _Visit, time: Any, limit: Limit, notes: Notes) -> Iterator[_Visit]:
    """Visits of the prototypes of a point instancer, each at all of its instances.

    Raises:
        SceneError: the instancer is below one of its own prototypes.
    """
    library = usd()
    instancer = library.UsdGeom.PointInstancer(prim)
    path = str(prim.GetPath())
    if path in visit.above:
        raise SceneError(f"{path}: the point instancer holds itself: its prototypes have a cycle")
    numbers = np.array(instancer.GetProtoIndicesAttr().Get(time) or [], np.int64)
    targets = instancer.GetPrototypesRel().GetForwardedTargets()
    mask = np.array(instancer.ComputeMaskAtTime(time) or [True] * len(numbers), bool)
    options = (library.UsdGeom.PointInstancer.ExcludeProtoXform, library.UsdGeom.PointInstancer.IgnoreMask)
    limit.take("places", PLACE_BYTES * len(numbers))
    transforms = instancer.ComputeInstanceTransformsAtTime(time, time, *options)
    if transforms is None or len(transforms) != len(numbers) or len(mask) != len(numbers):
        notes.add("point instancers with a wrong number of places are left out", path)
        return
    local = np.array(transforms, np.float64).reshape(-1, 4, 4).transpose(0, 2, 1)
    for k, target in enumerate(targets):
        prototype = prim.GetStage().GetPrimAtPath(target)
        chosen = local[(numbers == k) & mask]
        if prototype and len(chosen):
            limit.take("places", PLACE_BYTES * len(chosen) * len(places))
            at = (places[:, None] @ chosen[None]).reshape(-1, 4, 4)
            yield _Visit(prim=prototype, places=at, above=(*visit.above, path), level=visit.level + 1)


def _note(prim: Any, notes: Notes) -> None:
    """Note what a prim has that pictures do not show."""
    kind = str(prim.GetTypeName())
    if kind in LEFT_OUT:
        notes.add(LEFT_OUT[kind], prim.GetName())
    if kind == "SkelRoot":
        notes.add("skeletons are left out; meshes stand in their rest pose")
    xformable = usd().UsdGeom.Xformable(prim)
    if kind in SURFACES and xformable:
        moves = xformable.TransformMightBeTimeVarying()
        points = prim.GetAttribute("points")
        if moves or (points and points.ValueMightBeTimeVarying()):
            notes.add("meshes that move stand where they are at the first frame", prim.GetName())


TRIANGLE_BYTES = 450  # least memory per triangle while a scene is read, as for glTF


def read_usd(file: Path, assets: Assets) -> Meshes:
    """Read a USD file.

    Raises:
        SceneError: usd-core is not installed, the file has a form that cannot be read, or names layers elsewhere.
        ValueError, ...: the file is broken.
    """
    notes = Notes()
    with opened(file, assets, notes) as stage:
        reader = _Reader(stage, assets, notes)
        for placed in placed_meshes(stage, assets.limit, notes):
            reader.add(placed)
        lights = count_lights(stage)
    materials = [entry.material for entry in reader.materials]
    return join_meshes(reader.parts, materials, reader.textures, reader.outside, lights)


class _Reader:
    """Gathers parts, and each material once."""

    def __init__(self, stage: Any, assets: Assets, notes: Notes) -> None:
        self.time, self.assets, self.notes = scene_time(stage), assets, notes
        self.textures = TextureTable(notes, assets.limit)
        self.parts: list[Part] = []
        self.materials: list[PlacedMaterial] = []
        self.numbers: dict[str, int] = {}
        self.names: dict[str, int] = {}
        self.outside = 0

    def add(self, placed: PlacedMesh) -> None:
        """Add a surface: a part per material."""
        surface = read_surface(placed.prim, self.time, self.assets.limit, self.notes)
        if surface is None:
            return
        places = placed.world_from_mesh
        self.assets.limit.take("triangles", TRIANGLE_BYTES * len(surface.triangles) * len(places))
        self.outside += surface.outside * len(places)
        for material, rows in self._by_material(placed.prim, surface):
            self._add_part(placed, surface, material, surface.triangles[rows])

    def _by_material(self, prim: Any, surface: Surface) -> list[tuple[int, Indices]]:
        """Material and triangles of each subset of faces, and of all others; a face belongs to the first subset."""
        shade = usd().UsdShade
        owner = np.full(len(surface.counts), -1, np.int64)
        found = [self._number(prim, surface)]
        for subset in shade.MaterialBindingAPI(prim).GetMaterialBindSubsets():
            faces = np.array(subset.GetIndicesAttr().Get(self.time) or [], np.int64)
            faces = faces[(faces >= 0) & (faces < len(owner))]
            owner[faces[owner[faces] < 0]] = len(found) - 1
            found.append(self._number(subset.GetPrim(), surface))
        of_triangles = owner[surface.face] + 1
        rows = [(found[k], np.flatnonzero(of_triangles == k)) for k in range(len(found))]
        return [(number, chosen) for number, chosen in rows if len(chosen)]

    def _number(self, prim: Any, surface: Surface) -> int:
        """Index of the material that a prim is bound to; the default where it has none that can be read."""
        material = bound_material(prim)
        path = str(material.GetPath()) if material else ""
        if path and path not in self.numbers:
            name, shader = self._name(material.GetPrim().GetName()), material.ComputeSurfaceSource()[0]
            source = UsdMaterial(name=name, assets=self.assets, textures=self.textures, shader=shader, time=self.time)
            read = source.read()
            self.numbers[path] = -1 if read is None else self._append(read)
        number = self.numbers.get(path, -1)
        if number >= 0:
            return number
        coloured = surface.colours is not None
        key = f"default {coloured}"
        if key not in self.numbers:
            self.numbers[key] = self._append(
                PlacedMaterial(material=default_material(coloured, self.notes), coloured=coloured)
            )
        return self.numbers[key]

    def _name(self, name: str) -> str:
        """A name for a material; prims in several places may share one, but are not one material."""
        self.names[name] = self.names.get(name, 0) + 1
        return name if self.names[name] == 1 else f"{name}.{self.names[name]}"

    def _append(self, material: PlacedMaterial) -> int:
        self.materials.append(material)
        return len(self.materials) - 1

    def _add_part(self, placed: PlacedMesh, surface: Surface, number: int, triangles: Indices) -> None:
        entry, prim = self.materials[number], placed.prim
        material: Material = entry.material
        rows = triangles.reshape(-1)
        points, normals = surface.points[rows], None if surface.normals is None else surface.normals[rows]
        textured = material.textured or self.assets.all_uvs
        uvs = self._uvs(prim, surface, entry.places, rows) if textured else None
        far = uvs is not None and len(uvs) > 0 and (uvs.min() < 0 or uvs.max() > 1)
        if material.textured and far and not entry.places.repeats:
            self.notes.add("textures that clamp or mirror at their edges repeat", material.name)
        bumps = self._uvs(prim, surface, entry.normal_places, rows) if material.normal_texture >= 0 else None
        tangents = None
        if bumps is not None:
            shaped = (None if normals is None else normals.reshape(-1, 3, 3), bumps.reshape(-1, 3, 2))
            tangents = tangents_within(self.assets.limit, points.reshape(-1, 3, 3), *shaped)
        colours = surface.colours[triangles] if entry.coloured and surface.colours is not None else None
        mesh = Mesh(
            material=number,
            vertices=points,
            faces=np.arange(len(rows)).reshape(-1, 3),
            normals=normals,
            uvs=uvs,
            colours=colours,
            tangents=tangents,
            normal_uvs=bumps,
        )
        self.parts.append(place_mesh(mesh, placed.world_from_mesh, placed.names))

    def _uvs(self, prim: Any, surface: Surface, places: TexturePlaces, rows: Indices) -> Float64 | None:
        """(corners, 2) texture coordinates, transformed, v upwards."""
        found = texture_coordinates(prim, surface, places.name or ST, self.time)
        if found is None:
            return None
        uvs = found[rows]
        if places.matrix is not None:
            uvs = np.column_stack([uvs, np.ones(len(uvs))]) @ places.matrix.T
        return uvs
