"""UsdPreviewSurface, and what MaterialX calls surfaces -> materials: colour, gloss, opacity, emission, normal maps.

Inputs of shaders are constants, textures or vertex colours: UsdUVTexture, UsdPrimvarReader, UsdTransform2d.
"""

import math
from collections.abc import Mapping
from dataclasses import dataclass, field, replace
from functools import reduce
from typing import Any

import numpy as np

from framearray_cli.base.arrays import Float64
from framearray_cli.base.colour import linear_from_srgb

from ..layers import MOSTLY, LayeredSource, Slot
from ..materials import PlacedMaterial, Split, SurfaceGloss, TexturePlaces, is_mirror
from ..model import BLACK, CLAMP, MIRROR, REPEAT, WRAP_V, Material, PaneGlass, rgb3
from ..textures import AUTO, SRGB, UDIM, Channel, EncodedImage, mean_texel
from .usdcore import read_asset, usd, value_of

CHANNELS = {name: k % 4 for k, name in enumerate("rgbaxyzw")}
ST = "st"  # the usual name of texture coordinates
# Metadata that images seldom have say nothing: repeat.
WRAPS = {"clamp": CLAMP, "mirror": MIRROR, "black": BLACK, "constant": BLACK}
# First word of the name of a colour space -> exponent for its codes.
GAMMAS = {"": AUTO, "auto": AUTO, "srgb": SRGB, "g18": 1.8, "g22": 2.2, "acescg": 1.0}
GAMMAS |= dict.fromkeys(("lin", "linear", "raw", "none", "data", "identity"), 1.0)
PREVIEW = "UsdPreviewSurface"
BRUSHED = "brushed surfaces look the same from all sides"
ROUGHNESS, IOR = 0.5, 1.5  # defaults of UsdPreviewSurface
GREY = 0.18  # its diffuse colour
COAT_ROUGHNESS = 0.01  # and of its clear coat
# Inputs that UsdPreviewSurface does not have.
TINT, SHEEN, CLOTH, VARNISH = "transmitted colour", "rim of cloth", "roughness of the rim", "colour of the coat"
SCATTERS, SKIN, SHINE, LOBE = "share of subsurface", "its colour", "colour of reflection", "share of reflection"

# Input of UsdPreviewSurface -> its name and default in the shaders of MaterialX, see SHADERS [MaterialX, OpenPBR].
INPUTS: Mapping[str, tuple[tuple[str, float | None] | None, ...]] = {
    "diffuseColor": (("base_color", 0.8), ("base_color", 0.8), ("base_color", 1.0)),
    "metallic": (("metalness", 0.0), ("base_metalness", 0.0), ("metallic", 1.0)),
    "roughness": (("specular_roughness", 0.2), ("specular_roughness", 0.3), ("roughness", 1.0)),
    "ior": (("specular_IOR", 1.5), ("specular_ior", 1.5), ("ior", 1.5)),
    "emissiveColor": (("emission_color", 1.0), ("emission_color", 1.0), ("emissive", 0.0)),
    "normal": (("normal", None), ("geometry_normal", None), ("normal", None)),
    "opacity": (("opacity", 1.0), ("geometry_opacity", 1.0), ("alpha", 1.0)),
    "opacityThreshold": (None, None, ("alpha_cutoff", 0.5)),
    "clearcoat": (("coat", 0.0), ("coat_weight", 0.0), ("clearcoat", 0.0)),
    "clearcoatRoughness": (("coat_roughness", 0.1), ("coat_roughness", 0.0), ("clearcoat_roughness", 0.0)),
    VARNISH: (("coat_color", 1.0), ("coat_color", 1.0), None),
    SHEEN: (("sheen_color", 1.0), ("fuzz_color", 1.0), ("sheen_color", 0.0)),
    CLOTH: (("sheen_roughness", 0.3), ("fuzz_roughness", 0.5), ("sheen_roughness", 0.0)),
    TINT: (("transmission_color", 1.0), ("transmission_color", 1.0), None),
    SCATTERS: (("subsurface", 0.0), ("subsurface_weight", 0.0), None),
    SKIN: (("subsurface_color", 1.0), ("subsurface_color", 0.8), None),
    SHINE: (("specular_color", 1.0), ("specular_color", 1.0), ("specular_color", 1.0)),
    LOBE: (("specular", 1.0), ("specular_weight", 1.0), ("specular", 1.0)),
}
# Weights of inputs; opacity has the weight of the light that passes.
WEIGHTS: Mapping[str, tuple[tuple[str, float] | None, ...]] = {
    "diffuseColor": (("base", 1.0), ("base_weight", 1.0), None),
    "emissiveColor": (("emission", 0.0), ("emission_luminance", 0.0), ("emissive_strength", 1.0)),
    "opacity": (("transmission", 0.0), ("transmission_weight", 0.0), ("transmission", 0.0)),
    SHEEN: (("sheen", 0.0), ("fuzz_weight", 0.0), None),
}
PREVIEWS = (PREVIEW, "ND_UsdPreviewSurface_surfaceshader")
GLTF_PBR = "ND_gltf_pbr_surfaceshader"
SHADERS = ("ND_standard_surface_surfaceshader", "ND_open_pbr_surface_surfaceshader", GLTF_PBR)
# Inputs that are left out, the first that a shader has -> the value that changes nothing, and the look without.
LEFT_OUT = {
    ("displacement",): (0, "displacement is left out"),
    ("occlusion",): (1, "occlusion maps are left out (obscurances are computed)"),
    ("subsurface", "subsurface_weight"): (0, "subsurface scattering is left out; its colour is diffuse"),
    ("specular_anisotropy", "specular_roughness_anisotropy", "anisotropy_strength"): (0, BRUSHED),
    ("thin_film_weight", "thin_film_thickness", "iridescence"): (0, "the surface under the thin film shows"),
    ("diffuse_roughness", "base_diffuse_roughness"): (0, "rough diffuse surfaces are as bright from all sides"),
    ("coat_normal", "geometry_coat_normal", "clearcoat_normal"): (0, "clear coats have the normals of the surface"),
    ("transmission_scatter",): (0, "cloudy glass is clear"),
    ("transmission_dispersion", "transmission_dispersion_scale", "dispersion"): (0, "glass does not part colours"),
    ("transmission_depth", "thickness"): (0, "glass has one colour, however thick"),
}
IMAGES = ("UsdUVTexture", "ND_UsdUVTexture", "ND_image_", "ND_tiledimage_", "ND_gltf_image_", "ND_gltf_colorimage")
GLTF_IMAGE, TRANSFORM = "ND_gltf_", "UsdTransform2d"
PLACING = (TRANSFORM, "ND_place2d_vector2")
READERS = ("UsdPrimvarReader", "ND_UsdPrimvarReader", "ND_geompropvalue_")
THROUGH = ("ND_normalmap", "ND_dot_", "ND_constant_", "ND_convert_")  # nodes that hand on the first of PASSED
PASSED = ("in", "value", "in1", "fg", "in2", "bg", "fallback")


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class Texture:
    """Values that an input reads from an image: scale * texel + bias.

    Attributes:
        channel: 0 to 3, or -1 for red, green and blue.
        scale, bias: (4,).
    """

    image: EncodedImage
    channel: int
    scale: Float64
    bias: Float64
    places: TexturePlaces

    @property
    def one_channel(self) -> Channel:
        """One channel of the image, and its scale and bias."""
        k = max(self.channel, 0)
        return self.image, k, self.scale[k], self.bias[k]


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class Value:
    """The value of an input: a constant, and a texture that takes its place; `coloured`: the display colours do."""

    constant: Any = None
    texture: Texture | None = None
    coloured: bool = False

    @property
    def varies(self) -> bool:
        """True with a texture or vertex colours."""
        return self.texture is not None or self.coloured

    def number(self, default: float) -> float:
        """The constant as a finite number."""
        try:
            found = float(self.constant)
        except (TypeError, ValueError):
            return default
        return found if math.isfinite(found) else default

    def color(self, default: float) -> Float64:
        """(3,) constant as a colour."""
        return _finite(self.constant, 3, default)


def _finite(values: Any, n: int, default: float) -> Float64:
    """(n,) numbers of an input, repeated if there are fewer; the default for those that are missing or not finite."""
    found = np.resize(np.array(np.nan if values is None else values, np.float64), n)
    return np.asarray(np.where(np.isfinite(found), found, default))


@dataclass(frozen=True, slots=True, kw_only=True)
class UsdMaterial(LayeredSource):
    """A material of a USD file, and its inputs."""

    shader: Any
    time: Any
    followed: dict[str, Value] = field(default_factory=dict)

    def read(self) -> PlacedMaterial | None:
        """Read the material; None, with a note, if its shader is not known."""
        if self._kind(self.shader) not in PREVIEWS + SHADERS:
            self.note(f"materials without {PREVIEW} have their display colour, or grey")
            return None
        base = self._base()
        colour, texture = self._colour(base)
        metal = self.value("metallic")
        gloss = -1
        if self.value("useSpecularWorkflow").number(0.0) > 0:
            specular, rough = self._slot("specularColor", 0.0), self._slot("roughness", ROUGHNESS, 0)
            lobe, texture = self.with_specular(colour, texture, specular, rough)
            colour, metal, gloss = np.array(lobe.base), Value(constant=lobe.metallic), lobe.texture
        opacity = self._opacity()
        surface, texture = self._layered(self._surface(colour, metal, gloss), texture, opacity)
        material = self.make(opacity, surface, texture=texture, mirror_texture=texture)
        material = self._shining(material)
        bumps = self.value("normal").texture
        if bumps and not self.assets.as_file:
            self.note_unused(bumps=True)
        elif bumps:  # its scale is 2 and its bias -1 if its image is one of codes from 0 to 1
            strength = float(abs(bumps.scale[0])) / (2 if bumps.bias[:3].any() else 1)
            normal_texture = self.textures.sampled(self.textures.index(bumps.image, numbers=True), bumps.places.sampler)
            material = replace(material, normal_texture=normal_texture, normal_scale=strength)
        for names, (neutral, instead) in LEFT_OUT.items():
            found = next((self._follow(self.shader, name) for name in names if self.shader.GetInput(name)), Value())
            changes = found.texture or (found.color(neutral) != neutral).any()
            if changes and (material.unseen or "glass" not in instead):
                self.note(instead)
        return PlacedMaterial(
            material=material,
            places=self.places,
            normal_places=bumps.places if bumps else TexturePlaces(),
            coloured=base.coloured,
        )

    def _kind(self, node: Any) -> str:
        """The identifier of a shader, or empty."""
        return str(node.GetIdAttr().Get(self.time) or "") if node else ""

    def _base(self) -> Value:
        """The base colour, with the colours of subsurface scattering and of a clear coat."""
        base, skin, share = self.value("diffuseColor"), self.value(SKIN), self._factor(self.value(SCATTERS), 0.0)
        if base.varies or skin.varies:
            base = skin if share >= MOSTLY else base
        elif share > 0:
            base = Value(constant=(1.0 - share) * base.color(GREY) + share * skin.color(1.0))
        coat, varnish = self._factor(self.value("clearcoat"), 0.0), self.value(VARNISH)
        if not varnish.texture or coat < MOSTLY:
            varnish = Value(constant=1.0 - coat + coat * self.mean_of(self._slot(VARNISH, 1.0)))
        return self._product(base, varnish)

    def _colour(self, value: Value, default: float = GREY) -> tuple[Float64, int]:
        """(3,) factor and the texture that it multiplies."""
        if value.coloured:
            return np.ones(3), -1
        if value.texture is None or (index := self._index(value.texture)) < 0:
            return value.color(default), -1
        if value.texture.bias[:3].any():
            self.note("the bias of colour textures is left out")
        return value.texture.scale[:3], index

    def _index(self, texture: Texture) -> int:
        """Index in the texture table; -1, with a note, if it cannot be read."""
        return self.placed(self.textures.index(texture.image), texture.places)

    def _factor(self, value: Value, default: float) -> float:
        """A number, or the mean of a texture."""
        mean = self.textures.mean(value.texture.image) if value.texture else None
        if value.texture is None or mean is None:
            return value.number(default)
        _, k, scale, bias = value.texture.one_channel
        return float(np.clip(mean[k] * scale + bias, 0.0, 1.0))

    def _slot(self, name: str, default: float, channel: int = -1) -> Slot:
        """The value of an input: a colour, or, if a channel is given, a number."""
        value = self.value(name)
        if (texture := value.texture) is None or self.textures.mean(texture.image) is None:
            return Slot(scale=value.color(default) if channel < 0 else value.number(default))
        if channel >= 0:
            image, channel, scale, bias = texture.one_channel
            return Slot(scale=scale, image=image, channel=channel, bias=bias, places=texture.places)
        return Slot(scale=texture.scale[:3], image=texture.image, bias=texture.bias[:3], places=texture.places)

    def _surface(self, colour: Float64, metal: Value, gloss: int) -> SurfaceGloss | Split:
        """Gloss; of a mirror, or if surfaces do not follow the file, diffuse and mirror part.

        Args:
            gloss: texture of metal and roughness that was converted, or -1.
        """
        rough = self.value("roughness")
        metallic, roughness = self._factor(metal, 0.0), self._factor(rough, ROUGHNESS)
        if gloss >= 0:
            _, roughness, metallic, _ = mean_texel(self.textures.textures[gloss])
            metallic = metallic if metallic > MOSTLY else 0.0
        if not self.assets.as_file or is_mirror(metallic, roughness):
            return self.split_metal(colour, metallic, roughness)
        if gloss >= 0:
            return SurfaceGloss(base=rgb3(colour), metallic=1.0, roughness=1.0, texture=gloss)
        plain = SurfaceGloss(base=rgb3(colour), metallic=metallic, roughness=roughness)
        found = [value.texture for value in (rough, metal) if value.texture]
        if not found:
            return plain
        if not found[0].places.same(found[-1].places):
            self.note("roughness and metal textures with different texture coordinates count by their mean")
            return plain
        green, blue = (value.texture.one_channel if value.texture else None for value in (rough, metal))
        if (texture := self.placed(self.textures.packed(green, blue), found[0].places)) < 0:
            return plain
        return replace(
            plain, metallic=1.0 if blue else metallic, roughness=1.0 if green else roughness, texture=texture
        )

    def _layered(
        self, surface: SurfaceGloss | Split, texture: int, opacity: Material
    ) -> tuple[SurfaceGloss | Split, int]:
        """The surface with clear coat and the rim of cloth, and as much reflection as its index of refraction says."""
        plain = opacity.glass or self.value("useSpecularWorkflow").number(0.0) > 0
        ior = IOR if plain else max(self.value("ior").number(IOR), 1.0)
        shine, lobe = (Slot(scale=np.ones(3)), Slot(scale=1.0)) if plain else (
            self._slot(SHINE, 1.0), self._slot(LOBE, 1.0, 0),
        )  # fmt: skip
        if (self.mean_of(shine) * self.mean_of(lobe) != 1).any() and self._factor(self.value("metallic"), 0.0) > 0:
            self.note("metals have one colour, without a tint of their edges")
        layers = (
            shine,
            lobe,
            self._slot(SHEEN, 0.0),
            self._slot(CLOTH, 0.0, 0),
            self._slot("clearcoat", 0.0, 0),
            self._slot("clearcoatRoughness", COAT_ROUGHNESS, 0),
        )
        return self.layered(surface, texture, ior, layers)

    def _opacity(self) -> Material:
        """Opacity of the material: holes below a threshold, a thin pane if hardly anything is left, else a cover."""
        value = self.value("opacity")
        threshold = self.value("opacityThreshold").number(0.0)
        alpha, texture = value.number(1.0), -1
        if value.texture is not None:
            k, image = value.texture.channel, value.texture.image
            texture = self.textures.cutout(image) if k != 3 else self.textures.index(image, numbers=image.gamma > 0)
            texture = self.placed(texture, value.texture.places)
            alpha = float(value.texture.scale[max(k, 0)]) if texture >= 0 else alpha
        alpha = min(max(alpha, 0.0), 1.0)
        if threshold > 0:
            return self.masked(alpha, texture, threshold)
        if alpha == 1.0 and texture < 0:
            return Material(name=self.name)
        ior = max(self.value("ior").number(IOR), 1.0)
        tint, number = self._colour(self.value(TINT) if self.assets.as_file else Value(), 1.0)
        pane = PaneGlass(colour=rgb3((1.0 - alpha) * tint), texture=number, ior=ior, covers=ior == 1.0)
        return self.blended(alpha, texture, pane if self.assets.as_file else None)

    def _shining(self, material: Material) -> Material:
        value = self.value("emissiveColor")
        emission = np.maximum(value.color(0.0), 0.0) if value.texture is None else value.texture.scale[:3]
        if not emission.any():
            return material
        self.note_unused(emits=True)
        if not self.shows_emission:
            return material
        texture = self._index(value.texture) if value.texture else -1
        if value.texture and texture < 0:
            return material
        return replace(material, emission=rgb3(emission), emission_texture=texture)

    def value(self, name: str) -> Value:
        """Return the value of an input of the shader, by its name in UsdPreviewSurface, or TINT."""
        kind = self._kind(self.shader)
        if kind in PREVIEWS:
            return self._follow(self.shader, name)
        own, weight = (table[name][SHADERS.index(kind)] if name in table else None for table in (INPUTS, WEIGHTS))
        mode = self._constant(self.shader, "alpha_mode", 0)
        if own is None or (name == "opacityThreshold" and mode != 1):
            return Value()
        found = Value(constant=1.0) if kind == GLTF_PBR and name == "opacity" and mode == 0 else self._given(*own)
        if weight is None:
            return found
        factor = self._given(*weight)
        if name == "opacity":
            factor = Value(constant=1.0 - self._factor(factor, 0.0))
            found = replace(found, constant=float(np.mean(_finite(found.constant, 3, 1.0))))
        return self._product(found, factor)

    def _given(self, name: str, default: float | None) -> Value:
        """The value of an input of the shader, or its default."""
        found = self._follow(self.shader, name)
        return found if found.texture or found.constant is not None else replace(found, constant=default)

    def _product(self, first: Value, second: Value) -> Value:
        """The product of two values; the first that varies, with a note, if it cannot be multiplied."""
        if second.varies and not first.varies:
            first, second = second, first
        if not second.varies and (_finite(second.constant, 3, 1.0) == 1).all():
            return first
        if second.varies or first.coloured:
            self.note("factors of vertex colours, and textures that multiply other textures, are left out")
            return first
        texture = first.texture
        if texture is not None:
            factor = _finite(second.constant, 4, 1.0)
            texture = replace(texture, scale=texture.scale * factor, bias=texture.bias * factor)
        n = min((size for size in (np.size(first.constant), np.size(second.constant)) if size > 1), default=1)
        constant = _finite(first.constant, n, 1.0) * _finite(second.constant, n, 1.0)
        return Value(constant=constant if n > 1 else float(constant[0]), texture=texture)

    def _follow(self, node: Any, name: str) -> Value:
        shade, entry = usd().UsdShade, node.GetInput(name)
        attributes = shade.Utils.GetValueProducingAttributes(entry) if entry else []
        if not attributes:
            return Value()
        attribute = attributes[0]
        if not attribute.GetName().startswith("outputs:"):
            constant = value_of(attribute, self.time)
            coded = attribute.GetColorSpace().startswith("srgb") and attribute.GetTypeName().role == "Color"
            return Value(constant=linear_from_srgb(_finite(constant, 3, 0.0)) if coded else constant)
        node, output = shade.Shader(attribute.GetPrim()), attribute.GetBaseName().removeprefix("out")
        kind = self._kind(node)
        if kind.startswith(IMAGES):
            return self._texture(node, output)
        if kind.startswith(READERS):
            name = self._primvar(node)
            if name == "displayColor":
                return Value(coloured=True)
            self.note(f"values of the primvar {name} are left out")
            return Value(constant=self._constant(node, "fallback", None))
        key = f"{node.GetPath()}.{output}"
        if key not in self.followed:
            self.followed[key] = Value()  # a loop of nodes has none
            self.followed[key] = self._computed(node, kind, output)
        return self.followed[key]

    def _computed(self, node: Any, kind: str, output: str) -> Value:
        """The value that a node computes; its first texture or value, with a note, if that is not known."""
        found = [self._follow(node, key) for key in PASSED if node.GetInput(key)] or [Value()]
        first = found[0]
        if kind.startswith(THROUGH):
            return self._product(first, self._follow(node, "scale")) if kind.startswith("ND_normalmap") else first
        if kind.startswith("ND_multiply_"):
            return reduce(self._product, found)
        if kind.startswith(("ND_extract_", "ND_separate")):
            k = CHANNELS.get(output, 0) if kind.startswith("ND_s") else int(self._constant(node, "index", 0)) % 4
            constant = None if first.constant is None else np.resize(first.constant, 4)[k]
            return replace(first, constant=constant, texture=first.texture and replace(first.texture, channel=k))
        found.sort(key=lambda one: (not one.varies, one.constant is None))
        shown = "; their first texture or value shows" if found[0].varies or found[0].constant is not None else ""
        self.note(f"shaders {kind or 'without id'} are left out{shown}")
        return found[0]

    def _primvar(self, node: Any) -> str:
        """The primvar that a node reads; empty if it names none."""
        return str(self._constant(node, "varname", None) or self._constant(node, "geomprop", ""))

    def _constant(self, node: Any, name: str, default: Any) -> Any:
        """An input of a node, followed to its constant."""
        found = self._follow(node, name).constant
        return default if found is None else found

    def _texture(self, node: Any, output: str) -> Value:
        fallback = self._constant(node, "fallback", None)
        asset = self._constant(node, "file", None)
        if asset is None or not getattr(asset, "path", ""):
            self.note("textures without a file are left out")
            return Value(constant=fallback)
        written = usd().UsdShade.Utils.GetValueProducingAttributes(node.GetInput("file"))[0].GetColorSpace()
        image = self._image(asset, self._gamma(str(self._constant(node, "sourceColorSpace", None) or written)))
        along_u, along_v = (
            WRAPS.get(str(self._constant(node, names[0], None) or self._constant(node, names[1], "")), REPEAT)
            for names in (("wrapS", "uaddressmode"), ("wrapT", "vaddressmode"))
        )
        if output not in ("rgb", *CHANNELS):
            output = "rgb"
        kind = self._kind(node)
        factor = "scale" if not kind.startswith(GLTF_IMAGE) else "color" if "colorimage" in kind else "factor"
        return Value(
            constant=fallback,
            texture=Texture(
                image=image,
                channel=CHANNELS.get(output, -1),
                scale=_finite(self._constant(node, factor, None), 4, 1.0),
                bias=_finite(self._constant(node, "bias", None), 4, 0.0),
                places=replace(self._places(node, image.counts), sampler=along_u | along_v << WRAP_V),
            ),
        )

    def _gamma(self, space: str) -> float:
        """Exponent for the codes of a colour space, see `EncodedImage`."""
        transfer, _, rest = space.lower().removesuffix("_scene").partition("_")
        if transfer == "acescg" or transfer not in GAMMAS or rest not in ("", "texture", "rec709"):
            self.note(f"colours of the space {space} are taken as Rec. 709")
        return GAMMAS.get(transfer, SRGB)

    def _image(self, asset: Any, gamma: float) -> EncodedImage:
        if UDIM not in asset.path:
            key, read = read_asset(asset, self.assets)
            return self.image(("usd", key, gamma), read)._replace(gamma=gamma)

        def tile(number: int) -> bytes:
            names = (name.replace(UDIM, str(number)) for name in (asset.path, asset.resolvedPath))
            return bytes(read_asset(usd().Sdf.AssetPath(*names), self.assets)[1]())

        return self.tiled(("usd", asset.resolvedPath or asset.path, gamma), tile)._replace(gamma=gamma)

    def _places(self, node: Any, counts: tuple[int, int]) -> TexturePlaces:
        """Follow the input `st` of a texture, of so many tiles, through transforms to the reader of a primvar."""
        shade, name = usd().UsdShade, ST
        tiling, moved = (self._constant(node, key, fill) for key, fill in (("uvtiling", (1, 1)), ("uvoffset", (0, 0))))
        matrix = np.array([[tiling[0], 0, -moved[0]], [0, tiling[1], -moved[1]], [0, 0, 1]], np.float64)
        if (kind := self._kind(node)).startswith(GLTF_IMAGE):
            matrix = matrix @ self._placement(node, kind)
        for _ in range(len(CHANNELS)):  # transforms in a row; more are not met
            entry = next((node.GetInput(key) for key in ("st", "in", "texcoord") if node.GetInput(key)), None)
            attributes = shade.Utils.GetValueProducingAttributes(entry) if entry else []
            if not attributes:
                break
            node = shade.Shader(attributes[0].GetPrim())
            kind = self._kind(node)
            if kind in PLACING:
                matrix = matrix @ self._placement(node, kind)
                continue
            name = self._primvar(node) if kind.startswith(READERS) else ST
            break
        matrix /= np.reshape((*counts, 1), (3, 1))
        return TexturePlaces(name=name or ST, matrix=None if (matrix == np.eye(3)).all() else matrix[:2])

    def _placement(self, node: Any, kind: str) -> Float64:
        """(3, 3) of a place2d of MaterialX: about its pivot, one over the scale, then a turn, then minus the offset.

        A UsdTransform2d, and images of glTF, which place themselves, do the opposite.
        """
        usual, gltf = kind == TRANSFORM, kind.startswith(GLTF_IMAGE)
        rotate, move = ("rotation", "translation") if usual else ("rotate", "offset")
        defaults = {"pivot": (0, int(gltf)), "scale": (1, 1), move: (0, 0), rotate: 0}
        pivot, scale, offset, angle = (
            np.array(self._constant(node, key, fill), float) for key, fill in defaults.items()
        )
        angle, scale = np.radians(angle), np.where(scale == 0, 1.0, scale)
        if usual or gltf:
            angle, scale, offset = -angle, 1.0 / scale, offset * (-1.0, 1.0 if gltf else -1.0)
        turn = np.array([[np.cos(angle), np.sin(angle)], [-np.sin(angle), np.cos(angle)]])
        found = np.eye(3)
        found[:2, :2] = turn / scale
        found[:2, 2] = pivot - offset - found[:2, :2] @ pivot
        if self._constant(node, "operationorder", int("gltf_colorimage" in kind)):
            found[:2, :2] = turn / scale[:, None]
            found[:2, 2] = pivot - found[:2, :2] @ (pivot + offset)
        return found
