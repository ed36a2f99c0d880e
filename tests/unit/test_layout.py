"""The package's shape: data flows one way, each library has one door, hot loops are compiled in one way."""

import ast
import subprocess
import sys
from functools import cache
from pathlib import Path

import pytest

import framearray_cli

PACKAGE = Path(framearray_cli.__file__).parent

# Every file, in the order in which data flows; a file imports only from those before it.
FLOW = """
__init__ errors extras units tomltext arrays files limits
kernelcache kernel lanes/kinds lanes/arithmetic lanes/memory lanes/__init__
compiling fingerprint colour sphere usage
jobvalues jobtimes jobkeys jobmethod job jobschema jobdocs problems eyefile jobfile
meshes/limit meshes/model meshes/assets meshes/gltf_values meshes/gltf_check meshes/container meshes/headers
meshes/cleaning
meshes/polygons meshes/merge meshes/overrides meshes/textures meshes/materials meshes/mtl meshes/walk
meshes/gltf_materials meshes/gltf_motion meshes/gltf_triangles meshes/gltf_nodes meshes/gltf_stage
meshes/gltf meshes/obj meshes/other meshes/read meshes/__init__
scene sun planes paths camera lights sampling surface
embree/packets embree/masks embree/native embree/fallback embree/__init__
rays hits eyehits plan allotment
terms/__init__ terms/walks terms/obscurance terms/direct terms/direct_steps terms/specular terms/ambient
terms/ambient_eye terms/ambient_area terms/ambient_light terms/ambient_fit
reuse work crew shading mirrors frame denoise standarderror compose accumulate window loop
imageattributes pngjpeg exrtiff images filepatterns manifest manifestfile pictures ranges record resume folderlock
outfolder stored
prepare writer memory acceptance expected auto allot target identity describe summary progress session render
check verify
start/rays start/sample start/views start/room start/orbit start/model start/staged start/expose start/plan
start/text start/__init__
imagecheck
movie/__init__ movie/places movie/easing movie/curves movie/pathfile movie/timeline movie/sweep
movie/cube movie/display movie/label movie/look movie/yuv movie/video movie/animation movie/sequence movie/assemble
places sheet
export/selection export/folder export/points export/colmap export/nerfstudio export/cinema export/write export/__init__
view/coding view/streams view/index view/tiles view/prepare view/pagefiles view/server view/export view/run
view/__init__
report/settings report/case report/probes report/metrics report/reference report/flip report/quality report/measure
report/offsets report/front report/run report/tables report/plots report/crops report/page report/__init__
screen interrupts
parts/chunks wording parts/openjd parts/progress parts/worker parts/cluster parts/handout parts/run parts/__init__
commands/__init__ commands/options commands/init commands/render commands/check commands/verify
commands/assemble commands/sheet commands/export commands/openjd commands/report commands/schema
commands/view
cli __main__
"""
ORDER = FLOW.split()

# Which files may import a library; what is not here may be imported anywhere.
DOORS = {
    "embreex": ("embree/",),
    "llvmlite": ("embree/", "kernel", "lanes/"),
    "numba": (
        "embree/",
        "kernelcache",
        "kernel",
        "lanes/",
        "compiling",
        "eyehits",
    ),  # eyehits: one function that allocates, so no kernel
    "trimesh": ("meshes/",),
    "OpenImageIO": ("exrtiff", "movie/display"),
    "PIL": ("meshes/", "pngjpeg", "movie/label", "movie/animation", "sheet"),
    "tomllib": ("jobfile", "manifestfile"),
    "tomli_w": ("manifestfile", "tomltext", "report/tables"),
    "matplotlib": ("report/plots",),
    "jinja2": ("report/page",),
    "flip_evaluator": ("report/flip",),
    "typer": ("cli", "commands/"),
    "rich": ("screen",),
    "av": ("movie/video",),
    "scipy": ("paths", "standarderror", "allotment"),
    "psutil": ("usage",),
    "xxhash": ("record",),
    "filelock": ("folderlock",),
    "pvlib": ("sun",),
    "distributed": ("parts/",),
}
# What takes long to import, or may be absent: `framearray --help` does without.
HEAVY = (
    "numba",
    "llvmlite",
    "embreex",
    "trimesh",
    "OpenImageIO",
    "PIL",
    "scipy",
    "av",
    "matplotlib",
    "jinja2",
    "pvlib",
    "distributed",
)

FILES = {path.relative_to(PACKAGE).with_suffix("").as_posix(): path for path in sorted(PACKAGE.rglob("*.py"))}


@cache
def tree_of(name: str) -> ast.Module:
    return ast.parse(FILES[name].read_text(encoding="utf-8"))


def imported(name: str) -> set[str]:
    """Files of the package that a file imports, wherever in it."""
    found = set()
    for node in ast.walk(tree_of(name)):
        if not (isinstance(node, ast.ImportFrom) and node.level):
            continue
        folder = Path(name).parent
        for _ in range(node.level - 1):
            folder = folder.parent
        inside = folder / (node.module or "").replace(".", "/")
        for target in [inside] if node.module else [inside / alias.name for alias in node.names]:
            names = (target.as_posix(), (target / "__init__").as_posix(), (target.parent / "__init__").as_posix())
            found.add(next(name for name in names if name in FILES))
    return found - {name}


@cache
def libraries(name: str) -> set[str]:
    """Libraries that a file imports, wherever in it."""
    found = set()
    for node in ast.walk(tree_of(name)):
        if isinstance(node, ast.Import):
            found |= {alias.name.split(".")[0] for alias in node.names}
        elif isinstance(node, ast.ImportFrom) and not node.level and node.module:
            found.add(node.module.split(".")[0])
    return found


def test_every_file_has_its_place() -> None:
    assert len(set(ORDER)) == len(ORDER)
    assert FILES.keys() <= set(ORDER), "name new files in FLOW, where their data flows"


@pytest.mark.parametrize("name", [name for name in ORDER if name in FILES])
def test_a_file_imports_only_from_those_before_it(name: str) -> None:
    before = set(ORDER[: ORDER.index(name)])
    assert imported(name) <= before


def test_the_package_does_not_import_itself_by_name() -> None:
    assert not [name for name in FILES if "framearray_cli" in libraries(name)]


@pytest.mark.parametrize("library", DOORS)
def test_each_library_has_one_door(library: str) -> None:
    users = [name for name in FILES if library in libraries(name)]
    strangers = [name for name in users if not name.startswith(DOORS[library])]
    assert users or library == "av"
    assert not strangers


def test_imports_are_seen() -> None:
    """The tests above can fail: what they look for is there to be found."""
    assert {"window", "loop", "writer", "terms/ambient"} <= imported("render")
    assert "errors" in imported("meshes/gltf_nodes") and "surface" in imported("embree/masks")
    assert {"embreex", "ctypes"} <= libraries("embree/native")


def test_hot_loops_are_compiled_by_the_decorators_of_kernel() -> None:
    """numba's own decorators stand where a function allocates, or is called by Embree, and nowhere else."""
    own = {}
    for name in FILES:
        for node in ast.walk(tree_of(name)):
            if isinstance(node, ast.FunctionDef):
                texts = [ast.unparse(decorator) for decorator in node.decorator_list]
                if any(text.startswith(("nb.", "numba.", "njit")) for text in texts):
                    own[f"{name}.{node.name}"] = texts
    assert set(own) <= {"eyehits.pixel_order", "embree/masks._surfaces_at", "embree/masks.filter_masked"}


@pytest.mark.parametrize("name", ["kernel", "inlined"])
def test_kernels_say_what_they_do(name: str) -> None:
    """Each has a docstring, or is a private step of a few lines."""
    for file in FILES:
        for node in ast.walk(tree_of(file)):
            if isinstance(node, ast.FunctionDef) and name in [ast.unparse(d) for d in node.decorator_list]:
                short = node.name.startswith("_") and len(node.body) <= 6
                assert ast.get_docstring(node) or short, f"{file}.{node.name}"


def test_help_imports_nothing_heavy() -> None:
    code = f"import sys, framearray_cli.cli; print([name for name in {HEAVY!r} if name in sys.modules])"
    run = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=True)
    assert run.stdout.strip() == "[]"
