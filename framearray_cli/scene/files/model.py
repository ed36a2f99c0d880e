"""Results of every reader of scene files: parts, materials, textures and notes, in the file's own coordinates."""

from collections.abc import Sequence, Set
from dataclasses import dataclass, field, replace
from typing import Any

from framearray_cli.base.arrays import Bytes, Float32, Float64, Int32
from framearray_cli.base.units import counted

GREY = 0.5  # reflectivity of surfaces without material: neither black, nor a white that hides all shading
NAMES_IN_A_NOTE = 6  # names that one note lists before it says "and n more"
# The sampler of a texture, in bits: its continuation beyond 0 to 1 along u, and from WRAP_V on along v; NEAREST: no
# blending between texels; from UV_SET on the number of the set of texture coordinates.
REPEAT, CLAMP, MIRROR, BLACK = range(4)
WRAP_V, NEAREST, UV_SET = 2, 1 << 4, 5
WRAPS = (1 << 2 * WRAP_V) - 1
SCREENED = -1.0  # alpha cutoff of a surface with holes, by chance, at the share 1 - alpha of its points
POSED = "meshes that move are shown at {}; scene.time selects another time"
Rgb3 = tuple[float, float, float]
MOST_NOTES = 50  # more would scroll away what matters


@dataclass(frozen=True, slots=True, kw_only=True)
class PaneGlass:
    """Transmission of a thin pane, see `PANE_COLUMNS`.

    Attributes:
        colour: share of the light that passes a whole pane, besides what its faces reflect, linear RGB in [0, 1].
        ior: refractive index, at least 1; 1 reflects nothing head-on.
        texture: multiplies the colour, or -1.
        solid: True if a closed mesh of it is a solid body, which refracts what eyes see.
        covers: True if the pane is no glass but a surface that covers a part of what is behind it: nothing reflects.
    """

    colour: tuple[float, float, float]
    texture: int = -1
    ior: float = 1.5
    covers: bool = False
    solid: bool = False


@dataclass(frozen=True, slots=True, kw_only=True)
class Material:
    """A material as the renderer sees it; textures are indices into `Meshes.textures`, or -1.

    Attributes:
        reflectivity: diffuse part, linear RGB in [0, 1].
        specular: mirror part, linear RGB in [0, 1].
        texture: base colour texture; multiplies `reflectivity`.
        specular_texture: multiplies `specular`.
        emission: radiance of what the surface emits, linear RGB; as the file gives it.
        emission_texture: multiplies `emission`.
        one_sided: True if the file says that only the front is seen, where corners run counter-clockwise.
        alpha: opacity factor, multiplied with the alpha of `alpha_texture`.
        alpha_cutoff: a point is absent where alpha is below it; 0 for an opaque material, or SCREENED.
        normal_texture: normal map, or -1; `normal_scale` multiplies what its red and green say.
        roughness, metallic: of a glossy material, as glTF defines them, with `reflectivity` for the base colour;
            other materials have roughness 0.
        coat, coat_roughness: weight of the clear coat of a glossy material, 0 without, and its roughness.
        gloss_texture: its green multiplies `roughness`, its blue `metallic`, its red `coat`, its alpha
            `coat_roughness`.
        left_out: why its triangles are left out ("transmissive", "cut out"), or "".
        glass: what its triangles let through as thin panes, which nothing else is seen of; None: of no pane.
    """

    name: str
    reflectivity: tuple[float, float, float] = (GREY, GREY, GREY)
    specular: tuple[float, float, float] = (0.0, 0.0, 0.0)
    texture: int = -1
    specular_texture: int = -1
    emission: tuple[float, float, float] = (0.0, 0.0, 0.0)
    emission_texture: int = -1
    one_sided: bool = False
    alpha: float = 1.0
    alpha_texture: int = -1
    alpha_cutoff: float = 0.0
    normal_texture: int = -1
    normal_scale: float = 1.0
    roughness: float = 0.0
    metallic: float = 0.0
    coat: float = 0.0
    coat_roughness: float = 0.0
    gloss_texture: int = -1
    left_out: str = ""
    glass: PaneGlass | None = None

    @property
    def textured(self) -> bool:
        """True if it needs texture coordinates."""
        return bool(self.used_textures)

    @property
    def used_textures(self) -> set[int]:
        """The textures that it reads, besides its normal map."""
        return {*(getattr(self, slot) for slot in SLOTS), self.glass.texture if self.glass else -1} - {-1}

    @property
    def unseen(self) -> bool:
        """True if its triangles are left out, or are glass."""
        return bool(self.left_out) or self.glass is not None

    def without(self, textures: Set[int]) -> "Material":
        """Return the material for meshes without texture coordinates of some textures."""
        lost: dict[str, Any] = {slot: -1 for slot in SLOTS if getattr(self, slot) in textures}
        cutoff = min(self.alpha_cutoff, 0.0) if "alpha_texture" in lost else self.alpha_cutoff
        glass = replace(self.glass, texture=-1) if self.glass and self.glass.texture in textures else self.glass
        return replace(self, **lost, alpha_cutoff=cutoff, glass=glass)


SLOTS = ("texture", "specular_texture", "alpha_texture", "emission_texture", "gloss_texture")  # of `Material`


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class Part:
    """n triangles of one material, one row per corner, in file coordinates.

    Attributes:
        corners: (n, 3, 3) positions; may hold non-finite values.
        normals: (n, 3, 3) from the file, of any length, or None.
        uvs: (n, 3, 2 k) k sets of texture coordinates, v upwards, or None; a set that the mesh lacks is NaN.
        colours: (n, 3, 3) linear colours, or None.
        tangents: (n, 3, 4) direction in which u of the normal map grows, of any length, and w: the bitangent is w times
            normal x tangent; all 0 where there is none. None without normal map.
        normal_uvs: (n, 3, 2) texture coordinates of the normal map, v upwards, or None.
        objects: names of the objects that they belong to, at least one.
        object: (n,) index of each triangle's object among these; None: all belong to the first.
    """

    material: int
    corners: Float64
    normals: Float64 | None = None
    uvs: Float64 | None = None
    colours: Float32 | None = None
    tangents: Float64 | None = None
    normal_uvs: Float64 | None = None
    objects: tuple[str, ...] = ("",)
    object: Int32 | None = None


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class Meshes:
    """The contents of a scene file.

    Attributes:
        textures: (height, width, 4) RGBA each, row 0 on top, colours sRGB encoded, alpha linear; one array for all
            textures that differ only in their sampler.
        samplers: of each texture, see WRAP_V; none where all are 0.
        dropped: reason -> the number of triangles that could not even be read.
        lights: number of light sources in the file; a job has its own.
    """

    parts: tuple[Part, ...]
    materials: tuple[Material, ...]
    textures: tuple[Bytes, ...]
    dropped: dict[str, int]
    notes: tuple[str, ...]
    lights: int = 0
    samplers: tuple[int, ...] = ()


@dataclass(slots=True)
class Notes:
    """Collects what the user should know: one sentence per kind of finding, with the names it concerns."""

    found: dict[str, dict[str, None]] = field(default_factory=dict)  # sentence -> names, in the order found

    def add(self, sentence: str, name: str = "") -> None:
        """Add a finding; several names with the same sentence become one line."""
        names = self.found.setdefault(sentence, {})
        if name:
            names[name] = None

    def lines(self) -> tuple[str, ...]:
        """One line per finding, in the order found; only the first ones of very many."""
        shown = list(self.found.items())[:MOST_NOTES]
        lines = [f"{sentence}: {join_names(list(names))}" if names else sentence for sentence, names in shown]
        more = len(self.found) - len(shown)
        return (*lines, *([f"and {counted(more, 'more note')}"] if more else []))


def rgb3(values: Any) -> Rgb3:
    """The first three of some numbers as a colour."""
    return (float(values[0]), float(values[1]), float(values[2]))


def join_names(names: Sequence[str], limit: int = NAMES_IN_A_NOTE) -> str:
    """Join names for a sentence; cut a long list short."""
    shown = ", ".join(names[:limit])
    more = len(names) - limit
    return f"{shown} and {more} more" if more > 0 else shown
