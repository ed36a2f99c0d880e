"""Animated AVIF, by Pillow: it takes one picture with many frames, so they wait in a temporary file.

Pillow keeps frames of any kind apart here, equal ones too, and looks at one after the other.
"""

import tempfile
from collections.abc import Iterator, Sequence
from contextlib import contextmanager
from typing import IO, TYPE_CHECKING, BinaryIO

from framearray_cli.base.arrays import Bytes
from framearray_cli.base.errors import MissingExtraError
from framearray_cli.base.extras import install_command

if TYPE_CHECKING:
    from PIL.ImageFile import ImageFile

# speed: 0 slow to 10. 6 takes nine times as long, for a fifth less error. All chroma is kept.
OPTIONS = {"quality": 80, "speed": 8, "subsampling": "4:4:4"}


def require_avif() -> None:
    """Check that Pillow can write AVIF.

    Raises:
        MissingExtraError: it is older than 11.3, or built without AVIF.
    """
    import PIL.features

    if "avif" not in PIL.features.modules or not PIL.features.check("avif"):
        raise MissingExtraError(
            "AVIF needs Pillow 11.3 or newer, built with it; choose another kind, or install it with: "
            + install_command("--upgrade 'Pillow>=11.3'")
        )


class Avif:
    """The format `open_animation` writes; `open_avif` makes it."""

    def __init__(self, spool: IO[bytes]) -> None:
        self._spool = spool
        self._starts: list[int] = []  # of each frame in the spool; a held picture is there once
        self._delays: list[int] = []
        self._last = b""
        self._size = (0, 0)

    def begin(self, file: BinaryIO, width: int, height: int) -> None:
        self._size = (width, height)

    def encode(self, codes: Bytes) -> bytes:
        return codes.tobytes()

    def add(self, file: BinaryIO, coded: bytes, delay: int) -> None:
        if coded is not self._last:
            self._spool.write(coded)
            self._last = coded
        self._starts.append(self._spool.tell() - len(coded))
        self._delays.append(delay)

    def end(self, file: BinaryIO) -> None:
        frames = _frames(self._spool, self._starts, self._size)
        frames.save(file, "AVIF", save_all=True, duration=self._delays, **OPTIONS)


def _frames(spool: IO[bytes], starts: Sequence[int], size: tuple[int, int]) -> "ImageFile":
    """Return one picture whose frames are read when Pillow looks at them."""
    import PIL.ImageFile

    class Frames(PIL.ImageFile.ImageFile):
        format = "frames"

        def _open(self) -> None:
            self._mode, self._size = "RGB", size
            self.n_frames, self.is_animated = len(starts), len(starts) > 1
            self.seek(0)

        def seek(self, frame: int) -> None:
            if frame >= len(starts):
                raise EOFError(f"no frame {frame}")
            self.fp, self._at = spool, frame
            # named like a private name, but what plugins of Pillow fill their tiles with
            self.tile = [PIL.ImageFile._Tile("raw", (0, 0, *size), starts[frame], "RGB")]

        def tell(self) -> int:
            return self._at

    return Frames(spool)


@contextmanager
def open_avif() -> Iterator[Avif]:
    """Open the format with its temporary file."""
    with tempfile.TemporaryFile() as spool:
        yield Avif(spool)
