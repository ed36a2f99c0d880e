"""Small arrays for the tests of movies, written by hand, and movies decoded again."""

from bisect import bisect_right
from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace
from fractions import Fraction
from pathlib import Path
from typing import Any

import numpy as np

from framearray_cli.array.images import ImageFormat, write_image
from framearray_cli.array.manifest import (
    Manifest,
    ManifestCamera,
    ManifestLight,
    array_files,
    file_patterns,
    image_path,
    matrix_rows,
)
from framearray_cli.array.manifest_toml import write_manifest
from support.handmade import group_of

CAMERA = ManifestCamera(world_from_camera=matrix_rows(np.eye(4)), fov=60.0)
DARK = ManifestLight(ambient=(0.0,) * 3, ambient_error=(0.0,) * 3, sources=())


def barred(c: int, l: int, width: int = 64, height: int = 48) -> Any:
    """A smooth picture with a bar across for c and a bar down for l; no two of an array of 6 x 6 look alike."""
    y, x = np.mgrid[0:height, 0:width].astype(np.float32)
    image = np.stack([0.3 * x / width, 0.3 * y / height, np.full_like(x, 0.1)], axis=-1)
    image[:, 4 + 9 * c : 10 + 9 * c] += np.float32([0.5, 0.3, 0.1])
    image[3 + 7 * l : 8 + 7 * l] += np.float32([0.1, 0.3, 0.4])
    return image


def array_of(n_cameras: int, n_lights: int, fps: float = 24, **more: Any) -> Manifest:
    """An array without groups that is in no folder; `more` are other fields."""
    images, layers = file_patterns("a", n_cameras, n_lights, "png")
    table: dict[str, Any] = {"version": "0", "name": "a", "fingerprint": "", "images": images, "layers": layers}
    table |= {"resolution": (8, 6), "fps": fps, "cameras": (CAMERA,) * n_cameras, "lights": (DARK,) * n_lights}
    return Manifest(**(table | more))


def plain(
    folder: Path,
    n_cameras: int = 5,
    n_lights: int = 4,
    extension: str = "exr",
    picture: Callable[[int, int], Any] = barred,
    fps: float = 24,
) -> Manifest:
    """Write an array without groups."""
    images, _ = file_patterns("tiny", n_cameras, n_lights, extension)
    height, width, _ = picture(0, 0).shape
    own = {"name": "tiny", "images": images, "layers": "", "resolution": (width, height), "directory": folder}
    manifest = array_of(n_cameras, n_lights, fps, **own)
    for c in range(n_cameras):
        for l in range(n_lights):
            write_image(image_path(manifest, c, l), picture(c, l), ImageFormat(format=extension))  # type: ignore[arg-type]
    write_manifest(folder, manifest)
    return manifest


def grouped(folder: Path, n_lamp: int = 3, seed: int = 7) -> Manifest:
    """Write an array of 2 eyes with the groups "sun" along "light" (4 positions) and "lamp" along their own axis."""
    lamp, sun = (
        [replace(DARK, ambient=(red, 0.1 + 0.05 * l, 0.2)) for l in range(n)] for n, red in ((n_lamp, 0.3), (4, 0.1))
    )
    own: dict[str, Any] = {"name": "room", "images": "", "layers": "", "resolution": (16, 12), "directory": folder}
    own |= {"ambient_images": "ambient.c{camera:04d}.exr", "background_images": "back.c{camera:04d}.exr"}
    manifest = array_of(2, 0, **own, groups=(group_of("lamp", "lamp", lamp), group_of("sun", "light", sun)))
    rng = np.random.default_rng(seed)
    for file in array_files(manifest):
        write_image(file, 0.4 * rng.random((12, 16, 3), np.float32), ImageFormat())
    write_manifest(folder, manifest)
    return manifest


def path_file(folder: Path, text: str) -> Path:
    """Write a path file."""
    file = folder / "path.toml"
    file.write_text(text, encoding="utf-8")
    return file


@dataclass(frozen=True)
class Decoded:
    """A movie read back; GIF and WebP store equal frames in a row as one.

    Attributes:
        frames: (h, w, 3) codes of each, 8 bits.
        luma: of each frame of a video, as its codec keeps it.
        times: when each frame begins, seconds.
        rate: frames per second of the file; None where a format has only delays.
        length: seconds in all, where the format says so.
        pixels: the pixel format.
    """

    frames: Sequence[Any]
    luma: Sequence[Any]
    times: Sequence[Fraction]
    rate: Fraction | None
    length: Fraction | None
    pixels: str

    def shown(self, fps: Fraction) -> Sequence[Any]:
        """Return the frame in view in the middle of each interval of a rate; without a length, all frames."""
        if self.length is None:
            return self.frames
        middles = [(k + Fraction(1, 2)) / fps for k in range(round(self.length * fps))]
        return [self.frames[bisect_right(self.times, middle) - 1] for middle in middles]


def decoded(movie: Path) -> Decoded:
    """Read a movie with a program that is not ours: FFmpeg or Pillow."""
    return _animation(movie) if movie.suffix in (".gif", ".webp", ".avif") else _video(movie)


def _video(movie: Path) -> Decoded:
    import av

    frames, luma, times = [], [], []
    with av.open(str(movie)) as container:
        stream = container.streams.video[0]
        for frame in container.decode(stream):
            assert int(frame.colorspace) == 1, "Rec. 709"
            times.append(frame.pts * frame.time_base)
            rgb = frame.reformat(format="rgb24", src_colorspace="ITU709", dst_color_range="JPEG").to_ndarray()
            frames.append(rgb.copy())
            kind = np.dtype("<u2") if "10le" in frame.format.name else np.dtype(np.uint8)
            plane = np.frombuffer(frame.planes[0], kind).reshape(frame.planes[0].height, -1)
            luma.append(plane[:, : frame.width].copy())
        return Decoded(frames, luma, times, stream.average_rate, None, str(stream.codec_context.pix_fmt))


def _animation(movie: Path) -> Decoded:
    from PIL import Image, ImageSequence

    frames, times, now = [], [], 0
    with Image.open(movie) as picture:
        for frame in ImageSequence.Iterator(picture):
            frames.append(np.asarray(frame.convert("RGB")))
            times.append(Fraction(now, 1000))
            now += round(frame.info["duration"])
    return Decoded(frames, [], times, None, Fraction(now, 1000), "rgb24")


def rms(a: Any, b: Any) -> float:
    """Root of the mean squared difference of two pictures, in codes."""
    return float(np.sqrt(((a.astype(np.float64) - b) ** 2).mean()))
