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

from ..materials import (
    CUTOFF,
    MaterialSource,
    PlacedMaterial,
    Split,
    SurfaceGloss,
    TexturePlaces,
    from_specular,
    is_mirror,
)
from ..model import Material, PaneGlass, rgb3
from ..textures import EncodedImage
from .container import Gltf, Tree, image_bytes

IOR = 1.5  # glTF's default
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


@dataclass(frozen=True, slots=True, kw_only=True)
class GltfMaterial(MaterialSource):
    """A material of a glTF file, and the images that its texture infos refer to."""

    gltf: Gltf
    entry: Tree

    def read(self) -> PlacedMaterial:
        """Map the material."""
        glossy = GLOSSY in self.entry.get("extensions", {})
        pbr: Tree = self._as_metal() if glossy else self.entry.get("pbrMetallicRoughness", {})
        info: Tree | None = pbr.get("baseColorTexture")
        base = np.array(pbr.get("baseColorFactor", [1.0] * 4), dtype=np.float64)
        texture = self._index(info)
        surface = self._surface(base, pbr)
        opacity = self._opacity(base, texture, info)
        self._note_ignored()
        material = self.make(opacity, surface, texture=texture, mirror_texture=texture)
        if texture < 0 and material.gloss_texture >= 0:
            texture, info = material.gloss_texture, pbr["metallicRoughnessTexture"]
        if self.shows_emission:
            material, own = self._shining(material, None if texture < 0 else info)
            texture, info = (texture, info) if texture >= 0 else (material.emission_texture, own)
        bumps: Tree | None = self.entry.get("normalTexture") if self.assets.as_file else None
        if bumps is not None:
            scale = float(bumps.get("scale", 1.0))
            material = replace(material, normal_texture=self._index(bumps), normal_scale=scale)
        normal_places = self._placed(material.normal_texture, bumps)
        return PlacedMaterial(material=material, places=self._placed(texture, info), normal_places=normal_places)

    def _extension(self, name: str) -> Tree:
        """The values of an extension; empty without it."""
        found: Tree = self.entry.get("extensions", {}).get(name) or {}
        return found

    def _index(self, info: Tree | None) -> int:
        """Index in the texture table; -1 without texture, and with a note if it cannot be read."""
        return self.textures.index(self._image(info))

    def _mean(self, info: Tree | None) -> Float64 | None:
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
        return self.image(("image", image), partial(image_bytes, self.gltf, image, self.assets))

    def _placed(self, texture: int, info: Tree | None) -> TexturePlaces:
        """The places of a texture; it repeats in both directions, unless its sampler says something else."""
        if texture < 0 or info is None:
            return TexturePlaces()
        uv_set, transform = _places(info)
        sampler = self.gltf.tree["textures"][info["index"]].get("sampler")
        entry: Tree = {} if sampler is None else self.gltf.tree["samplers"][sampler]
        repeats = all(entry.get(key, REPEAT) == REPEAT for key in ("wrapS", "wrapT"))
        return TexturePlaces(name=f"TEXCOORD_{uv_set}", matrix=_uv_matrix(transform), repeats=repeats)

    def _surface(self, base: Float64, pbr: Tree) -> SurfaceGloss | Split:
        """Gloss of metal and roughness; of a mirror, or if surfaces do not follow the file, diffuse and mirror part."""
        metallic, roughness = float(pbr.get("metallicFactor", 1.0)), float(pbr.get("roughnessFactor", 1.0))
        info: Tree | None = pbr.get("metallicRoughnessTexture")
        mean = self._mean(info) if metallic > 0 or self.assets.as_file else None
        green, blue = (1.0, 1.0) if mean is None else (float(mean[1]), float(mean[2]))
        if not self.assets.as_file or is_mirror(metallic * blue, roughness * green):
            if mean is not None:
                self.note("metallic-roughness textures count by their mean")
            return self.split_metal(base, metallic * blue, roughness * green)
        texture = -1
        infos = [pbr[key] for key in ("baseColorTexture", "metallicRoughnessTexture") if pbr.get(key) is not None]
        if mean is not None and len({str(_places(info)) for info in infos}) <= 1:
            texture = self._index(info)
        elif mean is not None:
            metallic, roughness = metallic * blue, roughness * green
            self.note("metallic-roughness textures with texture coordinates of their own count by their mean")
        return SurfaceGloss(base=rgb3(base), roughness=roughness, metallic=metallic, texture=texture)

    def _as_metal(self) -> Tree:
        """Describe a material of the older KHR_materials_pbrSpecularGlossiness by metal and roughness."""
        entry = self._extension(GLOSSY)
        base = np.array(entry.get("diffuseFactor", [1.0] * 4), dtype=np.float64)
        specular = np.array(entry.get("specularFactor", [1.0] * 3), dtype=np.float64)
        glossiness = float(entry.get("glossinessFactor", 1.0))
        if (mean := self._mean(entry.get("specularGlossinessTexture"))) is not None:
            specular, glossiness = specular * linear_from_srgb(mean[:3]), glossiness * float(mean[3])
            self.note("specular-glossiness textures count by their mean")
        texture = entry.get("diffuseTexture")
        mean = self._mean(texture)
        shade = np.ones(3) if mean is None else np.maximum(linear_from_srgb(mean[:3]), 1e-3)
        colour, metallic = from_specular(base[:3] * shade, specular)
        return {
            "baseColorFactor": [*(colour / shade), base[3]],
            "baseColorTexture": texture,
            "metallicFactor": metallic
            if metallic > 0.5
            else 0.0,  # a little metal would make a smooth surface a mirror
            "roughnessFactor": 1.0 - glossiness,
        }

    def _shining(self, material: Material, base: Tree | None) -> tuple[Material, Tree | None]:
        """Add emission [KHR_materials_emissive_strength]; also return the info of its texture, if any.

        Args:
            base: info of the texture of its colour, whose texture coordinates the emission must share.
        """
        strength = float(self._extension(STRENGTH).get("emissiveStrength", 1.0))
        emission = np.array(self.entry.get("emissiveFactor") or (0.0, 0.0, 0.0), dtype=np.float64) * strength
        emission = np.where(np.isfinite(emission), np.maximum(emission, 0.0), 0.0)
        info: Tree | None = self.entry.get("emissiveTexture") if emission.any() else None
        placed = info is None or base is None or _places(base) == _places(info)
        found, texture = self.shining(emission, self._image(info), placed=placed)
        emits = rgb3(emission if found is None else found)
        one_sided = not self.entry.get("doubleSided", False)
        material = replace(material, emission=emits, emission_texture=texture, one_sided=one_sided)
        return material, info if placed else None

    def _opacity(self, base: Float64, texture: int, info: Tree | None) -> Material:
        """Opacity of the material; with `Assets.as_file`, transmission of a nearly clear one."""
        transmission = self._extension("KHR_materials_transmission")
        alpha, passed = float(base[3]), float(transmission.get("transmissionFactor", 0.0))
        mode, panes = self.entry.get("alphaMode", "OPAQUE"), self.assets.as_file
        coloured = panes and (passed > 0 or mode == "BLEND") and texture >= 0
        texel = self._mean(info) if coloured else None
        if transmission.get("transmissionTexture") is not None and passed > 0:
            self.note("transmission textures are left out, their factor counts")
        if passed > 0:
            through = self.blended(1.0 - passed, -1, self._pane(passed, base, texel) if panes else None)
            if through.left_out or through.glass or through.alpha_cutoff:
                return through
        if mode == "MASK":
            return self.masked(alpha, texture, float(self.entry.get("alphaCutoff", CUTOFF)))
        if mode == "BLEND":
            shown = 1.0 - alpha * (1.0 if texel is None else float(texel[3]))
            cover = PaneGlass(colour=rgb3(np.full(3, min(max(shown, 0.0), 1.0))), ior=1.0, covers=True)
            return self.blended(alpha, texture, cover if panes else None)
        return Material(name=self.name)

    def _pane(self, passed: float, base: Float64, texel: Float64 | None) -> PaneGlass:
        """The pane of a material with a transmission.

        Args:
            passed: transmission, the share of light that is not reflected diffusely.
            base: (>= 3,) linear base colour.
            texel: (4,) mean of its texture, sRGB encoded; None without texture.
        """
        volume = self._extension("KHR_materials_volume")
        thickness, distance = (
            float(volume.get(key, default))
            for key, default in (("thicknessFactor", 0.0), ("attenuationDistance", np.inf))
        )
        absorbed = np.ones(3)  # share of light that passes the thickness
        if thickness > 0 and 0 < distance < np.inf:
            colour = np.clip(np.array(volume.get("attenuationColor", [1.0, 1.0, 1.0]), np.float64), 0.0, 1.0)
            absorbed = colour ** (thickness / distance)
        colour = base[:3] if texel is None else base[:3] * linear_from_srgb(texel[:3])
        colour = np.where(np.isfinite(colour), colour, 1.0) * passed * absorbed
        ior = float(self._extension("KHR_materials_ior").get("ior", IOR))
        return PaneGlass(colour=rgb3(np.clip(colour, 0.0, 1.0)), ior=max(ior, 1.0), solid=thickness > 0)

    def _note_ignored(self) -> None:
        emissive = self.entry.get("emissiveFactor")
        emits = emissive is not None and max(emissive) > 0
        self.note_unused(emits=emits, bumps="normalTexture" in self.entry)
        if self.entry.get("occlusionTexture") is not None:
            self.note("occlusion maps are left out (obscurances are computed)")
        for extension in sorted(set(self.entry.get("extensions", {})) - KNOWN - SILENT):
            if extension == "KHR_materials_unlit":
                self.note("unlit materials are lit like any other")
            else:
                instead = f"; {INSTEAD[extension]}" if extension in INSTEAD else ""
                self.note(f"{extension} is left out{instead}")


def _places(info: Tree) -> tuple[int, Tree]:
    """The set of texture coordinates that a texture info reads, and their transform."""
    transform: Tree = (info.get("extensions") or {}).get("KHR_texture_transform") or {}
    uv_set: int = {"texCoord": 0, **info, **transform}["texCoord"]  # the transform's own set wins
    return uv_set, transform


def _uv_matrix(transform: Tree) -> Float64 | None:
    """(2, 3) matrix of KHR_texture_transform, for (u, v, 1) with v downwards; None if it changes nothing."""
    offset = np.array(transform.get("offset", [0.0, 0.0]), dtype=np.float64)
    scale = np.array(transform.get("scale", [1.0, 1.0]), dtype=np.float64)
    angle = float(transform.get("rotation", 0.0))
    if not offset.any() and (scale == 1).all() and angle == 0:
        return None
    turn = np.array([[math.cos(angle), math.sin(angle)], [-math.sin(angle), math.cos(angle)]])
    return np.column_stack([turn * scale, offset])
