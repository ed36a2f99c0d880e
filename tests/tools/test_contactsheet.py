"""Contact sheets, also of one camera line by line, and choices along the axes of an array."""

from itertools import pairwise
from pathlib import Path

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from support.boxarrays import grouped_manifest, plain_manifest, write_array, write_groups
from support.making import make_sheet
from support.movies import plain
from support.sheets import blocks

from framearray_cli.array.images import area_mean, read_codes, read_image
from framearray_cli.array.manifest import Manifest, image_path
from framearray_cli.array.pictures import Pictures
from framearray_cli.base.colour import srgb8_from_linear
from framearray_cli.base.errors import JobError, OutputError
from framearray_cli.base.views import find_view
from framearray_cli.tools.axes import evenly_spaced, named_places, read_light_indices
from framearray_cli.tools.drawing import SHEET_GREY


@pytest.fixture
def array(tmp_path: Path) -> Manifest:
    return write_array(plain_manifest(tmp_path / "out"))


@settings(max_examples=30)
@given(st.integers(1, 40), st.integers(1, 40), st.data())
def test_the_mean_of_areas_keeps_the_mean_and_flat_images(width: int, height: int, data: st.DataObject) -> None:
    new = data.draw(st.integers(1, width)), data.draw(st.integers(1, height))
    image = np.random.default_rng(width + 100 * height).random((height, width, 3), np.float32)
    small = area_mean(image, *new)
    assert small.shape == (new[1], new[0], 3)
    np.testing.assert_allclose(small.mean((0, 1)), image.mean((0, 1)), rtol=1e-4)
    np.testing.assert_allclose(area_mean(np.full_like(image, 0.3), *new), 0.3, rtol=1e-5)


def test_the_mean_of_areas_is_a_plain_mean_where_pixels_fit() -> None:
    image = np.random.default_rng(1).random((6, 8, 3), np.float32)
    expected = image.reshape(3, 2, 4, 2, 3).mean((1, 3))
    np.testing.assert_allclose(area_mean(image, 4, 3), expected, rtol=1e-5)
    np.testing.assert_allclose(area_mean(image[:1, :3], 2, 1)[0, 0], (image[0, 0] + image[0, 1] / 2) / 1.5, rtol=1e-5)


@pytest.mark.parametrize("suffix", [".png", ".jpg"])
def test_a_sheet_shows_every_image_in_its_place(array: Manifest, tmp_path: Path, suffix: str) -> None:
    target = tmp_path / f"sheet{suffix}"
    seen: list[tuple[int, int]] = []
    made = make_sheet(array.directory, target, progress=lambda done, total: seen.append((done, total)))
    assert (made.cameras, made.lights) == ((0, 1, 2, 3), (0, 1, 2))
    assert seen == [(k, 12) for k in range(1, 13)]
    codes = read_codes(target)
    assert (codes.shape[1], codes.shape[0]) == made.size
    shown = blocks(codes, array.resolution)
    assert [len(row) for row in shown] == [4, 4, 4]
    for l, row in enumerate(shown):
        for c, tile in enumerate(row):
            difference = np.abs(tile.astype(int) - read_codes(image_path(array, c, l)))
            assert difference.mean() <= (0 if suffix == ".png" else 3)  # JPEG blurs the border to the grey
            other = np.abs(tile.astype(int) - read_codes(image_path(array, (c + 1) % 4, l)))
            assert other.mean() > 10, "another image would fail"
    assert not list(tmp_path.glob(".*"))


def test_images_shrink_in_linear_light(array: Manifest, tmp_path: Path) -> None:
    made = make_sheet(array.directory, tmp_path / "s.png", columns=2, rows=2, width=180)
    assert (made.cameras, made.lights) == ((0, 3), (0, 2))
    assert made.size[0] <= 180
    plain = make_sheet(array.directory, tmp_path / "s.exr", columns=2, rows=2, width=60)
    assert plain.size == (60, 40)
    wanted = area_mean(read_image(image_path(array, 0, 2)), 30, 20)
    np.testing.assert_allclose(read_image(tmp_path / "s.exr")[20:, :30], wanted, rtol=1e-3, atol=1e-4)


def test_exposure_brightens_images(array: Manifest, tmp_path: Path) -> None:
    make_sheet(array.directory, tmp_path / "s.png", exposure=-2.0)
    expected = srgb8_from_linear(read_image(image_path(array, 0, 0)) / 4)
    assert np.abs(blocks(read_codes(tmp_path / "s.png"), array.resolution)[0][0].astype(int) - expected).max() <= 1


@pytest.mark.parametrize("name", ["neutral", "agx"])
def test_a_view_shows_images_with_their_exposure(array: Manifest, tmp_path: Path, name: str) -> None:
    view = find_view(name)
    make_sheet(array.directory, tmp_path / "s.png", exposure=1.0, view=view)
    expected = view.codes(read_image(image_path(array, 0, 0)) * 2)
    assert np.abs(blocks(read_codes(tmp_path / "s.png"), array.resolution)[0][0].astype(int) - expected).max() <= 1
    with pytest.raises(OutputError, match=r"a view is only for PNG and JPEG; \.exr keeps the radiance"):
        make_sheet(array.directory, tmp_path / "s.exr", view=view)


def test_labels_and_counts_are_drawn(array: Manifest, tmp_path: Path) -> None:
    make_sheet(array.directory, tmp_path / "s.png")
    codes = read_codes(tmp_path / "s.png")
    written = (codes != SHEET_GREY).any(-1)
    assert written[:50].any(), "the head line"
    assert written[55:75].any(), "cameras along the top"
    assert written[85:, 20:70].any(), "lights along the side"
    assert not written[:15].any() and not written[-20:].any() and not written[:, :15].any(), "margins"


def test_groups_are_summed_and_another_axis_may_be_at_the_side(tmp_path: Path) -> None:
    array = write_groups(grouped_manifest(tmp_path / "out"))
    made = make_sheet(array.directory, tmp_path / "s.exr", at=["lamps=0"], rows=3)
    assert made.lights == (0, 1, 2)
    image = read_image(tmp_path / "s.exr")
    np.testing.assert_allclose(image[40:80, :60], Pictures(array).picture(0, (1, 0)), rtol=2e-3)
    made = make_sheet(array.directory, tmp_path / "t.exr", side="lamps", at=["light=2"])
    assert made.lights == (0, 1)
    image = read_image(tmp_path / "t.exr")
    np.testing.assert_allclose(image[40:80, 60:120], Pictures(array).picture(1, (2, 1)), rtol=2e-3)
    make_sheet(array.directory, tmp_path / "s.png")
    with pytest.raises(JobError, match="--at lamps: expected one place, as the rows show light, got 2"):
        make_sheet(array.directory, tmp_path / "u.exr", at=["lamps=all"])
    with pytest.raises(JobError, match="--light: expected one place, as the rows show lamps, got 3"):
        make_sheet(array.directory, tmp_path / "u.exr", side="lamps", light="0-2")


def test_columns_and_rows_may_be_named(array: Manifest, tmp_path: Path) -> None:
    made = make_sheet(array.directory, tmp_path / "s.exr", cameras="3,0-1", light="last,0", columns=1, rows=1)
    assert (made.cameras, made.lights) == ((3, 0, 1), (2, 0))
    corner = read_image(tmp_path / "s.exr")[:40, :60]
    np.testing.assert_allclose(corner, Pictures(array).picture(3, (2,)), rtol=2e-3)
    assert make_sheet(array.directory, tmp_path / "t.exr", at=["light=1"]).lights == (1,)


@pytest.mark.parametrize(
    ("options", "message"),
    [
        ({"side": "lamps"}, '--side: expected one of the axes light, got "lamps"'),
        ({"at": ["light=3"]}, "--at light: expected one of 3 light positions"),
        ({"cameras": "0-4"}, "--cameras: expected one of 4 camera positions"),
        ({"width": 100}, "--width: 100 pixels are too few for 4 columns; try fewer --columns"),
    ],
)
def test_what_cannot_be_drawn_is_reported(array: Manifest, tmp_path: Path, options: dict, message: str) -> None:
    with pytest.raises(JobError, match=message):
        make_sheet(array.directory, tmp_path / "s.png", **options)
    assert not (tmp_path / "s.png").exists()


def test_files_that_cannot_be_written_or_read_are_named(array: Manifest, tmp_path: Path) -> None:
    with pytest.raises(OutputError, match=r"sheet\.gif: expected a \.png, \.jpg, \.exr or \.tif"):
        make_sheet(array.directory, tmp_path / "sheet.gif")
    with pytest.raises(OutputError, match=r"exposure changes only PNG and JPEG; \.exr keeps the radiance"):
        make_sheet(array.directory, tmp_path / "sheet.exr", exposure=1.0)
    image_path(array, 2, 1).write_bytes(b"")
    with pytest.raises(OutputError, match=r"box\.c0002\.l001\.png: .*"):
        make_sheet(array.directory, tmp_path / "sheet.png")
    assert not list(tmp_path.glob("*sheet*"))


@pytest.fixture
def noisy_array(tmp_path: Path) -> Manifest:
    noise = np.random.default_rng(3).random((3, 20, 48, 64, 3), np.float32)
    return plain(tmp_path / "out", 3, 20, "png", lambda c, l: 0.3 + 0.7 * noise[c, l])


def test_every_light_position_in_its_line(noisy_array: Manifest, tmp_path: Path) -> None:
    made = make_sheet(noisy_array.directory, tmp_path / "a.png", wrap=True, columns=5, rows=4)
    assert (made.cameras, made.lights) == ((1,), tuple(range(20)))
    shown = blocks(read_codes(tmp_path / "a.png"), noisy_array.resolution)
    assert [len(row) for row in shown] == [5] * 4
    for l in range(20):
        np.testing.assert_array_equal(shown[l // 5][l % 5], read_codes(image_path(noisy_array, 1, l)))


def test_what_is_left_of_the_last_line_is_blank(noisy_array: Manifest, tmp_path: Path) -> None:
    make_sheet(noisy_array.directory, tmp_path / "a.png", wrap=True, cameras="2", light="0-5,19,7", columns=6)
    shown = blocks(read_codes(tmp_path / "a.png"), noisy_array.resolution)
    for k, l in enumerate((0, 1, 2, 3, 4, 5, 19, 7)):
        np.testing.assert_array_equal(shown[k // 6][k % 6], read_codes(image_path(noisy_array, 2, l)))
    assert (np.array(shown[1][2:]) == SHEET_GREY).all()
    made = make_sheet(noisy_array.directory, tmp_path / "a.tif", wrap=True, cameras="2", light="0-4", columns=3)
    assert made.size == (3 * 64, 2 * 48)
    image = read_image(tmp_path / "a.tif")
    assert not image[48:, 128:].any() and image[48:, :128].all()


def test_as_many_as_fit_are_chosen_evenly(noisy_array: Manifest, tmp_path: Path) -> None:
    made = make_sheet(noisy_array.directory, tmp_path / "a.png", wrap=True, columns=2, rows=2)
    assert made.lights == (0, 6, 13, 19)
    assert make_sheet(noisy_array.directory, tmp_path / "b.png", wrap=True, light="3").lights == (3,)


def test_several_camera_positions_are_refused(noisy_array: Manifest, tmp_path: Path) -> None:
    with pytest.raises(JobError, match=r"--wrap: expected one camera position, got 2; give one with --cameras"):
        make_sheet(noisy_array.directory, tmp_path / "a.png", wrap=True, cameras="0-1")


def test_evenly_spaced_indices_have_both_ends() -> None:
    assert evenly_spaced(3, 8) == (0, 1, 2)
    assert evenly_spaced(192, 3) == (0, 96, 191)
    assert evenly_spaced(7, 1) == (3,)
    for n, most in ((24, 12), (192, 12), (48, 8), (9, 8)):
        chosen = evenly_spaced(n, most)
        steps = {b - a for a, b in pairwise(chosen)}
        assert (len(chosen), chosen[0], chosen[-1]) == (most, 0, n - 1)
        assert max(steps) - min(steps) <= 1


def test_an_axis_goes_by_its_name_or_by_that_of_a_group() -> None:
    axes, groups = {"light": 3, "lamps": 2}, {"sun": "light", "ceiling": "lamps", "rest": "light"}
    assert named_places(axes, groups, None, ["sun=0-1", "lamps=last"]) == {
        "light": ("--at sun", "0-1"),
        "lamps": ("--at lamps", "last"),
    }
    with pytest.raises(JobError, match="got twice the same axis"):
        named_places(axes, groups, None, ["sun=0", "rest=1"])


def test_light_indices_combine_the_axes() -> None:
    manifest = grouped_manifest()
    assert dict(manifest.axes) == {"light": 3, "lamps": 2}
    assert read_light_indices(manifest, None, (), "50%") == [(1, 1)]
    assert read_light_indices(manifest, "0,-1", ["lamps=all"], "50%") == [(0, 0), (0, 1), (2, 0), (2, 1)]
    assert len(read_light_indices(manifest, None, (), "all")) == 6
    assert read_light_indices(plain_manifest(), "last", (), "50%") == [(2,)]


@pytest.mark.parametrize(
    ("light", "at", "message"),
    [
        (None, ["moon=1"], r"--at: expected AXIS=PLACES with one of the axes light \(0 to 2\), lamps \(0 to 1\)"),
        (None, ["lamps"], "--at: expected AXIS=PLACES"),
        (None, ["lamps=0", "lamps=1"], "--at: .* got twice the same axis"),
        (None, ["lamps=2"], r"--at lamps: expected one of 2 positions of lamps \(0 to 1, or -2 to -1\), got 2"),
        ("0", ["light=1"], "--light: expected either this or --at light"),
    ],
)
def test_unknown_axes_are_named(light: str | None, at: list[str], message: str) -> None:
    with pytest.raises(JobError, match=message):
        read_light_indices(grouped_manifest(), light, at, "all")
