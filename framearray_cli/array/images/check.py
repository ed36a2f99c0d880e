"""Check quickly that an image file exists, is whole and has the right size, without decoding all of it."""

import os
from pathlib import Path

from framearray_cli.base.errors import OutputError
from framearray_cli.base.files import require_file
from framearray_cli.base.openimage import last_row

from .images import format_name, read_image
from .png import open_picture

JPEG_END = b"\xff\xd9"


def check_image(path: Path, resolution: tuple[int, int]) -> None:
    """Check the head and the end of an image file, as a truncated file has lost its end; of PNG, all checksums.

    Where that is inconclusive (tiles, bytes behind the end of a JPEG), decode the whole image.

    Args:
        resolution: expected width and height, pixels.

    Raises:
        OutputError: the file is missing, damaged, cut short or of another size.
    """
    require_file(path)
    size: tuple[int, int] | None
    match format_name(path):
        case "png":
            size = _size_of_png(path)
        case "jpg":
            size = _size_of_jpeg(path)
        case _:
            size = last_row(path)
    if size is None:
        image = read_image(path)
        size = (image.shape[1], image.shape[0])
    if size != resolution:
        width, height = resolution
        raise OutputError(f"{path}: expected {width} x {height} pixels, got {size[0]} x {size[1]}")


def _size_of_png(path: Path) -> tuple[int, int]:
    """Read the size of a PNG and check the checksum of each chunk, which Pillow skips when it decodes."""
    with open_picture(path) as picture:
        size: tuple[int, int] = picture.size
        picture.verify()
    return size


def _size_of_jpeg(path: Path) -> tuple[int, int] | None:
    """Read the size from the head of a JPEG; None if the head is unreadable or the end marker is missing."""
    try:
        with path.open("rb") as file:
            file.seek(-len(JPEG_END), os.SEEK_END)
            if file.read() != JPEG_END:
                return None
        with open_picture(path) as picture:
            size: tuple[int, int] = picture.size
            return size
    except (OSError, OutputError):
        return None
