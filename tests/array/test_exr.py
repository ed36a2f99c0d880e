"""EXR files: attributes, Cryptomatte, the bytes of uncompressed files, and what a second library reads."""

import json
from fractions import Fraction
from pathlib import Path
from typing import Any

import numpy as np
import OpenImageIO as oiio
import pytest
from support.boxarrays import EYES

from framearray_cli.array import images
from framearray_cli.array.cryptomatte import attributes_of, channels_of, id_bits, ids_of, murmur3
from framearray_cli.array.exr import exr_camera_from_world, exr_ndc_from_world, frame_attributes
from framearray_cli.array.images import ImageFormat, read_image, write_image, write_layers
from framearray_cli.base.lens import Lens
from framearray_cli.base.units import frame_rate


def noisy(height: int = 12, width: int = 17, seed: int = 0) -> np.ndarray:
    return np.random.default_rng(seed).uniform(0, 1.5, (height, width, 3)).astype(np.float32)


def looking_down_x() -> np.ndarray:
    """A camera at (10, 2, 3) that looks along +x, y up: its -z is x, so its x is z."""
    world_from_camera = np.eye(4)
    world_from_camera[:3, 0] = [0, 0, 1]
    world_from_camera[:3, 1] = [0, 1, 0]
    world_from_camera[:3, 2] = [-1, 0, 0]
    world_from_camera[:3, 3] = [10, 2, 3]
    return world_from_camera


def test_world_to_camera_is_left_handed_along_plus_z() -> None:
    camera_from_world = exr_camera_from_world(looking_down_x())
    # 5 ahead, 1 to the right, 2 up
    np.testing.assert_allclose(camera_from_world @ [15, 4, 4, 1], [1, 2, 5, 1], atol=1e-12)
    assert np.linalg.det(camera_from_world[:3, :3]) == pytest.approx(-1)


@pytest.mark.parametrize("corner", [(0, 0), (1, 0), (0, 1), (1, 1), (0.5, 0.5)])
def test_world_to_ndc_finds_the_corners_of_the_image(corner: tuple[float, float]) -> None:
    ndc_from_world = exr_ndc_from_world(looking_down_x(), Lens(fov=60), 400, 300)
    half_height = np.tan(np.radians(30))
    half_width = half_height * 400 / 300
    x, y = 2 * corner[0] - 1, 1 - 2 * corner[1]  # NDC has y downwards
    for distance in (0.5, 20):
        point = looking_down_x() @ [distance * x * half_width, distance * y * half_height, -distance, 1]
        ndc = ndc_from_world @ point
        np.testing.assert_allclose(ndc[:2] / ndc[3], corner, atol=1e-12)
        assert ndc[3] == pytest.approx(distance)


def test_exr_attributes_have_standard_names_types_and_row_vectors(tmp_path: Path) -> None:
    attributes = frame_attributes(
        world_from_camera=looking_down_x(), lens=Lens(fov=60), resolution=(17, 12), fps=23.976, c=3, l=5
    )
    attributes["framearray:ambient"] = (0.1, 0.2, 0.3)
    write_image(tmp_path / "a.exr", noisy(), ImageFormat(), attributes)
    spec = oiio.ImageInput.open(str(tmp_path / "a.exr")).spec()
    kept = {item.name: (str(item.type), item.value) for item in spec.extra_attribs}
    kind, rate = kept["framesPerSecond"]
    assert kind.startswith("rational")  # older releases print it as rational2i
    assert rate == (24000, 1001)
    assert kept["framearray:camera"] == ("int", 3)
    assert kept["framearray:light"] == ("int", 5)
    assert kept["framearray:fov"] == ("float", 60)
    assert kept["framearray:ambient"][1] == pytest.approx((0.1, 0.2, 0.3))
    kind, rows = kept["worldToCamera"]
    assert kind == "matrix"
    point = np.array([15, 4, 4, 1]) @ np.reshape(rows, (4, 4))  # rows from the left, as Imath does
    np.testing.assert_allclose(point, [1, 2, 5, 1], atol=1e-5)
    kind, rows = kept["worldToNDC"]
    assert kind == "matrix"
    np.testing.assert_allclose(
        np.reshape(rows, (4, 4)).T, exr_ndc_from_world(looking_down_x(), Lens(fov=60), 17, 12), rtol=1e-6, atol=1e-5
    )


@pytest.mark.parametrize(
    ("fps", "expected"),
    [
        (24, "24"),
        (25.0, "25"),
        (23.976, "24000/1001"),
        (23.98, "24000/1001"),
        (29.97, "30000/1001"),
        (59.94, "60000/1001"),
        (12.5, "25/2"),
        (Fraction(24000, 1001), "24000/1001"),
    ],
)
def test_frame_rates_are_exact(fps: float, expected: str) -> None:
    assert frame_rate(fps) == Fraction(expected)


@pytest.mark.parametrize("fps", [0, -24, float("nan"), float("inf")])
def test_impossible_frame_rates_are_refused(fps: float) -> None:
    with pytest.raises(ValueError, match="positive"):
        frame_rate(fps)


@pytest.mark.parametrize(
    "lens",
    [Lens(fov=50, shift=(0.2, -0.1), pixel_aspect=1.3), Lens(type="orthographic", height=3.0, shift=(0.1, 0.3))],
)
def test_the_matrix_of_other_lenses_projects_as_they_do(lens: Lens) -> None:
    size, pose = (400, 300), looking_down_x()
    points = np.random.default_rng(1).uniform([-2, -1, -9], [2, 1, -1], (20, 3))
    x, y, _, w = exr_ndc_from_world(pose, lens, *size) @ pose @ np.c_[points, np.ones(20)].T
    places = np.stack([x, y], -1) / w[:, None] * size
    np.testing.assert_allclose(places, lens.project(size, points)[0], atol=1e-9)


def test_images_say_which_lens_they_were_seen_with() -> None:
    def said(lens: Lens) -> dict[str, object]:
        found = frame_attributes(world_from_camera=looking_down_x(), lens=lens, resolution=(40, 20), fps=24, c=0)
        return {name: value for name, value in found.items() if name not in ("worldToCamera", "worldToNDC")}

    common = said(Lens(fov=60)).items() - {("framearray:fov", 60.0)}
    assert said(Lens(type="panorama")).items() - common == {("framearray:type", "panorama")}
    assert said(Lens(type="orthographic", height=3.0, shift=(0.5, 0.25))).items() - common == {
        ("framearray:type", "orthographic"),
        ("framearray:height", 3.0),
        ("framearray:shift_x", 0.5),
        ("framearray:shift_y", 0.25),
    }
    assert ("PixelAspectRatio", 2.0) in said(Lens(fov=60, pixel_aspect=2.0)).items()
    everywhere = frame_attributes(
        world_from_camera=looking_down_x(), lens=Lens(type="panorama"), resolution=(40, 20), fps=24, c=0
    )
    assert "worldToNDC" not in everywhere


RNG = np.random.default_rng(3)
ATTRIBUTES = frame_attributes(
    world_from_camera=EYES[1], lens=Lens(fov=47.5), resolution=(7, 5), fps=Fraction(30000, 1001), c=12, l=345,
    group="Lamp über dem Tisch", software="framearray 0",
)  # fmt: skip
OTHERS: dict[str, Any] = {
    "framearray:a long name of more than thirty-one bytes": "x" * 300,
    "framearray:empty": "",
    "framearray:negative": -7,
    "framearray:place": (1.5, -2.0, 1e-9),
    "PixelAspectRatio": 1.3,
}


@pytest.mark.parametrize("shape", [(1, 1, 3), (5, 7, 3), (16, 33, 3), (300, 1, 3)])
@pytest.mark.parametrize("half", ["always", "never"])
@pytest.mark.parametrize("attributes", [{}, ATTRIBUTES, ATTRIBUTES | OTHERS])
@pytest.mark.parametrize("more", [(), ("error", "difference")])
def test_the_bytes_are_those_of_openimageio(
    shape: Any, half: Any, attributes: Any, more: Any, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    image = RNG.uniform(-10, 100, shape).astype(np.float32)
    layers = {name: RNG.normal(size=shape).astype(np.float32) for name in more}
    stored = ImageFormat(half=half)
    write_image(tmp_path / "plain.exr", image, stored, attributes, layers)
    with monkeypatch.context() as patched:
        patched.setattr(images, "is_plain", lambda attributes: False)
        write_image(tmp_path / "theirs.exr", image, stored, attributes, layers)
    assert (tmp_path / "plain.exr").read_bytes() == (tmp_path / "theirs.exr").read_bytes()


def test_halves_and_strided_pixels_are_read_back(tmp_path: Path) -> None:
    image = RNG.uniform(0, 100, (6, 3, 9)).astype(np.float16).transpose(0, 2, 1)
    write_image(tmp_path / "a.exr", image, ImageFormat(), ATTRIBUTES)
    np.testing.assert_array_equal(read_image(tmp_path / "a.exr"), image.astype(np.float32))


def test_attributes_that_openimageio_renames_are_left_to_it(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(images, "encode_plain_exr", None)
    write_image(tmp_path / "a.exr", np.ones((2, 2, 3), np.float32), ImageFormat(), {"ImageDescription": "a table"})
    assert read_image(tmp_path / "a.exr").all()


@pytest.mark.parametrize("compression", ["none", "zip", "piz", "dwaa"])
@pytest.mark.parametrize("half", ["auto", "never"])
def test_openexr_reads_images(tmp_path: Path, compression: str, half: str) -> None:
    OpenEXR = pytest.importorskip("OpenEXR", reason="OpenEXR is not installed (extra dev)")
    image = np.random.default_rng(1).random((5, 7, 3), np.float32) * 4
    write_image(tmp_path / "a.exr", image, ImageFormat(compression=compression, half=half), ATTRIBUTES)
    with OpenEXR.File(str(tmp_path / "a.exr")) as file:
        header, pixels = file.header(), file.channels()["RGB"].pixels
        assert pixels.dtype == (np.float16 if half == "auto" else np.float32)
        wanted = image.astype(pixels.dtype)
        np.testing.assert_allclose(pixels, wanted, rtol=0.1 if compression == "dwaa" else 0)  # dwaa loses a little
        for name in ("worldToCamera", "worldToNDC"):
            rows = np.transpose(ATTRIBUTES[name])  # the file multiplies row vectors
            np.testing.assert_allclose(np.reshape(header[name], (4, 4)), rows, rtol=1e-5, atol=1e-6)
        assert header["framesPerSecond"] == Fraction(30000, 1001)
        assert (header["framearray:camera"], header["framearray:light"]) == (12, 345)
        assert header["framearray:fov"] == 47.5 and header["Software"] == "framearray 0"
        x, y, _, w = np.array([*(EYES[1] @ [0, 0, -2.0, 1])[:3], 1]) @ np.reshape(header["worldToNDC"], (4, 4))
        assert (x / w, y / w) == pytest.approx((0.5, 0.5), abs=1e-6), "a point on the axis is in the middle"


def test_openexr_reads_layers(tmp_path: Path) -> None:
    OpenEXR = pytest.importorskip("OpenEXR", reason="OpenEXR is not installed (extra dev)")
    values = np.random.default_rng(2).random((7, 9), np.float32)
    layers = {"normal.X": values, "normal.Y": -values, "depth.Z": values * 1e5, "samples": np.round(values * 9)}
    write_layers(tmp_path / "a.exr", layers, ATTRIBUTES)
    with OpenEXR.File(str(tmp_path / "a.exr"), separate_channels=True) as file:
        found = {name: channel.pixels for name, channel in file.channels().items()}
    assert set(found) == set(layers)
    for name, pixels in found.items():
        assert pixels.dtype == (np.float32 if name in ("depth.Z", "samples") else np.float16)
        np.testing.assert_array_equal(pixels, layers[name].astype(pixels.dtype))


# From the tests of the reference implementation.
KNOWN = {
    "hello": 6.0705627102400005616e-17,
    "cube": -4.08461912519e15,
    "sphere": 2.79018604383e15,
    "plane": 3.66557617593e-11,
    "равнина": -1.3192631212399999468e-25,
    "mädchen": 6.2361298211599995797e25,
}


def test_ids_are_those_of_the_reference_implementation() -> None:
    np.testing.assert_allclose(ids_of(list(KNOWN)), np.array(list(KNOWN.values()), np.float32), rtol=1e-7)


def test_known_hashes() -> None:
    """Values of MurmurHash3_x86_32 with seed 0, for every length of the last block."""
    known = {b"": 0, b"\0": 0x514E28B7, b"\0\0": 0x30F4C306, b"\0\0\0": 0x85F0B427, b"\0\0\0\0": 0x2362F9DE}
    assert {data: murmur3(data) for data in known} == known


def test_every_id_is_a_normal_number() -> None:
    names = [f"object {k}" for k in range(3000)]
    bits = np.array([id_bits(name) for name in names], np.uint32)
    exponent = bits >> 23 & 255
    assert ((exponent > 0) & (exponent < 255)).all()
    changed = np.array([murmur3(name.encode()) for name in names], np.uint32) != bits
    assert 1 <= changed.sum() < 100, "one of 128 hashes is no normal number"
    np.testing.assert_array_equal(ids_of(names).view(np.uint32), bits)


def test_another_reader_finds_every_matte(tmp_path: Path) -> None:
    """By the specification only: metadata -> manifest -> id -> sum of the coverage of all ranks with that id."""
    openexr = pytest.importorskip("OpenEXR", reason="the second reader of EXR is not installed")
    rng, names = np.random.default_rng(1), ("floor", "größe", "a/b", 'say "x"', "lamp")
    number = np.sort(rng.integers(-1, 5, (7, 9, 6)).astype(np.int32), axis=-1)[..., ::-1].copy()
    coverage = np.where(number >= 0, np.sort(rng.uniform(0, 0.3, number.shape))[..., ::-1], 0).astype(np.float32)
    channels = {"depth.Z": np.ones((7, 9), np.float32), **channels_of("CryptoObject", names, number, coverage)}
    write_layers(tmp_path / "a.exr", channels, {**attributes_of("CryptoObject", names)})

    file = openexr.File(str(tmp_path / "a.exr"), separate_channels=True)
    header, pixels = file.header(), {name: channel.pixels for name, channel in file.channels().items()}
    (key,) = {name.split("/")[1] for name in header if name.startswith("cryptomatte/")}
    assert header[f"cryptomatte/{key}/hash"] == "MurmurHash3_32"
    assert header[f"cryptomatte/{key}/conversion"] == "uint32_to_float32"
    layer, manifest = header[f"cryptomatte/{key}/name"], json.loads(header[f"cryptomatte/{key}/manifest"])
    assert list(manifest) == list(names)
    for k, name in enumerate(names):
        wanted, found = np.uint32(int(manifest[name], 16)).view(np.float32), np.zeros((7, 9))
        for level in ("00", "01", "02"):
            for of_id, of_coverage in ("RG", "BA"):
                same = pixels[f"{layer}{level}.{of_id}"] == wanted
                found += np.where(same, pixels[f"{layer}{level}.{of_coverage}"], 0)
        np.testing.assert_allclose(found, np.where(number == k, coverage, 0).sum(axis=-1), rtol=1e-6)
