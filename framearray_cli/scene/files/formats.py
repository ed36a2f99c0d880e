"""Formats of scenes: how to turn a file that cannot be read into one that can, by its suffix."""

import shlex
from pathlib import Path

from framearray_cli.base.extras import install_command

_BLENDER = "open Blender, File > Import > {kind}, then File > Export > glTF 2.0 (.glb)"

# How to export each format as GLB, by its suffix.
_EXPORTS = {
    "fbx": _BLENDER.format(kind="FBX"),
    "abc": _BLENDER.format(kind="Alembic"),
    **dict.fromkeys(("x3d", "wrl", "3ds", "lwo", "dxf"), _BLENDER.format(kind="its format (an add-on may be needed)")),
    "max": "in 3ds Max: File > Export > glTF; or as FBX, which Blender turns into GLB",
    "skp": "in SketchUp: File > Export > 3D Model > GLB",
    **dict.fromkeys(("ma", "mb"), "in Maya: File > Export All as FBX, which Blender turns into GLB"),
    "c4d": "in Cinema 4D: File > Export > glTF",
    "3dm": "in Rhino: File > Export > glTF Binary (.glb)",
    "ifc": "IfcConvert of IfcOpenShell writes it: IfcConvert house.ifc house.glb",
    **dict.fromkeys(("rvt", "dwg"), "in the program that wrote it; or as FBX or OBJ, which Blender turns into GLB"),
    **dict.fromkeys(("hip", "hiplc", "hipnc"), "in Houdini: the ROP GLTF Output node"),
    "xml": "Blender opens scenes of Mitsuba with the add-on mitsuba-blender, and writes GLB",
    "pbrt": "in the program that wrote it; pbrt --toply writes its shapes as PLY files, to be read one by one",
    **dict.fromkeys(("f3d", "sldprt", "sldasm", "iges", "igs"), "in the program that wrote it; or as STL or STEP"),
}
_OTHERS = {
    "vrm": "it is a GLB by another name: rename it to .glb",
    "mtlx": "it holds materials; a scene needs surfaces, too: export it as GLB or USD",
    "mtl": "it holds the materials of an OBJ file; give the .obj file",
    "bin": "it may hold the data of a glTF file; give the .gltf file",
    **dict.fromkeys(("zip", "7z", "rar", "gz", "tgz"), "it is an archive: unpack it, and give the scene in it"),
    **dict.fromkeys(("las", "laz", "e57", "pcd"), "it holds points; a scene needs surfaces: triangles"),
    **dict.fromkeys(("splat", "ksplat", "spz"), "it holds splats; a scene needs surfaces: triangles"),
}
# Further packages that trimesh needs.
_PACKAGES = {
    **dict.fromkeys(("dae", "zae"), "pycollada"),
    **dict.fromkeys(("step", "stp"), "cascadio"),
    **dict.fromkeys(("3mf", "3dxml", "xaml"), "lxml networkx"),
}


def unknown_format(file: Path, known: set[str]) -> str:
    """Describe a format that cannot be read, and what to do.

    Args:
        known: extensions that can be read, in small letters, without the dot.
    """
    extension = file.suffix[1:].lower()
    if extension == "blend":
        scene, job = (shlex.quote(str(path)) for path in (file, file.with_suffix(".toml")))
        command = f"blender --background {scene} --python framearray_export.py -- {job}"
        return (
            f".blend files cannot be read; Blender writes a GLB and a job of it: {command} (the script is in "
            "contrib/blender of the sources; see guide/blender.md)"
        )
    if extension in _EXPORTS:
        return f".{extension} files cannot be read; export the scene as GLB: {_EXPORTS[extension]}"
    if extension in _OTHERS:
        return f"expected a scene, got a .{extension} file; {_OTHERS[extension]}"
    got = f"'.{extension}'" if extension else "a name without a suffix"
    formats = ", ".join(sorted(known))
    return f"expected a scene of a known format, got {got}; known are {formats}; GLB is best, most programs export it"


def missing_package(extension: str) -> str:
    """Name the package that a format needs, and how to install it.

    Args:
        extension: in small letters, without the dot.
    """
    remedy = "export the scene as GLB"
    if package := _PACKAGES.get(extension):
        needs = " and ".join(package.split())
        return f"reading .{extension} files needs {needs}; {remedy}, or install it with: {install_command(package)}"
    return f"reading .{extension} files needs a further package; {remedy}"
