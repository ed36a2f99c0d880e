"""What a second process compiles for a job: the kernels that the job then calls, for the same types."""

import json
import os
import subprocess
import sys
import time
from pathlib import Path

import psutil
import pytest
from support import ROOT

from framearray_cli.base.forms.table import changed
from framearray_cli.engine.kernels import second_process
from framearray_cli.job.read import read_job
from framearray_cli.render.features import EVERY_PROPERTY
from framearray_cli.render.precompile import FLOATS, offer_for, room_job

# Compiles for a job as the second process does, then renders it; prints the kernels that came for other types.
PROGRAM = """
import json, sys
from pathlib import Path
from framearray_cli.job.read import read_job
from framearray_cli.render import precompile
from framearray_cli.render.render import render

def kernels():
    found = {}
    for name, module in list(sys.modules.items()):
        for attribute, value in list(vars(module).items()) if name.startswith("framearray_cli.") else []:
            if hasattr(value, "signatures") and value.py_func.__module__ == name:
                found[f"{name}.{attribute}"] = len(value.signatures)
    return found

job = read_job(Path(sys.argv[1]), [f"output.directory={sys.argv[2]!r}", *sys.argv[3:]])
precompile.compile_for(precompile.tables_for(job))
before = kernels()
render(job)
print(json.dumps([name for name, n in kernels().items() if n > before.get(name, 0)]))
"""
# Kernels whose types depend on the scene, none of which takes long.
OF_THE_SCENE = {"framearray_cli.engine.terms.ambient.intensity.add_background"}


@pytest.mark.parametrize(
    "settings",
    [
        pytest.param([], marks=pytest.mark.slow),
        ['output.format="exr"', 'reuse.weights="area"', "samples.halves=true"],
        ['indirect.method="cells"', "indirect.samples=4096"],
    ],
    ids=["smoke", "halves by area", "cells"],
)
def test_it_compiles_for_the_types_of_the_job(settings: list[str], tmp_path: Path) -> None:
    command = [sys.executable, "-c", PROGRAM, str(ROOT / "jobs" / "smoke.toml"), str(tmp_path / "out"), *settings]
    found = subprocess.run(command, capture_output=True, text=True, timeout=400)
    assert found.returncode == 0, found.stderr
    assert set(json.loads(found.stdout.splitlines()[-1])) <= OF_THE_SCENE


@pytest.mark.slow
def test_two_processes_compile_in_less_time_than_one(tmp_path: Path) -> None:
    """A render on an empty disk: the same images, and nothing is left running."""
    if second_process.available_cores() < 2:
        pytest.skip("one core")
    seconds, images = [], []
    for compilers in ("2", "1"):
        folder = tmp_path / compilers
        environment = os.environ | {second_process.PROCESSES: compilers, "NUMBA_CACHE_DIR": str(folder / "kernels")}
        command = [sys.executable, "-m", "framearray_cli", "render", "jobs/smoke.toml", "-o", str(folder / "out")]
        started = time.perf_counter()
        subprocess.run(command, check=True, env=environment, cwd=ROOT)
        seconds.append(time.perf_counter() - started)
        images.append([file.read_bytes() for file in sorted((folder / "out").glob("*.png"))])
        assert not psutil.Process().children(recursive=True)
    assert images[0] == images[1]
    assert seconds[0] < 0.9 * seconds[1]


def test_a_job_with_one_thread_starts_no_second_process(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    offered: list[object] = []
    monkeypatch.setattr("framearray_cli.render.precompile.offer_beside", offered.append)
    job = read_job(ROOT / "jobs" / "smoke.toml")
    for threads, expected in ((1, 0), (2, 1), (None, 2)):
        offer_for(changed(job, render=changed(job.render, threads=threads)), FLOATS)
        assert len(offered) == expected


def test_keys_that_need_the_file_are_in_no_diffuse_room(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setitem(EVERY_PROPERTY, "gloss", {"normal_strength": 2.0})
    diffuse, of_file = (room_job({"scene": {"surfaces": kind}}, tmp_path / kind) for kind in ("diffuse", "file"))
    assert diffuse.scene.materials["gloss"].normal_strength is None
    assert of_file.scene.materials["gloss"].normal_strength == 2
    assert all(job.scene.materials["mirror"].specular == (0.8, 0.8, 0.8) for job in (diffuse, of_file))
