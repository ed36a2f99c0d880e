"""Pictures of an array at any light position, and sums of light positions."""

from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from support.handmade import cameras, grouped_manifest
from support.movies import DARK

from framearray_cli.array.images import ImageFormat, read_image, write_image
from framearray_cli.array.manifest import Manifest, ManifestLight, array_files
from framearray_cli.array.manifest_toml import read_manifest, write_manifest
from framearray_cli.array.mixtures import constant_sources, is_constant
from framearray_cli.array.pictures import Pictures, Relight
from framearray_cli.base.errors import OutputError

SIZE = (6, 4)


@pytest.fixture
def array(tmp_path: Path) -> Manifest:
    manifest = replace(grouped_manifest(tmp_path), resolution=SIZE, cameras=cameras(2))
    rng = np.random.default_rng(5)
    for file in array_files(manifest):
        write_image(file, rng.random((*SIZE[::-1], 3), np.float32), ImageFormat(half="never"))
    write_manifest(tmp_path, manifest)
    return manifest


def read(manifest: Manifest, name: str) -> np.ndarray:
    return read_image(manifest.directory / name).astype(np.float64)


def test_a_manifest_with_groups_is_read_back(array: Manifest) -> None:
    back = read_manifest(array.directory)
    assert back == array
    assert back.axes == {"light": 3, "lamps": 2}
    assert (back.n_cameras, back.n_lights) == (2, 3)
    assert len(list(array_files(back))) == 2 * (2 + 3 + 2)


def test_groups_ambient_and_background_are_summed(array: Manifest) -> None:
    factor, dim = np.array([0.5, 2.0, 1.0]), np.array([1.0, 0.0, 3.0])
    made = Pictures(array).picture(1, (2, 1), Relight(groups={"lamps": tuple(factor)}, ambient=tuple(dim)))
    i_a = factor * 0.1 + [0.2, 0.2, 0.3] + np.array([0.01, 0.02, 0.03])
    expected = (
        read(array, "room.lamps.c0001.l001.exr") * factor
        + read(array, "room.sun.c0001.l002.exr")
        + read(array, "room.ambient.c0001.exr") * i_a * dim
        + read(array, "room.background.c0001.exr")
    )
    np.testing.assert_allclose(made, expected, rtol=1e-5)
    night = Pictures(array).picture(1, (2, 1), Relight(groups={"background": (0.0, 0.5, 1.0)}))
    day = Pictures(array).picture(1, (2, 1))
    lost = read(array, "room.background.c0001.exr") + read(array, "room.ambient.c0001.exr") * [0.01, 0.02, 0.03]
    np.testing.assert_allclose(day - night, lost * [1.0, 0.5, 0.0], atol=1e-5)


def test_pictures_between_two_positions_are_blended(array: Manifest) -> None:
    pictures = Pictures(array)
    made = pictures.picture(0, (1.25, 0))
    np.testing.assert_allclose(made, 0.75 * pictures.picture(0, (1, 0)) + 0.25 * pictures.picture(0, (2, 0)), rtol=1e-5)
    names = [path.name for path in pictures.files(0, (1.25, 0))]
    assert names == [
        "room.lamps.c0000.l000.exr",
        "room.sun.c0000.l001.exr",
        "room.sun.c0000.l002.exr",
        "room.ambient.c0000.exr",
        "room.background.c0000.exr",
    ]


def test_a_missing_file_and_a_wrong_size_are_named(array: Manifest) -> None:
    pictures = Pictures(array)
    write_image(array.directory / "room.sun.c0000.l000.exr", np.zeros((4, 4, 3), np.float32), ImageFormat())
    with pytest.raises(OutputError, match=r"room\.sun\.c0000\.l000\.exr: expected 6 x 4 pixels, got 4 x 4"):
        pictures.picture(0, (0, 0))
    (array.directory / "room.ambient.c0001.exr").unlink()
    with pytest.raises(OutputError, match=r"room\.ambient\.c0001\.exr: no such file"):
        pictures.picture(1, (0, 0))


PANEL = {"type": "rect", "position": [0.0] * 3, "intensity": [1.0] * 3, "width": 1.0, "two_sided": False}
PANORAMA = {"type": "environment", "file": "sky.exr", "rotation": 0.0, "intensity": [1.0] * 3}
SHINING = {"type": "mesh", "material": "Lamp", "radiance": [1.0] * 3, "two_sided": True}


def lights(*sources: dict[str, Any]) -> tuple[ManifestLight, ...]:
    """One source at each light position."""
    return tuple(replace(DARK, sources=(each,)) for each in sources)


@pytest.mark.parametrize(
    ("source", "change"),
    [
        (PANEL, {"width": 2.0}),
        (PANEL, {"two_sided": True}),
        (PANEL, {"across": [0.0, 0.0, 1.0]}),
        (PANEL, {"sides": 5}),  # a key that shapes of other versions may have
        (PANORAMA, {"rotation": 60.0}),
        (PANORAMA, {"intensity": [1.0, 0.5, 0.5]}),
        (SHINING, {"radiance": [0.0] * 3}),
    ],
)
def test_a_source_that_changes_is_not_constant(source: dict[str, Any], change: dict[str, Any]) -> None:
    assert constant_sources(lights(*[source] * 6)) == [0]
    assert is_constant(lights(*[source] * 6))
    changed = lights(*[source, source | change] * 3)
    assert constant_sources(changed) == []
    assert not is_constant(changed)
    noted = lights(*(source | {"time": f"2026-06-21T{hour:02d}:00"} for hour in range(6)))
    assert is_constant(noted)
