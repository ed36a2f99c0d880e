"""Layers of positions in scenes far from their origin."""

from pathlib import Path
from typing import Any

import numpy as np
from support import tiny

from framearray_cli.array.images import POSITION_ORIGIN, read_layers
from framearray_cli.array.manifest import layers_path
from framearray_cli.array.manifest_toml import read_manifest
from framearray_cli.base.openimage import read_texts
from framearray_cli.render.render import render

AWAY = np.array([500_001.25, 121.5, 4_600_002.75])  # easting, height, northing


def positions(folder: Path, at: Any) -> tuple[Any, Any, dict[str, str]]:
    """Positions in a room of 4 x 2.5 x 4 at a place: (h, w, 3), their origin in the manifest, and the header's text."""
    folder.mkdir()
    corners = tiny.box((-2, 0, -2), (2, 2.5, 2)).reshape(-1, 3) + at
    lines = [f"v {x!r} {y!r} {z!r}" for x, y, z in corners.tolist()]
    lines += [f"f {k} {k + 1} {k + 2}" for k in range(1, len(corners), 3)]
    (folder / "room.obj").write_text("\n".join(lines))
    key = tiny.WALK["keys"][0]
    moved = {name: (np.array(key[name]) + at).tolist() for name in ("eye", "target")}
    lamp = {"type": "point", "keys": [{"frame": 0, "position": np.add(at, [0.5, 2.0, 0.5]).tolist(), "intensity": 9.0}]}
    tables = {"camera": {"keys": [{"frame": 0} | moved]}, "light": {"frames": 1, "sources": [lamp]}}
    render(tiny.job_of_file(folder / "room.obj", folder / "out", output={"position": True}, **tables))
    manifest = read_manifest(folder / "out")
    file = layers_path(manifest, 0)
    layers = read_layers(file)
    found = np.stack([layers[f"position.{letter}"] for letter in "XYZ"], axis=-1)
    return found, manifest.scene.get("position_origin"), read_texts(file, POSITION_ORIGIN)


def test_far_from_the_origin_positions_are_relative_to_a_point_near_the_scene(tmp_path: Path) -> None:
    near, none, nothing = positions(tmp_path / "near", np.zeros(3))
    assert none is None and nothing == {}
    far, origin, text = positions(tmp_path / "far", AWAY)
    assert origin == [500_000, 120, 4_600_000] and text == {POSITION_ORIGIN: "500000 120 4600000"}
    np.testing.assert_allclose(far.astype(np.float64) + origin - AWAY, near, atol=1e-4)
