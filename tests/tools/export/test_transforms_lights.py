"""Sources of every kind in `transforms.json`."""

import json
from pathlib import Path
from typing import Any

from support.boxarrays import plain_manifest, write_array

from framearray_cli.array.manifest import ManifestLight
from framearray_cli.tools.export import export_array

AT = {"position": [0.5, 2.0, -1.0], "direction": [0.0, -1.0, 0.0], "intensity": [4.0, 3.0, 2.0]}
SUN = {"azimuth": 180.0, "elevation": 45.0, "time": "2026-06-21T12:00:00+01:00"}


def sources(l: int) -> tuple[dict[str, Any], ...]:
    return (
        {"type": "point", "position": [0.0, 2.0, 0.0], "intensity": [9.0, 7.0, 6.0], "radius": 0.1 * l},
        {"type": "directional", "direction": [0.6, -0.8, 0.0], "irradiance": [3.0, 2.0, 1.0], "angle": 0.53, **SUN},
        {"type": "spot", **AT, "inner": 10.0, "outer": 20.0 + l},
        {"type": "spot", **AT, "ies": "lamp.ies", "up": [1.0, 0.0, 0.0]},
        {"type": "rect", **AT, "across": [1.0, 0.0, 0.0], "width": 0.5, "height": 0.25 * l, "two_sided": False},
        {"type": "disc", **AT, "radius": 0.5, "two_sided": True},
        {"type": "mesh", "material": "Lamp", "radiance": [1.0 * l, 2.0, 3.0], "two_sided": True},
        {"type": "environment", "file": "sky.exr", "rotation": 90.0 * l, "intensity": [1.0, 0.5, 0.25]},
    )


def test_frames_hold_all_sources_of_their_light(tmp_path: Path) -> None:
    at = [ManifestLight(ambient=(0.0,) * 3, ambient_error=(0.0,) * 3, sources=sources(l)) for l in range(3)]
    manifest = write_array(plain_manifest(tmp_path / "out", lights=at))
    folder = export_array(manifest.directory, tmp_path / "ns", "nerfstudio", light="all").target
    frames = json.loads((folder / "transforms.json").read_text(encoding="utf-8"))["frames"]
    assert len(frames) == 3 * manifest.n_cameras
    for frame in frames:
        assert frame["sources"] == list(sources(frame["light"]))
        assert "pl_pos" not in frame, "it names a point that is the only source"
    assert [frame["light"] for frame in frames[:3]] == [0, 1, 2]
