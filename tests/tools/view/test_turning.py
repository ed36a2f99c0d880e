"""The page under an environment that turns: tiles, what they depend on, and arrays that cannot be lit so."""

import json
import os
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from support import handmade

from framearray_cli.array.images import read_codes
from framearray_cli.array.manifest import Manifest, image_path
from framearray_cli.array.manifest_toml import write_manifest
from framearray_cli.base.errors import OutputError
from framearray_cli.tools.mixing import SumOptions, open_pictures
from framearray_cli.tools.view.coding import encode
from framearray_cli.tools.view.show import open_tiles, prepare_all


@pytest.fixture
def lit(tmp_path: Path) -> tuple[Manifest, Path]:
    """Five directions, and a map."""
    manifest = handmade.circled(tmp_path / "out")
    return manifest, handmade.write_sky(tmp_path / "sky.exr")


def test_tiles_are_sums_of_the_images(lit: tuple[Manifest, Path]) -> None:
    """Each picture is the one that `--environment --rotate` gives, up to half a code and the JPEG."""
    manifest, sky = lit
    tiles = open_tiles(manifest.directory, None, 2, sky)
    assert prepare_all(tiles, 2, lambda n: None) == []
    (stream,) = tiles.streams
    assert (stream.n, tiles.n_pictures, tiles.folder.name) == (36, 36 * 7, "environment")
    for c, turn in ((0, 0), (4, 9), (6, 25)):
        pictures, _ = open_pictures(manifest, SumOptions(environment=sky, rotate=(10.0 * turn, 10.0 * turn)))
        exact = encode(pictures.picture(c, (0.0,)), stream.coding).astype(float)
        found = read_codes(tiles.tile_path(stream.key, c, turn))
        assert np.abs(found - exact).mean() < 1.0 < np.abs(found - np.roll(exact, 3, axis=1)).mean()
        sheet = read_codes(tiles.tile_path(stream.key, c, None))[tiles.layout.part(turn)]
        assert np.abs(sheet - exact).mean() < 1.5
    index = json.loads((tiles.folder / "index.json").read_text())
    assert index["environment"] == {"file": "sky.exr", "step": 10}
    assert [(axis["name"], axis["n"], axis["times"][9]) for axis in index["axes"]] == [("rotation", 36, "90 degrees")]


def test_tiles_follow_the_map_and_every_image(lit: tuple[Manifest, Path]) -> None:
    manifest, sky = lit
    tiles = open_tiles(manifest.directory, None, 1, sky)
    before = tiles.ensure_tile("environment", 3, 7).read_bytes()
    assert tiles.ensure_tile("environment", 3, 7).read_bytes() == before
    contents = tiles.contents(live=True)
    assert contents["lacking"] == [0, ""]
    image = image_path(manifest, 3, 4)
    os.utime(image, ns=(1, 1))
    stamps = (
        tiles.contents(live=True)["streams"]["environment"]["stamps"],
        contents["streams"]["environment"]["stamps"],
    )
    assert [c for c in range(7) if stamps[0][c] != stamps[1][c]] == [3]
    handmade.write_sky(sky, 200.0)
    other = open_tiles(manifest.directory, None, 1, sky)
    assert other.ensure_tile("environment", 3, 7).read_bytes() != before
    image.unlink()
    assert other.contents(live=True)["lacking"] == [1, "3"]
    with pytest.raises(OutputError, match="no such file"):
        other.ensure_tile("environment", 3, None)


def test_an_array_that_no_map_can_light(lit: tuple[Manifest, Path]) -> None:
    """One message, before anything is written."""
    manifest, sky = lit
    png = replace(manifest, images="room.c{camera:04d}.l{light:03d}.png")
    write_manifest(manifest.directory, png)
    with pytest.raises(OutputError, match=r"need linear light, and images are \.png") as caught:
        open_tiles(manifest.directory, None, 1, sky)
    assert not getattr(caught.value, "__notes__", [])
    assert not (manifest.directory / ".view").exists()
    still = replace(manifest, lights=manifest.lights[:1] * manifest.n_lights)
    write_manifest(manifest.directory, still)
    with pytest.raises(OutputError, match="needs one source that moves along the first light axis, got 0"):
        open_tiles(manifest.directory, None, 1, sky)


def test_a_group_that_stays_is_added_once(lit: tuple[Manifest, Path], tmp_path: Path) -> None:
    """The picture of groups is one stream: lamps with an axis of their own stay at their first position."""
    manifest = handmade.grouped(tmp_path / "grouped")
    ways = handmade.circled(tmp_path / "ways").lights[:3]
    lights = tuple(replace(one, sources=way.sources) for one, way in zip(manifest.groups[1].lights, ways, strict=True))
    manifest = replace(manifest, groups=(manifest.groups[0], replace(manifest.groups[1], lights=lights)))
    manifest = replace(manifest, groups=manifest.groups[::-1])  # the first axis is the sun's
    write_manifest(manifest.directory, manifest)
    tiles = open_tiles(manifest.directory, None, 1, lit[1])
    assert [stream.role for stream in tiles.streams] == ["environment"]
    pictures, _ = open_pictures(manifest, SumOptions(environment=lit[1], rotate=(50.0, 50.0)))
    exact = encode(pictures.picture(1, (0.0, 0.0)), tiles.streams[0].coding).astype(float)
    assert np.abs(read_codes(tiles.ensure_tile("environment", 1, 5)) - exact).mean() < 1.0
