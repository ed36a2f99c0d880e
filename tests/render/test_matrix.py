"""One set of kernels: jobs with all features, in one order and in another, call each kernel with one set of types."""

import json
import subprocess
import sys
from pathlib import Path
from typing import Any

import tomli_w
from bench.core.results import ROOT
from fuzz import jobseeds

# Kernels with two sets of types: they write images as float32 or as halves.
OF_IMAGES = {"compose_pixels", "finish"}
METHODS = {"method": "obscurance"}, {"method": "cells", "samples": 1024}, {"method": "cells", "samples": 1024}
SURFACES = "diffuse", "diffuse", "file"

RENDERING = """
import gc, json, sys
from pathlib import Path
from numba.core.dispatcher import Dispatcher
import framearray
for k, job in enumerate(sys.argv[2:]):
    framearray.render(job, output=f"{sys.argv[1]}/{k}", threads=1)
found = [each for each in gc.get_objects() if isinstance(each, Dispatcher) and each.signatures]
own = [each for each in found if each.py_func.__module__.startswith("framearray_cli")]
print(json.dumps([
    {each.py_func.__name__: sorted(map(str, each.signatures)) for each in own},
    sum(sum(each.stats.cache_misses.values()) for each in own),
]))
"""


def rendered(folder: Path, jobs: list[Path]) -> tuple[dict[str, list[str]], int]:
    """Render jobs in one process; return the types of each kernel, and how many were compiled."""
    command = [sys.executable, "-c", RENDERING, str(folder), *map(str, jobs)]
    run = subprocess.run(command, capture_output=True, text=True, cwd=ROOT)
    assert run.returncode == 0, run.stderr
    types, compiled = json.loads(run.stdout.splitlines()[-1])
    return types, compiled


def test_no_scene_light_camera_or_output_has_kernels_of_its_own(tmp_path: Path) -> None:
    scene = str(jobseeds.with_scene(tmp_path))
    tables: list[dict[str, Any]] = [
        {**table, "indirect": method, "scene": {"surfaces": surfaces} | table["scene"]}
        for table in jobseeds.tables(scene).values()
        for method, surfaces in zip(METHODS, SURFACES, strict=True)
    ]
    tables.append(tables[0] | {"output": {"format": "exr", "half": "never"}})
    assert len(tables) >= 40
    jobs = [tmp_path / f"{k}.toml" for k in range(len(tables))]
    for job, table in zip(jobs, tables, strict=True):
        job.write_text(tomli_w.dumps(table))
    found, _ = rendered(tmp_path / "one", jobs)
    assert len(found) > 50
    assert {name: kinds for name, kinds in found.items() if len(kinds) > 1 + (name in OF_IMAGES)} == {}
    again, compiled = rendered(tmp_path / "other", jobs[::-1])
    # a kernel that was compiled names those that it calls, too
    assert {
        name: (again[name], found[name]) for name in again.keys() & found.keys() if again[name] != found[name]
    } == {}
    assert {name: kinds for name, kinds in again.items() if len(kinds) > 1 + (name in OF_IMAGES)} == {}
    assert compiled == 0
