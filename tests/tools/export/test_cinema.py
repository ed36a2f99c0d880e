"""Columns of a Cinema database for light of every kind."""

import csv
from pathlib import Path
from typing import Any

from support.boxarrays import plain_manifest, write_array
from support.making import export_array

from framearray_cli.array.manifest import ManifestLight

SPOT = {"type": "spot", "position": [0.0, 2.0, 0.0], "direction": [0.0, -1.0, 0.0], "intensity": [4.0] * 3}


def sources(l: int) -> tuple[dict[str, Any], ...]:
    return (
        SPOT | {"inner": 10.0, "outer": 20.0 + l},
        {"type": "environment", "file": "sky.exr", "rotation": 90.0 * l, "intensity": [1.0, 0.5, 0.25]},
        {"type": "mesh", "material": "Lamp", "radiance": [1.0 * l, 2.0, 3.0], "two_sided": True},
    )


def test_rows_say_how_lights_differ(tmp_path: Path) -> None:
    at = [ManifestLight(ambient=(0.0,) * 3, ambient_error=(0.0,) * 3, sources=sources(l)) for l in range(3)]
    manifest = write_array(plain_manifest(tmp_path / "out", lights=at))
    folder = export_array(manifest.directory, tmp_path / "box.cdb", "cinema").target
    with (folder / "data.csv").open(encoding="utf-8", newline="") as file:
        rows = list(csv.DictReader(file))
    for row in rows:
        l = int(row["light"])
        assert (float(row["source0_inner"]), float(row["source0_outer"])) == (10.0, 20.0 + l)
        assert (row["source1_file"], float(row["source1_rotation"])) == ("sky.exr", 90.0 * l)
        assert [float(row[f"source1_intensity_{channel}"]) for channel in "rgb"] == [1.0, 0.5, 0.25]
        assert (row["source2_material"], float(row["source2_radiance_r"])) == ("Lamp", 1.0 * l)
