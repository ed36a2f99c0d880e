"""Files of movies and animations."""

import sys
import weakref
from collections.abc import Iterator
from fractions import Fraction
from itertools import groupby
from pathlib import Path
from typing import Any

import numpy as np
import PIL.features
import PIL.Image
import pytest
from support.making import assemble_movie
from support.movies import Decoded, barred, decoded, path_file, plain, rms

from framearray_cli.base.colour import srgb8_from_linear, srgb_from_linear
from framearray_cli.base.errors import MissingExtraError, OutputError
from framearray_cli.base.units import frame_rate
from framearray_cli.tools.movie.video import delays, planes_422_10, write_animation

pytest.importorskip("av")

AVIF = (".avif",) if PIL.features.check("avif") else ()
CONTAINERS = (".mp4", ".mkv", ".webm", ".mov", ".gif", ".webp", *AVIF)
UNITS = {".gif": Fraction(1, 100), ".webp": Fraction(1, 1000), ".avif": Fraction(1, 1000)}
PATH = """
[[segments]]
frames = 4
light = [0, -1]
[[segments]]
frames = 6
camera = [0, 4]
light = [3, 1]
[[segments]]
frames = 4
camera = [1, 2]
hold = 0.125
"""
FPS = Fraction(24)
SHOWN = [(0, 0), (0, 1), (0, 2), (0, 3)]
SHOWN += [(1, 3), (1, 2), (2, 2), (3, 2), (3, 1), (4, 1)]
SHOWN += [(1, 1), (1, 1), (2, 1), (2, 1), (2, 1), (2, 1), (2, 1)]


@pytest.fixture(scope="module")
def array(tmp_path_factory: pytest.TempPathFactory) -> Path:
    return plain(tmp_path_factory.mktemp("array")).directory


@pytest.fixture(scope="module")
def movies(array: Path, tmp_path_factory: pytest.TempPathFactory) -> dict[str, Decoded]:
    folder = tmp_path_factory.mktemp("movies")
    path = path_file(folder, PATH)
    for suffix in CONTAINERS:
        result = assemble_movie(array, path, folder / f"m{suffix}")
        assert (result.frames, result.images, result.fps) == (17, 12, FPS)
    return {suffix: decoded(folder / f"m{suffix}") for suffix in CONTAINERS}


def errors(frame: Any) -> dict[tuple[int, int], float]:
    """Difference between a frame and each image of the array, codes RMS."""
    size = frame.shape[1], frame.shape[0]
    return {(c, l): rms(frame, srgb8_from_linear(barred(c, l, *size))) for c in range(5) for l in range(4)}


@pytest.mark.parametrize("suffix", CONTAINERS)
def test_every_frame_shows_its_image_and_no_other(movies: dict[str, Decoded], suffix: str) -> None:
    movie = movies[suffix]
    for frame, place in zip(movie.shown(FPS), SHOWN, strict=True):
        found = errors(frame)
        own = found.pop(place)
        assert own < 0.4 * min(found.values()), (place, own)


def test_the_comparison_can_fail(movies: dict[str, Decoded]) -> None:
    """Every image is nearer to its own frame than to that of a neighbour, by more than the error of codecs."""
    codes = {(c, l): srgb8_from_linear(barred(c, l)) for c in range(5) for l in range(4)}
    apart = min(rms(a, b) for p, a in codes.items() for q, b in codes.items() if p != q)
    assert apart > 20
    pairs = [pair for movie in movies.values() for pair in zip(movie.shown(FPS), SHOWN, strict=True)]
    worst = max(errors(frame)[place] for frame, place in pairs)
    assert worst < apart / 2
    wrong = [*SHOWN[1:], SHOWN[0]]
    assert any(errors(f)[p] > 0.4 * apart for f, p in zip(movies[".mp4"].frames, wrong, strict=True))


@pytest.mark.parametrize("suffix", [".mp4", ".mkv", ".webm", ".mov"])
@pytest.mark.parametrize(
    ("fps", "exact"),
    [(12.5, "25/2"), (23.976, "24000/1001"), (24, "24"), (29.97, "30000/1001"), (59.94, "60000/1001"), (60, "60")],
)
def test_rates_of_videos_are_exact(array: Path, tmp_path: Path, suffix: str, fps: float, exact: str) -> None:
    path = path_file(tmp_path, f"fps = {fps}\n[[segments]]\nframes = 13\ncamera = [0, 4]\n")
    result = assemble_movie(array, path, tmp_path / f"m{suffix}")
    movie, rate = decoded(tmp_path / f"m{suffix}"), Fraction(exact)
    assert (len(movie.frames), result.fps) == (13, float(rate))
    assert movie.rate is not None
    if suffix in (".mkv", ".webm"):  # store the length of each frame in nanoseconds, and its time in milliseconds
        assert movie.rate == rate or (fps == 59.94 and abs(1 / movie.rate - 1 / rate) <= Fraction(1, 10**9))
        assert all(abs(time - k / rate) <= Fraction(1, 2000) for k, time in enumerate(movie.times))
    else:
        assert movie.rate == rate
        assert [k / rate for k in range(13)] == list(movie.times)


@pytest.mark.parametrize("suffix", [".gif", ".webp", *AVIF])
@pytest.mark.parametrize("fps", [23.976, 24, 30, 48])
def test_animations_are_as_long_as_they_should_be(array: Path, tmp_path: Path, suffix: str, fps: float) -> None:
    unit = UNITS[suffix]
    path = path_file(tmp_path, f"fps = {fps}\n[[segments]]\nframes = 25\ncamera = [0, 4]\nhold = 0.5\n")
    result = assemble_movie(array, path, tmp_path / f"m{suffix}")
    movie = decoded(tmp_path / f"m{suffix}")
    rate = frame_rate(fps)
    assert result.frames == 25 + round(rate / 2)
    assert movie.length is not None and abs(movie.length - result.frames / rate) <= unit / 2
    assert all(min(abs(time - k / rate) for k in range(result.frames)) <= unit / 2 for time in movie.times)
    assert len(movie.times) == (result.frames if suffix == ".avif" else 5), "one for equal ones in a row"


def test_frames_of_animations_are_not_all_of_one_length() -> None:
    assert delays(6, Fraction(24), 100) == [4, 4, 4, 5, 4, 4]
    assert sum(delays(2400, Fraction(24000, 1001), 100)) == 10010
    assert set(delays(240, Fraction(24), 1000)) == {41, 42}


@pytest.mark.parametrize("suffix", [".webp", *AVIF])
def test_only_encoded_frames_wait_in_memory(tmp_path: Path, monkeypatch: pytest.MonkeyPatch, suffix: str) -> None:
    make, made = PIL.Image.fromarray, []

    def fromarray(codes: Any) -> PIL.Image.Image:
        image = make(codes)
        made.append(weakref.ref(image))
        return image

    def pictures() -> Iterator[Any]:
        for k in range(9):
            assert sum(image() is not None for image in made) <= 2, "the first and the last"
            yield srgb8_from_linear(barred(k % 5, k % 4))

    monkeypatch.setattr(PIL.Image, "fromarray", fromarray)
    write_animation(tmp_path / f"m{suffix}", pictures(), 64, 48, FPS, 9)
    assert len(made) == len(decoded(tmp_path / f"m{suffix}").frames) == 9


def test_animations_and_sequences_need_no_pyav(array: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setitem(sys.modules, "av", None)
    path = path_file(tmp_path, "[[segments]]\nframes = 2\n")
    for name in ("m.gif", "m.webp", "f.#.png"):
        assert assemble_movie(array, path, tmp_path / name).frames == 2
    with pytest.raises(MissingExtraError, match=r"pip install .*\[movie\]"):
        assemble_movie(array, path, tmp_path / "m.mov")


@pytest.mark.skipif(not AVIF, reason="needs Pillow with AVIF")
def test_ffmpeg_reads_our_avif(array: Path, tmp_path: Path) -> None:
    """Every frame, equal ones too, at its time."""
    import av

    assemble_movie(array, path_file(tmp_path, PATH), tmp_path / "m.avif")
    with av.open(str(tmp_path / "m.avif")) as container:
        frames = list(container.decode(video=len(container.streams.video) - 1))  # the first is the still picture
    assert len(frames) == len(SHOWN)
    assert [round(24 * frame.time) for frame in frames] == list(range(len(SHOWN)))
    for frame, place in zip(frames, SHOWN, strict=True):
        found = errors(frame.to_ndarray(format="rgb24"))
        assert min(found, key=lambda other: found[other]) == place


def test_a_pillow_without_avif_says_so(array: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setitem(sys.modules, "PIL._avif", None)
    with pytest.raises(MissingExtraError, match=r"built without AVIF here; .*pip install .*--force-reinstall Pillow"):
        assemble_movie(array, path_file(tmp_path, PATH), tmp_path / "m.avif")


def test_ffmpeg_reads_our_gif_as_pillow_does(movies: dict[str, Decoded], array: Path, tmp_path: Path) -> None:
    import av

    assemble_movie(array, path_file(tmp_path, PATH), tmp_path / "m.gif")
    with av.open(str(tmp_path / "m.gif")) as container:
        frames = [frame.to_ndarray(format="rgb24") for frame in container.decode(video=0)]
    assert len(frames) == len(list(groupby(SHOWN))), "one for equal ones in a row"
    for ours, other in zip(movies[".gif"].frames, frames, strict=True):
        np.testing.assert_array_equal(ours, other)


def test_a_gif_that_viewers_would_slow_down_is_refused(array: Path, tmp_path: Path) -> None:
    path = path_file(tmp_path, "fps = 60\n[[segments]]\nframes = 3\n")
    with pytest.raises(OutputError, match=r"m\.gif: expected at most 50 frames per second, got 60"):
        assemble_movie(array, path, tmp_path / "m.gif")
    assert [file.name for file in tmp_path.iterdir()] == ["path.toml"]


@pytest.mark.parametrize("suffix", CONTAINERS)
def test_odd_sizes(tmp_path: Path, suffix: str) -> None:
    plain(tmp_path / "out", 2, 1, picture=lambda c, l: barred(c, l, 33, 21))
    path = path_file(tmp_path, "[[segments]]\nframes = 2\ncamera = [0, 1]\n")
    assemble_movie(tmp_path / "out", path, tmp_path / f"m{suffix}")
    for c, frame in enumerate(decoded(tmp_path / f"m{suffix}").frames):
        grows = (dict.fromkeys(UNITS, (21, 33)) | {".mov": (21, 34)}).get(suffix, (22, 34))
        assert frame.shape == (*grows, 3)
        assert rms(frame[:21, :33], srgb8_from_linear(barred(c, 0, 33, 21))) < 20


# ProRes


def shallow(c: int, l: int) -> Any:
    """Linear radiance that rises by less than an 8-bit code every few columns."""
    x = np.linspace(0.10, 0.13, 256, dtype=np.float32)
    return np.broadcast_to(x[None, :, None], (32, 256, 3)) * np.float32([1.0, 0.9, 0.8])


def luma_10(image: Any) -> Any:
    """Y' of 10 bits, not rounded."""
    return 64 + 876 * (srgb_from_linear(image.astype(np.float64)) @ [0.2126, 0.7152, 0.0722])


def test_prores_holds_ten_bits_of_the_radiance(tmp_path: Path) -> None:
    plain(tmp_path / "out", 1, 1, picture=shallow)
    path = path_file(tmp_path, "[[segments]]\nframes = 3\n")
    for name in ("m.mov", "m.mp4"):
        assemble_movie(tmp_path / "out", path, tmp_path / name)
    fine, coarse = decoded(tmp_path / "m.mov"), decoded(tmp_path / "m.mp4")
    assert (fine.pixels, coarse.pixels) == ("yuv422p10le", "yuv420p")
    truth = luma_10(shallow(0, 0))
    eight = srgb8_from_linear(shallow(0, 0)).astype(np.float64) / 255  # the input of the mp4
    fed = 64 + 876 * (eight @ [0.2126, 0.7152, 0.0722])
    error = rms(fine.luma[0], truth)
    assert error < rms(fed, truth)  # smaller than that of 8-bit codes before any codec
    assert error < rms(4.0 * coarse.luma[0], truth) / 2
    assert len(np.unique(fine.luma[0])) > 2 * len(np.unique(coarse.luma[0]))


def test_our_yuv_is_the_standards() -> None:
    """White, black and the primaries at full range [BT.709-6, table 3.5], the chroma of a column halfway between."""
    codes = np.zeros((1, 10, 3), np.uint16)
    codes[0, :2] = 65535
    codes[0, 4:6, 0], codes[0, 6:8, 1], codes[0, 8:, 2] = 65535, 65535, 65535
    y, cb, cr = planes_422_10(codes)
    assert y[0].tolist() == [940, 940, 64, 64, 250, 250, 691, 691, 127, 127]
    assert (cb.shape, cr.shape) == ((1, 5), (1, 5))
    flat = np.zeros((1, 4, 3), np.uint16)
    flat[..., 2] = 65535
    _, cb, cr = planes_422_10(flat)
    assert (cb[0].tolist(), cr[0].tolist()) == ([960, 960], [471, 471])
