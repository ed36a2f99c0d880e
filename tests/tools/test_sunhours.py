"""Hours of sun, and dates and times of light positions."""

from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from support.making import make_sheet
from support.movies import DARK, plain
from support.program import run

from framearray_cli.array.images import read_codes, read_image, write_layers
from framearray_cli.array.manifest import Manifest, ManifestLight, layers_path
from framearray_cli.array.manifest_toml import write_manifest
from framearray_cli.array.mixtures import Mixture
from framearray_cli.base.errors import OutputError
from framearray_cli.base.openimage import read_texts
from framearray_cli.base.ramp import ramp
from framearray_cli.tools.contactsheet import SheetOptions, make_sun_sheet
from framearray_cli.tools.movie.look import shot_label
from framearray_cli.tools.movie.timeline import Shot
from framearray_cli.tools.view.index import index_table, sheet_layout
from framearray_cli.tools.view.streams import layer_streams
from framearray_cli.tools.view.tiles import Tiles

TIMES = [f"2026-{day}T{hour:02d}:{minute:02d}:00+01:00" for day in ("03-20", "06-21") for hour, minute in
         ((8, 0), (8, 30), (9, 0), (9, 30))]  # fmt: skip
DAYS_OF_LAYER = ("2026-03-20", "2026-06-21")
SIZE = (12, 8)


def sun_at(time: str) -> ManifestLight:
    source = {"type": "directional", "direction": [0.0, -1.0, 0.0], "irradiance": [3.0] * 3}
    source |= {"time": time} if time else {}
    return replace(DARK, sources=(source,))


def study(folder: Path, days: Any = DAYS_OF_LAYER, times: Any = TIMES) -> Manifest:
    """Write hours as a layer: k + c / 4 in all pixels of camera c on day k."""
    manifest = replace(
        plain(folder, 2, len(times)), name="study", resolution=SIZE, lights=tuple(map(sun_at, times)),
        layers="study.layers.c{camera:04d}.exr", job={"output": {"sun_hours": True}},
    )  # fmt: skip
    for c in range(2):
        layers = {
            f"sun_hours.{day}": np.full(SIZE[::-1], k + c / 4, np.float32) for k, day in enumerate((*days, "total"))
        }
        write_layers(layers_path(manifest, c), layers)
    write_manifest(folder, manifest)
    return manifest


def test_a_sheet_in_false_colour(tmp_path: Path) -> None:
    manifest = study(tmp_path / "out")
    make_sun_sheet(manifest.directory, tmp_path / "hours.png", SheetOptions())
    codes = {tuple(code) for code in read_codes(tmp_path / "hours.png").reshape(-1, 3).tolist()}
    for hours in (0.0, 0.25, 1.0, 1.25):
        assert tuple(ramp(np.float32(hours / 2)).tolist()) in codes


def test_a_sheet_of_numbers_has_the_hours_themselves(tmp_path: Path) -> None:
    manifest = study(tmp_path / "out")
    made = make_sun_sheet(manifest.directory, tmp_path / "hours.exr", SheetOptions(cameras="all"))
    assert (made.cameras, made.lights, made.size) == ((0, 1), (0, 4), (24, 16))
    hours = read_image(tmp_path / "hours.exr").reshape(2, 8, 2, 12, 3)
    np.testing.assert_array_equal(hours[:, 0, :, 0, 0], [[0.0, 0.25], [1.0, 1.25]])
    assert (hours == hours[:, :1, :, :1, :1]).all()
    assert read_texts(tmp_path / "hours.exr", "colorInteropID") == {"colorInteropID": "data"}


def test_the_command_draws_hours_and_refuses_sums_of_pictures(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    command = ["sheet", study(tmp_path / "out").directory, "--sun-hours", "-o", tmp_path / "hours.png"]
    made = run(capsys, *command)
    assert (made.code, made.err) == (0, "") and "2 camera positions" in made.out
    refused = run(capsys, *command, "--soft", "3", "--force")
    assert refused.code == 2 and refused.err.startswith("--sun-hours: expected no sums")
    for option in ("--light", "--side"):
        refused = run(capsys, *command, option, "", "--force")
        assert refused.code == 2 and refused.err.startswith(f"--sun-hours: expected no {option} next to it")


def test_a_layer_without_a_day_or_a_file_is_named(tmp_path: Path) -> None:
    manifest = study(tmp_path / "a", ("2026-03-20",))
    with pytest.raises(OutputError, match=r"c0000\.exr: expected the channel sun_hours\.2026-06-21, found "):
        make_sun_sheet(manifest.directory, tmp_path / "x.png", SheetOptions())
    layers_path(manifest, 0).unlink()
    with pytest.raises(OutputError, match=r"study\.layers\.c0000\.exr: no such file"):
        make_sun_sheet(manifest.directory, tmp_path / "x.png", SheetOptions())
    bare = study(tmp_path / "b", times=[""] * 8)
    assert all("time" not in light.sources[0] for light in bare.lights)
    with pytest.raises(OutputError, match="expected the times of a sun next to its hours, found "):
        make_sun_sheet(bare.directory, tmp_path / "x.png", SheetOptions())


def test_the_page_lists_days_and_their_sum() -> None:
    one = np.zeros((2, 3), np.float32)
    channels = {f"sun_hours.{day}": one for day in ("2026-03-20", "2026-06-21", "total")} | {"depth.Z": one}
    assert [stream.key for stream in layer_streams("", channels)] == [
        "depth", "sun-2026-03-20", "sun-2026-06-21", "sun-total"
    ]  # fmt: skip
    assert layer_streams("", channels)[-1].label == "Hours of sun, all days"
    del channels["sun_hours.2026-03-20"]
    (_, day) = layer_streams("", channels)
    assert (day.key, day.label) == ("sun-2026-06-21", "Hours of sun 2026-06-21"), "of one day the sum is the same"


def test_the_page_shows_hours(tmp_path: Path) -> None:
    manifest = study(tmp_path / "out")
    tiles = Tiles(manifest, tmp_path / "tiles", 1)
    (stream,) = (stream for stream in tiles.streams if stream.key == "sun-2026-06-21")
    assert (stream.coding.scale, stream.coding.high) == (0.0, 1.3), "data, up to the most hours"
    assert tiles.ensure_tile(stream.key, 1, 0).exists()
    assert not stream.exposed


def test_an_array_without_hours_says_how_to_get_them(tmp_path: Path) -> None:
    with pytest.raises(OutputError, match=r"holds no hours of sun; render again with output\.sun_hours = true"):
        make_sun_sheet(plain(tmp_path / "out").directory, tmp_path / "x.png", SheetOptions())
    assert not (tmp_path / "x.png").exists()


DAYS = (("06-21", 2), ("12-21", 1))
MOMENTS = [f"2026-{day}T{hour:02d}:00:00+0{zone}:00" for day, zone in DAYS for hour in (8, 12, 16)]


@pytest.fixture
def sunny(tmp_path: Path) -> Manifest:
    manifest = replace(plain(tmp_path / "out", 2, 6, "png"), lights=tuple(map(sun_at, MOMENTS)))
    write_manifest(manifest.directory, manifest)
    return manifest


def test_labels_say_when(sunny: Manifest) -> None:
    assert shot_label(sunny, Shot(1, (4.0,))) == "c 1  l 4  2026-12-21 12:00"
    assert shot_label(sunny, Shot(1, (0.4,))) == "c 1  l 0.4  2026-06-21 08:00"
    mixture = Mixture(weights=tuple((l, (1.0, 1.0, 1.0)) for l in range(6)))
    assert shot_label(sunny, Shot(1, (mixture,))) == "c 1  l sum of 6"


def test_rows_of_a_sheet_have_times(sunny: Manifest, tmp_path: Path) -> None:
    made = make_sheet(sunny.directory, tmp_path / "a.png", light="3-5,1")
    assert made.lights == (3, 4, 5, 1)
    bare = replace(sunny, lights=(sun_at("soon"),) * 6)
    write_manifest(sunny.directory, bare)
    plain_sheet = make_sheet(sunny.directory, tmp_path / "b.png", light="3-5,1")
    assert plain_sheet.size[0] < made.size[0], "labels without times are narrower"


def test_the_page_knows_the_times(sunny: Manifest) -> None:
    (axis,) = index_table(sunny, [], sheet_layout(sunny.resolution, 6))["axes"]
    assert axis == {"name": "light", "n": 6, "times": [time[:16].replace("T", " ") for time in MOMENTS]}
    (axis,) = index_table(replace(sunny, lights=(sun_at(""),) * 6), [], sheet_layout(sunny.resolution, 6))["axes"]
    assert axis == {"name": "light", "n": 6}
