"""USD -> parts: every surface that its default scene shows, at each of its places."""

from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from framearray_cli.base.arrays import Float64

from ..assets import Assets
from ..materials import default_material
from ..model import Material, Meshes, Notes, Part
from ..obj.polygons import Ears
from ..placing import place_mesh
from ..tangents import CORNER_BYTES, compute_tangents
from ..textures import TextureTable
from .lights import count_lights
from .materials import UsdMaterial, read_material
from .meshes import Surface, read_surface, texture_coordinates
from .nodes import PlacedMesh, bound_material, placed_meshes, scene_time
from .shading import Places
from .usdcore import opened, usd

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
        if reader.ears.fans:
            notes.add(f"large concave polygons are split as if they were convex: {reader.ears.fans}")
        lights = count_lights(stage)
    return Meshes(
        parts=tuple(reader.parts),
        materials=tuple(entry.material for entry in reader.materials),
        textures=tuple(reader.textures.textures),
        dropped={"index out of range": reader.outside} if reader.outside else {},
        notes=notes.lines(),
        lights=lights,
    )


class _Reader:
    """Gathers parts, and each material once."""

    def __init__(self, stage: Any, assets: Assets, notes: Notes) -> None:
        self.time, self.assets, self.notes = scene_time(stage), assets, notes
        self.textures = TextureTable(notes, assets.limit)
        self.parts: list[Part] = []
        self.materials: list[UsdMaterial] = []
        self.numbers: dict[str, int] = {}
        self.names: dict[str, int] = {}
        self.ears = Ears()
        self.outside = 0

    def add(self, placed: PlacedMesh) -> None:
        """Add a surface: a part per material."""
        surface = read_surface(placed.prim, self.time, self.assets.limit, self.ears, self.notes)
        if surface is None:
            return
        places = placed.world_from_mesh
        self.assets.limit.take("triangles", TRIANGLE_BYTES * len(surface.triangles) * len(places))
        self.outside += surface.outside * len(places)
        for material, rows in self._by_material(placed.prim, surface):
            self._add_part(placed, surface, material, surface.triangles[rows])

    def _by_material(self, prim: Any, surface: Surface) -> list[tuple[int, NDArray[np.int64]]]:
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
            name = self._name(material.GetPrim().GetName())
            arguments = (self.time, self.assets, self.textures, self.notes)
            read = read_material(material.GetPrim(), name, *arguments)
            self.numbers[path] = -1 if read is None else self._append(read)
        number = self.numbers.get(path, -1)
        if number >= 0:
            return number
        coloured = surface.colours is not None
        key = f"default {coloured}"
        if key not in self.numbers:
            self.numbers[key] = self._append(
                UsdMaterial(material=default_material(coloured, self.notes), coloured=coloured)
            )
        return self.numbers[key]

    def _name(self, name: str) -> str:
        """A name for a material; prims in several places may share one, but are not one material."""
        self.names[name] = self.names.get(name, 0) + 1
        return name if self.names[name] == 1 else f"{name}.{self.names[name]}"

    def _append(self, material: UsdMaterial) -> int:
        self.materials.append(material)
        return len(self.materials) - 1

    def _add_part(self, placed: PlacedMesh, surface: Surface, number: int, triangles: NDArray[np.int64]) -> None:
        entry, prim = self.materials[number], placed.prim
        material: Material = entry.material
        rows = triangles.reshape(-1)
        points, normals = surface.points[rows], None if surface.normals is None else surface.normals[rows]
        textured = material.textured or self.assets.all_uvs
        uvs = self._uvs(prim, surface, entry.places, rows, material) if textured else None
        if (
            material.textured
            and uvs is not None
            and not entry.repeats
            and len(uvs)
            and (uvs.min() < 0 or uvs.max() > 1)
        ):
            self.notes.add("textures that clamp or mirror at their edges repeat", material.name)
        bumps = self._uvs(prim, surface, entry.normal_places, rows, material) if material.normal_texture >= 0 else None
        tangents = None
        if bumps is not None:
            with self.assets.limit.lend("tangents", CORNER_BYTES * len(rows)):
                shaped = (None if normals is None else normals.reshape(-1, 3, 3), bumps.reshape(-1, 3, 2))
                tangents = compute_tangents(points.reshape(-1, 3, 3), *shaped)
        self.parts.append(
            place_mesh(
                points,
                np.arange(len(rows)).reshape(-1, 3),
                placed.world_from_mesh,
                number,
                normals=normals,
                uvs=uvs,
                colours=surface.colours[rows] if entry.coloured and surface.colours is not None else None,
                tangents=tangents,
                normal_uvs=bumps,
                names=placed.names,
            )
        )

    def _uvs(
        self, prim: Any, surface: Surface, places: Places, rows: NDArray[np.int64], material: Material
    ) -> Float64 | None:
        """(corners, 2) texture coordinates, transformed, v upwards."""
        found = texture_coordinates(prim, surface, places.primvar, self.time)
        if found is None:
            return None
        uvs = found[rows]
        if places.matrix is not None:
            uvs = np.column_stack([uvs, np.ones(len(uvs))]) @ places.matrix.T
        return uvs
