"""Materials: the same rules for the readers of all formats, and for values of the job that replace values of a file.

A reader maps a surface of its file to a diffuse part, a mirror part and an opacity; `MaterialSource` puts them
together. No surface reflects more than it receives. Unless surfaces follow the file, glass is left out and blended
textures are cut out. There are defaults for missing materials, and for colours that are not colours. Gloss of every
format becomes metal and roughness of glTF.
"""

import difflib
from collections.abc import Callable, Hashable, Mapping, Sequence
from dataclasses import dataclass, field, replace
from typing import Any

import numpy as np
from numpy.typing import NDArray

from framearray_cli.base.arrays import Bytes, Float32, Float64
from framearray_cli.base.errors import SceneError
from framearray_cli.job.job import MaterialTable

from .assets import Assets
from .geometry import Mesh, place_mesh
from .model import GREY, SCREENED, UV_SET, Material, Meshes, Notes, PaneGlass, Part, Rgb3, join_names, rgb3
from .textures import EncodedImage, TextureTable, mean_texel

TRANSMISSIVE_ALPHA = 0.25  # a surface that stops less light counts as glass, which is left out for now
OPAQUE = 0.999  # a surface that covers this share covers everything
CUTOFF = 0.5  # alpha where a blended texture turns from hole to surface; also glTF's default for masks
BLACK: Rgb3 = (0.0, 0.0, 0.0)
Split = tuple[Rgb3, Rgb3]  # diffuse and mirror part of a surface
BRIGHTEST = 1e30  # stands in for infinite reflectivities, before they are scaled to 1
ROUGH_METAL = "rough metals are taken as diffuse"
COVERS = "partly transparent materials cover a part of what is behind them, by chance"
THIN_GLASS = "transmissive materials are thin glass, which light passes straight"
LEFT_OUT = 'transmissive materials are left out; scene.surfaces = "file" takes them as thin glass'
CUT_OUT = "materials that their alpha mask removes everywhere are left out"


IN_PLACE, SAME_PLACE = np.eye(3)[:2], 1e-7  # a texture 10,000 texels wide is moved by less than a texel


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class TexturePlaces:
    """Texture coordinates by which the meshes of a material show a texture.

    Attributes:
        name: of the attribute or primvar; "" without texture.
        matrix: (2, 3) transform of (u, v, 1), v as in the file, or None.
        sampler: continuation and blending of the texture, see `model.WRAP_V`.
    """

    name: str = ""
    matrix: Float64 | None = None
    sampler: int = 0

    def of(self, uvs: Float64) -> Float64:
        """(v, 2) texture coordinates, transformed, v as in the file."""
        with np.errstate(all="ignore"):
            return uvs if self.matrix is None else np.column_stack([uvs, np.ones(len(uvs))]) @ self.matrix.T

    def agrees(self, other: "TexturePlaces") -> bool:
        """True if the texture coordinates are equal."""
        a, b = (IN_PLACE if one.matrix is None else one.matrix for one in (self, other))
        return self.name == other.name and np.allclose(a, b, rtol=SAME_PLACE, atol=SAME_PLACE)

    def same(self, other: "TexturePlaces") -> bool:
        """True if images lie at the same places, and continue alike."""
        return self.sampler == other.sampler and self.agrees(other)


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class PlacedMaterial:
    """A material, the places of its textures and of its normal map; `coloured`: vertex colours are its colour.

    `places` lists the sets of texture coordinates, by the numbers that samplers give. `glass` is thin glass in the same
    places, seen through the holes of the material.
    """

    material: Material
    glass: Material | None = None
    places: Sequence[TexturePlaces] = ()
    normal_places: TexturePlaces = field(default_factory=TexturePlaces)
    coloured: bool = False


MIRROR_ROUGHNESS = 0.1  # up to it a metal is a mirror
# Nothing shines more sharply: light of a point on a smooth dielectric would be seen in single pixels only.
SMOOTHEST = 0.1


@dataclass(frozen=True, slots=True, kw_only=True)
class SurfaceGloss:
    """Gloss of a material.

    Attributes:
        base: base colour factor, of any size.
        roughness, metallic: factors.
        texture: index of the texture whose green and blue multiply them, and red and alpha the coat, or -1.
        coat, coat_roughness: weight of a clear coat, and its roughness.
    """

    base: Rgb3
    roughness: float
    metallic: float
    texture: int = -1
    coat: float = 0.0
    coat_roughness: float = 0.0


def is_mirror(metallic: float, roughness: float) -> bool:
    """True if a metal is so smooth that it is a mirror."""
    return metallic > 0 and roughness <= MIRROR_ROUGHNESS


@dataclass(frozen=True, slots=True, kw_only=True)
class MaterialSource:
    """A material of a file while it is read; the reader of each format adds where it finds values.

    Attributes:
        textures: gets the images of the material, and its notes.
        places: gets the sets of texture coordinates that textures of the material have, each once.
    """

    name: str
    assets: Assets
    textures: TextureTable
    places: list[TexturePlaces] = field(default_factory=list)

    @property
    def shows_emission(self) -> bool:
        """True if the emission of the material is read."""
        return self.assets.as_file or self.name in self.assets.shining

    def note(self, sentence: str) -> None:
        """Note something about the material."""
        self.textures.notes.add(sentence, self.name)

    def note_unused(self, *, emits: bool = False, bumps: bool = False) -> None:
        """Note emission and normal maps that the scene does not use, or only shows."""
        if emits and self.name not in self.assets.shining:
            seen = 'emission is seen and lights nothing; a source of type "mesh" lets it light'
            self.note(seen if self.assets.as_file else "emission is left out")
        if bumps and not self.assets.as_file:
            self.note('normal maps are left out; scene.surfaces = "file" uses them')

    def image(self, key: Hashable, read: Callable[[], bytes]) -> EncodedImage:
        """An image of the material."""
        return EncodedImage(key, f"material {self.name}", read)

    def tiled(self, key: Hashable, read: Callable[[int], bytes]) -> EncodedImage:
        """An image of the material in tiles, see `TextureTable.tiled`."""
        return self.textures.tiled(key, f"material {self.name}", read)

    def placed(self, texture: int, places: TexturePlaces) -> int:
        """Index of a texture at its places; -1 of none."""
        if texture < 0:
            return -1
        number = next((k for k, other in enumerate(self.places) if other.agrees(places)), len(self.places))
        if number == len(self.places):
            self.places.append(places)
        return self.textures.sampled(texture, places.sampler | number << UV_SET)

    def make(
        self, opacity: Material, surface: SurfaceGloss | Split, *, texture: int = -1, mirror_texture: int = -1
    ) -> Material:
        """Make the material; no surface reflects more than it receives.

        Args:
            opacity: its transparency.
            surface: its gloss, or the reflectivities of its diffuse and of its mirror part, of any size.
            texture: multiplies the diffuse part, or the base colour.
            mirror_texture: multiplies the mirror part, unless that is 0.
        """
        if isinstance(surface, SurfaceGloss):
            roughness, metallic = min(max(surface.roughness, SMOOTHEST), 1.0), min(max(surface.metallic, 0.0), 1.0)
            opacity = replace(opacity, roughness=roughness, metallic=metallic, gloss_texture=surface.texture)
            coat = min(max(surface.coat, 0.0), 1.0)
            opacity = replace(opacity, coat=coat, coat_roughness=min(surface.coat_roughness, 1.0) if coat else 0.0)
            surface = surface.base, BLACK
        found = np.array(surface, np.float64)  # (2, 3)
        held = np.clip(np.nan_to_num(found, nan=0.0), 0.0, BRIGHTEST)
        scale = 1.0 / np.maximum(held.sum(axis=0), 1.0)
        if (held != found).any() or scale.min() < 1 - 1e-6:
            self.note("reflectivities outside 0 to 1 are brought into it")
        reflectivity, specular = map(rgb3, held * scale)
        mirror_texture = mirror_texture if max(specular) > 0 else -1
        return replace(
            opacity, reflectivity=reflectivity, specular=specular, texture=texture, specular_texture=mirror_texture
        )

    def masked(self, alpha: float, texture: int, cutoff: float) -> Material:
        """Opacity of a material whose points are absent where alpha is below the cutoff."""
        lowest, highest = self.textures.alpha_range(texture)
        if alpha * lowest >= cutoff:
            return Material(name=self.name)
        if alpha * highest < cutoff:
            self.note(CUT_OUT)
            return Material(name=self.name, left_out="cut out")
        return Material(name=self.name, alpha=alpha, alpha_texture=texture, alpha_cutoff=cutoff)

    def blended(self, alpha: float, texture: int, glass: PaneGlass | None = None) -> Material:
        """Opacity of a material that lets light through by alpha: glass, screened, cut out, or taken as opaque.

        Args:
            glass: transmission of a pane of the material, if surfaces follow the file; None leaves panes out.
        """
        lowest, highest = self.textures.alpha_range(texture)
        if alpha * highest < TRANSMISSIVE_ALPHA:
            self.note(LEFT_OUT if glass is None else THIN_GLASS)
            return Material(name=self.name, left_out="transmissive" if glass is None else "", glass=glass)
        if glass is not None:
            if alpha * lowest >= OPAQUE:
                return Material(name=self.name)
            self.note(COVERS)
            return Material(name=self.name, alpha=alpha, alpha_texture=texture, alpha_cutoff=SCREENED)
        if lowest < CUTOFF <= highest:
            self.note("textures with partial transparency are cut out at half opacity")
            return Material(name=self.name, alpha_texture=texture, alpha_cutoff=CUTOFF)
        if alpha * lowest < 1:
            self.note("partly transparent materials are taken as opaque")
        return Material(name=self.name)

    def shown_alpha(self, alpha: float, textured: bool) -> float:
        """Opacity factor in a format whose exporters disagree on opacity 0: 1 if the material has a texture."""
        if alpha != 0 or not textured:
            return alpha
        self.note("opacity 0 under a texture is taken as opaque: many exporters mean that")
        return 1.0

    def split_metal(self, base: Float64, metallic: float, roughness: float) -> Split:
        """Split a base colour if surfaces do not follow the file: smooth metal is the mirror part, the rest diffuse."""
        metallic = min(max(metallic, 0.0), 1.0)
        mirror = metallic if roughness <= MIRROR_ROUGHNESS else 0.0
        if metallic > 0 and mirror == 0:
            self.note(ROUGH_METAL)
        return rgb3(base * (1.0 - mirror)), rgb3(base * mirror)


@dataclass(slots=True, kw_only=True, eq=False)
class MeshBuilder:
    """Contents of a file while it is read.

    Attributes:
        textures: gets the images of materials, and notes.
        outside: number of triangles left out because a vertex of theirs does not exist.
    """

    assets: Assets
    notes: Notes = field(default_factory=Notes)
    textures: TextureTable = field(init=False)
    parts: list[Part] = field(default_factory=list)
    materials: list[PlacedMaterial] = field(default_factory=list)
    outside: int = 0

    def __post_init__(self) -> None:
        self.textures = TextureTable(self.notes, self.assets.limit)

    def add_material(self, material: PlacedMaterial | Material) -> int:
        """Add a material; return its index."""
        self.materials.append(material if isinstance(material, PlacedMaterial) else PlacedMaterial(material=material))
        return len(self.materials) - 1

    def place(self, mesh: Mesh, world_from_mesh: Float64, names: Sequence[str]) -> None:
        """Add a mesh at all of its places, see `place_mesh`."""
        self.parts.append(place_mesh(mesh, world_from_mesh, names))
        self.outside += mesh.outside * len(world_from_mesh)

    def meshes(self, lights: int = 0) -> Meshes:
        """Return the contents of the file."""
        materials, parts = [entry.material for entry in self.materials], list(self.parts)
        for number, entry in enumerate(self.materials):
            if entry.glass is not None:
                parts += [replace(part, material=len(materials)) for part in self.parts if part.material == number]
                materials.append(entry.glass)
        texels = self.textures.textures
        used = {id(texels[n]) for m in materials for n in {*m.used_textures, m.normal_texture} - {-1}}
        gone = {id(texels[old]): new for old, new in self.textures.replaced.items() if old >= 0}
        texels[:] = [texels[gone[id(t)]] if id(t) in gone.keys() - used else t for t in texels]
        return Meshes(
            parts=tuple(parts),
            materials=tuple(materials),
            textures=tuple(self.textures.textures),
            samplers=tuple(self.textures.samplers),
            dropped={"index out of range": self.outside} if self.outside else {},
            notes=self.notes.lines(),
            lights=lights,
        )


def with_something_shown(meshes: Meshes) -> Meshes:
    """Make all materials opaque if every triangle would be invisible or glass, as no picture could show anything."""
    used = {part.material for part in meshes.parts if len(part.corners)}
    if not used or not all(meshes.materials[number].unseen for number in used):
        return meshes
    materials = tuple(replace(material, left_out="", glass=None) for material in meshes.materials)
    notes = [note for note in meshes.notes if not note.startswith((THIN_GLASS, LEFT_OUT, CUT_OUT))]
    names = join_names([meshes.materials[number].name for number in sorted(used)])
    note = f"materials that would leave nothing visible are taken as opaque: {names}"
    return replace(meshes, materials=materials, notes=(*notes, note))


def default_material(coloured: bool, notes: Notes, name: str = "") -> Material:
    """The default for a missing material: white under vertex colours, else grey."""
    if coloured:
        return Material(name=name or "vertex colours", reflectivity=(1.0, 1.0, 1.0))
    notes.add(f"surfaces without material have a grey of reflectivity {GREY}")
    return Material(name=name or "default")


def clean_colours(values: NDArray[Any], notes: Notes) -> Float32:
    """Bring vertex colours into [0, 1]: scale 0 to 255, replace NaN by white, leave out an opacity behind blue."""
    if (values[..., 3:] < 1).any():
        notes.add("the opacity of vertex colours is left out")
    colours = values[..., :3].astype(np.float64)
    bad = np.asarray(~np.isfinite(colours).all(axis=-1))
    if bad.any():
        notes.add("vertex colours that are not numbers are taken as white")
        colours = np.where(bad[..., None], 1.0, colours)
    if colours.size and colours.max() > 1.5:
        notes.add("vertex colours from 0 to 255 are scaled to 0 to 1")
        colours = colours / 255.0
    return np.clip(colours, 0.0, 1.0).astype(np.float32)


ROUGH = 1.0  # glTF's default
LONGEST_NAME = 100  # characters of a name in a message
NAMES_IN_AN_ERROR = 12


def override_materials(
    materials: Sequence[Material], overrides: Mapping[str, MaterialTable], textures: Sequence[Bytes], notes: Notes
) -> list[Material]:
    """Apply the values of the job.

    Args:
        textures: (height, width, 4) RGBA each.
    """
    names = sorted({material.name for material in materials})
    if unknown := [name for name in overrides if name not in names]:
        raise SceneError("; ".join(_unknown_material(name, names) for name in unknown))
    changes = {name: _Override(table, textures, notes) for name, table in overrides.items()}
    return [changes[m.name].applied(m) if m.name in changes else m for m in materials]


@dataclass(frozen=True, slots=True)
class _Override:
    """Values of the job for all materials of a name."""

    table: MaterialTable
    textures: Sequence[Bytes]
    notes: Notes

    def applied(self, material: Material) -> Material:
        """Return a material with these values."""
        table, was = self.table, material.glass
        if table.reflectivity is not None or table.specular is not None:
            material = self._with_colours(material)
        if table.roughness is not None or table.metallic is not None:
            material = self._with_gloss(material, table.roughness, table.metallic)
        if table.transmission is not None:
            material = self._with_transmission(material, table.transmission, was)
        if table.ior is not None and material.glass is not None:
            material = replace(material, glass=replace(material.glass, ior=table.ior))
        elif table.ior is not None:
            self.notes.add("ior changes nothing where there is no glass", material.name)
        if (strength := table.normal_strength) is not None:
            if material.normal_texture < 0:
                self.notes.add("normal_strength changes nothing where there is no normal map", material.name)
            texture = material.normal_texture if strength > 0 else -1  # without slopes there is no map
            material = replace(material, normal_texture=texture, normal_scale=material.normal_scale * strength)
        if table.emission is not None:
            material = replace(material, emission=rgb3(table.emission), emission_texture=-1)
        return material

    def _with_colours(self, material: Material) -> Material:
        """Replace colours. Glass is shown then, since its colour was set on purpose."""
        table = self.table
        if table.roughness is None and table.metallic is None:
            material = replace(material, roughness=0.0, gloss_texture=-1)
        if material.left_out == "transmissive" or material.glass is not None:
            material = replace(material, left_out="", glass=None)
            if not table.transmission:
                self.notes.add("transmissive materials with an override are shown after all", material.name)
        if table.reflectivity is not None:
            material = replace(material, reflectivity=rgb3(table.reflectivity), texture=-1)
        if table.specular is not None:
            material = replace(material, specular=rgb3(table.specular), specular_texture=-1)
        if any(d + s > 1 for d, s in zip(material.reflectivity, material.specular, strict=True)):
            self.notes.add("overridden materials reflect more than they receive", material.name)
        return material

    def _with_gloss(self, material: Material, roughness: float | None, metallic: float | None) -> Material:
        """Set roughness and metal; of a texture that holds both, what the job leaves out keeps its mean."""
        # 1. What the file says, of mirrors, too.
        diffuse, mirror = np.array(material.reflectivity), np.array(material.specular)
        base, texture = diffuse + mirror, material.texture if material.texture >= 0 else material.specular_texture
        was_metal, was_rough = material.metallic, material.roughness if material.roughness > 0 else ROUGH
        if mirror.any():
            was_metal, was_rough = float(mirror.max() / base.max()), SMOOTHEST
        if material.gloss_texture >= 0:
            red, green, blue, alpha = mean_texel(self.textures[material.gloss_texture])
            was_metal, was_rough = was_metal * blue, was_rough * green
            coat, of_coat = material.coat * red, material.coat_roughness * alpha
            material = replace(material, coat=coat, coat_roughness=of_coat)
            if roughness is None or metallic is None:
                note = "metallic-roughness textures count by their mean where the job gives one of both"
                self.notes.add(note, material.name)
        # 2. A mirror, or gloss.
        rough, metal = was_rough if roughness is None else roughness, was_metal if metallic is None else metallic
        share = metal if is_mirror(metal, rough) else 0.0
        return replace(
            material,
            reflectivity=rgb3((1 - share) * base),
            specular=rgb3(share * base),
            texture=texture,
            specular_texture=texture if share > 0 else -1,
            roughness=0.0 if share > 0 else max(rough, SMOOTHEST),
            metallic=0.0 if share > 0 else metal,
            gloss_texture=-1,
        )

    def _with_transmission(self, material: Material, passed: float, was: PaneGlass | None) -> Material:
        """Make a material glass, with the refractive index and the body that it `was`, a screen, or neither."""
        solid = replace(material, left_out="", glass=None)
        if material.alpha_cutoff == SCREENED:
            solid = replace(solid, alpha=1.0, alpha_texture=-1, alpha_cutoff=0.0)
        if passed == 0:
            return solid
        if 1 - passed >= TRANSMISSIVE_ALPHA:
            self.notes.add(COVERS, material.name)
            return replace(solid, alpha=1 - passed, alpha_texture=-1, alpha_cutoff=SCREENED)
        colour = np.clip(np.array(material.reflectivity) + np.array(material.specular), 0.0, 1.0)
        glass = PaneGlass(colour=rgb3(passed * colour), texture=material.texture)
        return replace(solid, glass=glass if was is None else replace(glass, ior=was.ior, solid=was.solid))


def _unknown_material(name: str, names: Sequence[str]) -> str:
    """The error message; it lists the materials of the scene, the most similar name first."""
    matchers = {known: difflib.SequenceMatcher(None, name.lower(), known.lower()) for known in names}
    similar = sorted(names, key=lambda known: matchers[known].ratio(), reverse=True)
    short = name if len(name) <= LONGEST_NAME else f"{name[:LONGEST_NAME]}..."
    return f'scene.materials."{short}": no such material in the scene; it has {join_names(similar, NAMES_IN_AN_ERROR)}'
