"""Export for reflectance imaging: an `.lp` that our own jobs, and the rules of the format, read back."""

import json
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest
import tomli_w
from support import tiny
from support.boxarrays import light, plain_manifest, write_array

from framearray_cli.array.manifest import ManifestLight
from framearray_cli.base.errors import OutputError
from framearray_cli.job.read import read_job
from framearray_cli.scene.paths.paths import lights
from framearray_cli.tools.export import export_array

EYE, TARGET = [0.3, 1.2, 2.1], [-0.4, 0.9, -1.0]  # of camera 0 of the box


def positions(l: int, kind: str) -> ManifestLight:
    places = np.array([[0.3, 1.8, -0.5], [-1.0, 0.4, 0.7], [0.5, 2.2, 1.5]])
    vector, strength = ("position", "intensity") if kind == "point" else ("direction", "irradiance")
    source = {"type": kind, vector: places[l].tolist(), strength: [3.0, 3.0, 3.0]}
    return ManifestLight(ambient=(0.0,) * 3, ambient_error=(0.0,) * 3, sources=(source,))


def export(folder: Path, kind: str, **options: Any) -> Path:
    manifest = write_array(plain_manifest(folder / "out", lights=[positions(l, kind) for l in range(3)]))
    export_array(manifest.directory, folder / "rti", "rti", **options)
    return folder / "rti"


def read_back(folder: Path, file: Path, kind: str, **source: Any) -> Any:
    strength = "intensity" if kind == "point" else "irradiance"
    table = tiny.table() | {
        "scene": {"file": "a.glb"},
        "camera": {"keys": [{"frame": 0, "eye": EYE, "target": TARGET}]},
        "light": {"sources": [{"type": kind, "file": str(file), strength: 3.0} | source]},
    }
    (folder / "job.toml").write_text(tomli_w.dumps(table), encoding="utf-8")
    return lights(read_job(folder / "job.toml")).sources[0].vector


def test_directions_come_back_through_the_lp(tmp_path: Path) -> None:
    folder = export(tmp_path, "directional")
    found = read_back(tmp_path, folder / "images" / "c0000.lp", "directional", space="camera")
    wanted = np.array([positions(l, "directional").sources[0]["direction"] for l in range(3)])
    np.testing.assert_allclose(found, wanted / np.linalg.norm(wanted, axis=1, keepdims=True), atol=2e-9)


def test_directions_come_back_through_lights_json(tmp_path: Path) -> None:
    found = read_back(tmp_path, export(tmp_path, "point") / "lights.json", "point")
    np.testing.assert_allclose(found, [positions(l, "point").sources[0]["position"] for l in range(3)], atol=1e-12)


def test_rows_of_the_lp(tmp_path: Path) -> None:
    folder = export(tmp_path, "point", cameras="0,2", light="1-2")
    assert sorted(file.name for file in (folder / "images").glob("*.lp")) == ["c0000.lp", "c0002.lp"]
    head, *rows = (folder / "images" / "c0002.lp").read_text(encoding="utf-8").splitlines()
    assert head == "2" and [row.split()[0] for row in rows] == ["c0002_l001.png", "c0002_l002.png"]
    for row in rows:
        assert (folder / "images" / row.split()[0]).is_file()
        assert np.linalg.norm([float(cell) for cell in row.split()[1:]]) == pytest.approx(1, abs=1e-8)


def test_light_from_above_and_from_the_camera(tmp_path: Path) -> None:
    """What the format means by its axes, without our reader: z towards the camera, y up in the picture."""
    back = np.array(EYE) - TARGET
    sources = [{"type": "directional", "direction": d, "irradiance": [1.0] * 3} for d in ((-back).tolist(), [0, -1, 0])]
    at = [ManifestLight(ambient=(0.0,) * 3, ambient_error=(0.0,) * 3, sources=(source,)) for source in sources]
    manifest = write_array(plain_manifest(tmp_path / "out", lights=at))
    export_array(manifest.directory, tmp_path / "rti", "rti")
    rows = (tmp_path / "rti" / "images" / "c0000.lp").read_text(encoding="utf-8").splitlines()[1:]
    from_camera, from_above = ([float(cell) for cell in row.split()[1:]] for row in rows)
    np.testing.assert_allclose(from_camera, [0, 0, 1], atol=1e-8)
    assert from_above[1] > 0.9 and abs(from_above[0]) < 1e-8


@pytest.mark.parametrize("n", [0, 2])
def test_several_sources_are_refused(n: int, tmp_path: Path) -> None:
    manifest = write_array(plain_manifest(tmp_path / "out", lights=[light(l, n) for l in range(3)]))
    with pytest.raises(OutputError, match=f"expected one source per picture, .*, got {n} at light position 0"):
        export_array(manifest.directory, tmp_path / "rti", "rti")


SHINING = {"type": "mesh", "material": "Lamp", "radiance": [1.0] * 3, "two_sided": True}


@pytest.mark.parametrize(("n", "found"), [(0, "with a position or a direction, .*, got type 'mesh'"), (1, "got 2 at")])
def test_surfaces_that_shine_are_refused(n: int, found: str, tmp_path: Path) -> None:
    at = [light(l, n) for l in range(3)]
    with_mesh = [replace(each, sources=(*each.sources, SHINING)) for each in at]
    manifest = write_array(plain_manifest(tmp_path / "out", lights=with_mesh))
    with pytest.raises(OutputError, match=found):
        export_array(manifest.directory, tmp_path / "rti", "rti")


def test_an_earlier_export_is_replaced_only_with_force(tmp_path: Path) -> None:
    folder = export(tmp_path, "point")
    with pytest.raises(OutputError, match="an earlier export is there"):
        export_array(tmp_path / "out", folder, "rti")
    export_array(tmp_path / "out", folder, "rti", force=True)
    assert len(json.loads((folder / "lights.json").read_text(encoding="utf-8"))) == 3
