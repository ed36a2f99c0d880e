"""Environment maps in jobs: placed along the light path, checked before anything is traced."""

from pathlib import Path
from typing import Any

import numpy as np
import pytest
from support import tiny
from support.scenes import write_floats

from framearray_cli.base.errors import JobError
from framearray_cli.base.openimage import colour_channels, read_environment
from framearray_cli.engine.inputs.lights import light_arrays
from framearray_cli.job.job import Job
from framearray_cli.render.identity import job_fingerprint
from framearray_cli.render.messages import scene_lines
from framearray_cli.render.preview import lights_of_preview
from framearray_cli.scene.paths.lightpath import LightPath
from framearray_cli.scene.paths.panorama import texel_powers
from framearray_cli.scene.paths.paths import lights

SKY = np.full((4, 8, 3), (0.5, 1.0, 2.0), np.float32)


def save(folder: Path, pixels: Any, name: str = "sky.exr") -> Path:
    return write_floats(folder / name, pixels)


def job_of(file: Path, *keys: dict[str, Any], **changes: Any) -> Job:
    found = [{"frame": k} | key for k, key in enumerate(keys or ({},))]
    return tiny.job(
        light={"frames": len(found), "sources": [{"type": "environment", "file": str(file), "keys": found}]}, **changes
    )


def placed(file: Path, *keys: dict[str, Any], **changes: Any) -> LightPath:
    return lights(job_of(file, *keys, **changes)).sources[0]


def test_its_middle_is_north_and_turns_over_east(tmp_path: Path) -> None:
    keys = [{"rotation": 0, "color": 1}, {"rotation": 90, "intensity": 2, "color": [1, 0.5, 0]}]
    path = placed(save(tmp_path, SKY), *keys)
    np.testing.assert_allclose(path.vector, [(0, 0, 1), (-1, 0, 0)], atol=1e-12)
    flux = 4 * np.pi * (0.2126 * 0.5 + 0.7152 * 1.0 + 0.0722 * 2.0)
    np.testing.assert_allclose(path.intensity, [(flux, flux, flux), (2 * flux, flux, 0)])
    assert path.table(1) == {"type": "environment", "file": "sky.exr", "rotation": 90.0, "intensity": [2.0, 1.0, 0.0]}
    up = placed(tmp_path / "sky.exr", *keys, scene={"up": "z"})
    np.testing.assert_allclose(up.vector, [(0, -1, 0), (-1, 0, 0)], atol=1e-12)


def test_turns_between_keys_are_even(tmp_path: Path) -> None:
    path = placed(save(tmp_path, SKY), {"rotation": 0}, {"rotation": 180})
    assert path.environment is not None
    np.testing.assert_allclose(path.environment.rotation_deg, [0, 180])
    assert path.at([1]).table(0)["rotation"] == 180


@pytest.mark.parametrize("name", ["sky.hdr", "sky.tif", "sky.exr"])
def test_formats_of_linear_light_are_read(name: str, tmp_path: Path) -> None:
    path = placed(save(tmp_path, SKY, name))
    assert path.environment is not None
    np.testing.assert_allclose(path.environment.panorama.pixels, SKY, rtol=4e-3)  # HDR has 8 bits per channel
    assert light_arrays(lights(job_of(tmp_path / name)), np.zeros(3)).channels == 3


def test_the_fingerprint_holds_the_map_and_not_its_name(tmp_path: Path) -> None:
    def digest(name: str, pixels: Any) -> str:
        return job_fingerprint(tiny.prepared(job_of(save(tmp_path, pixels, name))), "scene")

    assert digest("a.exr", SKY) == digest("b.exr", SKY)
    assert digest("a.exr", SKY) != digest("a.exr", SKY * np.float32(1.5))


@pytest.mark.parametrize(
    ("pixels", "problem"),
    [
        (SKY[:, :7], "expected a panorama, twice as wide as high, got 7 x 4 pixels"),
        (np.zeros((4, 8, 3)), "expected an environment that shines, got radiance 0 everywhere"),
        (np.full((4, 8, 3), -1.0), "expected an environment that shines, got no radiance above 0"),
        (np.full((4, 8, 3), np.nan), "expected radiance, got no finite texel"),
    ],
)
def test_what_is_no_radiance_is_refused(pixels: Any, problem: str, tmp_path: Path) -> None:
    file = save(tmp_path, pixels)
    with pytest.raises(JobError) as error:
        placed(file)
    assert error.value.problems == (f"light.sources[0].file: sky.exr: {problem}",)


def test_texels_that_are_no_radiance_are_repaired_with_a_note(tmp_path: Path) -> None:
    pixels = SKY.copy()
    pixels[1, 3, 2], pixels[2, 7] = -0.1, np.nan
    prepared = tiny.prepared(job_of(save(tmp_path, pixels)))
    environment = prepared.lights.sources[0].environment
    assert environment is not None
    expected = SKY.copy()
    expected[1, 3, 2] = 0
    others = np.delete(expected.reshape(-1, 3), 2 * expected.shape[1] + 7, axis=0)
    expected[2, 7] = others.mean(axis=0)
    np.testing.assert_allclose(environment.panorama.pixels, expected, rtol=1e-6)
    kinds = "negative in 1 texel (taken as 0), not finite in 1 texel (taken as the mean of the others)"
    assert f"note: sky.exr: radiance is {kinds}" in scene_lines(prepared)


def test_broken_files_are_refused_with_their_key(tmp_path: Path) -> None:
    good = save(tmp_path, SKY).read_bytes()
    cases = {"cut.exr": good[:-40], "text.exr": b"no image", "sky.png": good, "empty.hdr": b""}
    for name, data in cases.items():
        (tmp_path / name).write_bytes(data)
        with pytest.raises(JobError, match=rf"^tiny: light\.sources\[0\]\.file: {name}: \S.*[^.]$") as error:
            placed(tmp_path / name)
        assert "Traceback" not in str(error.value) and "\n" not in str(error.value)
    with pytest.raises(JobError, match=r"light\.sources\[0\]\.file: none\.exr: no such file"):
        placed(tmp_path / "none.exr")


def with_sun() -> Any:
    """Three texels are 1,000 times as bright as the others."""
    pixels = np.full((64, 128, 3), (0.5, 1.0, 2.0), np.float32)
    pixels[20, 30:33] = 2000.0
    return pixels


def test_suns_become_sources_of_their_own(tmp_path: Path) -> None:
    """They follow the sources of the job, belong to the same group, and the manifest keeps to one."""
    file = save(tmp_path, with_sun())
    sky = {"type": "environment", "file": str(file), "keys": [{"frame": 0}, {"frame": 1, "rotation": 90}]}
    job = tiny.job(
        light={"sources": [sky | {"group": "sky"}, tiny.RED | {"group": "lamp", "axis": "lamps"}]},
        output={"format": "exr"},
    )
    found = lights(job)
    rest, lamp, suns = found.sources
    assert (rest.part_of, lamp.part_of, suns.part_of) == (None, None, 0)
    assert [group.sources for group in found.groups] == [(0, 2), (1,)]
    assert rest.environment is not None and suns.environment is not None
    whole = texel_powers(with_sun())
    assert suns.intensity[0] == pytest.approx([whole[20, 30:33].sum()] * 3, rel=1e-5)
    assert rest.intensity[0] + suns.intensity[0] == pytest.approx([whole.sum()] * 3, rel=1e-5)
    assert (suns.vector == rest.vector).all()
    assert rest.table(1) == {"type": "environment", "file": "sky.exr", "rotation": 90.0, "intensity": [1.0, 1.0, 1.0]}
    assert job_fingerprint(tiny.prepared(job), "scene")
    previewed = lights_of_preview(found, {"light": 1, "lamps": 0})
    assert [path.environment and path.environment.rotation_deg.tolist() for path in previewed.sources] == [
        [90],
        None,
        [90],
    ]


def test_a_map_without_suns_or_with_nothing_else_stays_whole(tmp_path: Path) -> None:
    only = np.zeros((64, 128, 3), np.float32)
    only[20, 30] = 1.0
    for pixels in (SKY, only):
        assert len(lights(job_of(save(tmp_path, pixels))).sources) == 1


@pytest.mark.parametrize(
    ("x", "y", "columns", "rows"),
    [(2, 1, 4, 2), (-3, -1, 20, 9), (4, 0, 8, 4)],
    ids=["cropped", "overscan", "offset"],
)
def test_a_map_is_the_display_window_of_its_file(x: int, y: int, columns: int, rows: int, tmp_path: Path) -> None:
    pixels = np.random.default_rng(3).uniform(0.5, 1.0, (rows, columns, 3)).astype(np.float32)
    window = {"full_x": 5, "full_y": 7, "full_width": 8, "full_height": 4}
    file = write_floats(tmp_path / "sky.exr", pixels, x=x + 5, y=y + 7, **window)
    expected = np.zeros((4, 8, 3), np.float32)
    for row in range(4):
        for column in range(8):
            if 0 <= row - y < rows and 0 <= column - x < columns:
                expected[row, column] = pixels[row - y, column - x]
    np.testing.assert_array_equal(read_environment(file)[0], expected)


@pytest.mark.parametrize(
    ("names", "channels"),
    [
        (["Y"], [0, 0, 0]),
        (["Y", "A"], [0, 0, 0]),
        (["r", "g", "b"], [0, 1, 2]),
        (["Depth.Z", "View.Combined.B", "View.Combined.G", "View.Combined.R"], [3, 2, 1]),
        (["Y", "RY", "BY"], []),
    ],
)
def test_the_channels_of_a_map(names: list[str], channels: list[int]) -> None:
    """Grey, and the first layer with red, green and blue."""
    assert colour_channels(names) == channels
