"""Illuminance in false colour: of pictures over reflectivity, with iso-lines and a scale."""

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from support.making import make_sheet
from support.movies import plain

from framearray_cli.array.images import ImageFormat, read_codes, read_image, write_image, write_layers
from framearray_cli.array.manifest import Manifest, image_path, layers_path
from framearray_cli.array.manifest_toml import write_manifest
from framearray_cli.base.openimage import read_texts
from framearray_cli.base.ramp import ramp
from framearray_cli.base.units import LUMENS_PER_WATT
from framearray_cli.tools.contactsheet import _lux_codes, _step
from framearray_cli.tools.drawing import SHEET_GREY

SIZE = (24, 16)
LUX = np.linspace(0, 900, SIZE[0], dtype=np.float32)  # from left to right
GREEN = np.float32([0.1, 0.7, 0.2])


def lit(folder: Path) -> Manifest:
    """An array of one camera and two light positions, the second twice as bright; its upper rows are the background."""
    manifest = replace(
        plain(folder, 1, 2), resolution=SIZE, images="a.l{light:03d}.exr", layers="a.layers.exr", fps=24.0
    )
    reflectivity = np.zeros((SIZE[1], SIZE[0], 3), np.float32)
    reflectivity[4:] = GREEN
    for l in range(2):
        radiance = (l + 1) * reflectivity * LUX[:, None] / np.float32(np.pi * LUMENS_PER_WATT)
        write_image(image_path(manifest, 0, l), radiance, ImageFormat(half="never"))
    write_layers(layers_path(manifest, 0), {f"reflectivity.{x}": reflectivity[..., k] for k, x in enumerate("RGB")})
    write_manifest(folder, manifest)
    return manifest


def test_a_sheet_of_numbers_is_lux(tmp_path: Path) -> None:
    lit(tmp_path)
    make_sheet(tmp_path, tmp_path / "lux.exr", lux=1000.0)
    found = read_image(tmp_path / "lux.exr").reshape(2, SIZE[1], SIZE[0], 3)
    np.testing.assert_allclose(
        found[:, 4:, :, 1], np.broadcast_to([[LUX], [2 * LUX]], (2, 12, 24)), rtol=1e-3
    )  # of halves
    assert (found[:, :4] == 0).all()
    assert read_texts(tmp_path / "lux.exr", "colorInteropID") == {"colorInteropID": "data"}


def test_a_sheet_in_false_colour_has_a_scale(tmp_path: Path) -> None:
    lit(tmp_path)
    made = make_sheet(tmp_path, tmp_path / "lux.png", lux=1000.0)
    plain_sheet = make_sheet(tmp_path, tmp_path / "plain.png")
    assert made.size[1] > plain_sheet.size[1], "the scale is below the pictures"
    codes = {tuple(code) for code in read_codes(tmp_path / "lux.png").reshape(-1, 3).tolist()}
    assert {tuple(ramp(np.float32(x / 1000)).tolist()) for x in LUX[[2, 7, 20]]} <= codes


@pytest.mark.parametrize(("most", "step"), [(1000, 200), (300, 50), (5000, 1000), (8, 2), (0.4, 0.1)])
def test_lines_lie_at_round_values(most: float, step: float) -> None:
    assert _step(most) == pytest.approx(step)


def test_lines_run_where_the_illuminance_passes_their_values() -> None:
    lux = np.tile(np.linspace(0, 1000, 201, dtype=np.float32), (9, 1))
    lux[:, 180:] = np.nan
    codes = _lux_codes(lux, 1000.0)
    line = (codes != ramp(np.nan_to_num(lux) / 1000)).any(axis=-1)
    assert (line == line[0]).all()
    at = lux[0, np.flatnonzero(line[0])]
    np.testing.assert_allclose(at[np.isfinite(at)], [200, 400, 600, 800], atol=5)
    assert (codes[:, 180:] == SHEET_GREY).all()
