"""glTF materials -> a diffuse part, a mirror part, opacity and a transform of the texture coordinates.

KHR_materials_transmission describes a sheet without thickness: light passes straight through, coloured by the base
colour. With a volume, a closed mesh is a solid body; absorption along its thickness counts as part of the colour.
"""

import math
from dataclasses import dataclass, replace
from functools import partial
from typing import Any

import numpy as np

from framearray_cli.base.arrays import Float64

from ..layers import MOSTLY, LayeredSource, Slot
from ..materials import CUTOFF, OPAQUE, THIN_GLASS, PlacedMaterial, Split, SurfaceGloss, TexturePlaces, is_mirror
from ..model import CLAMP, MIRROR, NEAREST, REPEAT, SCREENED, WRAP_V, Material, PaneGlass, rgb3
from ..textures import EncodedImage, mean_texel
from .container import Gltf, Tree, image_bytes

IOR = 1.5  # glTF's default
STRENGTH = "KHR_materials_emissive_strength"
GLOSSY = "KHR_materials_pbrSpecularGlossiness"
TRANSMISSION = "KHR_materials_transmission"
KNOWN = {TRANSMISSION, GLOSSY, STRENGTH}
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
class GltfMaterial(LayeredSource):
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
        surface, texture = self._layered(self._surface(base, pbr, gloss), texture)
        mask = self._mask()
        opacity = self._opacity(base, texture, info, masked=mask >= 0)
        self._note_ignored()
        material = self.make(opacity, surface, texture=texture, mirror_texture=texture)
        material = replace(material, one_sided=not self.entry.get("doubleSided", False))
        glass = None
        if mask >= 0:
            self.note(THIN_GLASS)
            glass = replace(material, glass=self._pane(1.0, base, info))
            material = replace(material, alpha=1.0, alpha_texture=mask, alpha_cutoff=SCREENED)
        if self.shows_emission:
            material = self._shining(material)
        bumps: Tree | None = self.entry.get("normalTexture") if self.assets.as_file else None
        normal_places = TexturePlaces()
        if bumps is not None and (number := self.textures.index(self._image(bumps))) >= 0:
            normal_places, scale = self._places(bumps), float(bumps.get("scale", 1.0))
            number = self.textures.sampled(number, normal_places.sampler)
            material = replace(material, normal_texture=number, normal_scale=scale)
        return PlacedMaterial(material=material, glass=glass, places=self.places, normal_places=normal_places)

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

    def _layered(self, surface: SurfaceGloss | Split, texture: int) -> tuple[SurfaceGloss | Split, int]:
        """The surface with the extensions LAYERS, and the texture of its base colour."""
        sheen, specular, coat = (
            self._extension(f"KHR_materials_{name}") for name in ("sheen", "specular", "clearcoat")
        )
        bumps = coat.get("clearcoatNormalTexture") != self.entry.get("normalTexture")
        if self.assets.as_file and coat.get("clearcoatFactor") and bumps:
            self.note("clear coats have the normal map of the surface under them, and none of their own")
        clear = bool(self._extension(TRANSMISSION))
        layers = (
            self._slot(specular, "specularColor", [1.0] * 3),
            self._slot(specular, "specular", 1.0, 3),
            self._slot(sheen, "sheenColor", [0.0] * 3),
            self._slot(sheen, "sheenRoughness", 0.0, 3),
            self._slot(coat, "clearcoat", 0.0, 0),
            self._slot(coat, "clearcoatRoughness", 0.0, 1),
        )
        return self.layered(surface, texture, IOR if clear else self._ior(), layers)

    def _ior(self) -> float:
        """The index of refraction; the extension allows 0, which reflects all light."""
        return float(self._extension("KHR_materials_ior").get("ior", IOR))

    def _slot(self, table: Tree, name: str, default: Any, channel: int = -1) -> Slot:
        """A factor of an extension, and its texture."""
        factor, info = np.array(table.get(f"{name}Factor", default), np.float64), table.get(f"{name}Texture")
        if info is None:
            return Slot(scale=factor)
        return Slot(scale=factor, image=self._image(info), channel=channel, places=self._places(info))

    def _as_metal(self) -> tuple[Tree, int, int]:
        """Describe a material of the older KHR_materials_pbrSpecularGlossiness by metal and roughness.

        Returns:
            Values of `pbrMetallicRoughness`, and textures of base colour and gloss instead of those that it names.
        """
        entry = self._extension(GLOSSY)
        base = np.array(entry.get("diffuseFactor", [1.0] * 4), dtype=np.float64)
        info, glossiness = entry.get("diffuseTexture"), float(entry.get("glossinessFactor", 1.0))
        shine = entry | {"specularTexture": entry.get("specularGlossinessTexture")}
        specular = self._slot(shine, "specular", [1.0] * 3)
        rough = replace(specular, scale=-glossiness, bias=1.0, channel=3)
        gloss, texture = self.with_specular(base[:3], self._index(info), specular, rough)
        pbr = {"baseColorFactor": [*gloss.base, base[3]], "baseColorTexture": info}
        return pbr | {"metallicFactor": gloss.metallic, "roughnessFactor": gloss.roughness}, texture, gloss.texture

    def _shining(self, material: Material) -> Material:
        """Add emission [KHR_materials_emissive_strength]."""
        strength = float(self._extension(STRENGTH).get("emissiveStrength", 1.0))
        emission = np.array(self.entry.get("emissiveFactor") or (0.0, 0.0, 0.0), dtype=np.float64) * strength
        emission = np.where(np.isfinite(emission), np.maximum(emission, 0.0), 0.0)
        texture = self._index(self.entry.get("emissiveTexture")) if emission.any() else -1
        return replace(material, emission=rgb3(emission), emission_texture=texture)

    def _mask(self) -> int:
        """Texture whose alpha is what a transmission texture keeps from passing; -1 where it is the same everywhere."""
        entry = self._extension(TRANSMISSION)
        info: Tree = entry.get("transmissionTexture") or {}
        share, image = float(entry.get("transmissionFactor", 0.0)), self._image(info or None)
        if not self.assets.as_file or share <= 0 or image is None:
            return -1
        mask = self.textures.rest(image, share)
        lowest, highest = self.textures.alpha_range(mask)
        return self.placed(mask, self._places(info)) if lowest < min(highest, OPAQUE) else -1

    def _opacity(self, base: Float64, texture: int, info: Tree | None, *, masked: bool) -> Material:
        """Opacity of the material; with `Assets.as_file`, transmission of a nearly clear one, unless it is `masked`."""
        transmission = self._extension(TRANSMISSION)
        alpha, passed = float(base[3]), 0.0 if masked else float(transmission.get("transmissionFactor", 0.0))
        mode, panes = self.entry.get("alphaMode", "OPAQUE"), self.assets.as_file
        if passed > 0 and (mean := self._mean(transmission.get("transmissionTexture"))) is not None:
            passed *= float(mean[0])
        if passed > 0:
            through = self.blended(1.0 - passed, -1, self._pane(passed, base, info) if panes else None)
            if through.left_out or through.glass or through.alpha_cutoff:
                return through
        if mode == "MASK":
            return self.masked(alpha, texture, float(self.entry.get("alphaCutoff", CUTOFF)))
        if mode == "BLEND":
            texel = self._mean(info) if panes and texture >= 0 else None
            shown = 1.0 - alpha * (1.0 if texel is None else float(texel[3]))
            cover = PaneGlass(colour=rgb3(np.full(3, min(max(shown, 0.0), 1.0))), ior=1.0, covers=True)
            return self.blended(alpha, texture, cover if panes else None)
        return Material(name=self.name)

    def _pane(self, passed: float, base: Float64, info: Tree | None) -> PaneGlass:
        """The pane of a material with a transmission.

        Args:
            passed: transmission, the share of light that is not reflected diffusely.
            base: (>= 3,) linear base colour; info: of its texture.
        """
        volume = self._extension("KHR_materials_volume")
        thickness = float(volume.get("thicknessFactor", 0.0))
        distance, depth = float(volume.get("attenuationDistance", np.inf)), volume.get("thicknessTexture")
        absorbed, texture = np.ones(3), self._index(info)  # share of light that passes the thickness
        if thickness > 0 and 0 < distance < np.inf:
            colour = np.clip(np.array(volume.get("attenuationColor", [1.0, 1.0, 1.0]), np.float64), 0.0, 1.0)
            absorbed = colour ** (thickness / distance)
            if depth is not None and (tinted := self._tinted(texture, depth, absorbed)) >= 0:
                texture, absorbed = tinted, np.ones(3)
            elif (mean := self._mean(depth)) is not None:
                absorbed **= float(mean[1])
        colour = np.where(np.isfinite(base[:3]), base[:3], 1.0) * passed * absorbed
        pane = PaneGlass(colour=rgb3(np.clip(colour, 0.0, 1.0)), texture=texture, ior=max(self._ior(), 1.0))
        return replace(pane, solid=thickness > 0)

    def _tinted(self, texture: int, depth: Tree, absorbed: Float64) -> int:
        """Base colour times what glass passes, `absorbed` where it is thickest; -1 if their places differ."""
        colour, places = self._slot_of(texture, 1.0), self._places(depth)
        if texture >= 0 and not colour.places.same(places):
            self.note("thickness textures with texture coordinates of their own count by their mean")
            return -1

        def blend(shade: Float64, thick: Float64) -> tuple[Any, ...]:
            return (shade * absorbed ** thick[..., None],)

        thickness = Slot(scale=1.0, image=self._image(depth), channel=1, places=places)
        return self._bake((str(absorbed),), (colour, thickness), blend, places)[0]

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
