"""glTF materials -> a diffuse part, a mirror part, opacity and a transform of the texture coordinates.

KHR_materials_transmission describes a sheet without thickness: light passes straight through, coloured by the base
colour. With a volume, a closed mesh is a solid body; absorption along its thickness counts as part of the colour.
"""

import math
from dataclasses import dataclass, replace
from functools import partial

import numpy as np

from framearray_cli.base.arrays import Bytes, Float64
from framearray_cli.base.colour import linear_from_srgb

from ..materials import (
    CUTOFF,
    MOSTLY,
    MaterialSource,
    PlacedMaterial,
    Reflects,
    Split,
    SurfaceGloss,
    TexturePlaces,
    from_mean_specular,
    is_mirror,
    sheen_albedo,
    textures_of_specular,
)
from ..model import CLAMP, MIRROR, NEAREST, REPEAT, WRAP_V, Material, PaneGlass, rgb3
from ..textures import EncodedImage, mean_texel
from .container import Gltf, Tree, image_bytes

IOR = 1.5  # glTF's default
STRENGTH = "KHR_materials_emissive_strength"
GLOSSY = "KHR_materials_pbrSpecularGlossiness"
KNOWN = {"KHR_materials_transmission", GLOSSY, STRENGTH}
LAYERS = {"KHR_materials_clearcoat", "KHR_materials_ior", "KHR_materials_sheen", "KHR_materials_specular"}
SILENT = {"KHR_materials_volume", *LAYERS}  # a volume only matters for glass
# What a surface is taken for without an extension that is left out.
INSTEAD = {
    "KHR_materials_anisotropy": "brushed surfaces look the same from all sides",
    "KHR_materials_diffuse_transmission": "no light comes through from the back",
    "KHR_materials_dispersion": "glass does not part colours",
    "KHR_materials_iridescence": "the surface under the thin film shows",
}
WRAPS = {33071: CLAMP, 33648: MIRROR}  # of samplers; else a texture repeats
NEAREST_TEXEL = 9728


@dataclass(frozen=True, slots=True, kw_only=True)
class GltfMaterial(MaterialSource):
    """A material of a glTF file, and the images that its texture infos refer to."""

    gltf: Gltf
    entry: Tree

    def read(self) -> PlacedMaterial:
        """Map the material."""
        glossy = GLOSSY in self.entry.get("extensions", {})
        pbr, texture, gloss = self._as_metal() if glossy else (self.entry.get("pbrMetallicRoughness", {}), -1, -1)
        info: Tree | None = pbr.get("baseColorTexture")
        base = np.array(pbr.get("baseColorFactor", [1.0] * 4), dtype=np.float64)
        texture = self._index(info) if texture < 0 else texture
        surface = self._layered(self._surface(base, pbr, gloss), info)
        opacity = self._opacity(base, texture, info)
        self._note_ignored()
        material = self.make(opacity, surface, texture=texture, mirror_texture=texture)
        material = replace(material, one_sided=not self.entry.get("doubleSided", False))
        if self.shows_emission:
            material = self._shining(material)
        bumps: Tree | None = self.entry.get("normalTexture") if self.assets.as_file else None
        normal_places = TexturePlaces()
        if bumps is not None and (number := self.textures.index(self._image(bumps))) >= 0:
            normal_places, scale = self._places(bumps), float(bumps.get("scale", 1.0))
            number = self.textures.sampled(number, normal_places.sampler)
            material = replace(material, normal_texture=number, normal_scale=scale)
        return PlacedMaterial(material=material, places=self.places, normal_places=normal_places)

    def _extension(self, name: str) -> Tree:
        """The values of an extension; empty without it."""
        found: Tree = self.entry.get("extensions", {}).get(name) or {}
        return found

    def _index(self, info: Tree | None) -> int:
        """Index in the texture table; -1 without texture, and with a note if it cannot be read."""
        return -1 if info is None else self.placed(self.textures.index(self._image(info)), self._places(info))

    def _mean(self, info: Tree | None) -> Float64 | None:
        """(4,) mean of an image's raw channels; None without texture, or if it cannot be read."""
        return self.textures.mean(self._image(info))

    def _image(self, info: Tree | None) -> EncodedImage | None:
        """The image that a texture info refers to."""
        if info is None:
            return None
        texture = self.gltf.tree["textures"][info["index"]]
        extensions: Tree = texture.get("extensions") or {}
        others = (extensions.get(name, {}).get("source") for name in ("EXT_texture_webp", "KHR_texture_basisu"))
        image = next((source for source in (texture.get("source"), *others) if source is not None), None)
        if image is None:
            kinds = ", ".join(extensions) or "no source"
            self.note(f"textures in a form that cannot be read ({kinds}) are left out")
            return None
        return self.image(("image", image), partial(image_bytes, self.gltf, image, self.assets))

    def _places(self, info: Tree) -> TexturePlaces:
        """The texture coordinates of a texture info, and the sampler of its texture."""
        transform: Tree = (info.get("extensions") or {}).get("KHR_texture_transform") or {}
        uv_set: int = {"texCoord": 0, **info, **transform}["texCoord"]  # the transform's own set wins
        number = self.gltf.tree["textures"][info["index"]].get("sampler")
        entry: Tree = {} if number is None else self.gltf.tree["samplers"][number]
        along_u, along_v = (WRAPS.get(entry.get(key, 0), REPEAT) for key in ("wrapS", "wrapT"))
        sampler = along_u | along_v << WRAP_V | (NEAREST if entry.get("magFilter") == NEAREST_TEXEL else 0)
        return TexturePlaces(name=f"TEXCOORD_{uv_set}", matrix=_uv_matrix(transform), sampler=sampler)

    def _surface(self, base: Float64, pbr: Tree, gloss: int) -> SurfaceGloss | Split:
        """Gloss of metal and roughness; of a mirror, or if surfaces do not follow the file, diffuse and mirror part.

        Args:
            gloss: texture of both that was converted, or -1.
        """
        metallic, roughness = float(pbr.get("metallicFactor", 1.0)), float(pbr.get("roughnessFactor", 1.0))
        info: Tree | None = pbr.get("metallicRoughnessTexture")
        mean = self._mean(info) if metallic > 0 or self.assets.as_file else None
        if gloss >= 0:
            mean = mean_texel(self.textures.textures[gloss])
            mean[2] = mean[2] if mean[2] > MOSTLY else 0.0
        green, blue = (1.0, 1.0) if mean is None else (float(mean[1]), float(mean[2]))
        if not self.assets.as_file or is_mirror(metallic * blue, roughness * green):
            if mean is not None:
                self.note("metallic-roughness textures count by their mean")
            return self.split_metal(base, metallic * blue, roughness * green)
        texture = -1 if mean is None else gloss if gloss >= 0 else self._index(info)
        return SurfaceGloss(base=rgb3(base), roughness=roughness, metallic=metallic, texture=texture)

    def _layered(self, surface: SurfaceGloss | Split, info: Tree | None) -> SurfaceGloss | Split:
        """The surface with the extensions LAYERS, whose textures count by their mean; `info` is of its base colour."""
        sheen, specular, coat = (
            self._extension(f"KHR_materials_{name}") for name in ("sheen", "specular", "clearcoat")
        )
        rim = self._colour(sheen, "sheenColor", 0.0)
        if rim.any():
            rim *= sheen_albedo(self._number(sheen, "sheenRoughness", 0.0, 3))
        clear = bool(self._extension("KHR_materials_transmission"))
        tint, weight = self._colour(specular, "specularColor", 1.0), self._number(specular, "specular", 1.0, 3)
        return self.layered(
            surface,
            image=self._image(info),
            reflects=Reflects.by_index(IOR if clear else self._ior(), tint, weight),
            coat=(self._number(coat, "clearcoat", 0.0, 0), self._number(coat, "clearcoatRoughness", 0.0, 1)),
            rim=rim,
        )

    def _ior(self) -> float:
        """The index of refraction; the extension allows 0, which reflects all light."""
        return float(self._extension("KHR_materials_ior").get("ior", IOR))

    def _number(self, table: Tree, name: str, default: float, channel: int) -> float:
        """A factor of an extension, times the mean of a channel of its texture."""
        mean = self._layer_mean(table, name)
        return float(table.get(f"{name}Factor", default)) * (1.0 if mean is None else float(mean[channel]))

    def _colour(self, table: Tree, name: str, default: float) -> Float64:
        """(3,) colour of an extension, times the mean of its texture, linear."""
        factor = np.array(table.get(f"{name}Factor", [default] * 3), np.float64)
        mean = self._layer_mean(table, name)
        return factor if mean is None else factor * linear_from_srgb(mean[:3])

    def _layer_mean(self, table: Tree, name: str) -> Float64 | None:
        """(4,) mean of the texture of a factor, with a note; None without texture."""
        if (mean := self._mean(table.get(f"{name}Texture"))) is not None and self.assets.as_file:
            self.note("textures of clearcoat, sheen and specular count by their mean")
        return mean

    def _as_metal(self) -> tuple[Tree, int, int]:
        """Describe a material of the older KHR_materials_pbrSpecularGlossiness by metal and roughness.

        Returns:
            Values of `pbrMetallicRoughness`, and textures of base colour and gloss instead of those that it names.
        """
        entry = self._extension(GLOSSY)
        base = np.array(entry.get("diffuseFactor", [1.0] * 4), dtype=np.float64)
        specular = np.array(entry.get("specularFactor", [1.0] * 3), dtype=np.float64)
        glossiness = float(entry.get("glossinessFactor", 1.0))
        info, shine = entry.get("diffuseTexture"), entry.get("specularGlossinessTexture")
        if shine is not None and (info is None or self._places(info).same(self._places(shine))):

            def find() -> tuple[Bytes, Bytes] | None:
                found = [self.textures.decode(one) for one in map(self._image, (info or shine, shine)) if one]
                if len(found) < 2 or found[0] is None or found[1] is None:
                    return None
                white = np.full((1, 1, 4), 255, np.uint8)
                return textures_of_specular(
                    white if info is None else found[0], found[1], base[:3], specular, glossiness
                )

            key = (GLOSSY, str(info), str(shine), *base[:3], *specular, glossiness)
            texture, gloss = (self.placed(one, self._places(shine)) for one in self.textures.pair(key, find))
            if texture >= 0:
                return {"baseColorFactor": [1.0, 1.0, 1.0, base[3]], "baseColorTexture": info}, texture, gloss
        if (mean := self._mean(shine)) is not None:
            specular, glossiness = specular * linear_from_srgb(mean[:3]), glossiness * float(mean[3])
            self.note("specular-glossiness textures with texture coordinates of their own count by their mean")
        colour, metallic = from_mean_specular(base[:3], self._mean(info), specular)
        pbr = {"baseColorFactor": [*colour, base[3]], "metallicFactor": metallic, "roughnessFactor": 1.0 - glossiness}
        return pbr | {"baseColorTexture": info}, -1, -1

    def _shining(self, material: Material) -> Material:
        """Add emission [KHR_materials_emissive_strength]."""
        strength = float(self._extension(STRENGTH).get("emissiveStrength", 1.0))
        emission = np.array(self.entry.get("emissiveFactor") or (0.0, 0.0, 0.0), dtype=np.float64) * strength
        emission = np.where(np.isfinite(emission), np.maximum(emission, 0.0), 0.0)
        texture = self._index(self.entry.get("emissiveTexture")) if emission.any() else -1
        return replace(material, emission=rgb3(emission), emission_texture=texture)

    def _opacity(self, base: Float64, texture: int, info: Tree | None) -> Material:
        """Opacity of the material; with `Assets.as_file`, transmission of a nearly clear one."""
        transmission = self._extension("KHR_materials_transmission")
        alpha, passed = float(base[3]), float(transmission.get("transmissionFactor", 0.0))
        mode, panes = self.entry.get("alphaMode", "OPAQUE"), self.assets.as_file
        coloured = panes and (passed > 0 or mode == "BLEND") and texture >= 0
        texel = self._mean(info) if coloured else None
        if passed > 0 and (mean := self._mean(transmission.get("transmissionTexture"))) is not None:
            passed *= float(mean[0])
            self.note("transmission textures count by their mean")
        if passed > 0:
            through = self.blended(1.0 - passed, -1, self._pane(passed, base, texel) if panes else None)
            if through.glass and texel is not None:
                self.note("textures of glass count by their mean")
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
        thickness = float(volume.get("thicknessFactor", 0.0))
        distance = float(volume.get("attenuationDistance", np.inf))
        if thickness > 0 and (mean := self._mean(volume.get("thicknessTexture"))) is not None:
            thickness *= float(mean[1])
        absorbed = np.ones(3)  # share of light that passes the thickness
        if thickness > 0 and 0 < distance < np.inf:
            colour = np.clip(np.array(volume.get("attenuationColor", [1.0, 1.0, 1.0]), np.float64), 0.0, 1.0)
            absorbed = colour ** (thickness / distance)
        colour = base[:3] if texel is None else base[:3] * linear_from_srgb(texel[:3])
        colour = np.where(np.isfinite(colour), colour, 1.0) * passed * absorbed
        return PaneGlass(colour=rgb3(np.clip(colour, 0.0, 1.0)), ior=max(self._ior(), 1.0), solid=thickness > 0)

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


def _uv_matrix(transform: Tree) -> Float64 | None:
    """(2, 3) matrix of KHR_texture_transform, for (u, v, 1) with v downwards; None if it changes nothing."""
    offset = np.array(transform.get("offset", [0.0, 0.0]), dtype=np.float64)
    scale = np.array(transform.get("scale", [1.0, 1.0]), dtype=np.float64)
    angle = float(transform.get("rotation", 0.0))
    if not offset.any() and (scale == 1).all() and angle == 0:
        return None
    turn = np.array([[math.cos(angle), math.sin(angle)], [-math.sin(angle), math.cos(angle)]])
    return np.column_stack([turn * scale, offset])
