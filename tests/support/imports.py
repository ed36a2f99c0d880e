"""The graph of imports in a package, read from its source files, for the tests of the layout."""

import ast
from collections.abc import Iterator, Mapping
from functools import cache
from graphlib import CycleError, TopologicalSorter
from pathlib import Path
from typing import TypeAlias

Graph: TypeAlias = Mapping[str, set[str]]  # module -> modules of the package that it imports; "engine/loop"


def modules(package: Path) -> dict[str, Path]:
    """Find every module of a package: its path without the ending, relative to the package -> its file."""
    return {file.relative_to(package).with_suffix("").as_posix(): file for file in sorted(package.rglob("*.py"))}


def import_graph(package: Path) -> Graph:
    """Read all imports between modules of a package, those inside functions too."""
    files = modules(package)
    return {name: set(_imported(package.name, name, files)) - {name} for name in files}


def _imported(package: str, name: str, files: Mapping[str, Path]) -> Iterator[str]:
    """List the modules that one module imports; a name that a package exports counts as its `__init__`."""
    for node in ast.walk(ast.parse(files[name].read_text(encoding="utf-8"))):
        if isinstance(node, ast.Import):
            targets = [alias.name.split(".") for alias in node.names]
        elif isinstance(node, ast.ImportFrom):
            start = [package, *name.split("/")[:-1]]
            base = start[: len(start) + 1 - node.level] if node.level else []
            base += node.module.split(".") if node.module else []
            targets = [[*base, alias.name] for alias in node.names]
        else:
            continue
        for target in targets:
            if target[0] != package:
                continue
            inside, outside = "/".join(target[1:]), "/".join(target[1:-1])
            places = (inside, f"{inside}/__init__".lstrip("/"), outside, f"{outside}/__init__".lstrip("/"))
            yield next(place for place in places if place in files)


@cache
def libraries(file: Path) -> frozenset[str]:
    """Find the libraries that a file imports, also inside functions."""
    found: set[str] = set()
    for node in ast.walk(ast.parse(file.read_text(encoding="utf-8"))):
        if isinstance(node, ast.Import):
            found |= {alias.name.split(".")[0] for alias in node.names}
        elif isinstance(node, ast.ImportFrom) and not node.level and node.module:
            found.add(node.module.split(".")[0])
    return frozenset(found)


def room(module: str) -> str:
    """Return the room of a module; "" for the package's own files."""
    return module.split("/")[0] if "/" in module else ""


def against_the_table(graph: Graph, table: Mapping[str, set[str]]) -> list[str]:
    """List the imports between rooms that a table does not allow.

    Args:
        table: room -> rooms that it may import. Files outside all rooms may import all, and be imported by all.
    """
    return [
        f"{module} imports {other}"
        for module, others in graph.items()
        for other in sorted(others)
        if room(module) in table and room(other) in table.keys() - {room(module), *table[room(module)]}
    ]


def circle(graph: Graph) -> list[str]:
    """Find modules that import each other in a circle, in turn; none: []."""
    try:
        TopologicalSorter(graph).prepare()
    except CycleError as error:
        return list(reversed(error.args[1]))
    return []
