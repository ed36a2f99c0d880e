"""UsdPreviewSurface, and what MaterialX calls surfaces -> materials: colour, gloss, opacity, emission, normal maps.

Inputs of shaders are constants, textures or vertex colours: UsdUVTexture, UsdPrimvarReader, UsdTransform2d.
"""

import math
from collections.abc import Mapping
from dataclasses import dataclass, replace
from typing import Any

import numpy as np

from framearray_cli.base.arrays import Float64
from framearray_cli.base.colour import linear_from_srgb

from ..materials import (
    MaterialSource,
    PlacedMaterial,
    Reflects,
    Split,
    SurfaceGloss,
    TexturePlaces,
    from_mean_specular,
    is_mirror,
    sheen_albedo,
)
from ..model import BLACK, CLAMP, MIRROR, REPEAT, WRAP_V, Material, PaneGlass, rgb3
from ..textures import UDIM, Channel, EncodedImage
from .usdcore import read_asset, usd, value_of

CHANNELS = {"r": 0, "g": 1, "b": 2, "a": 3}
ST = "st"  # the usual name of texture coordinates
# Metadata that images seldom have say nothing: repeat.
WRAPS = {"clamp": CLAMP, "mirror": MIRROR, "black": BLACK, "constant": BLACK}
PREVIEW = "UsdPreviewSurface"
ROUGHNESS, IOR = 0.5, 1.5  # defaults of UsdPreviewSurface
GREY = 0.18  # its diffuse colour
COAT_ROUGHNESS = 0.01  # and of its clear coat
# Inputs that UsdPreviewSurface does not have.
TINT, SHEEN, CLOTH = "transmitted colour", "rim of cloth", "roughness of the rim"


# Shaders of MaterialX: input of UsdPreviewSurface -> its name there and its default, and then the same of its weight;
# opacity has the weight of the light that passes. What else these shaders have is left out [MaterialX, OpenPBR].
STANDARD = {
    "diffuseColor": ("base_color", 0.8, "base", 1.0),
    "metallic": ("metalness", 0.0),
    "roughness": ("specular_roughness", 0.2),
    "ior": ("specular_IOR", 1.5),
    "emissiveColor": ("emission_color", 1.0, "emission", 0.0),
    "normal": ("normal", None),
    "opacity": ("opacity", 1.0, "transmission", 0.0),
    "clearcoat": ("coat", 0.0),
    "clearcoatRoughness": ("coat_roughness", 0.1),
    SHEEN: ("sheen_color", 1.0, "sheen", 0.0),
    CLOTH: ("sheen_roughness", 0.3),
    TINT: ("transmission_color", 1.0),
}
OPEN_PBR = {
    "diffuseColor": ("base_color", 0.8, "base_weight", 1.0),
    "metallic": ("base_metalness", 0.0),
    "roughness": ("specular_roughness", 0.3),
    "ior": ("specular_ior", 1.5),
    "emissiveColor": ("emission_color", 1.0, "emission_luminance", 0.0),
    "normal": ("geometry_normal", None),
    "opacity": ("geometry_opacity", 1.0, "transmission_weight", 0.0),
    "clearcoat": ("coat_weight", 0.0),
    "clearcoatRoughness": ("coat_roughness", 0.0),
    SHEEN: ("fuzz_color", 1.0, "fuzz_weight", 0.0),
    CLOTH: ("fuzz_roughness", 0.5),
    TINT: ("transmission_color", 1.0),
}
GLTF_PBR = {
    "diffuseColor": ("base_color", 1.0),
    "metallic": ("metallic", 1.0),
    "roughness": ("roughness", 1.0),
    "ior": ("ior", 1.5),
    "emissiveColor": ("emissive", 0.0, "emissive_strength", 1.0),
    "normal": ("normal", None),
    "opacity": ("alpha", 1.0, "transmission", 0.0),
    "clearcoat": ("clearcoat", 0.0),
    "clearcoatRoughness": ("clearcoat_roughness", 0.0),
    SHEEN: ("sheen_color", 0.0),
    CLOTH: ("sheen_roughness", 0.0),
}
MODELS: dict[str, Mapping[str, tuple[Any, ...]] | None] = {
    PREVIEW: None,
    "ND_UsdPreviewSurface_surfaceshader": None,
    "ND_standard_surface_surfaceshader": STANDARD,
    "ND_open_pbr_surface_surfaceshader": OPEN_PBR,
    "ND_gltf_pbr_surfaceshader": GLTF_PBR,
}
IMAGES = ("UsdUVTexture", "ND_UsdUVTexture", "ND_image_", "ND_tiledimage_", "ND_gltf_image_", "ND_gltf_colorimage")
READERS = ("UsdPrimvarReader", "ND_UsdPrimvarReader", "ND_geompropvalue_")
THROUGH = ("ND_normalmap", "ND_dot_", "ND_constant_", "ND_convert_")  # nodes that hand on the first of PASSED
PASSED = ("in", "value")


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
class UsdMaterial(MaterialSource):
    """A material of a USD file, and its inputs."""

    shader: Any
    time: Any

    def read(self) -> PlacedMaterial | None:
        """Read the material; None, with a note, if its shader is not known."""
        if self._kind(self.shader) not in MODELS:
            self.note(f"materials without {PREVIEW} have their display colour, or grey")
            return None
        base = self.value("diffuseColor")
        colour, texture = self._colour(base)
        metal = self.value("metallic")
        if self.value("useSpecularWorkflow").number(0.0) > 0:
            mean = self.textures.mean(base.texture.image) if base.texture and texture >= 0 else None
            colour, metallic = from_mean_specular(colour, mean, self._specular())
            metal = Value(constant=metallic)
        opacity = self._opacity()
        surface = self._layered(self._surface(colour, metal), base.texture if texture >= 0 else None, opacity)
        material = self.make(opacity, surface, texture=texture, mirror_texture=texture)
        material = self._shining(material)
        bumps = self.value("normal").texture
        if bumps and not self.assets.as_file:
            self.note_unused(bumps=True)
        elif bumps:  # its scale is 2 and its bias -1 if its image is one of codes from 0 to 1
            strength = float(abs(bumps.scale[0])) / 2 if bumps.bias[:3].any() else 1.0
            normal_texture = self.textures.sampled(self.textures.index(bumps.image, numbers=True), bumps.places.sampler)
            material = replace(material, normal_texture=normal_texture, normal_scale=strength)
        found = self.value("displacement")
        if found.texture or found.number(0.0) > 0:
            self.note("displacement is left out")
        return PlacedMaterial(
            material=material,
            places=self.places,
            normal_places=bumps.places if bumps else TexturePlaces(),
            coloured=base.coloured,
        )

    def _kind(self, node: Any) -> str:
        """The identifier of a shader, or empty."""
        return str(node.GetIdAttr().Get(self.time) or "") if node else ""

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

    def _specular(self) -> Float64:
        """(3,) specular colour, or the mean of its texture."""
        shine = self.value("specularColor")
        mean = self.textures.mean(shine.texture.image) if shine.texture else None
        if shine.texture is None or mean is None:
            return shine.color(0.0)
        self.note("specular textures count by their mean")
        return np.clip(linear_from_srgb(mean[:3]) * shine.texture.scale[:3] + shine.texture.bias[:3], 0.0, 1.0)

    def _surface(self, colour: Float64, metal: Value) -> SurfaceGloss | Split:
        """Gloss; of a mirror, or if surfaces do not follow the file, diffuse and mirror part."""
        rough = self.value("roughness")
        metallic, roughness = self._factor(metal, 0.0), self._factor(rough, ROUGHNESS)
        if not self.assets.as_file or is_mirror(metallic, roughness):
            return self.split_metal(colour, metallic, roughness)
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
        self, surface: SurfaceGloss | Split, texture: Texture | None, opacity: Material
    ) -> SurfaceGloss | Split:
        """The surface with clear coat and the rim of cloth, and as much reflection as its index of refraction says."""
        plain = opacity.glass or self.value("useSpecularWorkflow").number(0.0) > 0
        sheen = self.value(SHEEN).color(0.0)
        if sheen.any():
            sheen = sheen * sheen_albedo(self._factor(self.value(CLOTH), 0.0))
        coat = self.value("clearcoat"), self.value("clearcoatRoughness")
        return self.layered(
            surface,
            image=texture.image if texture else None,
            reflects=Reflects.by_index(IOR if plain else max(self.value("ior").number(IOR), 1.0)),
            coat=(self._factor(coat[0], 0.0), self._factor(coat[1], COAT_ROUGHNESS)),
            rim=sheen,
        )

    def _opacity(self) -> Material:
        """Opacity of the material: holes below a threshold, a thin pane if hardly anything is left, else a cover."""
        value = self.value("opacity")
        threshold = self.value("opacityThreshold").number(0.0)
        alpha, texture = value.number(1.0), -1
        if value.texture is not None:
            k, image = value.texture.channel, value.texture.image
            texture = self.textures.index(image) if k == 3 else self.textures.cutout(image)
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
        model = MODELS[self._kind(self.shader)]
        if model is None:
            return self._follow(self.shader, name)
        if name not in model:
            return Value()
        own, default, *weight = model[name]
        found = self._follow(self.shader, own)
        if found.constant is None and found.texture is None:
            found = replace(found, constant=default)
        factor = self._follow(self.shader, weight[0]).number(weight[1]) if weight else 1.0
        if name == "opacity":
            factor = 1.0 - factor
            found = replace(found, constant=float(np.mean(_finite(found.constant, 3, 1.0))))
        if factor == 1.0 or found.coloured:
            return found
        constant = None if found.constant is None else np.multiply(found.constant, factor)
        texture = found.texture and replace(found.texture, scale=found.texture.scale * factor)
        return replace(found, constant=constant, texture=texture)

    def _follow(self, node: Any, name: str) -> Value:
        shade, entry = usd().UsdShade, node.GetInput(name)
        attributes = shade.Utils.GetValueProducingAttributes(entry) if entry else []
        if not attributes:
            return Value()
        attribute = attributes[0]
        if not attribute.GetName().startswith("outputs:"):
            return Value(constant=value_of(attribute, self.time))
        node = shade.Shader(attribute.GetPrim())
        kind = self._kind(node)
        if kind.startswith(IMAGES):
            return self._texture(node, attribute.GetBaseName())
        if kind.startswith(THROUGH):
            return self._follow(node, next((key for key in PASSED if node.GetInput(key)), PASSED[0]))
        if kind.startswith(READERS):
            name = self._primvar(node)
            if name == "displayColor":
                return Value(coloured=True)
            self.note(f"values of the primvar {name} are left out")
        else:
            self.note(f"shaders {kind or 'without id'} are left out")
        return Value(constant=self._constant(node, "fallback", None))

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
        image = self._image(asset)
        along_u, along_v = (
            WRAPS.get(str(self._constant(node, names[0], None) or self._constant(node, names[1], "")), REPEAT)
            for names in (("wrapS", "uaddressmode"), ("wrapT", "vaddressmode"))
        )
        if output not in ("rgb", *CHANNELS):
            output = "rgb"
        return Value(
            constant=fallback,
            texture=Texture(
                image=image,
                channel=CHANNELS.get(output, -1),
                scale=_finite(self._constant(node, "scale", None), 4, 1.0),
                bias=_finite(self._constant(node, "bias", None), 4, 0.0),
                places=replace(self._places(node, image.counts), sampler=along_u | along_v << WRAP_V),
            ),
        )

    def _image(self, asset: Any) -> EncodedImage:
        if UDIM not in asset.path:
            key, read = read_asset(asset, self.assets)
            return self.image(("usd", key), read)

        def tile(number: int) -> bytes:
            names = (name.replace(UDIM, str(number)) for name in (asset.path, asset.resolvedPath))
            return bytes(read_asset(usd().Sdf.AssetPath(*names), self.assets)[1]())

        return self.tiled(("usd", asset.resolvedPath or asset.path), tile)

    def _places(self, node: Any, counts: tuple[int, int]) -> TexturePlaces:
        """Follow the input `st` of a texture, of so many tiles, through transforms to the reader of a primvar."""
        shade, name = usd().UsdShade, ST
        tiling, moved = (self._constant(node, key, fill) for key, fill in (("uvtiling", (1, 1)), ("uvoffset", (0, 0))))
        matrix = np.array([[tiling[0], 0, -moved[0]], [0, tiling[1], -moved[1]], [0, 0, 1]], np.float64)
        for _ in range(len(CHANNELS)):  # transforms in a row; more are not met
            entry = next((node.GetInput(key) for key in ("st", "in", "texcoord") if node.GetInput(key)), None)
            attributes = shade.Utils.GetValueProducingAttributes(entry) if entry else []
            if not attributes:
                break
            node = shade.Shader(attributes[0].GetPrim())
            kind = self._kind(node)
            if kind == "UsdTransform2d":
                matrix = matrix @ self._transform(node)
                continue
            if kind == "ND_place2d_vector2":
                matrix = matrix @ self._placement(node)
                continue
            name = self._primvar(node) if kind.startswith(READERS) else ST
            break
        matrix /= np.reshape((*counts, 1), (3, 1))
        return TexturePlaces(name=name or ST, matrix=None if (matrix == np.eye(3)).all() else matrix[:2])

    def _transform(self, node: Any) -> Float64:
        """(3, 3) of a UsdTransform2d: scale, then rotation counter-clockwise in degrees, then translation."""
        angle = math.radians(float(self._constant(node, "rotation", 0.0)))
        scale, move = self._constant(node, "scale", (1.0, 1.0)), self._constant(node, "translation", (0.0, 0.0))
        turn = np.array([[math.cos(angle), -math.sin(angle)], [math.sin(angle), math.cos(angle)]])
        found = np.eye(3)
        found[:2, :2] = turn * np.array(scale, np.float64)
        found[:2, 2] = np.array(move, np.float64)
        return found

    def _placement(self, node: Any) -> Float64:
        """(3, 3) of a place2d of MaterialX: about its pivot, one over the scale, then a turn, then minus the offset."""
        defaults = {"pivot": (0, 0), "scale": (1, 1), "offset": (0, 0)}
        pivot, scale, offset = (np.array(self._constant(node, key, fill), float) for key, fill in defaults.items())
        angle = math.radians(float(self._constant(node, "rotate", 0.0)))
        turn = np.array([[math.cos(angle), math.sin(angle)], [-math.sin(angle), math.cos(angle)]])
        found = np.eye(3)
        found[:2, :2] = turn / np.where(scale == 0, 1.0, scale)
        found[:2, 2] = pivot - offset - found[:2, :2] @ pivot
        return found
