"""GIF, WebP and AVIF animations, one kind of target of `movie.py`: Pillow encodes the pictures.

Pillow's own GIF and WebP merge equal neighbours and keep all pictures in memory; this module joins pictures, and writes
every frame as one.
Formats: GIF89a, and Google's "WebP Container Specification".
"""

import io
import struct
from abc import ABC, abstractmethod
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from fractions import Fraction
from itertools import pairwise
from pathlib import Path
from typing import TYPE_CHECKING, Any, BinaryIO

from numpy.typing import NDArray

from framearray_cli.base.arrays import Bytes
from framearray_cli.base.errors import MissingExtraError, OutputError
from framearray_cli.base.extras import install_command
from framearray_cli.base.files import whole_file

if TYPE_CHECKING:
    from PIL.Image import Image

# speed: 0 slow to 10. 6 needs nine times as long, for a fifth less error. All chroma is kept.
AVIF_OPTIONS = {"quality": 80, "speed": 8, "subsampling": "4:4:4"}
GIF_UNITS, WEBP_UNITS = 100, 1000  # of time, per second
GIF_FASTEST = 50  # frames per second; browsers play faster animations at a tenth of their rate
WEBP_LARGEST = 16383  # pixels
WEBP_LONGEST = 2**24 - 1  # ms of one frame
WEBP_OPTIONS = {"quality": 90, "method": 4}  # method: 0 fast to 6 small
WEBP_FILE_MOST = 2**32 - 10  # bytes
ANIMATIONS = (".gif", ".webp", ".avif")


def delays(n: int, fps: Fraction, units: int) -> list[int]:
    """Return the lengths of n frames in whole units of time; each frame ends within half a unit of its exact time."""
    ends = [round(k * units / fps) for k in range(n + 1)]
    return [end - start for start, end in pairwise(ends)]


def require_animation(suffix: str) -> None:
    """Check that Pillow can write a kind of animation.

    Args:
        suffix: one of ANIMATIONS.

    Raises:
        MissingExtraError: Pillow is built without it.
    """
    import PIL.features

    if suffix != ".gif" and not PIL.features.check(suffix[1:]):
        raise MissingExtraError(
            f"Pillow is built without {'WebP' if suffix == '.webp' else 'AVIF'} here; choose another kind, or install "
            f"a build that has it with: {install_command('--force-reinstall Pillow')}"
        )


class AnimationWriter(ABC):
    """An open animation; `open_animation` makes it."""

    def __init__(self, file: BinaryIO, size: tuple[int, int], delays: Iterator[int]) -> None:
        self._file, self._delays = file, delays
        self._codes: NDArray[Any] | None = None
        self._coded: Any = None

    def add(self, codes: NDArray[Any]) -> None:
        """Add one picture: (h, w, 3) uint8, which must not change; the same array twice in a row is encoded once."""
        if codes is not self._codes:
            self._codes, self._coded = codes, self._encode(codes)
        self._put(self._coded, next(self._delays))

    @abstractmethod
    def _encode(self, codes: Bytes) -> Any: ...
    @abstractmethod
    def _put(self, coded: Any, delay: int) -> None:
        """Write a frame of an encoded picture."""

    @abstractmethod
    def finish(self) -> None:
        """Write the end of the file."""


@contextmanager
def open_animation(target: Path, width: int, height: int, fps: Fraction, n_frames: int) -> Iterator[AnimationWriter]:
    """Open an animation that loops for ever; it appears under its name once it is whole.

    Args:
        target: its suffix, one of ANIMATIONS, decides the format.

    Raises:
        OutputError: the system refuses to write, or the format has no room for the animation.
    """
    suffix = target.suffix.lower()
    lengths = delays(n_frames, fps, GIF_UNITS if suffix == ".gif" else WEBP_UNITS)
    if suffix == ".gif" and fps > GIF_FASTEST:
        raise OutputError(
            f"{target}: expected at most {GIF_FASTEST} frames per second, got {float(fps):g}: viewers play faster GIFs "
            "too slowly; choose another rate or .webp"
        )
    if suffix == ".webp" and (max(width, height) > WEBP_LARGEST or max(lengths) > WEBP_LONGEST):
        raise OutputError(
            f"{target}: WebP holds up to {WEBP_LARGEST} pixels per side, and {WEBP_LONGEST} ms per frame; choose "
            "another format"
        )
    kinds: dict[str, Callable[..., AnimationWriter]] = {".gif": _Gif, ".webp": _WebP, ".avif": _Avif}
    with whole_file(target) as part, part.open("wb") as file:
        writer = kinds[suffix](file, (width, height), iter(lengths))
        yield writer
        writer.finish()


class _Gif(AnimationWriter):
    """GIF89a: each frame has its own 256 colours, dithered."""

    def __init__(self, file: BinaryIO, size: tuple[int, int], delays: Iterator[int]) -> None:
        super().__init__(file, size, delays)
        file.write(b"GIF89a" + struct.pack("<HHBBB", *size, 0x70, 0, 0))  # 0x70: 8 bits per channel, no table
        file.write(b"\x21\xff\x0bNETSCAPE2.0\x03\x01\x00\x00\x00")  # plays for ever

    def _encode(self, codes: Bytes) -> bytes:
        import PIL.GifImagePlugin
        import PIL.Image

        picture = PIL.Image.fromarray(codes)
        colours = picture.quantize(256, PIL.Image.Quantize.MEDIANCUT)
        dithered = picture.quantize(palette=colours, dither=PIL.Image.Dither.FLOYDSTEINBERG)
        return b"".join(PIL.GifImagePlugin.getdata(dithered, include_color_table=True))

    def _put(self, coded: bytes, delay: int) -> None:
        self._file.write(
            b"\x21\xf9\x04\x04" + struct.pack("<HBB", delay, 0, 0)
        )  # 0x04: stays until the next frame covers it
        self._file.write(coded)

    def finish(self) -> None:
        self._file.write(b";")


class _WebP(AnimationWriter):
    """Animated WebP: each frame is a key frame."""

    def __init__(self, file: BinaryIO, size: tuple[int, int], delays: Iterator[int]) -> None:
        super().__init__(file, size, delays)
        self._sides = b"".join(_int24(side - 1) for side in size)
        file.write(b"RIFF\0\0\0\0WEBP")  # the size follows at the end
        file.write(b"VP8X" + struct.pack("<IB3x", 10, 0x02) + self._sides)  # 0x02: animated
        file.write(b"ANIM" + struct.pack("<IIH", 6, 0, 0))  # black behind; plays for ever

    def _encode(self, codes: Bytes) -> bytes:
        import PIL.Image

        buffer = io.BytesIO()
        PIL.Image.fromarray(codes).save(buffer, "WEBP", **WEBP_OPTIONS)
        return buffer.getvalue()[12:]  # only the chunk "VP8 "

    def _put(self, coded: bytes, delay: int) -> None:
        head = _int24(0) * 2 + self._sides + _int24(delay) + b"\x02"  # at 0, 0; 0x02: replaces the frame before
        self._file.write(b"ANMF" + struct.pack("<I", len(head) + len(coded)) + head + coded)

    def finish(self) -> None:
        size = self._file.tell() - 8
        if size > WEBP_FILE_MOST:
            raise OSError("WebP files hold at most 4 GiB")
        self._file.seek(4)
        self._file.write(struct.pack("<I", size))


def _int24(value: int) -> bytes:
    return value.to_bytes(3, "little")


class _Avif(AnimationWriter):
    """AVIF: one call of Pillow writes all frames, which wait in memory; a held picture is there once."""

    def __init__(self, file: BinaryIO, size: tuple[int, int], delays: Iterator[int]) -> None:
        super().__init__(file, size, delays)
        self._frames: list[Image] = []
        self._lengths: list[int] = []

    def _encode(self, codes: Bytes) -> "Image":
        import PIL.Image

        return PIL.Image.fromarray(codes)

    def _put(self, coded: "Image", delay: int) -> None:
        self._frames.append(coded)
        self._lengths.append(delay)

    def finish(self) -> None:
        first, *others = self._frames
        first.save(self._file, "AVIF", save_all=True, append_images=others, duration=self._lengths, **AVIF_OPTIONS)
