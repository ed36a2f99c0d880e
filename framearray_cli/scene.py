"""Scene: plain arrays, centred in float64 and only then float32; what the kernels read."""

from dataclasses import dataclass, field

from .arrays import Bytes, CornerUvs, Corners, Float32, Float64, Int32, Rgb


@dataclass(frozen=True, slots=True, kw_only=True)
class SceneReport:
    """What a scene file held, for the line that the user sees.

    Attributes:
        dropped: reason -> number of triangles left out, e.g. "degenerate", "non-finite", "duplicate", "transmissive".
        notes: whatever was not understood or was approximated, one sentence each.
    """

    triangles: int
    materials: int
    textures: int
    dropped: dict[str, int] = field(default_factory=dict)
    notes: tuple[str, ...] = ()


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class Scene:
    """One merged triangle mesh with materials; a feature the scene lacks is an array of length 0.

    Opaque triangles come first; those from `n_opaque` on have an alpha mask.

    Attributes:
        centre: (3,) float64; scene coordinates = file coordinates - centre.
        corners: (n, 3, 3) corner positions, centred.
        normals: (n, 3, 3) unit shading normals a corner, or (0, 3, 3) where no mesh has them.
        uvs: (n, 3, 2) texture coordinates, v upwards, or (0, 3, 2) where nothing is textured.
        colours: (n, 3, 3) linear corner colours that multiply the reflectivity, or (0, 3, 3).
        material: (n,) index into the material tables.
        material_names: m names.
        reflectivity: (m, 3) diffuse reflectivity, before texture and corner colour.
        specular: (m, 3) mirror reflectivity, before texture and corner colour.
        reflectivity_texture: (m,) texture that multiplies `reflectivity`, or -1.
        specular_texture: (m,) texture that multiplies `specular`, or -1.
        alpha: (m,) opacity factor, multiplied with the alpha of `alpha_texture`.
        alpha_texture: (m,) texture whose alpha is the mask, or -1.
        alpha_cutoff: (m,) a point of a masked triangle is absent where alpha < cutoff.
        texels: (n_texels, 4) uint8 RGBA of all textures one after another; colours sRGB encoded, alpha linear; row 0 on top.
        textures: (n_textures, 3) int32 first texel, width, height.
        n_opaque: number of triangles without alpha mask.
    """

    centre: Float64
    corners: Corners
    normals: Corners
    uvs: CornerUvs
    colours: Corners
    material: Int32
    material_names: tuple[str, ...]
    reflectivity: Rgb
    specular: Rgb
    reflectivity_texture: Int32
    specular_texture: Int32
    alpha: Float32
    alpha_texture: Int32
    alpha_cutoff: Float32
    texels: Bytes
    textures: Int32
    n_opaque: int
    report: SceneReport

    @property
    def has_mirrors(self) -> bool:
        """Whether any material reflects specularly; without one the specular code never runs."""
        return bool((self.specular > 0).any())
