"""glTF materials -> a diffuse part, a mirror part, opacity and a transform of the texture coordinates.

KHR_materials_transmission describes a sheet without thickness: light passes straight through, coloured by the base
colour. With a volume, a closed mesh is a solid body; absorption along its thickness counts as part of the colour.
"""

import math
from dataclasses import dataclass, replace
from functools import partial

import numpy as np

from framearray_cli.base.arrays import Float64
from framearray_cli.base.colour import linear_from_srgb

from ..assets import Assets
from ..materials import (
    CUTOFF,
    PlacedMaterial,
    Split,
    SurfaceGloss,
    TexturePlaces,
    blended_opacity,
    from_specular,
    is_mirror,
    make_material,
    masked_opacity,
    note_unused,
    split_metal,
)
from ..model import Material, PaneGlass, rgb3
from ..textures import EncodedImage, TextureTable
from .container import Gltf, Tree, image_bytes

IOR = 1.5  # glTF's default


def pane_of(passed: float, base: Float64, texel: Float64 | None, extensions: Tree) -> PaneGlass:
    """The pane of a material with a transmission.

    Args:
        passed: transmission, the share of light that is not reflected diffusely.
        base: (>= 3,) linear base colour.
        texel: (4,) mean of its texture, sRGB encoded; None without texture.
    """
    volume: Tree = extensions.get("KHR_materials_volume") or {}
    colour = base[:3] if texel is None else base[:3] * linear_from_srgb(texel[:3])
    colour = np.where(np.isfinite(colour), colour, 1.0) * passed * _absorbed(volume)
    ior = float((extensions.get("KHR_materials_ior") or {}).get("ior", IOR))
    return PaneGlass(
        colour=rgb3(np.clip(colour, 0.0, 1.0)), ior=max(ior, 1.0), solid=float(volume.get("thicknessFactor", 0.0)) > 0
    )


def cover_of(alpha: float, texel: Float64 | None) -> PaneGlass:
    """The pane of a material that covers the share `alpha` of what is behind it, all colours alike."""
    shown = 1.0 - alpha * (1.0 if texel is None else float(texel[3]))
    return PaneGlass(colour=rgb3(np.full(3, min(max(shown, 0.0), 1.0))), ior=1.0, covers=True)


def _absorbed(volume: Tree) -> Float64:
    """(3,) share of light that passes the thickness of a volume."""
    thickness, distance = float(volume.get("thicknessFactor", 0.0)), float(volume.get("attenuationDistance", np.inf))
    if not (thickness > 0 and 0 < distance < np.inf):
        return np.ones(3)
    colour = np.clip(np.array(volume.get("attenuationColor", [1.0, 1.0, 1.0]), np.float64), 0.0, 1.0)
    return np.asarray(colour ** (thickness / distance), np.float64)


def metal_surface(base: Float64, pbr: Tree, source: "MaterialSource") -> SurfaceGloss | Split:
    """Gloss of metal and roughness; of a mirror, or if surfaces do not follow the file, diffuse and mirror part."""
    metallic, roughness = float(pbr.get("metallicFactor", 1.0)), float(pbr.get("roughnessFactor", 1.0))
    info: Tree | None = pbr.get("metallicRoughnessTexture")
    mean = source.mean(info) if metallic > 0 or source.assets.as_file else None
    green, blue = (1.0, 1.0) if mean is None else (float(mean[1]), float(mean[2]))
    if not source.assets.as_file or is_mirror(metallic * blue, roughness * green):
        if mean is not None:
            source.note("metallic-roughness textures count by their mean")
        return split_metal(source.name, base, metallic * blue, roughness * green, source.textures.notes)
    texture = -1
    infos = [pbr[key] for key in ("baseColorTexture", "metallicRoughnessTexture") if pbr.get(key) is not None]
    if mean is not None and len({str(_places(info)) for info in infos}) <= 1:
        texture = source.index(info)
    elif mean is not None:
        metallic, roughness = metallic * blue, roughness * green
        source.note("metallic-roughness textures with texture coordinates of their own count by their mean")
    return SurfaceGloss(base=rgb3(base), roughness=roughness, metallic=metallic, texture=texture)


def _as_metal(entry: Tree, source: "MaterialSource") -> Tree:
    """Describe a material of the older KHR_materials_pbrSpecularGlossiness by metal and roughness."""
    base = np.array(entry.get("diffuseFactor", [1.0] * 4), dtype=np.float64)
    specular = np.array(entry.get("specularFactor", [1.0] * 3), dtype=np.float64)
    glossiness = float(entry.get("glossinessFactor", 1.0))
    if (mean := source.mean(entry.get("specularGlossinessTexture"))) is not None:
        specular, glossiness = specular * linear_from_srgb(mean[:3]), glossiness * float(mean[3])
        source.note("specular-glossiness textures count by their mean")
    texture = entry.get("diffuseTexture")
    mean = source.mean(texture)
    shade = np.ones(3) if mean is None else np.maximum(linear_from_srgb(mean[:3]), 1e-3)
    colour, metallic = from_specular(base[:3] * shade, specular)
    return {
        "baseColorFactor": [*(colour / shade), base[3]],
        "baseColorTexture": texture,
        "metallicFactor": metallic if metallic > 0.5 else 0.0,  # a little metal would make a smooth surface a mirror
        "roughnessFactor": 1.0 - glossiness,
    }


STRENGTH = "KHR_materials_emissive_strength"
GLOSSY = "KHR_materials_pbrSpecularGlossiness"
KNOWN = {"KHR_materials_transmission", GLOSSY, STRENGTH}
SILENT = {"KHR_materials_ior", "KHR_materials_volume"}  # they only matter for glass
# What a surface is taken for without an extension that is left out.
INSTEAD = {
    "KHR_materials_anisotropy": "brushed surfaces look the same from all sides",
    "KHR_materials_clearcoat": "the surface under the coat shows",
    "KHR_materials_diffuse_transmission": "no light comes through from the back",
    "KHR_materials_dispersion": "glass does not part colours",
    "KHR_materials_iridescence": "the surface under the thin film shows",
    "KHR_materials_sheen": "cloth has no bright rim",
    "KHR_materials_specular": "dielectrics mirror as much as those without it",
}
REPEAT = 10497


def read_materials(gltf: Gltf, used: set[int], assets: Assets, textures: TextureTable) -> list[PlacedMaterial]:
    """Map every material; read textures only for those that some primitive uses."""
    found = []
    for index, entry in enumerate(gltf.items("materials")):
        name = str(entry.get("name") or f"material {index}")
        source = MaterialSource(name, gltf, assets, textures)
        # no triangle has the others: keep their names for overrides, read no image
        found.append(_material(entry, source) if index in used else PlacedMaterial(material=Material(name=name)))
    return found


def _material(entry: Tree, source: "MaterialSource") -> PlacedMaterial:
    name, assets = source.name, source.assets
    extensions: Tree = entry.get("extensions") or {}
    pbr: Tree = _as_metal(extensions[GLOSSY], source) if GLOSSY in extensions else entry.get("pbrMetallicRoughness", {})
    info: Tree | None = pbr.get("baseColorTexture")
    base = np.array(pbr.get("baseColorFactor", [1.0] * 4), dtype=np.float64)
    texture = source.index(info)
    surface = metal_surface(base, pbr, source)
    opacity = _opacity(entry, base, texture, info, source)
    _note_ignored(entry, source)
    material = make_material(opacity, surface, source.textures.notes, texture=texture, mirror_texture=texture)
    if texture < 0 and material.gloss_texture >= 0:
        texture, info = material.gloss_texture, pbr["metallicRoughnessTexture"]
    if name in assets.shining or assets.as_file:
        material, own = _shining(material, entry, None if texture < 0 else info, source)
        texture, info = (texture, info) if texture >= 0 else (material.emission_texture, own)
    bumps: Tree | None = entry.get("normalTexture") if assets.as_file else None
    if bumps is not None:
        scale = float(bumps.get("scale", 1.0))
        material = replace(material, normal_texture=source.index(bumps), normal_scale=scale)
    return PlacedMaterial(
        material=material,
        places=_texture_places(texture, info, source),
        normal_places=_texture_places(material.normal_texture, bumps, source),
    )


def _texture_places(texture: int, info: Tree | None, source: "MaterialSource") -> TexturePlaces:
    if texture < 0 or info is None:
        return TexturePlaces()
    uv_set, transform = _places(info)
    return TexturePlaces(name=f"TEXCOORD_{uv_set}", matrix=uv_matrix(transform), repeats=source.repeats(info))


def _places(info: Tree) -> tuple[int, Tree]:
    """The set of texture coordinates that a texture info reads, and their transform."""
    transform: Tree = (info.get("extensions") or {}).get("KHR_texture_transform") or {}
    uv_set: int = {"texCoord": 0, **info, **transform}["texCoord"]  # the transform's own set wins
    return uv_set, transform


@dataclass(frozen=True, slots=True)
class MaterialSource:
    """A material of a file while it is read, and the images that its texture infos refer to."""

    name: str
    gltf: Gltf
    assets: Assets
    textures: TextureTable

    def note(self, sentence: str) -> None:
        """Note something about the material."""
        self.textures.notes.add(sentence, self.name)

    def index(self, info: Tree | None) -> int:
        """Index in the texture table; -1 without texture, and with a note if it cannot be read."""
        return self.textures.index(self._image(info))

    def mean(self, info: Tree | None) -> Float64 | None:
        """(4,) mean of an image's raw channels; None without texture, or if it cannot be read."""
        return self.textures.mean(self._image(info))

    def _image(self, info: Tree | None) -> EncodedImage | None:
        """The image that a texture info refers to."""
        if info is None:
            return None
        texture = self.gltf.tree["textures"][info["index"]]
        extensions: Tree = texture.get("extensions") or {}
        image = texture.get("source", extensions.get("EXT_texture_webp", {}).get("source"))
        if image is None:
            kinds = ", ".join(extensions) or "no source"
            self.note(f"textures in a form that cannot be read ({kinds}) are left out")
            return None
        read = partial(image_bytes, self.gltf, image, self.assets)
        return EncodedImage(("image", image), f"material {self.name}", read)

    def repeats(self, info: Tree) -> bool:
        """True if the texture repeats in both directions, as glTF's default sampler does."""
        sampler = self.gltf.tree["textures"][info["index"]].get("sampler")
        entry: Tree = {} if sampler is None else self.gltf.tree["samplers"][sampler]
        return bool(entry.get("wrapS", REPEAT) == REPEAT and entry.get("wrapT", REPEAT) == REPEAT)


def _shining(
    material: Material, entry: Tree, base: Tree | None, source: MaterialSource
) -> tuple[Material, Tree | None]:
    """Add what a material emits [KHR_materials_emissive_strength]; also return the info of its texture, if any.

    Args:
        base: info of the texture of its colour, whose texture coordinates the emission must share.
    """
    strength = float(((entry.get("extensions") or {}).get(STRENGTH) or {}).get("emissiveStrength", 1.0))
    emission = np.array(entry.get("emissiveFactor") or (0.0, 0.0, 0.0), dtype=np.float64) * strength
    emission = np.where(np.isfinite(emission), np.maximum(emission, 0.0), 0.0)
    info: Tree | None = entry.get("emissiveTexture")
    material = replace(material, one_sided=not entry.get("doubleSided", False))
    if info is None or not emission.any():
        return replace(material, emission=rgb3(emission)), None
    if base is not None and _places(base) != _places(info):
        mean = source.mean(info)
        source.note("emissive textures with texture coordinates of their own count by their mean")
        emission = emission if mean is None else emission * linear_from_srgb(mean[:3])
        return replace(material, emission=rgb3(emission)), None
    return replace(material, emission=rgb3(emission), emission_texture=source.index(info)), info


def _opacity(entry: Tree, base: Float64, texture: int, info: Tree | None, source: MaterialSource) -> Material:
    """Opacity of a material; with `Assets.as_file`, what nearly clear ones let through."""
    extensions: Tree = entry.get("extensions") or {}
    transmission: Tree = extensions.get("KHR_materials_transmission") or {}
    name, alpha, passed = source.name, float(base[3]), float(transmission.get("transmissionFactor", 0.0))
    mode, panes = entry.get("alphaMode", "OPAQUE"), source.assets.as_file
    coloured = panes and (passed > 0 or mode == "BLEND") and texture >= 0
    texel = source.mean(info) if coloured else None
    if transmission.get("transmissionTexture") is not None and passed > 0:
        source.note("transmission textures are left out, their factor counts")
    if passed > 0:
        pane = pane_of(passed, base, texel, extensions) if panes else None
        through = blended_opacity(name, 1.0 - passed, -1, source.textures, pane)
        if through.left_out or through.glass or through.alpha_cutoff:
            return through
    if mode == "MASK":
        return masked_opacity(name, alpha, texture, float(entry.get("alphaCutoff", CUTOFF)), source.textures)
    if mode == "BLEND":
        cover = cover_of(alpha, texel) if panes else None
        return blended_opacity(name, alpha, texture, source.textures, cover)
    return Material(name=name)


def uv_matrix(transform: Tree) -> Float64 | None:
    """(2, 3) matrix of KHR_texture_transform, for (u, v, 1) with v downwards; None if it changes nothing."""
    offset = np.array(transform.get("offset", [0.0, 0.0]), dtype=np.float64)
    scale = np.array(transform.get("scale", [1.0, 1.0]), dtype=np.float64)
    angle = float(transform.get("rotation", 0.0))
    if not offset.any() and (scale == 1).all() and angle == 0:
        return None
    turn = np.array([[math.cos(angle), math.sin(angle)], [-math.sin(angle), math.cos(angle)]])
    return np.column_stack([turn * scale, offset])


def _note_ignored(entry: Tree, source: MaterialSource) -> None:
    emissive = entry.get("emissiveFactor")
    bumps = entry.get("normalTexture") is not None
    emits = emissive is not None and max(emissive) > 0
    note_unused(source.name, source.assets, source.textures.notes, emits=emits, bumps=bumps)
    if entry.get("occlusionTexture") is not None:
        source.note("occlusion maps are left out (obscurances are computed)")
    for extension in sorted(set(entry.get("extensions") or {}) - KNOWN - SILENT):
        if extension == "KHR_materials_unlit":
            source.note("unlit materials are lit like any other")
        else:
            instead = f"; {INSTEAD[extension]}" if extension in INSTEAD else ""
            source.note(f"{extension} is left out{instead}")
