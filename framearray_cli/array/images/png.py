"""Read and write PNG and JPEG with Pillow: 8-bit codes."""

import io
import struct
import zlib
from collections.abc import Iterator
from contextlib import contextmanager
from fractions import Fraction
from pathlib import Path
from typing import Any

import numpy as np

from framearray_cli.base.arrays import Bytes
from framearray_cli.base.errors import OutputError
from framearray_cli.base.files import reason, require_file
from framearray_cli.base.openimage import check_size

from .attributes import Attributes

_PNG_HEAD, _JPEG_HEAD = b"\x89PNG\r\n\x1a\n", b"\xff\xd8"
# What Pillow raises for broken files, beside OSError.
_PILLOW_ERRORS = (SyntaxError, ValueError, EOFError, IndexError, KeyError, TypeError, struct.error, zlib.error)


def read_codes(path: Path) -> Bytes:
    """Read the 8-bit sRGB codes of a PNG or JPEG: (h, w, 3) uint8, or (h, w, 4) with alpha.

    Raises:
        OutputError: the file is missing, damaged or truncated.
    """
    with open_picture(path) as picture:
        return np.asarray(picture if picture.mode == "RGBA" else picture.convert("RGB"))


@contextmanager
def open_picture(path: Path) -> Iterator[Any]:
    """Open a PNG or JPEG with Pillow; errors raised while it is in use name the file.

    Pillow's own `open` takes files of any format, and refuses sizes that a job may have.

    Raises:
        OutputError: the file is missing, damaged, of another format, or larger than any job's.
    """
    from PIL.JpegImagePlugin import JpegImageFile
    from PIL.PngImagePlugin import PngImageFile

    require_file(path)
    kind: Any = PngImageFile if path.suffix.lower() == ".png" else JpegImageFile
    try:
        with path.open("rb") as file:
            head = file.read(len(_PNG_HEAD))
        if not head.startswith(_PNG_HEAD if kind is PngImageFile else _JPEG_HEAD):
            raise OutputError(f"{path}: not an image, or damaged: it does not begin like {path.suffix[1:].upper()}")
        with kind(path) as picture:
            check_size(path, *picture.size)
            yield picture
    except OSError as error:
        raise OutputError(f"{path}: cannot be read: {reason(error)}") from error
    except _PILLOW_ERRORS as error:
        raise OutputError(f"{path}: damaged: {error}") from error


def can_encode(name: str) -> bool:
    """Whether Pillow was built with a format, "png" or "jpg"."""
    import PIL.features

    return bool(PIL.features.check_codec("jpg" if name == "jpg" else "zlib"))


def encode_png(codes: Bytes, attributes: Attributes) -> bytes:
    """Encode (h, w, 3) 8-bit codes as PNG, or (h, w, 4) with alpha, in memory."""
    import PIL.Image
    import PIL.PngImagePlugin

    info = PIL.PngImagePlugin.PngInfo()
    info.add(b"sRGB", b"\0")  # says that the codes are sRGB; 0: perceptual intent
    for name, value in attributes.items():
        if isinstance(value, str | int | float | Fraction):
            info.add_text(name, str(value))
    buffer = io.BytesIO()
    PIL.Image.fromarray(codes).save(buffer, "PNG", compress_level=1, pnginfo=info)
    return buffer.getvalue()


def encode_jpeg(codes: Bytes, quality: int, comment: str = "") -> bytes:
    """Encode (h, w, 3) 8-bit codes as JPEG, in memory, without chroma subsampling, which makes coloured edges bleed.

    Args:
        comment: stands near the beginning of the file.
    """
    import PIL.Image

    buffer = io.BytesIO()
    PIL.Image.fromarray(codes).save(buffer, "JPEG", quality=quality, subsampling=0, comment=comment or None)
    return buffer.getvalue()
