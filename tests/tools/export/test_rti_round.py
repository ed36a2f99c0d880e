"""Round trips: `.lp`, `.dome` and domes -> job -> array -> `.lp` -> job, with the same light."""

import json
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest
import tomli_w
from support import tiny
from support.boxarrays import plain_manifest, write_array

from framearray_cli.array.manifest import ManifestLight
from framearray_cli.base.arrays import Float64
from framearray_cli.job.job import Job
from framearray_cli.job.read import job_table, read_job
from framearray_cli.scene.paths.paths import lights
from framearray_cli.tools.export import export_array

EYE, TARGET = [0.3, 1.2, 2.1], [-0.4, 0.9, -1.0]  # of camera 0 of the box
N = 12


def unit_rows(seed: int = 1) -> Float64:
    rows = np.random.default_rng(seed).normal(size=(N, 3))
    return np.asarray(rows / np.linalg.norm(rows, axis=1, keepdims=True))


def lp(rows: Any) -> str:
    return "\n".join([str(len(rows)), *(f"shot {k}.jpg {' '.join(map(repr, row))}" for k, row in enumerate(rows)), ""])


def dome(rows: Any, configuration: str) -> str:
    key = {"directional": "directions", "spherical": "positionsSphere", "lights3d": "positions3d"}[configuration]
    return json.dumps({"lightConfiguration": configuration, key: [dict(zip("xyz", row, strict=True)) for row in rows]})


def job_with(folder: Path, source: dict[str, Any]) -> Job:
    table = tiny.table() | {
        "scene": {"file": "a.glb"},
        "camera": {"keys": [{"frame": 0, "eye": EYE, "target": TARGET}]},
        "light": {"sources": [source]},
    }
    (folder / "job.toml").write_text(tomli_w.dumps(table), encoding="utf-8")
    return read_job(folder / "job.toml")


def exported(folder: Path, job: Job) -> Path:
    """Export the lights of a job as an array of the box has them; return the folder."""
    path = lights(job).sources[0]
    dark = (0.0, 0.0, 0.0)
    at = [ManifestLight(ambient=dark, ambient_error=dark, sources=(path.table(l),)) for l in range(len(path.vector))]
    manifest = replace(plain_manifest(folder / "out", lights=at), job=job_table(job))
    write_array(manifest)
    export_array(folder / "out", folder / "rti", "rti", cameras="0")
    return folder / "rti"


def read_rows(file: Path) -> Float64:
    return np.array([[float(cell) for cell in line.split()[1:]] for line in file.read_text().splitlines()[1:]])


FILES = [
    ("in.lp", lp(unit_rows().tolist())),
    ("in.dome", dome(unit_rows().tolist(), "directional")),
    ("sphere.dome", dome(unit_rows().tolist(), "spherical")),
]


@pytest.mark.parametrize(("name", "content"), FILES, ids=[name for name, _ in FILES])
@pytest.mark.parametrize(
    "source",
    [
        {"type": "directional", "irradiance": 3.0},
        {"type": "point", "intensity": 3.0, "scale": 2.5},
        {"type": "point", "intensity": 3.0, "scale": 0.5, "center": [7.0, -2.0, 0.5]},
    ],
    ids=["directions", "points", "points around a centre"],
)
def test_a_file_comes_back_as_it_was(tmp_path: Path, name: str, content: str, source: dict[str, Any]) -> None:
    if name == "in.dome" and source["type"] == "point":
        pytest.skip("a .dome of directions has no positions")
    (tmp_path / name).write_text(content, encoding="utf-8")
    job = job_with(tmp_path, source | {"file": name, "space": "camera"})
    folder = exported(tmp_path, job)
    np.testing.assert_allclose(read_rows(folder / "images" / "c0000.lp"), unit_rows(), atol=2e-9)
    (tmp_path / "again").mkdir()
    again = job_with(tmp_path / "again", source | {"file": str(folder / "images" / "c0000.lp"), "space": "camera"})
    np.testing.assert_allclose(lights(again).sources[0].vector, lights(job).sources[0].vector, atol=1e-8)
    second = exported(tmp_path / "again", again)
    np.testing.assert_allclose(read_rows(second / "images" / "c0000.lp"), unit_rows(), atol=2e-9)  # of 9 decimals


@pytest.mark.parametrize("shape", ["hemisphere", "sphere"])
@pytest.mark.parametrize("kind", ["point", "directional"])
def test_a_dome_comes_back_from_either_file(tmp_path: Path, shape: str, kind: str) -> None:
    """The directions begin at the target of the dome, wherever cameras look."""
    target, radius = [4.0, 1.0, -2.0], 1.5
    around = {"target": target, "radius": radius, "intensity": 2.0} if kind == "point" else {"irradiance": 2.0}
    job = job_with(tmp_path, {"type": "dome", "positions": N, "shape": shape, **around})
    folder, wanted = exported(tmp_path, job), lights(job).sources[0].vector
    strength = {"intensity": 2.0} if kind == "point" else {"irradiance": 2.0}
    (tmp_path / "again").mkdir()
    from_json = job_with(tmp_path / "again", {"type": kind, "file": str(folder / "lights.json"), **strength})
    np.testing.assert_allclose(lights(from_json).sources[0].vector, wanted, atol=1e-12)
    placed = {"scale": radius, "center": target} if kind == "point" else {}
    source = {"type": kind, "file": str(folder / "images" / "c0000.lp"), "space": "camera", **strength, **placed}
    np.testing.assert_allclose(lights(job_with(tmp_path / "again", source)).sources[0].vector, wanted, atol=1e-8)
