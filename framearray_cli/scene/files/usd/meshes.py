"""USD -> parts: every surface that its default scene shows, at each of its places, as triangles.

Places come from the hierarchy, instances, point instancers, visibility and purpose. Surfaces are polygon meshes with
values of all interpolations and subsets of faces, and the simple solids.
"""

from collections.abc import Iterator
from dataclasses import dataclass, field, replace
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np

from framearray_cli.base.arrays import Float32, Float64
from framearray_cli.base.errors import SceneError

from ..assets import Assets, Limit
from ..geometry import Indices, Mesh, join_sets, tangents_within, triangulate_faces
from ..materials import MeshBuilder, PlacedMaterial, TexturePlaces, clean_colours, default_material
from ..model import POSED, Meshes, Notes
from .materials import ST, UsdMaterial
from .stage import count_lights
from .subdivision import MOST_FACES, SCENE_FACES, Subdivision, subdivided, unbounded
from .usdcore import bake_skins, matrix, numbers, opened, pose_time, scene_time, usd

FACE_CORNER_BYTES = 200  # memory per corner of a face while a mesh is read
ROUND = 64  # sides of what is round
# Where the x, y and z of a solid whose axis is z go, without turning it inside out.
AXES = {"X": [2, 0, 1], "Y": [1, 2, 0], "Z": [0, 1, 2]}
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
TRIANGLE_BYTES = 450  # least memory per triangle while a scene is read, as for glTF


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class Surface:
    """A surface as triangles between the corners of its faces.

    Attributes:
        points: (c, 3) position of each corner.
        triangles: (f, 3) numbers of corners, counter-clockwise from the front.
        face: (f,) number of the face that each triangle is a part of.
        corner_points, counts: (c,) and (faces,), by which other values are found.
        normals: (c, 3) or None.
        outside: the number of faces left out, as a point of theirs does not exist.
        refined: what a subdivision surface is refined to; `points` and `triangles` have its corners.
    """

    prim: Any
    time: Any
    points: Float64
    triangles: Indices
    face: Indices
    corner_points: Indices
    counts: Indices
    n_points: int
    normals: Float64 | None = None
    outside: int = 0
    refined: Subdivision | None = None

    def at_corners(self, values: Float64, interpolation: str) -> Float64 | None:
        """(c, width) values at the corners of faces; None if there is another number of them than there should be."""
        if interpolation == "constant":
            return np.repeat(values[:1], len((self.refined or self).corner_points), axis=0) if len(values) else None
        found = self._at_cage(values, interpolation)
        if found is None or self.refined is None:
            return found
        if interpolation in ("vertex", "varying"):
            return self.refined.of_points(values, linear=interpolation == "varying")[self.refined.corner_points]
        return self.refined.of_corners(found)

    def _at_cage(self, values: Float64, interpolation: str) -> Float64 | None:
        """`at_corners` of the faces as the file has them, of what is not constant."""
        if interpolation == "uniform":
            return np.repeat(values, self.counts, axis=0) if len(values) == len(self.counts) else None
        if interpolation in ("vertex", "varying"):
            return values[self.corner_points] if len(values) == self.n_points else None
        return values if len(values) == len(self.corner_points) else None

    def values_of(self, primvar: Any, width: int) -> Float64 | None:
        """(c, width) values of a primvar at the corners of faces; None without, or with a wrong number."""
        if not primvar or not primvar.HasValue():
            return None
        return self.at_corners(numbers(primvar.ComputeFlattened(self.time), width), primvar.GetInterpolation())

    def texture_coordinates(self, places: TexturePlaces) -> Float64 | None:
        """(c, 2) texture coordinates, transformed, v upwards; None if the surface has none of that name."""
        found = self.values_of(self._primvar(places.name or ST), 2)
        return None if found is None else places.of(found)

    def colours(self, notes: Notes) -> Float32 | None:
        """(c, 3) linear display colours; None without."""
        found = self.values_of(self._primvar("displayColor"), 3)
        if found is None:
            return None
        opacity = self._primvar("displayOpacity")
        if opacity and opacity.HasValue() and (numbers(opacity.ComputeFlattened(self.time), 1) < 1).any():
            notes.add("the opacity of display colours is left out", self.prim.GetName())
        return clean_colours(found, notes)

    def _primvar(self, name: str) -> Any:
        return usd().UsdGeom.PrimvarsAPI(self.prim).FindPrimvarWithInheritance(name)


def read_surface(prim: Any, time: Any, limit: Limit, notes: Notes, most: int = MOST_FACES) -> Surface | None:
    """Read a mesh or a solid; None without faces.

    Args:
        most: faces that a subdivision surface may be refined to.
    """
    if prim.GetTypeName() != "Mesh":
        return _solid(prim, time, notes)
    geom = usd().UsdGeom
    mesh = geom.Mesh(prim)
    points = numbers(mesh.GetPointsAttr().Get(time), 3)
    counts, indices, holes = (
        np.array(attribute.Get(time) or [], np.int64)
        for attribute in (mesh.GetFaceVertexCountsAttr(), mesh.GetFaceVertexIndicesAttr(), mesh.GetHoleIndicesAttr())
    )
    limit.take("corners", FACE_CORNER_BYTES * len(indices))
    counts = counts[: int(np.argmax(counts < 0))] if (counts < 0).any() else counts
    ends = np.cumsum(counts)
    whole = int((ends <= len(indices)).sum())  # faces whose corners are all there
    counts, indices = counts[:whole], indices[: int(ends[whole - 1]) if whole else 0]
    bad = (indices < 0) | (indices >= len(points))
    starts = np.cumsum(counts) - counts
    outside = np.add.reduceat(np.append(bad, False), starts) > 0 if len(starts) else np.zeros(0, bool)
    outside &= counts >= 3
    kept = (counts >= 3) & ~outside
    kept[holes[(holes >= 0) & (holes < len(counts))]] = False
    if not kept.any():
        return None
    safe = np.clip(indices, 0, len(points) - 1)
    shape = counts, safe, (counts >= 3) & ~outside
    if (without := kept & unbounded(mesh, time, shape, len(points))).any():
        notes.add('faces at borders are left out, as interpolateBoundary = "none" says', prim.GetName())
        kept &= ~without
    triangles, face = triangulate_faces(points[safe], counts, kept, notes)
    bare = Surface(
        prim=prim, time=time, points=points[safe], triangles=triangles, face=face, corner_points=safe, counts=counts,
        n_points=len(points), outside=int(outside.sum()),
    )  # fmt: skip
    if refined := subdivided(mesh, time, points, shape, limit, notes, most):
        at, parent = refined.of_points(points), refined.parent
        triangles, face = triangulate_faces(at[refined.corner_points], refined.counts, kept[parent], notes)
        smooth = (at[refined.corner_points], refined.normals(at))
        bare = replace(
            bare, points=smooth[0], normals=smooth[1], triangles=triangles, face=parent[face], refined=refined
        )
    if mesh.GetOrientationAttr().Get(time) == "leftHanded":
        normals = None if bare.normals is None else -bare.normals
        bare = replace(bare, triangles=bare.triangles[:, ::-1], normals=normals)
    if refined:
        return bare
    smooth, values = geom.PrimvarsAPI(prim).GetPrimvar("normals"), mesh.GetNormalsAttr().Get(time)
    if smooth and smooth.HasValue():
        return replace(bare, normals=bare.values_of(smooth, 3))
    if values is None:
        return bare
    return replace(bare, normals=bare.at_corners(numbers(values, 3), mesh.GetNormalsInterpolation()))


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
    return Surface(
        prim=prim, time=time, points=vertices[corners], triangles=np.arange(3 * n).reshape(-1, 3), face=np.arange(n),
        normals=None if smooth is None else smooth[corners], corner_points=corners, counts=np.full(n, 3),
        n_points=len(vertices),
    )  # fmt: skip


def bound_material(prim: Any) -> Any:
    """The material that a prim is bound to, for previews or for all purposes before that for final pictures."""
    api = usd().UsdShade.MaterialBindingAPI(prim)
    return api.ComputeBoundMaterial("preview")[0] or api.ComputeBoundMaterial("full")[0]


@dataclass(slots=True, kw_only=True)
class PlacedMesh:
    """A surface at all of its places.

    Attributes:
        prim: a mesh or another surface; for instances the first one found, whose materials all share.
        places: (n, 4, 4) `world_from_mesh` each.
        paths: of the prim at each place; all places of an instancer have the path of its prototype.
    """

    prim: Any
    places: list[Any] = field(default_factory=list)
    paths: list[str] = field(default_factory=list)


class _Visit(NamedTuple):
    prim: Any
    places: Float64  # (n, 4, 4) of the parent
    above: tuple[str, ...] = ()  # prototypes on the way down
    level: int = 0


@dataclass(slots=True, kw_only=True, eq=False)
class UsdReader(MeshBuilder):
    """Finds the surfaces of a stage, and gathers their parts, and each material once."""

    stage: Any
    time: Any
    numbers: dict[str, int] = field(default_factory=dict)  # path of a material -> its index
    names: dict[str, int] = field(default_factory=dict)  # name of materials -> their number

    def placed_meshes(self) -> list[PlacedMesh]:
        """List every surface that pictures of the stage show, with all of its places, in the order of the stage.

        Raises:
            SceneError: an instancer holds itself, or there are more places than memory.
        """
        library = usd()
        found: dict[tuple[str, str], PlacedMesh] = {}
        waiting = [_Visit(self.stage.GetPseudoRoot(), np.eye(4)[None])]
        while waiting:
            prim, places, above, level = visit = waiting.pop()
            imageable = library.UsdGeom.Imageable(prim)
            if not prim.IsPseudoRoot():
                # visibility is inherited, so each step looks at its own
                if imageable and imageable.GetVisibilityAttr().Get(self.time) == "invisible":
                    continue
                places = self._placed(prim, places)
                self._note(prim)
            if prim.GetTypeName() == "PointInstancer":
                waiting += reversed(list(self._instances(visit._replace(places=places))))
                continue
            if prim.GetTypeName() in SURFACES and imageable.ComputePurpose() in SHOWN:
                self.assets.limit.take("places", PLACE_BYTES * len(places))
                # instances share a place in a prototype, and the material bound from outside, if any
                shared, material = prim.GetPrimInPrototype() if prim.IsInstanceProxy() else prim, bound_material(prim)
                identity = str(shared.GetPath()), str(material.GetPath()) if material else ""
                placed = found.setdefault(identity, PlacedMesh(prim=prim))
                placed.places.append(places)
                placed.paths += [str(prim.GetPath())] * len(places)
            children = prim.GetFilteredChildren(library.Usd.TraverseInstanceProxies())
            if level >= MOST_LEVELS:
                raise SceneError(f"{prim.GetPath()}: expected at most {MOST_LEVELS} prims below one another")
            waiting += [_Visit(child, places, above, level + 1) for child in reversed(children)]
        return list(found.values())

    def _placed(self, prim: Any, places: Float64) -> Float64:
        """(n, 4, 4) places of a prim from its parent's."""
        xformable = usd().UsdGeom.Xformable(prim)
        if not xformable:
            return places
        if xformable.GetResetXformStack():
            places = np.eye(4)[None]
        local = xformable.GetLocalTransformation(self.time)
        with np.errstate(all="ignore"):  # the scene counts and drops what is not finite
            return np.asarray(places @ matrix(local))

    def _instances(self, visit: _Visit) -> Iterator[_Visit]:
        """Visits of the prototypes of a point instancer, each at all of its instances.

        Raises:
            SceneError: the instancer is below one of its own prototypes.
        """
        kind, prim, limit = usd().UsdGeom.PointInstancer, visit.prim, self.assets.limit
        instancer, path = kind(prim), str(prim.GetPath())
        if path in visit.above:
            raise SceneError(f"{path}: the point instancer holds itself: its prototypes have a cycle")
        numbers = np.array(instancer.GetProtoIndicesAttr().Get(self.time) or [], np.int64)
        mask = np.array(instancer.ComputeMaskAtTime(self.time) or [True] * len(numbers), bool)
        limit.take("places", PLACE_BYTES * len(numbers))
        options = (kind.ExcludeProtoXform, kind.IgnoreMask)
        transforms = instancer.ComputeInstanceTransformsAtTime(self.time, self.time, *options)
        if transforms is None or len(transforms) != len(numbers) or len(mask) != len(numbers):
            self.notes.add("point instancers with a wrong number of places are left out", path)
            return
        local = np.array(transforms, np.float64).reshape(-1, 4, 4).transpose(0, 2, 1)
        for k, target in enumerate(instancer.GetPrototypesRel().GetForwardedTargets()):
            prototype = self.stage.GetPrimAtPath(target)
            chosen = local[(numbers == k) & mask]
            if prototype and len(chosen):
                limit.take("places", PLACE_BYTES * len(chosen) * len(visit.places))
                at = (visit.places[:, None] @ chosen[None]).reshape(-1, 4, 4)
                yield _Visit(prototype, at, (*visit.above, path), visit.level + 1)

    def _note(self, prim: Any) -> None:
        """Note what a prim has that pictures do not show."""
        kind = str(prim.GetTypeName())
        if kind in LEFT_OUT:
            self.notes.add(LEFT_OUT[kind], prim.GetName())
        xformable = usd().UsdGeom.Xformable(prim)
        if kind in SURFACES and xformable:
            points = prim.GetAttribute("points")
            if xformable.TransformMightBeTimeVarying() or (points and points.ValueMightBeTimeVarying()):
                self.notes.add(POSED.format(pose_time(self.stage, self.time)), prim.GetName())

    def add(self, placed: PlacedMesh, most: int) -> None:
        """Add a surface: a part per material; `most` as in `read_surface`."""
        surface = read_surface(placed.prim, self.time, self.assets.limit, self.notes, most)
        if surface is None:
            return
        colours, world_from_mesh = surface.colours(self.notes), np.concatenate(placed.places)
        self.assets.limit.take("triangles", TRIANGLE_BYTES * len(surface.triangles) * len(world_from_mesh))
        self.outside += surface.outside * len(world_from_mesh)
        names = placed.paths if len(set(placed.paths)) > 1 else placed.paths[:1]
        for number, rows in self._by_material(surface, colours is not None):
            self.place(self._mesh(surface, colours, number, surface.triangles[rows]), world_from_mesh, names)

    def _by_material(self, surface: Surface, coloured: bool) -> list[tuple[int, Indices]]:
        """Material and triangles of each subset of faces, and of all others; a face belongs to the first subset."""
        owner = np.full(len(surface.counts), -1, np.int64)
        found = [self._number(surface.prim, coloured)]
        for subset in usd().UsdShade.MaterialBindingAPI(surface.prim).GetMaterialBindSubsets():
            faces = np.array(subset.GetIndicesAttr().Get(self.time) or [], np.int64)
            faces = faces[(faces >= 0) & (faces < len(owner))]
            owner[faces[owner[faces] < 0]] = len(found) - 1
            found.append(self._number(subset.GetPrim(), coloured))
        of_triangles = owner[surface.face] + 1
        rows = [(number, np.flatnonzero(of_triangles == k)) for k, number in enumerate(found)]
        return [(number, chosen) for number, chosen in rows if len(chosen)]

    def _number(self, prim: Any, coloured: bool) -> int:
        """Index of the material that a prim is bound to; the default where it has none that can be read."""
        material = bound_material(prim)
        path = str(material.GetPath()) if material else ""
        if path and path not in self.numbers:
            name, shader = material.GetPrim().GetName(), material.ComputeSurfaceSource()[0]
            shader = shader or material.ComputeSurfaceSource("mtlx")[0]
            self.names[name] = self.names.get(name, 0) + 1  # prims in several places may share a name
            name = name if self.names[name] == 1 else f"{name}.{self.names[name]}"
            source = UsdMaterial(name=name, assets=self.assets, textures=self.textures, shader=shader, time=self.time)
            read = source.read()
            self.numbers[path] = -1 if read is None else self.add_material(read)
        number = self.numbers.get(path, -1)
        if number < 0 and (number := self.numbers.get(f"default {coloured}", -1)) < 0:
            plain = PlacedMaterial(material=default_material(coloured, self.notes), coloured=coloured)
            number = self.numbers[f"default {coloured}"] = self.add_material(plain)
        return number

    def _mesh(self, surface: Surface, colours: Float32 | None, number: int, triangles: Indices) -> Mesh:
        """Some triangles of a surface with one material."""
        entry, rows = self.materials[number], triangles.reshape(-1)
        material = entry.material

        def of_rows(values: Float64 | None) -> Float64 | None:
            return None if values is None else values[rows]

        textured = material.textured or self.assets.all_uvs
        sets = [surface.texture_coordinates(one) for one in entry.places or [TexturePlaces()]] if textured else []
        uvs = of_rows(join_sets(sets))
        bumps = of_rows(surface.texture_coordinates(entry.normal_places)) if material.normal_texture >= 0 else None
        points, normals, tangents = surface.points[rows], of_rows(surface.normals), None
        if bumps is not None:
            shaped = (None if normals is None else normals.reshape(-1, 3, 3), bumps.reshape(-1, 3, 2))
            tangents = tangents_within(self.assets.limit, points.reshape(-1, 3, 3), *shaped)
        return Mesh(
            material=number,
            vertices=points,
            faces=np.arange(len(rows)).reshape(-1, 3),
            normals=normals,
            uvs=uvs,
            colours=colours[triangles] if entry.coloured and colours is not None else None,
            tangents=tangents,
            normal_uvs=bumps,
        )


def read_usd(file: Path, assets: Assets) -> Meshes:
    """Read a USD file.

    Raises:
        SceneError: usd-core is not installed, the file has a form that cannot be read, or names layers elsewhere.
        ValueError, ...: the file is broken.
    """
    notes = Notes()
    with opened(file, assets, notes) as stage:
        time = scene_time(stage, assets.time)
        bake_skins(stage, time, notes)
        reader = UsdReader(assets=assets, notes=notes, stage=stage, time=time)
        found = reader.placed_meshes()
        n_meshes = sum(len(some) for placed in found for some in placed.places if placed.prim.GetTypeName() == "Mesh")
        for placed in found:
            reader.add(placed, min(MOST_FACES, SCENE_FACES // max(n_meshes, 1)))
        lights = count_lights(stage)
    return reader.meshes(lights)
