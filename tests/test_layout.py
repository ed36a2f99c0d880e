"""The shape of the package: rooms import only what their table allows, each library has one door, files are small."""

import ast
import re
import subprocess
import sys
from pathlib import Path

import pytest
from support import ROOT
from support.imports import Graph, against_the_table, circle, import_graph, libraries, modules, room

from framearray_cli.engine.kernels.cache import SEEN

PACKAGE, PUBLIC = ROOT / "framearray_cli", ROOT / "framearray"
PAGE = ROOT / "docs" / "develop" / "architecture.md"
FILES = modules(PACKAGE)
TREES = {name: ast.parse(file.read_text(encoding="utf-8")) for name, file in FILES.items()}
PUBLIC_FILES = {f"{PUBLIC.name}/{name}": file for name, file in modules(PUBLIC).items()}
PUBLIC_TREES = {name: ast.parse(file.read_text(encoding="utf-8")) for name, file in PUBLIC_FILES.items()}

MOST_ENTRIES = 12  # at the top of the package
MOST_LINES = 600
MOST_FUNCTION_LINES = 60

# The files that may import a library; every file may import a library that is not listed.
DOORS = {
    "embreex": ("engine/embree/",),
    "llvmlite": ("engine/embree/", "engine/kernels/"),
    "numba": ("engine/embree/", "engine/kernels/", "engine/hits/native"),  # native: one function that allocates
    "trimesh": ("scene/files/",),
    "OpenImageIO": ("base/openimage",),
    "PyOpenColorIO": ("base/views",),
    "PIL": (
        "scene/files/",
        "array/images",
        "tools/movie/video",
        "tools/drawing",
    ),
    "tomllib": ("base/forms/toml", "array/manifest_toml"),
    "tomli_w": ("base/forms/toml", "array/manifest_toml", "report/page"),
    "matplotlib": ("report/page",),
    "jinja2": ("report/page",),
    "typer": ("cli/",),
    "rich": ("cli/screen",),
    "av": ("tools/movie/video",),
    "scipy": (
        "scene/paths/curves",
        "engine/images/standard_error",
        "engine/frames/passes",
        "tools/export/colmap",
        "tools/mixing",
    ),
    "psutil": ("base/memory", "base/platform"),
    "pxr": ("scene/files/usd/usdcore",),
    "xxhash": ("base/files",),
    "filelock": ("array/folder", "array/coarsearray", "engine/kernels/machine_code"),
    "ephem": ("scene/paths/sun",),
    "distributed": ("render/parts/dask",),
    "xarray": ("framearray/array", "framearray/labelled"),  # array: for types only
    "zarr": ("framearray/zarrstore",),
}
# What not every system has: modules, and names of modules.
UNPORTABLE_MODULES = {"resource", "fcntl", "termios", "pwd", "grp", "pty", "msvcrt", "winreg"}
UNPORTABLE = {
    "sys.platform", "os.name", "os.fork", "os.statvfs", "os.sched_getaffinity", "os.geteuid", "os.getuid", "os.killpg",
    "os.mkfifo", "os.setsid", "signal.setitimer", "signal.alarm", "signal.SIGALRM", "signal.SIGHUP", "signal.SIGKILL",
    "signal.pthread_sigmask",
}  # fmt: skip
# Libraries that load slowly or may be absent: `framearray --help` does without.
HEAVY = (
    "numpy",
    "numba",
    "llvmlite",
    "embreex",
    "trimesh",
    "OpenImageIO",
    "PyOpenColorIO",
    "PIL",
    "scipy",
    "av",
    "matplotlib",
    "jinja2",
    "ephem",
    "distributed",
    "psutil",
    "pxr",
    "xarray",
    "zarr",
)


def rooms_table() -> dict[str, tuple[str, set[str]]]:
    """Read the table of rooms in the contributors' page: room -> purpose, rooms that it may import."""
    rows = re.findall(r"^\| `(\w+)/` \| (.+?) \| (.+?) \|$", PAGE.read_text(encoding="utf-8"), re.MULTILINE)
    every = {name for name, _, _ in rows}
    return {
        name: (purpose, every - {name, PUBLIC.name} if may == "all" else every & set(re.findall(r"\w+", may)) & every)
        for name, purpose, may in rows
    }


ROOMS = rooms_table()
PURPOSE, MAY = ROOMS.pop(PUBLIC.name)  # of the public package, which stands beside the rooms
ALLOWED = {name: may for name, (_, may) in ROOMS.items()}


def test_every_file_stands_in_a_room_of_the_table() -> None:
    assert {room(module) for module in FILES} == {"", *ROOMS}
    assert {module for module in FILES if not room(module)} == {"__init__", "__main__"}
    entries = [entry for entry in PACKAGE.iterdir() if entry.name not in ("__pycache__", "py.typed")]
    assert len(entries) <= MOST_ENTRIES


def test_the_table_gives_an_order() -> None:
    """Each room imports rooms above it; what it names exists."""
    above: set[str] = set()
    for name, may in ALLOWED.items():
        assert may <= above
        above.add(name)


def frozen_names(tree: ast.Module) -> set[str]:
    """Names whose values numba compiles into kernels: of decorated functions, and of a module's constants."""
    parts: list[ast.AST] = []
    for node in tree.body:
        if isinstance(node, ast.FunctionDef) and node.decorator_list:
            parts += node.body
        elif isinstance(node, ast.Assign | ast.AnnAssign) and node.value:
            parts.append(node.value)
    return {name.id for part in parts for name in ast.walk(part) if isinstance(name, ast.Name)}


def test_kernels_are_compiled_again_after_edits_of_the_files_with_their_constants() -> None:
    """Types, errors and functions for people are no constants of kernels."""
    no_constants = {"base/arrays", "base/errors", "base/files"}
    found = set()
    for module in (module for module in FILES if room(module) == "engine"):
        used = frozen_names(TREES[module])
        for node in (node for node in TREES[module].body if isinstance(node, ast.ImportFrom)):
            name = (node.module or "").replace(".", "/")
            if name.startswith(PACKAGE.name) and used & {alias.asname or alias.name for alias in node.names}:
                found.add(name.removeprefix(f"{PACKAGE.name}/"))
    elsewhere = {name for name in found if room(name) != "engine"} - no_constants
    assert set(SEEN) == {"engine/**/*.py", *(f"{name}.py" for name in elsewhere)}


@pytest.mark.parametrize("name", ROOMS)
def test_a_room_states_its_purpose_as_the_table_does(name: str) -> None:
    docstring = ast.get_docstring(TREES[f"{name}/__init__"]) or ""
    assert docstring.splitlines()[0] == f"{ROOMS[name][0]}."


@pytest.fixture(scope="module")
def graph() -> Graph:
    return import_graph(PACKAGE)


def test_rooms_import_what_the_table_allows(graph: Graph) -> None:
    assert against_the_table(graph, ALLOWED) == []


def test_no_modules_import_each_other_in_a_circle(graph: Graph) -> None:
    assert circle(graph) == []


def test_the_public_package_uses_the_rooms_and_no_room_uses_it() -> None:
    """What it states as its purpose is that of the table; inside it imports are relative."""
    assert (ast.get_docstring(PUBLIC_TREES["framearray/__init__"]) or "").splitlines()[0] == f"{PURPOSE}."
    assert [module for module, file in FILES.items() if PUBLIC.name in libraries(file)] == []
    assert [module for module, file in PUBLIC_FILES.items() if PUBLIC.name in libraries(file)] == []
    assert circle(import_graph(PUBLIC)) == []
    used = {
        node.module.split(".")[1]
        for tree in PUBLIC_TREES.values()
        for node in ast.walk(tree)
        if isinstance(node, ast.ImportFrom) and node.module and node.module.startswith("framearray_cli.")
    }
    assert used <= MAY
    assert {file.name for file in (PUBLIC, PACKAGE) if (file / "py.typed").is_file()} == {PUBLIC.name, PACKAGE.name}


def test_an_import_against_the_table_is_seen(tmp_path: Path) -> None:
    """The test of rooms can fail: one more import, in any form, also inside a function."""
    for text in (
        "from framearray_cli.render.render import render\n",
        "from ..render import render\n",
        "import framearray_cli.render.render\n",
        "def later() -> None:\n    from framearray_cli.render import render\n",
    ):
        package = tmp_path / "framearray_cli"
        for module in ("__init__", "engine/__init__", "engine/loop", "render/__init__", "render/render"):
            (package / module).parent.mkdir(parents=True, exist_ok=True)
            down = "from framearray_cli.engine import loop\n" if module == "render/render" else ""
            (package / f"{module}.py").write_text(down)
        assert against_the_table(import_graph(package), ALLOWED) == []
        assert circle(import_graph(package)) == []
        (package / "engine" / "loop.py").write_text(text)
        assert against_the_table(import_graph(package), ALLOWED) == ["engine/loop imports render/render"]


def test_a_circle_inside_a_room_is_seen(tmp_path: Path) -> None:
    package = tmp_path / "framearray_cli"
    (package / "engine").mkdir(parents=True)
    for name, text in {"a": "from .b import x\n", "b": "from . import c\n", "c": "", "__init__": ""}.items():
        (package / "engine" / f"{name}.py").write_text(text)
    assert circle(import_graph(package)) == []
    (package / "engine" / "c.py").write_text("from framearray_cli.engine.a import y\n")
    assert circle(import_graph(package)) == ["engine/a", "engine/b", "engine/c", "engine/a"]


def test_imports_are_seen(graph: Graph) -> None:
    """The graph holds imports of both forms."""
    assert {"engine/frames/setup", "array/manifest", "render/writer"} <= graph["render/render"]
    assert {"embreex", "ctypes"} <= libraries(FILES["engine/embree/library"])


def test_inside_a_room_imports_are_relative_and_between_rooms_absolute() -> None:
    """A line that begins with the package's name is then a door between rooms."""
    wrong = []
    for module, tree in TREES.items():
        for node in ast.walk(tree):
            if not isinstance(node, ast.ImportFrom):
                continue
            within = bool(node.level) and node.level <= module.count("/")
            across = not node.level and (node.module or "").split(".")[0] == "framearray_cli"
            same = across and (node.module or "").split(".")[1:2] == [room(module)]
            if room(module) and (same or (node.level and not within)):
                wrong.append(f"{module}: {ast.unparse(node)}")
    assert not wrong


def test_files_and_functions_stay_small() -> None:
    files, trees = FILES | PUBLIC_FILES, TREES | PUBLIC_TREES
    long = {module: n for module, file in files.items() if (n := len(file.read_text().splitlines())) > MOST_LINES}
    assert long == {}
    functions = {}
    for module, tree in trees.items():
        for node in ast.walk(tree):
            if isinstance(node, ast.FunctionDef) and node.end_lineno:
                functions[f"{module}.{node.name}"] = node.end_lineno - node.lineno + 1
    assert {name: n for name, n in functions.items() if n > MOST_FUNCTION_LINES} == {}


@pytest.mark.parametrize("library", DOORS)
def test_each_library_has_one_door(library: str) -> None:
    files = FILES | PUBLIC_FILES
    users = [module for module, file in files.items() if library in libraries(file)]
    assert users
    assert [module for module in users if not module.startswith(DOORS[library])] == []


def test_what_systems_differ_in_has_one_door() -> None:
    """Calls and modules that some systems lack, and questions which system it is."""
    outside = []
    for module, tree in TREES.items():
        for node in ast.walk(tree):
            if isinstance(node, ast.Import | ast.ImportFrom):
                found = {name.partition(".")[0] for name in imported(node)} & UNPORTABLE_MODULES
            else:
                found = {ast.unparse(node)} & UNPORTABLE if isinstance(node, ast.Attribute) else set()
            outside += [f"{module}: {name}" for name in found if module != "base/platform"]
    assert outside == []
    assert "getrusage" in FILES["base/platform"].read_text()


def imported(node: ast.Import | ast.ImportFrom) -> list[str]:
    """Return the modules that an import names."""
    return [alias.name for alias in node.names] if isinstance(node, ast.Import) else [node.module or ""]


def test_hot_loops_are_compiled_by_the_decorators_of_kernel() -> None:
    """numba's own decorators stand where a function allocates, or is called by Embree, and nowhere else."""
    own = {}
    for module, tree in TREES.items():
        for node in ast.walk(tree):
            if isinstance(node, ast.FunctionDef):
                texts = [ast.unparse(decorator) for decorator in node.decorator_list]
                if any(text.startswith(("nb.", "numba.", "njit")) for text in texts):
                    own[f"{module}.{node.name}"] = texts
    assert set(own) <= {"engine/embree/embreescene.filter_masked"}


@pytest.mark.parametrize("name", ["kernel", "step", "inlined"])
def test_kernels_say_what_they_do(name: str) -> None:
    """Each has a docstring, or is a private step of a few lines."""
    for module, tree in TREES.items():
        for node in ast.walk(tree):
            if isinstance(node, ast.FunctionDef) and name in [
                ast.unparse(d).partition("(")[0] for d in node.decorator_list
            ]:
                short = node.name.startswith("_") and len(node.body) <= 6
                assert ast.get_docstring(node) or short, f"{module}.{node.name}"


@pytest.mark.parametrize("module", ["framearray_cli.cli.main", "framearray"])
def test_help_and_the_public_package_import_nothing_heavy(module: str) -> None:
    code = f"import sys, {module}; print([name for name in {HEAVY!r} if name in sys.modules])"
    run = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=True)
    assert run.stdout.strip() == "[]"
