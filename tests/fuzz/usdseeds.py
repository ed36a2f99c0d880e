"""Whole USD files with one of everything: as text, as a crate, and as a package with an image."""

from pathlib import Path

from support.iesfiles import VARIANTS
from support.materialx import document, material

from . import sceneseeds

LAMP = "lamp.ies"
HEAD = """#usda 1.0
(
    defaultPrim = "World"
    upAxis = "Z"
    metersPerUnit = 0.01
    startTimeCode = 1
    endTimeCode = 3
)
"""
LOOKS = """
    def Scope "Looks" {
        def Material "Look" {
            token outputs:surface.connect = </World/Looks/Look/Surface.outputs:surface>
            def Shader "Surface" {
                uniform token info:id = "UsdPreviewSurface"
                color3f inputs:diffuseColor.connect = </World/Looks/Look/Image.outputs:rgb>
                float inputs:roughness.connect = </World/Looks/Look/Image.outputs:g>
                float inputs:metallic = 0.25
                float inputs:opacity = 0.9
                float inputs:opacityThreshold = 0.5
                color3f inputs:emissiveColor = (0.1, 0.2, 0.3)
                normal3f inputs:normal.connect = </World/Looks/Look/Image.outputs:rgb>
                token outputs:surface
            }
            def Shader "Image" {
                uniform token info:id = "UsdUVTexture"
                asset inputs:file = @seed.png@
                token inputs:wrapS = "repeat"
                float4 inputs:scale = (2, 2, 2, 1)
                float4 inputs:bias = (-1, -1, -1, 0)
                float2 inputs:st.connect = </World/Looks/Look/Turn.outputs:result>
                float3 outputs:rgb
                float outputs:g
            }
            def Shader "Turn" {
                uniform token info:id = "UsdTransform2d"
                float2 inputs:in.connect = </World/Looks/Look/Reader.outputs:result>
                float inputs:rotation = 30
                float2 inputs:scale = (2, 1)
                float2 outputs:result
            }
            def Shader "Reader" {
                uniform token info:id = "UsdPrimvarReader_float2"
                string inputs:varname = "st"
                float2 outputs:result
            }
        }
        def Material "Pane" {
            token outputs:surface.connect = </World/Looks/Pane/Surface.outputs:surface>
            def Shader "Surface" {
                uniform token info:id = "UsdPreviewSurface"
                int inputs:useSpecularWorkflow = 1
                color3f inputs:specularColor = (0.1, 0.1, 0.1)
                float inputs:opacity = 0.2
                float inputs:ior = 1.4
                token outputs:surface
            }
        }
    }
"""
SURFACES = """
    def Mesh "Floor" (prepend apiSchemas = ["MaterialBindingAPI"]) {
        uniform token subdivisionScheme = "none"
        uniform token orientation = "leftHanded"
        int[] faceVertexCounts = [4, 3, 5]
        int[] faceVertexIndices = [0, 1, 2, 3, 0, 1, 4, 0, 1, 2, 4, 3]
        int[] holeIndices = [1]
        point3f[] points = [(0, 0, 0), (2, 0, 0), (2, 3, 0), (0, 3, 0), (1, 1, 1)]
        normal3f[] normals = [(0, 0, 1)] (interpolation = "constant")
        color3f[] primvars:displayColor = [(0.2, 0.4, 0.6)]
        texCoord2f[] primvars:st = [(0, 0), (1, 0), (1, 1), (0, 1), (0.5, 0.5)] (interpolation = "vertex")
        rel material:binding = </World/Looks/Look>
        def GeomSubset "Part" (prepend apiSchemas = ["MaterialBindingAPI"]) {
            uniform token elementType = "face"
            uniform token familyName = "materialBind"
            int[] indices = [2]
            rel material:binding = </World/Looks/Pane>
        }
    }
    def Mesh "Round" {
        int[] faceVertexCounts = [4, 4, 3]
        int[] faceVertexIndices = [0, 1, 2, 3, 1, 5, 6, 2, 3, 2, 4]
        int[] creaseIndices = [0, 1, 2, 1, 5]
        int[] creaseLengths = [3, 2]
        float[] creaseSharpnesses = [2.5, 10]
        int[] cornerIndices = [4]
        float[] cornerSharpnesses = [1.5]
        token interpolateBoundary = "edgeOnly"
        point3f[] points = [(0, 0, 0), (1, 0, 0), (1, 1, 0), (0, 1, 0), (0.5, 2, 1), (2, 0, 1), (2, 1, 1)]
        texCoord2f[] primvars:st = [(0, 0), (1, 0), (1, 1), (0, 1), (0, 0), (1, 0), (1, 1), (0, 1), (0, 0), (1, 0),
            (1, 1)] (
            interpolation = "faceVarying"
        )
        rel material:binding = </World/Looks/Look>
    }
    def Mesh "Loop" {
        uniform token subdivisionScheme = "loop"
        int[] faceVertexCounts = [3, 3, 3, 3]
        int[] faceVertexIndices = [0, 2, 1, 0, 1, 3, 0, 3, 2, 1, 2, 3]
        point3f[] points = [(0, 0, 0), (1, 0, 0), (0, 1, 0), (0, 0, 1)]
    }
    def Sphere "Ball" { double radius = 0.3; }
    def Cylinder "Tube" { uniform token axis = "X"; }
    def Cone "Hat" {}
    def Capsule "Pill" {}
    def Cube "Box" { matrix4d xformOp:transform = ((1, 0, 0, 0), (0, 2, 0, 0), (0, 0, 1, 0), (1, 2, 3, 1))
        uniform token[] xformOpOrder = ["xformOp:transform"]; }
    def Plane "Card" { color3f[] primvars:displayColor = [(1, 0, 0)]; }
    def Xform "Copy" (instanceable = true
        prepend references = </Proto>) { double3 xformOp:translate = (3, 0, 0)
        uniform token[] xformOpOrder = ["xformOp:translate"]; }
    def PointInstancer "Many" {
        rel prototypes = </World/Many/P/Stone>
        int[] protoIndices = [0, 0, 0]
        int64[] ids = [1, 2, 3]
        int64[] invisibleIds = [2]
        point3f[] positions = [(0, 0, 5), (0, 0, 6), (0, 0, 7)]
        quath[] orientations = [(1, 0, 0, 0), (0, 1, 0, 0), (1, 0, 0, 0)]
        float3[] scales = [(1, 1, 1), (2, 2, 2), (1, 1, 2)]
        def Scope "P" {
            def Cube "Stone" { double size = 0.1; }
        }
    }
    def BasisCurves "Hair" {}
"""
LIGHTS = """
    def SphereLight "Bulb" (prepend apiSchemas = ["ShapingAPI"]) {
        float inputs:intensity.timeSamples = { 1: 5, 3: 0 }
        float inputs:exposure = 1
        bool inputs:enableColorTemperature = 1
        float inputs:colorTemperature = 3000
        float inputs:radius = 0.1
        float inputs:shaping:cone:angle = 40
        float inputs:shaping:cone:softness = 0.3
        double3 xformOp:translate.timeSamples = { 1: (0, 0, 2), 3: (1, 0, 2) }
        uniform token[] xformOpOrder = ["xformOp:translate"]
    }
    def SphereLight "Lamp" (prepend apiSchemas = ["ShapingAPI"]) { asset inputs:shaping:ies:file = @lamp.ies@; }
    def RectLight "Panel" { float inputs:width = 2
        bool inputs:normalize = 1
        asset inputs:texture:file = @seed.png@; }
    def DiskLight "Disc" { float inputs:radius = 0.3; }
    def CylinderLight "Neon" { float inputs:length = 2; }
    def DistantLight "Sun" { float inputs:angle = 1
        color3f inputs:color = (1, 0.5, 0.2); }
    def DomeLight "Dome" { asset inputs:texture:file = @seed.png@
        token inputs:texture:format = "latlong"; }
    def DomeLight_1 "Sky" { uniform token poleAxis = "Y"; }
"""
CAMERAS = """
    def Camera "Shot" {
        float focalLength.timeSamples = { 1: 24, 3: 50 }
        float horizontalAperture = 36
        float verticalAperture = 24
        float horizontalApertureOffset = 1.8
        float3 xformOp:rotateXYZ = (90, 0, 10)
        uniform token[] xformOpOrder = ["xformOp:rotateXYZ"]
    }
    def Camera "Plan" { token projection = "orthographic"; }
"""
PROTO = """
class "Proto" {
    def Mesh "M" {
        int[] faceVertexCounts = [3]
        int[] faceVertexIndices = [0, 1, 2]
        point3f[] points = [(0, 0, 0), (1, 0, 0), (0, 1, 0)]
    }
}
"""
WORLD = f'def Xform "World" {{{LOOKS}{SURFACES}{LIGHTS}{CAMERAS}}}\n'
TEXT = HEAD + WORLD + PROTO


def beside() -> dict[str, bytes]:
    """Files that it names."""
    return {"seed.png": sceneseeds.picture(), LAMP: next(iter(VARIANTS.values())).encode()}


def usd_seeds(suffix: str, folder: Path) -> list[bytes]:
    """The scene in one of the formats, ".usda", ".usdc" or ".usdz"."""
    if suffix == ".usda":
        return [TEXT.encode()]
    from pxr import Sdf, UsdUtils

    text, crate = folder / "text.usda", folder / "seed.usdc"
    text.write_text(TEXT)
    Sdf.Layer.FindOrOpen(str(text)).Export(str(crate))
    if suffix == ".usdc":
        return [crate.read_bytes()]
    for name, data in beside().items():
        (folder / name).write_bytes(data)
    package = folder / "seed.usdz"
    UsdUtils.CreateNewUsdzPackage(str(crate), str(package))
    return [package.read_bytes()]


LOOK: dict[str, float | str] = {"base_color": "N", "emission": 2.0, "opacity": "0.9, 0.9, 0.9", "transmission": 0.5}
MTLX = document(material("Look", "standard_surface", **LOOK)).replace("images/", "./").replace("a.png", "seed.png")


def with_document() -> dict[str, bytes]:
    """A stage that references MTLX, and the image of this."""
    stage = (
        HEAD
        + """def "World" {
    def "MaterialX" (references = @look.mtlx@</MaterialX>) {}
    def Cube "Box" (prepend apiSchemas = ["MaterialBindingAPI"]) {
        rel material:binding = </World/MaterialX/Materials/Look>
    }
}
"""
    )
    return {"seed.usda": stage.encode(), "seed.png": sceneseeds.picture()}
