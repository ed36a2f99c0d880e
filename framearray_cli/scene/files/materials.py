"""Materials: the same rules for the readers of all formats.

A reader maps what its file says of a surface to a diffuse part, a mirror part and an opacity; `make_material` puts them
together. No surface reflects more than it receives. Unless surfaces follow the file, glass is left out and blended
textures are cut out. There are defaults for missing materials, and for colours that are not colours. Gloss of every
format becomes metal and roughness of glTF.
"""

from collections.abc import Sequence
from dataclasses import dataclass, field, replace
from typing import Any

import numpy as np
from numpy.typing import NDArray

from framearray_cli.base.arrays import Float32, Float64

from .assets import Assets
from .model import GREY, SCREENED, Material, Meshes, Notes, PaneGlass, Part, Rgb3, join_names, rgb3
from .textures import TextureTable

TRANSMISSIVE_ALPHA = 0.25  # a surface that stops less light counts as glass, which is left out for now
OPAQUE = 0.999  # a surface that covers this share covers everything
CUTOFF = 0.5  # alpha where a blended texture turns from hole to surface; also glTF's default for masks
BLACK: Rgb3 = (0.0, 0.0, 0.0)
BRIGHTEST = 1e30  # stands in for infinite reflectivities, before they are scaled to 1
ROUGH_METAL = "rough metals are taken as diffuse"
COVERS = "partly transparent materials cover a part of what is behind them, by chance"
THIN_GLASS = "transmissive materials are thin glass, which light passes straight"
LEFT_OUT = 'transmissive materials are left out; scene.surfaces = "file" takes them as thin glass'
CUT_OUT = "materials that their alpha mask removes everywhere are left out"


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class TexturePlaces:
    """Texture coordinates by which the meshes of a material show a texture.

    Attributes:
        name: of the attribute or primvar; "" without texture.
        matrix: (2, 3) transform of (u, v, 1), v as in the file, or None.
        repeats: True if the texture repeats in both directions.
    """

    name: str = ""
    matrix: Float64 | None = None
    repeats: bool = True


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class PlacedMaterial:
    """A material, the places of its textures and of its normal map; `coloured`: vertex colours are its colour."""

    material: Material
    places: TexturePlaces = field(default_factory=TexturePlaces)
    normal_places: TexturePlaces = field(default_factory=TexturePlaces)
    coloured: bool = False


def make_material(
    opacity: Material,
    surface: "SurfaceGloss | tuple[Rgb3, Rgb3]",
    notes: Notes,
    *,
    texture: int = -1,
    mirror_texture: int = -1,
) -> Material:
    """Make a material from what a reader found; no surface reflects more than it receives.

    Args:
        opacity: its name and transparency.
        surface: its gloss, or the reflectivities of its diffuse and of its mirror part, of any size.
        notes: gets a note if the two have to be brought into range.
        texture: multiplies the diffuse part, or the base colour.
        mirror_texture: multiplies the mirror part, unless that is 0.
    """
    if isinstance(surface, SurfaceGloss):
        roughness, metallic = min(max(surface.roughness, SMOOTHEST), 1.0), min(max(surface.metallic, 0.0), 1.0)
        opacity = replace(opacity, roughness=roughness, metallic=metallic, gloss_texture=surface.texture)
        surface = surface.base, BLACK
    found = np.array(surface, np.float64)  # (2, 3)
    held = np.clip(np.nan_to_num(found, nan=0.0), 0.0, BRIGHTEST)
    scale = 1.0 / np.maximum(held.sum(axis=0), 1.0)
    if (held != found).any() or scale.min() < 1 - 1e-6:
        notes.add("reflectivities outside 0 to 1 are brought into it", opacity.name)
    reflectivity, specular = map(rgb3, held * scale)
    mirror_texture = mirror_texture if max(specular) > 0 else -1
    return replace(
        opacity, reflectivity=reflectivity, specular=specular, texture=texture, specular_texture=mirror_texture
    )


def join_meshes(
    parts: Sequence[Part], materials: Sequence[Material], textures: TextureTable, outside: int, lights: int = 0
) -> Meshes:
    """The contents of a file; `outside`: number of triangles left out because a vertex of theirs does not exist."""
    return Meshes(
        parts=tuple(parts),
        materials=tuple(materials),
        textures=tuple(textures.textures),
        dropped={"index out of range": outside} if outside else {},
        notes=textures.notes.lines(),
        lights=lights,
    )


def masked_opacity(name: str, alpha: float, texture: int, cutoff: float, textures: TextureTable) -> Material:
    """Opacity of a material whose points are absent where alpha is below the cutoff."""
    lowest, highest = textures.alpha_range(texture)
    if alpha * lowest >= cutoff:
        return Material(name=name)
    if alpha * highest < cutoff:
        textures.notes.add(CUT_OUT, name)
        return Material(name=name, left_out="cut out")
    return Material(name=name, alpha=alpha, alpha_texture=texture, alpha_cutoff=cutoff)


def blended_opacity(
    name: str, alpha: float, texture: int, textures: TextureTable, glass: PaneGlass | None = None
) -> Material:
    """Opacity of a material that lets light through by alpha: glass, screened, cut out, or taken as opaque.

    Args:
        glass: what a pane of the material lets through, where surfaces follow the file; None leaves panes out.
    """
    (lowest, highest), notes = textures.alpha_range(texture), textures.notes
    if alpha * highest < TRANSMISSIVE_ALPHA:
        if glass is not None:
            notes.add(THIN_GLASS, name)
            return Material(name=name, glass=glass)
        notes.add(LEFT_OUT, name)
        return Material(name=name, left_out="transmissive")
    if glass is not None:
        if alpha * lowest >= OPAQUE:
            return Material(name=name)
        notes.add(COVERS, name)
        return Material(name=name, alpha=alpha, alpha_texture=texture, alpha_cutoff=SCREENED)
    if lowest < CUTOFF <= highest:
        notes.add("textures with partial transparency are cut out at half opacity", name)
        return Material(name=name, alpha_texture=texture, alpha_cutoff=CUTOFF)
    if alpha * lowest < 1:
        notes.add("partly transparent materials are taken as opaque", name)
    return Material(name=name)


def shown_alpha(name: str, alpha: float, textured: bool, notes: Notes) -> float:
    """Opacity factor of a material in a format whose exporters disagree on opacity 0: 1 if it has a texture."""
    if alpha != 0 or not textured:
        return alpha
    notes.add("opacity 0 under a texture is taken as opaque: many exporters mean that", name)
    return 1.0


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


MIRROR_ROUGHNESS = 0.1  # up to it a metal is a mirror
# Nothing shines more sharply: light of a point on a smooth dielectric would be seen in single pixels only.
SMOOTHEST = 0.1
DIELECTRIC = 0.04  # what is no metal reflects, face on
_BRIGHTNESS = np.array([0.299, 0.587, 0.114])


@dataclass(frozen=True, slots=True, kw_only=True)
class SurfaceGloss:
    """Gloss of a material.

    Attributes:
        base: base colour factor, of any size.
        roughness, metallic: factors.
        texture: index of the texture whose green and blue multiply them, or -1.
    """

    base: Rgb3
    roughness: float
    metallic: float
    texture: int = -1


def is_mirror(metallic: float, roughness: float) -> bool:
    """True if a metal is so smooth that it is a mirror."""
    return metallic > 0 and roughness <= MIRROR_ROUGHNESS


def split_metal(name: str, base: Float64, metallic: float, roughness: float, notes: Notes) -> tuple[Rgb3, Rgb3]:
    """Split a base colour where surfaces do not follow the file: smooth metal is the mirror part, the rest diffuse."""
    metallic = min(max(metallic, 0.0), 1.0)
    mirror = metallic if roughness <= MIRROR_ROUGHNESS else 0.0
    if metallic > 0 and mirror == 0:
        notes.add(ROUGH_METAL, name)
    return rgb3(base * (1.0 - mirror)), rgb3(base * mirror)


def note_unused(name: str, assets: Assets, notes: Notes, *, emits: bool = False, bumps: bool = False) -> None:
    """Note emission and normal maps of a material that the scene does not use, or only shows."""
    if emits and name not in assets.shining:
        seen = 'emission is seen and lights nothing; a source of type "mesh" lets it light'
        notes.add(seen if assets.as_file else "emission is left out", name)
    if bumps and not assets.as_file:
        notes.add('normal maps are left out; scene.surfaces = "file" uses them', name)


def from_specular(diffuse: Sequence[float] | Float64, specular: Sequence[float] | Float64) -> tuple[Float64, float]:
    """Convert a diffuse and a specular colour to a base colour, (3,), and metal [KHR_materials_pbrSpecularGlossiness].

    Metal is what makes F0, the mean of 0.04 and the base colour by metal, as bright as the specular colour.
    """
    diffuse, specular = np.asarray(diffuse, np.float64), np.asarray(specular, np.float64)
    rest = 1.0 - min(float(specular.max()), 1.0)
    d, s = (float(np.sqrt(_BRIGHTNESS @ (colour * colour))) for colour in (diffuse, specular))
    metallic = 0.0
    if s > DIELECTRIC:
        b = d * rest / (1 - DIELECTRIC) + s - 2 * DIELECTRIC
        root = np.sqrt(max(b * b - 4 * DIELECTRIC * (DIELECTRIC - s), 0.0))
        metallic = min(max(float(-b + root) / (2 * DIELECTRIC), 0.0), 1.0)
    of_diffuse = diffuse * rest / (1 - DIELECTRIC) / max(1 - metallic, 1e-6)
    of_specular = (specular - DIELECTRIC * (1 - metallic)) / max(metallic, 1e-6)
    share = metallic * metallic
    return np.clip(of_diffuse * (1 - share) + of_specular * share, 0.0, 1.0), metallic
