"""A quick look whether an image file is there, whole and of the right size, without decoding all of it."""

from pathlib import Path

from .errors import OutputError
from .images import last_row, read_codes, read_image

_ENDS = {".png": b"IEND\xaeB`\x82", ".jpg": b"\xff\xd9", ".jpeg": b"\xff\xd9"}


def check_image(path: Path, resolution: tuple[int, int]) -> None:
    """Look at the head and the end of an image file: one that was cut short has lost its end.

    Where that tells nothing (tiles, bytes behind the end), the whole image is decoded.

    Args:
        resolution: width and height that are expected, pixels.

    Raises:
        OutputError: the file is missing, damaged, cut short or of another size.
    """
    end = _ENDS.get(path.suffix.lower())
    size = _size_of_picture(path, end) if end else last_row(path)
    if size is None:
        image = read_codes(path) if end else read_image(path)
        size = (image.shape[1], image.shape[0])
    if size != resolution:
        width, height = resolution
        raise OutputError(f"{path}: expected {width} x {height} pixels, got {size[0]} x {size[1]}")


def _size_of_picture(path: Path, end: bytes) -> tuple[int, int] | None:
    """Read the size from the head of a PNG or JPEG whose end is there; None if either is not found."""
    import PIL.Image

    try:
        with path.open("rb") as file:
            file.seek(-len(end), 2)
            if file.read() != end:
                return None
        with PIL.Image.open(path) as picture:
            return picture.size
    except (OSError, SyntaxError, ValueError):
        return None
