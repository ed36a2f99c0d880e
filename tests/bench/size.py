"""Size of the program in figures: `PYTHONPATH=tests python -m bench.size`, of any checkout named as its argument."""

import ast
import subprocess
import sys
from collections import Counter
from pathlib import Path

from support import ROOT
from support.imports import import_graph, modules
from support.prose import counts_of_code, counts_of_pages

MOST_PARAMETERS = 10
SMALL = 80  # lines of a file


def parameters(node: ast.FunctionDef) -> int:
    """Count the parameters of a function, `self` and `cls` aside."""
    names = [argument.arg for argument in (*node.args.posonlyargs, *node.args.args, *node.args.kwonlyargs)]
    return len([name for name in names if name not in ("self", "cls")])


def fields(classes: list[ast.ClassDef], name: str) -> int:
    """Count the annotated fields of a class."""
    body = next((node.body for node in classes if node.name == name), [])
    return sum(isinstance(statement, ast.AnnAssign) for statement in body)


def repeated(names: list[str]) -> list[str]:
    """Return the names that occur more than once."""
    return sorted(name for name, n in Counter(names).items() if n > 1)


def lines(files: list[Path]) -> int:
    """Count the lines of some files."""
    return sum(len(file.read_text(encoding="utf-8").splitlines()) for file in files)


def main() -> None:
    """Print the figures of a checkout."""
    root = Path(sys.argv[1]) if len(sys.argv) > 1 else ROOT
    listed = subprocess.run(["git", "ls-files"], cwd=root, capture_output=True, text=True, check=True).stdout.split()

    def below(suffix: str, *folders: str) -> list[Path]:
        return [root / name for name in listed if name.endswith(suffix) and name.partition("/")[0] in folders]

    package, tests = below(".py", "framearray_cli", "framearray"), below(".py", "tests")
    pages = below(".md", "docs")
    files = modules(root / "framearray_cli")
    trees = {module: ast.parse(file.read_text(encoding="utf-8")) for module, file in files.items()}
    graph = import_graph(root / "framearray_cli")
    importers = Counter(other for others in graph.values() for other in others)
    nodes = [(module, node) for module, tree in trees.items() for node in ast.walk(tree)]
    every = [(f"{module}.{node.name}", node) for module, node in nodes if isinstance(node, ast.FunctionDef)]
    classes = [node for _, node in nodes if isinstance(node, ast.ClassDef)]
    wide = sorted(((parameters(node), name) for name, node in every), reverse=True)
    outside_cli = [(n, name) for n, name in wide if not name.startswith("cli/")]
    plain = [module for module in files if not module.endswith("__init__")]
    readme = root / "README.md"
    figures = {
        "package, lines": lines(package),
        "package, modules": len(package),
        "package, modules below 80 lines": sum(lines([files[module]]) < SMALL for module in plain),
        "package, modules with one importer": sum(importers[module] == 1 for module in plain),
        "package, functions": len(every),
        "package, parameters per function": f"{sum(n for n, _ in wide) / len(wide):.2f}",
        "package, functions of more than 10 parameters": sum(n > MOST_PARAMETERS for n, _ in outside_cli),
        "package, most parameters outside cli": outside_cli[0],
        "fields of FrameSetup": fields(classes, "FrameSetup"),
        "fields of Scene": fields(classes, "Scene"),
        "most imported modules": max((len(others), module) for module, others in graph.items()),
        "file names used twice": repeated([module.rsplit("/", 1)[-1] for module in plain]),
        "class names used twice": repeated([node.name for node in classes]),
        "tests, lines": lines(tests),
        "tests, modules": len(tests),
        "docs, pages": len(pages),
        "docs, words": sum(len(file.read_text(encoding="utf-8").split()) for file in pages),
        "README, lines": lines([readme]),
        "phrases of the package": counts_of_code(package),
        "phrases of README and docs": counts_of_pages([readme, *pages]),
        "by room, lines": dict(Counter({room: lines([f for f in package if room in f.relative_to(root).parts[1:2]])
            for room in sorted({module.split("/")[0] for module in files if "/" in module})})),
    }  # fmt: skip
    for name, figure in figures.items():
        print(f"{name}: {figure}")


if __name__ == "__main__":
    main()
