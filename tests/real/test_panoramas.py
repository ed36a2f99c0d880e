"""Panoramas of a public set, as they are in the wild: lossy compression leaves negative texels."""

from pathlib import Path

import numpy as np
import pytest
from support import tiny
from support.scenes import suites_folder

from framearray_cli.base.colour import LUMINANCE
from framearray_cli.base.openimage import read_rgb
from framearray_cli.scene.paths.paths import lights
from framearray_cli.tools.mixing import read_map

FILES = sorted((suites_folder() / "hdri").glob("*.exr"))
pytestmark = pytest.mark.skipif(not FILES, reason="no panoramas; set FRAMEARRAY_SUITES to the folder of test suites")


@pytest.mark.parametrize("file", FILES, ids=lambda file: file.stem)
def test_a_panorama_with_negative_texels_lights_a_scene_with_its_own_flux(file: Path) -> None:
    """Independent of the reader: the sum over all texels by the cosine of their latitude."""
    source = {"type": "environment", "file": str(file), "keys": [{"frame": 0}]}
    found = lights(tiny.job(light={"frames": 1, "sources": [source]}))
    (note,) = found.notes
    assert note.startswith(f"{file.name}: radiance is negative in ")
    texels = read_rgb(file)
    height, width, _ = texels.shape
    latitude = (np.arange(height) + 0.5) / height * np.pi - np.pi / 2
    solid_angle = np.cos(latitude) * (np.pi / height) * (2 * np.pi / width)
    flux = (np.maximum(texels, 0) @ LUMINANCE).sum(axis=1, dtype=np.float64) @ solid_angle
    assert sum(path.intensity[0, 1] for path in found.sources) == pytest.approx(flux, rel=1e-3)
    assert read_map(file)[1] == note
