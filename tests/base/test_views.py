"""Views against reference implementations, and their errors."""

from pathlib import Path
from typing import Any

import numpy as np
import pytest

from framearray_cli.base.errors import JobError
from framearray_cli.base.views import ACES, ACES_CONFIG, LINEAR_REC709, SRGB, find_view

GREYS = np.repeat(np.float32([0, 0.02, 0.18, 0.5, 1, 2, 4, 10, 100, 1000])[None, :, None], 3, axis=2)
CONFIG = """ocio_profile_version: 2
roles:
  default: lin
  scene_linear: lin
displays:
  Screen:
    - !<View> {name: Half, colorspace: half}
    - !<View> {name: Same, colorspace: lin}
colorspaces:
  - !<ColorSpace>
    name: lin
    aliases: [SPACES]
  - !<ColorSpace>
    name: half
    from_scene_reference: !<MatrixTransform> {matrix: [0.5, 0, 0, 0, 0, 0.5, 0, 0, 0, 0, 0.5, 0, 0, 0, 0, 1]}
"""


def image(seed: int = 0) -> Any:
    return np.random.default_rng(seed).random((12, 16, 3), np.float32) * 1.5


def colours() -> Any:
    """A grid from black over saturated to bright colours, and some out of gamut, (n, 1, 3)."""
    levels = [-0.05, 0, 1e-4, 0.003, 0.02, 0.06, 0.1, 0.18, 0.5, 0.79, 1, 2, 7, 20, 500]
    return np.stack(np.meshgrid(levels, levels, levels), -1).reshape(-1, 1, 3).astype(np.float32)


def curve(x: float) -> float:
    """The sRGB curve of IEC 61966-2-1 as a code."""
    x = min(max(x, 0.0), 1.0)
    return 255 * (12.92 * x if x <= 0.0031308 else 1.055 * x ** (1 / 2.4) - 0.055)


def neutral(rgb: Any) -> list[float]:
    """Khronos PBR neutral, as its specification words it, of one colour that is not negative."""
    x = min(rgb)
    f = x - x * x / (4 * 0.04) if x <= 2 * 0.04 else 0.04
    p = max(rgb) - f
    if p <= 0.76:
        return [float(value - f) for value in rgb]
    new = 1 - (1 - 0.76) ** 2 / (p + 1 - 2 * 0.76)
    g = 1 / (0.15 * (p - new) + 1)
    return [float((value - f) * new / p * g + new * (1 - g)) for value in rgb]


def agx(rgb: Any) -> list[float]:
    """AgX of one colour, as three.js and Filament compute it, in double precision; matrices by columns."""
    wide = np.array([[1.6605, -0.1246, -0.0182], [-0.5876, 1.1329, -0.1006], [-0.0728, -0.0083, 1.1187]]).T
    inset = np.array(
        [
            [0.856627153315983, 0.137318972929847, 0.11189821299995],
            [0.0951212405381588, 0.761241990602591, 0.0767994186031903],
            [0.0482516061458583, 0.101439036467562, 0.811302368396859],
        ]
    ).T
    outset = np.array(
        [
            [0.899796955911611, 0.11142098895748, 0.11142098895748],
            [0.0871996192028351, 0.875575586156966, 0.0871996192028349],
            [0.013003424885555, 0.0130034248855548, 0.801379391839686],
        ]
    ).T
    mixed = np.maximum(inset @ np.maximum(np.linalg.inv(wide) @ rgb, 0), 1e-10)
    x = np.clip((np.log2(mixed) + 12.47393) / (4.026069 + 12.47393), 0, 1)
    x = 15.5 * x**6 - 40.14 * x**5 + 31.96 * x**4 - 6.868 * x**3 + 0.4298 * x**2 + 0.1191 * x - 0.00232
    shown: list[float] = (wide @ np.maximum(np.linalg.inv(outset) @ x, 0) ** 2.2).tolist()
    return shown


@pytest.mark.parametrize(("name", "reference"), [("neutral", neutral), ("agx", agx)])
def test_tone_mappers_are_within_one_code_of_their_definitions(name: str, reference: Any) -> None:
    view, grid = find_view(name), colours()
    kept = grid.copy()
    known = np.maximum(grid, 0) if name == "neutral" else grid  # neutral is defined for colours that are not negative
    expected = np.array([[curve(value) for value in reference(rgb)] for rgb in known[:, 0].astype(np.float64)])
    assert np.abs(view.codes(grid)[:, 0] - expected).max() <= 1
    assert np.abs(view.encode(grid)[:, 0] * 255 - expected).max() <= 0.1
    np.testing.assert_array_equal(grid, kept)


@pytest.mark.parametrize("name", ["neutral", "agx"])
def test_tone_mappers_keep_order_and_show_infinite_light_as_white(name: str) -> None:
    codes = find_view(name).encode(GREYS)[0]
    assert (np.diff(codes[:8, 0]) > 0).all() and np.ptp(codes, axis=1).max() < 0.004
    white = find_view(name).codes(np.full((1, 1, 3), np.inf, np.float32))
    assert white.min() >= 253


@pytest.mark.parametrize("name", ["neutral", "agx"])
def test_tone_mappers_give_a_pixel_the_same_bits_in_any_picture(name: str) -> None:
    view, whole = find_view(name), image(4)
    parts = np.concatenate([view.encode(whole[:5]), view.encode(whole[5:])])
    np.testing.assert_array_equal(view.encode(whole), parts)


def test_aces_rolls_off() -> None:
    """White stays below 1, greys keep their order, highlights that sRGB clips differ; black is black."""
    codes = find_view("aces").encode(GREYS)[0, :, 0]
    plain_codes = SRGB.encode(GREYS)[0, :, 0]
    assert codes[0] == pytest.approx(0, abs=1e-3)
    assert codes[4] < 0.75 and plain_codes[4] > 0.9999  # radiance 1
    assert (np.diff(codes) > 0).all() and codes[-1] <= 1
    assert (np.diff(plain_codes[4:]) < 1e-6).all()
    assert np.abs(codes - plain_codes)[1:6].max() > 0.1


def test_aces_is_that_of_opencolorio() -> None:
    """ACES 2.0 shows middle grey at 10 of 100 nits, which the sRGB curve codes as 0.349."""
    grey = find_view("aces").encode(np.full((1, 1, 3), 0.18, np.float32))
    np.testing.assert_allclose(grey, 1.055 * 0.1 ** (1 / 2.4) - 0.055, atol=2e-3)


def test_openimageio_computes_the_same_aces() -> None:
    """It carries an OpenColorIO of its own, whose version may differ."""
    import OpenImageIO as oiio

    rng = np.random.default_rng(3)
    bright = np.exp(rng.normal(-1.5, 1.5, (60, 80, 1))).astype(np.float32)
    colours = bright * rng.uniform(0, 1, (60, 80, 3)).astype(np.float32)
    kept = colours.copy()
    buffer = oiio.ImageBuf(colours)
    theirs = oiio.ImageBufAlgo.ociodisplay(buffer, *ACES, LINEAR_REC709[0], colorconfig=ACES_CONFIG)
    if theirs.has_error:
        pytest.skip(f"the OpenColorIO inside OpenImageIO is older than ACES 2.0: {theirs.geterror()}")
    expected = np.rint(255 * np.clip(theirs.get_pixels(oiio.FLOAT), 0, 1))
    codes = find_view("aces").codes(colours)
    assert np.abs(codes - expected).max() <= 1
    np.testing.assert_array_equal(colours, kept)  # converted in a copy
    brighter = find_view("aces").codes(colours * 1.05)
    assert np.abs(brighter - expected).max() > 1  # the comparison sees a twentieth of brightness


def test_views_of_a_configuration(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    config = tmp_path / "studio.ocio"
    config.write_text(CONFIG.replace("SPACES", "lin_rec709"), encoding="utf-8")
    monkeypatch.setenv("OCIO", str(config))
    for name in ("Half", "Screen/Half"):
        np.testing.assert_allclose(find_view(name).encode(image()), np.clip(image() / 2, 0, 1), atol=1e-6)
    np.testing.assert_allclose(find_view("Same").encode(image()), np.clip(image(), 0, 1), atol=1e-6)
    assert find_view("aces").encode(GREYS)[0, 4, 0] == pytest.approx(0.707, abs=0.01)  # from the one built in
    with pytest.raises(
        JobError,
        match=r"expected srgb, neutral, agx, aces or a view of \$OCIO, .*Screen/Half; Screen/Same.*, got \"Film\"",
    ):
        find_view("Film")


def test_what_a_configuration_lacks_is_reported(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    config = tmp_path / "studio.ocio"
    config.write_text(CONFIG.replace("SPACES", "other"), encoding="utf-8")
    monkeypatch.setenv("OCIO", str(config))
    with pytest.raises(JobError, match=r'no colour space "Linear Rec\.709'):
        find_view("Half")
    config.write_text(
        CONFIG.replace("SPACES", "lin_rec709").replace("colorspace: half", "colorspace: film"), encoding="utf-8"
    )
    with pytest.raises(JobError, match=r"--view: .*studio\.ocio: Screen/Half: .*film"):
        find_view("Half")
    config.write_text("no: configuration", encoding="utf-8")
    with pytest.raises(JobError, match=r"--view: \$OCIO: .*studio\.ocio: cannot be read"):
        find_view("Half")
    monkeypatch.setenv("OCIO", str(tmp_path / "none.ocio"))
    with pytest.raises(JobError, match=r"--view: \$OCIO: .*none\.ocio: cannot be read"):
        find_view("Half")


def test_views_of_the_configuration_inside_opencolorio(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.delenv("OCIO", raising=False)
    white = find_view("Un-tone-mapped").encode(np.ones((1, 1, 3), np.float32))
    np.testing.assert_allclose(white, 1.0, atol=1e-4)
    with pytest.raises(
        JobError,
        match=r"--view: expected srgb, neutral, agx, aces or a view of ocio://default, as \$OCIO is not set \(sRGB",
    ):
        find_view("filmic")
