"""Inputs of USD shaders -> constants, textures and vertex colours: UsdUVTexture, UsdPrimvarReader, UsdTransform2d."""

import math
from dataclasses import dataclass, field
from typing import Any

import numpy as np

from framearray_cli.base.arrays import Float64

from ..assets import Assets
from ..model import Notes
from ..textures import TextureTable
from .usdcore import read_asset, usd

CHANNELS = {"r": 0, "g": 1, "b": 2, "a": 3}
ST = "st"  # the usual name of texture coordinates
UDIM = "<UDIM>"


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class Places:
    """Where a texture lies on a mesh.

    Attributes:
        primvar: name of the texture coordinates.
        matrix: (2, 3) for (u, v upwards, 1), or None.
    """

    primvar: str = ST
    matrix: Float64 | None = None

    @property
    def key(self) -> tuple[Any, ...]:
        """Equal for places that are the same."""
        return self.primvar, None if self.matrix is None else tuple(self.matrix.ravel().tolist())


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class Texture:
    """What an input reads from an image: scale * texel + bias.

    Attributes:
        key: of the image in the texture table.
        channel: 0 to 3, or -1 for red, green and blue.
        repeats: whether it repeats in both directions.
    """

    key: str
    read: Any
    channel: int
    scale: tuple[float, float, float, float]
    bias: tuple[float, float, float, float]
    places: Places
    repeats: bool


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class Value:
    """The value of an input: a constant, and a texture that takes its place; `coloured`: the display colours do."""

    constant: Any
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
        found = np.array(np.nan if self.constant is None else self.constant, np.float64).ravel()
        found = np.resize(found, 3)
        return np.asarray(np.where(np.isfinite(found), found, default))


@dataclass(frozen=True, slots=True)
class Shading:
    """Finds what the inputs of one material's shader are."""

    name: str
    shader: Any
    time: Any
    assets: Assets
    textures: TextureTable
    notes: Notes
    base: dict[str, Any] = field(default_factory=dict)

    def value(self, name: str) -> Value:
        """Return the value of an input of the shader."""
        entry = self.shader.GetInput(name)
        return Value(constant=None) if not entry else self._follow(entry)

    def _follow(self, entry: Any) -> Value:
        shade = usd().UsdShade
        attributes = shade.Utils.GetValueProducingAttributes(entry)
        if not attributes:
            return Value(constant=None)
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
                return Value(constant=None, coloured=True)
            self.notes.add(f"values of the primvar {name} are left out", self.name)
        else:
            self.notes.add(f"shaders {kind or 'without id'} are left out", self.name)
        return Value(constant=self._constant(node, "fallback", None))

    def _constant(self, node: Any, name: str, default: Any) -> Any:
        """An input of a node, followed to its constant."""
        entry = node.GetInput(name)
        found = self._follow(entry).constant if entry else None
        return default if found is None else found

    def _texture(self, node: Any, output: str) -> Value:
        fallback = self._constant(node, "fallback", None)
        asset = self._constant(node, "file", None)
        if asset is None or not getattr(asset, "path", ""):
            self.notes.add("textures without a file are left out", self.name)
            return Value(constant=fallback)
        if UDIM in asset.path:
            self.notes.add("of textures in tiles (UDIM) only the first is read", self.name)
            first = asset.path.replace(UDIM, "1001")
            asset = usd().Sdf.AssetPath(first, (asset.resolvedPath or "").replace(UDIM, "1001"))
        key, read = read_asset(asset, self.assets)
        wraps = {str(self._constant(node, name, "repeat")) for name in ("wrapS", "wrapT")}
        if output not in ("rgb", *CHANNELS):
            output = "rgb"
        return Value(
            constant=fallback,
            texture=Texture(
                key=key,
                read=read,
                channel=CHANNELS.get(output, -1),
                scale=_four(self._constant(node, "scale", None), 1.0),
                bias=_four(self._constant(node, "bias", None), 0.0),
                places=self._places(node),
                repeats=wraps <= {"repeat", "useMetadata"},
            ),
        )

    def _places(self, node: Any) -> Places:
        """Follow the input `st` of a texture through transforms to the reader of a primvar."""
        shade, matrix = usd().UsdShade, np.eye(3)
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
            return Places(primvar=name or ST, matrix=None if (matrix == np.eye(3)).all() else matrix[:2])
        return Places(matrix=None if (matrix == np.eye(3)).all() else matrix[:2])

    def _transform(self, node: Any) -> Float64:
        """(3, 3) of a UsdTransform2d: scale, then rotation counter-clockwise in degrees, then translation."""
        angle = math.radians(float(self._constant(node, "rotation", 0.0)))
        scale, move = self._constant(node, "scale", (1.0, 1.0)), self._constant(node, "translation", (0.0, 0.0))
        turn = np.array([[math.cos(angle), -math.sin(angle)], [math.sin(angle), math.cos(angle)]])
        found = np.eye(3)
        found[:2, :2] = turn * np.array(scale, np.float64)
        found[:2, 2] = np.array(move, np.float64)
        return found

    def index(self, texture: Texture) -> int:
        """Index in the texture table; -1, with a note, where it cannot be read."""
        return self.textures.index(("usd", texture.key), f"material {self.name}", texture.read)

    def mean(self, texture: Texture) -> Float64 | None:
        """(4,) mean of the raw channels; None where it cannot be read."""
        return self.textures.mean(f"material {self.name}", texture.read)


def _four(values: Any, default: float) -> tuple[float, float, float, float]:
    found = np.array([default] * 4 if values is None else values, np.float64).ravel()
    r, g, b, a = np.where(np.isfinite(np.resize(found, 4)), np.resize(found, 4), default).tolist()
    return r, g, b, a
