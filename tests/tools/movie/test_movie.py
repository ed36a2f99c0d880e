"""Movies and sequences: which image stands in which frame, options and targets."""

import shutil
from pathlib import Path

import numpy as np
import pytest
from support.making import assemble_movie
from support.movies import decoded, plain
from support.smalldisk import largest_file

from framearray_cli.array.images import ImageFormat, read_codes, read_image, write_image
from framearray_cli.array.manifest import Manifest
from framearray_cli.base.colour import srgb8_from_linear
from framearray_cli.base.errors import OutputError
from framearray_cli.tools.movie.look import Look
from framearray_cli.tools.movie.pathfile import Sweep

av = pytest.importorskip("av")

N_CAMERAS, N_LIGHTS = 5, 4


def picture(c: int, l: int, width: int = 64, height: int = 48) -> np.ndarray:
    """A smooth picture whose left half encodes c (red) and whose right half encodes l (green)."""
    image = np.full((height, width, 3), 0.05, np.float32)
    image[:, : width // 2, 0] = 0.1 + 0.8 * c / (N_CAMERAS - 1)
    image[:, width // 2 :, 1] = 0.1 + 0.8 * l / (N_LIGHTS - 1)
    return image


def make_array(folder: Path, extension: str = "png", width: int = 64, height: int = 48) -> Manifest:
    return plain(folder, N_CAMERAS, N_LIGHTS, extension, lambda c, l: picture(c, l, width, height))


@pytest.fixture
def out(tmp_path: Path) -> Path:
    make_array(tmp_path / "out")
    return tmp_path / "out"


@pytest.fixture
def path_file(tmp_path: Path) -> Path:
    """Eleven frames: the light moves, then the camera, then a cut, then both."""
    file = tmp_path / "path.toml"
    file.write_text(
        "[[segments]]\nframes = 4\nlight = [0, -1]\n"
        "[[segments]]\nframes = 4\ncamera = [0, -1]\n"
        "[[segments]]\nframes = 3\ncamera = [1, 3]\nlight = [2, 0]\n",
        encoding="utf-8",
    )
    return file


FRAMES = [(0, 0), (0, 1), (0, 2), (0, 3), (1, 3), (2, 3), (3, 3), (4, 3), (1, 2), (2, 1), (3, 0)]


# movies


def test_colours_are_those_of_the_images(out: Path, path_file: Path, tmp_path: Path) -> None:
    """The matrix of Rec. 601 in a file that says Rec. 709 would shift red and green by up to 20 codes."""
    target = tmp_path / "movie.mp4"
    seen: list[tuple[int, int]] = []
    result = assemble_movie(out, path_file, target, progress=lambda done, total: seen.append((done, total)))
    assert (result.path, result.frames, result.images, result.fps) == (str(target), 11, 11, 24)
    assert seen == [(k, 11) for k in range(1, 12)]
    assert sorted(p.name for p in tmp_path.iterdir()) == [target.name, "out", "path.toml"]
    for (c, l), frame in zip(FRAMES, decoded(tmp_path / "movie.mp4").frames, strict=True):
        difference = frame.astype(int) - srgb8_from_linear(picture(c, l))
        inner = np.concatenate([difference[4:-4, 4:28], difference[4:-4, 36:-4]], axis=1)
        assert np.abs(inner.mean(axis=(0, 1))).max() < 2.5  # limited range and chroma have steps of 1.2 codes each
    with av.open(str(tmp_path / "movie.mp4")) as container:
        context = container.streams.video[0].codec_context
        assert (context.color_primaries, context.color_trc, context.colorspace) == (1, 1, 1)
        assert context.pix_fmt == "yuv420p"


def test_the_index_comes_first(out: Path, path_file: Path, tmp_path: Path) -> None:
    assemble_movie(out, path_file, tmp_path / "movie.mp4")
    data = (tmp_path / "movie.mp4").read_bytes()
    assert 0 < data.index(b"moov") < data.index(b"mdat")


def test_exposure_brightens_a_movie(path_file: Path, tmp_path: Path) -> None:
    make_array(tmp_path / "out", "exr")
    assemble_movie(tmp_path / "out", path_file, tmp_path / "dark.mp4", look=Look(exposure=-2))
    frames = decoded(tmp_path / "dark.mp4").frames
    expected = srgb8_from_linear(picture(4, 3) / 4)
    assert np.abs(frames[7][4:-4, 4:28].mean(axis=(0, 1)) - expected[0, 0]).max() < 2.5


# errors


@pytest.mark.parametrize("target", ["movie.mp4", "frame.####.png", "frame.####.jpg"])
def test_missing_images_are_found_before_anything_is_written(
    out: Path, path_file: Path, tmp_path: Path, target: str
) -> None:
    problem = r"2 of the 11 images on the path are missing, of cameras 2-3; the first is tiny\.c0002\.l003\.png "
    problem += r"\(camera 2, light 3\); `framearray render JOB` goes on with the rest"
    (out / "tiny.c0002.l003.png").unlink()
    (out / "tiny.c0003.l000.png").unlink()
    (out / "tiny.c0004.l000.png").unlink()  # not on the path
    started: list[int] = []
    with pytest.raises(OutputError, match=problem):
        assemble_movie(out, path_file, tmp_path / target, progress=lambda done, total: started.append(done))
    assert not started
    assert sorted(p.name for p in tmp_path.iterdir()) == ["out", "path.toml"]


def test_an_image_of_another_size_is_named(out: Path, path_file: Path, tmp_path: Path) -> None:
    write_image(out / "tiny.c0002.l003.png", picture(0, 0, 32, 48), ImageFormat(format="png"))
    with pytest.raises(OutputError, match=r"c0002\.l003\.png: expected 64 x 48 pixels, got 32 x 48"):
        assemble_movie(out, path_file, tmp_path / "movie.mp4")


@pytest.mark.parametrize("target", ["movie.mp4", "movie.webm", "frame.####.exr"])
def test_a_full_disk_is_an_error_and_leaves_nothing(path_file: Path, tmp_path: Path, target: str) -> None:
    make_array(tmp_path / "out")
    with largest_file(300), pytest.raises(OutputError, match="cannot be written"):
        assemble_movie(tmp_path / "out", path_file, tmp_path / target)
    assert sorted(p.name for p in tmp_path.iterdir()) == ["out", "path.toml"]


@pytest.mark.parametrize(
    ("target", "message"),
    [
        ("movie.avi", r"movie\.avi: expected \.mp4"),
        ("frame.png", 'expected a name with "####"'),
        ("a.##.b.##.png", 'expected a name with "####"'),
    ],
)
def test_other_targets_are_refused(out: Path, path_file: Path, tmp_path: Path, target: str, message: str) -> None:
    with pytest.raises(OutputError, match=message):
        assemble_movie(out, path_file, tmp_path / target)


def test_a_folder_without_a_manifest_is_an_error(path_file: Path, tmp_path: Path) -> None:
    with pytest.raises(OutputError, match=r"manifest\.toml: no such file"):
        assemble_movie(tmp_path, path_file, tmp_path / "movie.mp4")


# sequences


@pytest.mark.parametrize("name", ["folder", "folder/", "there"])
def test_a_folder_is_filled_in_the_arrays_format(out: Path, path_file: Path, tmp_path: Path, name: str) -> None:
    (tmp_path / "there").mkdir()
    assemble_movie(out, path_file, tmp_path / name)
    assert sorted(p.name for p in (tmp_path / name).iterdir()) == [f"frame.{k:04d}.png" for k in range(11)]


@pytest.mark.parametrize("extension", ["png", "jpg", "tif"])
def test_a_sequence_is_converted(path_file: Path, tmp_path: Path, extension: str) -> None:
    make_array(tmp_path / "out", "exr")
    assemble_movie(tmp_path / "out", path_file, tmp_path / f"shot.####.{extension}")
    for k, (c, l) in enumerate(FRAMES):
        codes = srgb8_from_linear(read_image(tmp_path / f"shot.{k:04d}.{extension}")).astype(int)
        error = np.abs(codes - srgb8_from_linear(read_image(tmp_path / "out" / f"tiny.c{c:04d}.l{l:03d}.exr")))
        assert error.mean() < (1.5 if extension == "jpg" else 1e-9)


def test_converted_exr_frames_carry_the_camera(out: Path, path_file: Path, tmp_path: Path) -> None:
    import OpenImageIO

    assemble_movie(out, path_file, tmp_path / "shot.####.exr")
    spec = OpenImageIO.ImageInput.open(str(tmp_path / "shot.0005.exr")).spec()
    assert (spec["framearray:camera"], spec["framearray:light"]) == FRAMES[5]
    assert spec["framesPerSecond"] == (24, 1)


def test_exposure_changes_a_sequence_of_the_same_format(out: Path, path_file: Path, tmp_path: Path) -> None:
    assemble_movie(out, path_file, tmp_path / "shot.####.png", look=Look(exposure=-1))
    linear = read_image(out / "tiny.c0000.l000.png")
    np.testing.assert_array_equal(read_codes(tmp_path / "shot.0000.png"), srgb8_from_linear(linear / 2))


def test_a_sequence_replaces_only_its_own_files(out: Path, path_file: Path, tmp_path: Path) -> None:
    (tmp_path / "cut").mkdir()
    (tmp_path / "cut" / "shot.0002.png").write_bytes(b"earlier")
    (tmp_path / "cut" / "notes.txt").write_bytes(b"mine")
    assemble_movie(out, path_file, tmp_path / "cut" / "shot.####.png")
    assert (tmp_path / "cut" / "notes.txt").read_bytes() == b"mine"
    read_image(tmp_path / "cut" / "shot.0002.png")
    shutil.copyfile(tmp_path / "cut" / "shot.0000.png", tmp_path / "cut" / "shot.0011.png")
    with pytest.raises(OutputError, match=r"shot\.0011\.png: belongs to an earlier sequence, with 1 file"):
        assemble_movie(out, path_file, tmp_path / "cut" / "shot.####.png")


def test_more_frames_than_digits(out: Path, path_file: Path, tmp_path: Path) -> None:
    assemble_movie(out, path_file, tmp_path / "cut" / "#.png")
    assert len(list((tmp_path / "cut").iterdir())) == 11
    assert (tmp_path / "cut" / "10.png").is_file()


def test_a_sequence_stays_out_of_the_folder_of_the_array(tmp_path: Path) -> None:
    array = plain(tmp_path / "out", 3, 2)
    before = sorted(array.directory.iterdir())
    for target in (array.directory, array.directory / "shot.####.png", tmp_path / "x" / ".." / "out"):
        with pytest.raises(OutputError, match="holds the frame array itself; choose another folder"):
            assemble_movie(array.directory, Sweep(kind="walk"), target)
    assert sorted(array.directory.iterdir()) == before
