"""UsdPreviewSurface -> materials: colour, metal and roughness, opacity, emission and normal maps."""

from dataclasses import dataclass, field, replace
from typing import Any

import numpy as np

from framearray_cli.base.arrays import Float64
from framearray_cli.base.colour import linear_from_srgb

from ..assets import Assets
from ..gloss import MIRROR_ROUGHNESS, Gloss, from_specular, is_mirror, with_gloss
from ..materials import (
    CUT_OUT,
    NO_NORMAL_MAPS,
    ONLY_SEEN,
    Opacity,
    Rgb3,
    blended_opacity,
    make_material,
    masked_opacity,
)
from ..model import Glass, Material, Notes
from ..textures import TextureTable
from .shading import Places, Shading, Texture, Value
from .usdcore import usd

PREVIEW = "UsdPreviewSurface"
ROUGHNESS, IOR = 0.5, 1.5  # defaults of UsdPreviewSurface
GREY = 0.18  # its diffuse colour
IGNORED = {"clearcoat": "clear coats are left out", "displacement": "displacement is left out"}


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class UsdMaterial:
    """A material, where its textures and its normal map lie on meshes, and whether display colours are its colour."""

    material: Material
    places: Places = field(default_factory=Places)
    normal_places: Places = field(default_factory=Places)
    repeats: bool = True
    coloured: bool = False


def read_material(
    prim: Any, name: str, time: Any, assets: Assets, textures: TextureTable, notes: Notes
) -> UsdMaterial | None:
    """Read a material; None, with a note, where it has no UsdPreviewSurface."""
    shader = usd().UsdShade.Material(prim).ComputeSurfaceSource()[0]
    kind = str(shader.GetIdAttr().Get() or "") if shader else ""
    if kind != PREVIEW:
        notes.add(f"materials without {PREVIEW} have their display colour, or grey", name)
        return None
    source = Shading(name, shader, time, assets, textures, notes)
    base = source.value("diffuseColor")
    colour, texture = _colour(base, source, GREY)
    gloss = _gloss(colour, base.texture, source) if assets.as_file else None
    diffuse, specular = (_rgb(colour), (0.0, 0.0, 0.0)) if gloss else _split(colour, source)
    material = make_material(name, diffuse, specular, _opacity(source), notes, texture=texture, mirror_texture=texture)
    material = _shining(with_gloss(material, gloss), base.texture, source)
    places, repeats = _places(material, base.texture, source)
    bumps = source.value("normal").texture
    material = _with_bumps(material, bumps, source)
    for key, text in IGNORED.items():
        found = source.value(key)
        if found.texture or found.number(0.0) > 0:
            notes.add(text, name)
    return UsdMaterial(
        material=material,
        places=places,
        normal_places=bumps.places if bumps else Places(),
        repeats=repeats,
        coloured=base.coloured,
    )


def _colour(value: Value, source: Shading, default: float) -> tuple[Float64, int]:
    """(3,) factor and the texture that it multiplies."""
    if value.coloured:
        return np.ones(3), -1
    if value.texture is None:
        return value.color(default), -1
    index = source.index(value.texture)
    if index < 0:
        return value.color(default), -1
    if any(value.texture.bias[:3]):
        source.notes.add("the bias of colour textures is left out", source.name)
    return np.array(value.texture.scale[:3]), index


def _same(texture: Texture | None, base: Texture | None) -> bool:
    """Whether a texture lies where that of the colour does."""
    return texture is None or base is None or texture.places.key == base.places.key


def _factor(value: Value, default: float, source: Shading) -> float:
    """A number; that of a texture by its mean."""
    if value.texture is None:
        return value.number(default)
    mean = source.mean(value.texture)
    if mean is None:
        return value.number(default)
    k = max(value.texture.channel, 0)
    return float(np.clip(mean[k] * value.texture.scale[k] + value.texture.bias[k], 0.0, 1.0))


def _split(colour: Float64, source: Shading) -> tuple[Rgb3, Rgb3]:
    """Diffuse and mirror part, where surfaces do not follow the file: the share of smooth metal is the mirror part."""
    metallic = min(max(_factor(source.value("metallic"), 0.0, source), 0.0), 1.0)
    mirror = metallic if _factor(source.value("roughness"), ROUGHNESS, source) <= MIRROR_ROUGHNESS else 0.0
    if metallic > 0 and mirror == 0:
        source.notes.add("rough metals are taken as diffuse", source.name)
    return _rgb(colour * (1 - mirror)), _rgb(colour * mirror)


def _gloss(colour: Float64, base: Texture | None, source: Shading) -> Gloss | None:
    """How a material shines; None where it is a mirror."""
    rough, metal = source.value("roughness"), source.value("metallic")
    if source.value("useSpecularWorkflow").number(0.0) > 0:
        shine = source.value("specularColor")
        if shine.texture:
            source.notes.add("specular textures are left out", source.name)
        colour, metallic = from_specular(colour, shine.color(0.0))
        metal = Value(constant=metallic)
    by_mean = (_factor(metal, 0.0, source), _factor(rough, ROUGHNESS, source))
    if is_mirror(*by_mean):
        return None
    if rough.texture is None and metal.texture is None:
        return Gloss(base=_rgb(colour), metallic=by_mean[0], roughness=by_mean[1])
    if not (_same(rough.texture, base) and _same(metal.texture, base) and _same(metal.texture, rough.texture)):
        source.notes.add("roughness textures with texture coordinates of their own count by their mean", source.name)
        return Gloss(base=_rgb(colour), metallic=by_mean[0], roughness=by_mean[1])
    picks = [_pick(rough.texture), _pick(metal.texture)]
    texture = source.textures.packed(f"material {source.name}", picks[0], picks[1])
    if texture < 0:
        return Gloss(base=_rgb(colour), metallic=by_mean[0], roughness=by_mean[1])
    return Gloss(
        base=_rgb(colour),
        metallic=1.0 if metal.texture else by_mean[0],
        roughness=1.0 if rough.texture else by_mean[1],
        texture=texture,
    )


def _pick(texture: Texture | None) -> tuple[Any, Any, int, float, float] | None:
    """One channel of an image, and its scale and bias."""
    if texture is None:
        return None
    k = max(texture.channel, 0)
    return ("usd", texture.key), texture.read, k, texture.scale[k], texture.bias[k]


def _opacity(source: Shading) -> Opacity:
    """Opacity of a material: holes below a threshold, a thin pane where hardly anything is left, else a cover."""
    value = source.value("opacity")
    threshold = source.value("opacityThreshold").number(0.0)
    alpha, texture = value.number(1.0), -1
    if value.texture is not None:
        k = value.texture.channel
        key, label = ("usd", value.texture.key), f"material {source.name}"
        texture = source.index(value.texture) if k == 3 else source.textures.cutout(key, label, value.texture.read)
        alpha = value.texture.scale[max(k, 0)] if texture >= 0 else alpha
    alpha = min(max(alpha, 0.0), 1.0)
    if threshold > 0:
        opacity = masked_opacity(alpha, texture, threshold, source.textures)
        if opacity.left_out:
            source.notes.add(CUT_OUT, source.name)
        return opacity
    if alpha == 1.0 and texture < 0:
        return Opacity()
    ior = max(source.value("ior").number(IOR), 1.0)
    shown = 1.0 - alpha
    pane = Glass(colour=(shown,) * 3, ior=ior, covers=ior == 1.0) if source.assets.as_file else None
    return blended_opacity(source.name, alpha, texture, source.textures, source.notes, pane)


def _shining(material: Material, base: Texture | None, source: Shading) -> Material:
    """Add what a material emits."""
    value, assets, notes = source.value("emissiveColor"), source.assets, source.notes
    emission = np.maximum(value.color(0.0), 0.0) if value.texture is None else np.array(value.texture.scale[:3])
    if not emission.any():
        return material
    if material.name not in assets.shining:
        notes.add(ONLY_SEEN if assets.as_file else "emission is left out", material.name)
        if not assets.as_file:
            return material
    if value.texture is None:
        return replace(material, emission=_rgb(emission))
    if base is None or _same(value.texture, base):
        index = source.index(value.texture)
        return replace(material, emission=_rgb(emission), emission_texture=index) if index >= 0 else material
    mean = source.mean(value.texture)
    notes.add("emissive textures with texture coordinates of their own count by their mean", material.name)
    return material if mean is None else replace(material, emission=_rgb(emission * linear_from_srgb(mean[:3])))


def _places(material: Material, base: Texture | None, source: Shading) -> tuple[Places, bool]:
    """Where the textures of a material lie: those of its colour, or of the first that there is."""
    others = [source.value(name).texture for name in ("opacity", "roughness", "metallic", "emissiveColor")]
    found = [texture for texture in (base, *others) if texture is not None]
    if not found or not material.textured:
        return Places(), True
    if not _same(others[0], base):
        source.notes.add("opacity textures lie where the colour's does", material.name)
    return found[0].places, found[0].repeats


def _with_bumps(material: Material, bumps: Texture | None, source: Shading) -> Material:
    """Add a normal map: its scale is 2 and its bias -1 where its image is one of codes from 0 to 1."""
    if bumps is None:
        return material
    if not source.assets.as_file:
        source.notes.add(NO_NORMAL_MAPS, material.name)
        return material
    strength = abs(bumps.scale[0]) / 2 if any(bumps.bias[:3]) else 1.0
    return replace(material, normal_texture=source.index(bumps), normal_scale=strength)


def _rgb(values: Float64) -> Rgb3:
    return (float(values[0]), float(values[1]), float(values[2]))
