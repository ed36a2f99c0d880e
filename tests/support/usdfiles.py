"""USD files that tests make, with usd-core itself."""

from pathlib import Path
from typing import Any

import pytest

REASON = "usd-core is not installed (extra usd)"


def pxr() -> Any:
    """The modules of usd-core; skips the test without it."""
    from framearray_cli.scene.files.usd.usdcore import usd

    pytest.importorskip("pxr", reason=REASON)
    return usd()


def new_stage(file: Path, up: str = "Y") -> Any:
    """An empty stage, which `save` writes."""
    library = pxr()
    stage = library.Usd.Stage.CreateNew(str(file))
    library.UsdGeom.SetStageUpAxis(stage, up)
    stage.SetDefaultPrim(stage.DefinePrim("/World", "Xform"))
    return stage


def save(stage: Any) -> Path:
    """Write a stage, and say where."""
    stage.GetRootLayer().Save()
    return Path(stage.GetRootLayer().realPath)


SQUARE = [(0, 0, 0), (2, 0, 0), (2, 3, 0), (0, 3, 0)]


def mesh(stage: Any, path: str, points: Any = SQUARE, counts: Any = (4,), indices: Any = (0, 1, 2, 3)) -> Any:
    """A mesh of polygons; by default one rectangle of 2 x 3."""
    found = pxr().UsdGeom.Mesh.Define(stage, path)
    found.CreatePointsAttr([tuple(map(float, point)) for point in points])
    found.CreateFaceVertexCountsAttr(list(counts))
    found.CreateFaceVertexIndicesAttr(list(indices))
    found.CreateSubdivisionSchemeAttr("none")
    return found


def instancer(stage: Any, path: str, prototype: str, places: Any) -> Any:
    """Copies of one prim at these places."""
    found = pxr().UsdGeom.PointInstancer.Define(stage, path)
    found.CreatePrototypesRel().SetTargets([prototype])
    found.CreateProtoIndicesAttr([0] * len(places))
    found.CreatePositionsAttr(places)
    return found


def bind(prim: Any, material: Any) -> None:
    """Give a prim a material."""
    pxr().UsdShade.MaterialBindingAPI.Apply(prim).Bind(material)


def preview(stage: Any, name: str, **inputs: Any) -> Any:
    """A material with a UsdPreviewSurface; inputs are numbers, colours, or (image, output, options)."""
    library = pxr()
    shade, types = library.UsdShade, library.Sdf.ValueTypeNames
    material = shade.Material.Define(stage, f"/World/Looks/{name}")
    shader = shade.Shader.Define(stage, f"/World/Looks/{name}/Surface")
    shader.CreateIdAttr("UsdPreviewSurface")
    material.CreateSurfaceOutput().ConnectToSource(shader.ConnectableAPI(), "surface")
    for key, value in inputs.items():
        colour = key in ("diffuseColor", "emissiveColor", "specularColor", "normal")
        kind = types.Color3f if colour else types.Int if key == "useSpecularWorkflow" else types.Float
        entry = shader.CreateInput(key, kind)
        if isinstance(value, tuple) and isinstance(value[0], str):
            entry.ConnectToSource(_texture(stage, f"/World/Looks/{name}/{key}", *value))
        else:
            entry.Set(value)
    return material


def _texture(stage: Any, path: str, image: str, output: str, options: Any = None) -> Any:
    """Output of a UsdUVTexture, its coordinates `st` through a UsdTransform2d where options are given.

    The texture takes the options "sourceColorSpace", "wrapS" and "wrapT", by default "repeat"; None leaves a wrap out.
    """
    library = pxr()
    shade, types = library.UsdShade, library.Sdf.ValueTypeNames
    texture, reader = shade.Shader.Define(stage, f"{path}Image"), shade.Shader.Define(stage, f"{path}Reader")
    texture.CreateIdAttr("UsdUVTexture")
    texture.CreateInput("file", types.Asset).Set(image)
    options = dict(options or {})
    if space := options.pop("sourceColorSpace", ""):
        texture.CreateInput("sourceColorSpace", types.Token).Set(space)
    for side in ("wrapS", "wrapT"):
        if wrap := options.pop(side, "repeat"):
            texture.CreateInput(side, types.Token).Set(wrap)
    reader.CreateIdAttr("UsdPrimvarReader_float2")
    reader.CreateInput("varname", types.String).Set("st")
    places = reader.CreateOutput("result", types.Float2)
    if options:
        turn = shade.Shader.Define(stage, f"{path}Transform")
        turn.CreateIdAttr("UsdTransform2d")
        turn.CreateInput("in", types.Float2).ConnectToSource(places)
        for key, value in options.items():
            turn.CreateInput(key, types.Float if key == "rotation" else types.Float2).Set(value)
        places = turn.CreateOutput("result", types.Float2)
    texture.CreateInput("st", types.Float2).ConnectToSource(places)
    return texture.CreateOutput(output, types.Float3 if output == "rgb" else types.Float)


def coordinates(surface: Any, values: Any, interpolation: str = "faceVarying") -> None:
    """Texture coordinates `st` of a mesh."""
    library = pxr()
    api = library.UsdGeom.PrimvarsAPI(surface)
    primvar = api.CreatePrimvar("st", library.Sdf.ValueTypeNames.TexCoord2fArray, interpolation)
    primvar.Set([tuple(map(float, value)) for value in values])
