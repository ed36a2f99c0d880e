"""`framearray compile` compiles every kernel, and later commands compile none."""

import json
import os
import subprocess
import sys
from pathlib import Path

from support import ROOT
from support.program import run

from framearray_cli.engine.kernels.cache import kernel_folder, kernels_in, ready_folder
from framearray_cli.render.precompile import all_kernels


def test_its_jobs_need_every_kernel(capsys) -> None:
    assert run(capsys, "compile").code == 0
    files = [file.name for folder in (ready_folder(), kernel_folder()) for file in kernels_in(folder)]
    missing = {".".join(name.split(".")[-2:]) for name in all_kernels()} - {file.rpartition("-")[0] for file in files}
    assert not missing


def test_it_compiles_once(capsys) -> None:
    first = json.loads(run(capsys, "compile", "--json").out)["result"]
    assert first["kernels"]["kernels"] + first["kernels"]["ready_made"] >= len(all_kernels())
    again = json.loads(run(capsys, "compile", "--json").out)["result"]
    assert again["compiled"] == 0


def test_after_it_a_first_job_compiles_nothing(capsys, tmp_path: Path) -> None:
    run(capsys, "compile")
    script = f"""
from framearray_cli.engine.kernels.clock import compile_clock
from framearray_cli.cli.main import main
with compile_clock() as clock:
    main(["init", {str(ROOT / "jobs/scenes/cabin.glb")!r}, "-o", {str(tmp_path / "room.toml")!r}])
    main(["render", {str(tmp_path / "room.toml")!r}, "--preview"])
print(clock.kernels)
"""
    found = subprocess.run([sys.executable, "-c", script], capture_output=True, text=True, check=True, env=os.environ)
    assert found.stdout.splitlines()[-1] == "0"


def test_a_folder_that_cannot_be_written_is_an_error(capsys, tmp_path: Path, monkeypatch) -> None:
    from framearray_cli.engine.kernels import cache

    monkeypatch.setattr(cache, "_problems", [f"{tmp_path}: Permission denied"])
    result = run(capsys, "compile")
    assert result.code != 0 and "compiled kernels cannot be kept" in result.err
