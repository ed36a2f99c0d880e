"""UsdPreviewSurface -> materials: colour, metal and roughness, opacity, emission and normal maps.

Inputs of shaders are constants, textures or vertex colours: UsdUVTexture, UsdPrimvarReader, UsdTransform2d.
"""

import math
from dataclasses import dataclass, replace
from typing import Any

import numpy as np

from framearray_cli.base.arrays import Float64
from framearray_cli.base.colour import linear_from_srgb

from ..assets import Assets
from ..materials import (
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
from ..textures import Channel, EncodedImage, TextureTable
from .usdcore import read_asset, usd

CHANNELS = {"r": 0, "g": 1, "b": 2, "a": 3}
ST = "st"  # the usual name of texture coordinates
UDIM = "<UDIM>"


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


@dataclass(frozen=True, slots=True)
class Shading:
    """Finds what the inputs of one material's shader are."""

    name: str
    shader: Any
    time: Any
    assets: Assets
    textures: TextureTable

    def note(self, sentence: str) -> None:
        """Note something about the material."""
        self.textures.notes.add(sentence, self.name)

    def value(self, name: str) -> Value:
        """Return the value of an input of the shader."""
        return self._follow(self.shader, name)

    def _follow(self, node: Any, name: str) -> Value:
        shade, entry = usd().UsdShade, node.GetInput(name)
        attributes = shade.Utils.GetValueProducingAttributes(entry) if entry else []
        if not attributes:
            return Value()
        attribute = attributes[0]
        if not attribute.GetName().startswith("outputs:"):
            return Value(constant=attribute.Get(self.time))
        node = shade.Shader(attribute.GetPrim())
        kind = str(node.GetIdAttr().Get(self.time) or "")
        if kind == "UsdUVTexture":
            return self._texture(node, attribute.GetBaseName())
        if kind.startswith("UsdPrimvarReader"):
            name = self._constant(node, "varname", "")
            if str(name) == "displayColor":
                return Value(coloured=True)
            self.note(f"values of the primvar {name} are left out")
        else:
            self.note(f"shaders {kind or 'without id'} are left out")
        return Value(constant=self._constant(node, "fallback", None))

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
        if UDIM in asset.path:
            self.note("of textures in tiles (UDIM) only the first is read")
            first = asset.path.replace(UDIM, "1001")
            asset = usd().Sdf.AssetPath(first, (asset.resolvedPath or "").replace(UDIM, "1001"))
        key, read = read_asset(asset, self.assets)
        wraps = {str(self._constant(node, name, "repeat")) for name in ("wrapS", "wrapT")}
        if output not in ("rgb", *CHANNELS):
            output = "rgb"
        return Value(
            constant=fallback,
            texture=Texture(
                image=EncodedImage(("usd", key), f"material {self.name}", read),
                channel=CHANNELS.get(output, -1),
                scale=_finite(self._constant(node, "scale", None), 4, 1.0),
                bias=_finite(self._constant(node, "bias", None), 4, 0.0),
                places=replace(self._places(node), repeats=wraps <= {"repeat", "useMetadata"}),
            ),
        )

    def _places(self, node: Any) -> TexturePlaces:
        """Follow the input `st` of a texture through transforms to the reader of a primvar."""
        shade, matrix, name = usd().UsdShade, np.eye(3), ST
        for _ in range(len(CHANNELS)):  # transforms in a row; more are not met
            entry = node.GetInput("st")
            entry = entry if entry else node.GetInput("in")
            attributes = shade.Utils.GetValueProducingAttributes(entry) if entry else []
            if not attributes:
                break
            node = shade.Shader(attributes[0].GetPrim())
            kind = str(node.GetIdAttr().Get(self.time) or "") if node else ""
            if kind == "UsdTransform2d":
                matrix = matrix @ self._transform(node)
                continue
            name = str(self._constant(node, "varname", ST)) if kind.startswith("UsdPrimvarReader") else ST
            break
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


def _finite(values: Any, n: int, default: float) -> Float64:
    """(n,) numbers of an input, repeated if there are fewer; the default for those that are missing or not finite."""
    found = np.resize(np.array(np.nan if values is None else values, np.float64), n)
    return np.asarray(np.where(np.isfinite(found), found, default))


PREVIEW = "UsdPreviewSurface"
ROUGHNESS, IOR = 0.5, 1.5  # defaults of UsdPreviewSurface
GREY = 0.18  # its diffuse colour
IGNORED = {"clearcoat": "clear coats are left out", "displacement": "displacement is left out"}


def read_material(prim: Any, name: str, time: Any, assets: Assets, textures: TextureTable) -> PlacedMaterial | None:
    """Read a material; None, with a note, where it has no UsdPreviewSurface."""
    shader = usd().UsdShade.Material(prim).ComputeSurfaceSource()[0]
    kind = str(shader.GetIdAttr().Get() or "") if shader else ""
    if kind != PREVIEW:
        textures.notes.add(f"materials without {PREVIEW} have their display colour, or grey", name)
        return None
    source = Shading(name, shader, time, assets, textures)
    base = source.value("diffuseColor")
    colour, texture = _colour(base, source, GREY)
    surface = (_gloss(colour, base.texture, source) if assets.as_file else None) or _split(colour, source)
    material = make_material(_opacity(source), surface, textures.notes, texture=texture, mirror_texture=texture)
    material = _shining(material, base.texture, source)
    places = _places_of(material, base.texture, source)
    bumps = source.value("normal").texture
    material = _with_bumps(material, bumps, source)
    for key, text in IGNORED.items():
        found = source.value(key)
        if found.texture or found.number(0.0) > 0:
            source.note(text)
    return PlacedMaterial(
        material=material,
        places=places,
        normal_places=bumps.places if bumps else TexturePlaces(),
        coloured=base.coloured,
    )


def _colour(value: Value, source: Shading, default: float) -> tuple[Float64, int]:
    """(3,) factor and the texture that it multiplies."""
    if value.coloured:
        return np.ones(3), -1
    if value.texture is None:
        return value.color(default), -1
    index = source.textures.index(value.texture.image)
    if index < 0:
        return value.color(default), -1
    if value.texture.bias[:3].any():
        source.note("the bias of colour textures is left out")
    return value.texture.scale[:3], index


def _same(texture: Texture | None, base: Texture | None) -> bool:
    """True if a texture lies where the texture of the colour does."""
    if texture is None or base is None:
        return True
    a, b = texture.places, base.places
    return a.name == b.name and np.array_equal(np.array(a.matrix), np.array(b.matrix))


def _factor(value: Value, default: float, source: Shading) -> float:
    """A number, or the mean of a texture."""
    if value.texture is None:
        return value.number(default)
    mean = source.textures.mean(value.texture.image)
    if mean is None:
        return value.number(default)
    k = max(value.texture.channel, 0)
    return float(np.clip(mean[k] * value.texture.scale[k] + value.texture.bias[k], 0.0, 1.0))


def _split(colour: Float64, source: Shading) -> Split:
    """Diffuse and mirror part, where surfaces do not follow the file: the share of smooth metal is the mirror part."""
    metallic, roughness = _factor(source.value("metallic"), 0.0, source), source.value("roughness")
    return split_metal(source.name, colour, metallic, _factor(roughness, ROUGHNESS, source), source.textures.notes)


def _gloss(colour: Float64, base: Texture | None, source: Shading) -> SurfaceGloss | None:
    """Gloss of a material; None for a mirror."""
    rough, metal = source.value("roughness"), source.value("metallic")
    if source.value("useSpecularWorkflow").number(0.0) > 0:
        shine = source.value("specularColor")
        if shine.texture:
            source.note("specular textures are left out")
        _, metallic = from_specular(colour, shine.color(0.0))
        metal = Value(constant=metallic)
    by_mean = (_factor(metal, 0.0, source), _factor(rough, ROUGHNESS, source))
    if is_mirror(*by_mean):
        return None
    plain = SurfaceGloss(base=rgb3(colour), metallic=by_mean[0], roughness=by_mean[1])
    if rough.texture is None and metal.texture is None:
        return plain
    if not (_same(rough.texture, base) and _same(metal.texture, base) and _same(metal.texture, rough.texture)):
        source.note("roughness textures with texture coordinates of their own count by their mean")
        return plain
    texture = source.textures.packed(_pick(rough.texture), _pick(metal.texture))
    if texture < 0:
        return plain
    metallic, roughness = 1.0 if metal.texture else plain.metallic, 1.0 if rough.texture else plain.roughness
    return replace(plain, metallic=metallic, roughness=roughness, texture=texture)


def _pick(texture: Texture | None) -> Channel | None:
    """One channel of an image, and its scale and bias."""
    if texture is None:
        return None
    k = max(texture.channel, 0)
    return texture.image, k, texture.scale[k], texture.bias[k]


def _opacity(source: Shading) -> Material:
    """Opacity of a material: holes below a threshold, a thin pane where hardly anything is left, else a cover."""
    value = source.value("opacity")
    threshold = source.value("opacityThreshold").number(0.0)
    alpha, texture = value.number(1.0), -1
    if value.texture is not None:
        k, image = value.texture.channel, value.texture.image
        texture = source.textures.index(image) if k == 3 else source.textures.cutout(image)
        alpha = float(value.texture.scale[max(k, 0)]) if texture >= 0 else alpha
    alpha = min(max(alpha, 0.0), 1.0)
    if threshold > 0:
        return masked_opacity(source.name, alpha, texture, threshold, source.textures)
    if alpha == 1.0 and texture < 0:
        return Material(name=source.name)
    ior = max(source.value("ior").number(IOR), 1.0)
    shown = 1.0 - alpha
    pane = PaneGlass(colour=(shown,) * 3, ior=ior, covers=ior == 1.0) if source.assets.as_file else None
    return blended_opacity(source.name, alpha, texture, source.textures, pane)


def _shining(material: Material, base: Texture | None, source: Shading) -> Material:
    """Add what a material emits."""
    value, assets = source.value("emissiveColor"), source.assets
    emission = np.maximum(value.color(0.0), 0.0) if value.texture is None else value.texture.scale[:3]
    if not emission.any():
        return material
    note_unused(material.name, assets, source.textures.notes, emits=True)
    if material.name not in assets.shining and not assets.as_file:
        return material
    if value.texture is None:
        return replace(material, emission=rgb3(emission))
    if base is None or _same(value.texture, base):
        index = source.textures.index(value.texture.image)
        return replace(material, emission=rgb3(emission), emission_texture=index) if index >= 0 else material
    mean = source.textures.mean(value.texture.image)
    source.note("emissive textures with texture coordinates of their own count by their mean")
    return material if mean is None else replace(material, emission=rgb3(emission * linear_from_srgb(mean[:3])))


def _places_of(material: Material, base: Texture | None, source: Shading) -> TexturePlaces:
    """Places of the textures of a material: of its colour, or of the first texture."""
    others = [source.value(name).texture for name in ("opacity", "roughness", "metallic", "emissiveColor")]
    found = [texture for texture in (base, *others) if texture is not None]
    if not found or not material.textured:
        return TexturePlaces()
    if not _same(others[0], base):
        source.note("opacity textures lie where the colour's does")
    return found[0].places


def _with_bumps(material: Material, bumps: Texture | None, source: Shading) -> Material:
    """Add a normal map: its scale is 2 and its bias -1 where its image is one of codes from 0 to 1."""
    if bumps is None:
        return material
    if not source.assets.as_file:
        note_unused(material.name, source.assets, source.textures.notes, bumps=True)
        return material
    strength = float(abs(bumps.scale[0])) / 2 if bumps.bias[:3].any() else 1.0
    return replace(material, normal_texture=source.textures.index(bumps.image), normal_scale=strength)
