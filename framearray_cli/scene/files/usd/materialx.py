"""MaterialX -> layers of USD: each material of a document, with its shader and the nodes that this reads.

A stage that references a document gets such a layer in its place, with the names that USD's own plugin gives: the
material M is at /MaterialX/Materials/M, and a node of category c and type t has the identifier ND_c_t.
"""

import os
from dataclasses import dataclass, field
from typing import Any

SUFFIX = ".mtlx"
ROOT = "/MaterialX"
_TYPES = {
    "float": "Float",
    "integer": "Int",
    "boolean": "Bool",
    "string": "String",
    "filename": "Asset",
    "vector2": "Float2",
    "vector3": "Float3",
    "vector4": "Float4",
    "color3": "Color3f",
    "color4": "Color4f",
    "surfaceshader": "Token",
}
COLOURS = ("filename", "color3", "color4")
_NUMBERS = ("float", "vector2", "vector3", "vector4", "color3", "color4")


def layer_of(file: str, library: Any) -> Any:
    """Convert a document.

    Args:
        library: usd-core.

    Raises:
        ImportError: MaterialX is not installed.
        Exception: of any kind, the document is broken.
    """
    import MaterialX

    document = MaterialX.createDocument()
    MaterialX.readFromXmlFile(document, file)
    layer = library.Sdf.Layer.CreateAnonymous(os.path.basename(file) + ".usda")
    stage = library.Usd.Stage.Open(layer)
    root = stage.DefinePrim(ROOT, "Scope")
    stage.SetDefaultPrim(root)
    for node in document.getMaterialNodes():
        material = library.UsdShade.Material.Define(stage, f"{ROOT}/Materials/{node.getName()}")
        for shader in MaterialX.getShaderNodes(node):
            made = _Nodes(library, stage, str(material.GetPath()), os.path.dirname(file)).add(shader)
            material.CreateSurfaceOutput().ConnectToSource(made.ConnectableAPI(), "out")
            if node.getConnectedNode("displacementshader") is not None:
                made.CreateInput("displacement", library.Sdf.ValueTypeNames.Float).Set(1.0)
    return layer


@dataclass(slots=True, eq=False)
class _Nodes:
    """The nodes of a material.

    Attributes:
        above: path of the prim below which they are.
        folder: of the document.
        made: by name, each once; a document may have a cycle.
    """

    library: Any
    stage: Any
    above: str
    folder: str
    made: dict[str, Any] = field(default_factory=dict)

    def add(self, node: Any) -> Any:
        """Define a node, and the nodes that it reads."""
        name = node.getNamePath().replace("/", "_")
        if name in self.made:
            return self.made[name]
        shader = self.made[name] = self.library.UsdShade.Shader.Define(self.stage, f"{self.above}/{name}")
        shader.CreateIdAttr(f"ND_{node.getCategory()}_{node.getType()}")
        shader.CreateOutput("out", self._type(node.getType()))
        for entry in node.getInputs():
            if entry.getType() in _TYPES:
                made = shader.CreateInput(entry.getName(), self._type(entry.getType()))
                source, value = entry.getConnectedNode(), self._value(entry)
                if source is not None:
                    output = (entry.getConnectedOutput() or entry).getOutputString() or "out"
                    made.ConnectToSource(self.add(source).ConnectableAPI(), output)
                elif value is not None:
                    made.Set(value)
                    if entry.getType() in COLOURS:
                        made.GetAttr().SetColorSpace(entry.getActiveColorSpace())
        return shader

    def _type(self, name: str) -> Any:
        return getattr(self.library.Sdf.ValueTypeNames, _TYPES.get(name, "Token"))

    def _value(self, entry: Any) -> Any:
        """The constant of an input, for USD; None without."""
        kind, text = entry.getType(), entry.getResolvedValueString()
        if kind == "filename":
            path = os.path.normpath(os.path.join(self.folder, text.replace("\\", "/")))
            return self.library.Sdf.AssetPath(path) if text else None
        if entry.getValue() is None or kind not in _NUMBERS:
            return entry.getValue()
        numbers = [float(part) for part in text.replace(",", " ").split()]
        return numbers[0] if len(numbers) == 1 else tuple(numbers)
