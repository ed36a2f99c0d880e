"""The door to OpenImageIO, and images read with it. It raises nothing: every return value is checked here."""

import os
from functools import cache
from pathlib import Path
from typing import Any

import numpy as np

from .arrays import Float32
from .errors import OutputError
from .extras import extra

MOST_PIXELS = 16384**2  # of an image; no job may have more
LINEAR_MAPS = (".exr", ".hdr", ".tif", ".tiff")
# Of EXR, TIFF, large TIFF and Radiance.
_HEADS = (b"\x76\x2f\x31\x01", b"II*\0", b"MM\0*", b"II+\0", b"MM\0+", b"#?RA", b"#?RG")


@cache
def oiio() -> Any:
    """Import OpenImageIO, with its own threads off: callers write several files at once instead."""
    with extra("images need OpenImageIO", "OpenImageIO", reason=True):
        import OpenImageIO
    OpenImageIO.attribute("threads", 1)
    OpenImageIO.attribute("exr_threads", -1)  # -1: compress in the calling thread; 1 would use another
    return OpenImageIO


def read_pixels(path: Path) -> tuple[list[str], Float32]:
    """Read all channels as float32; return their names and pixels (h, w, channels).

    Raises:
        OutputError: the file is missing, damaged or truncated.
    """
    library = oiio()
    if not os.path.isfile(path):
        raise OutputError(f"{path}: no such file")
    if not begins_well(path):
        raise OutputError(f"{path}: not an image, or damaged: it does not begin like EXR, TIFF or HDR")
    source = library.ImageInput.open(str(path))
    if source is None:
        raise OutputError(f"{path}: not an image, or damaged: {first_line(library.geterror(), path)}")
    spec = source.spec()
    check_size(path, spec.width, spec.height)
    pixels = source.read_image(library.FLOAT)
    message = source.geterror()
    source.close()
    if pixels is None or message:
        raise OutputError(f"{path}: damaged or cut short: {first_line(message, path)}")
    return list(spec.channelnames), np.asarray(pixels, np.float32).reshape(spec.height, spec.width, -1)


def read_rgb(path: Path) -> Float32:
    """Read the channels R, G and B of an EXR, TIFF or HDR as linear radiance, (h, w, 3).

    Raises:
        OutputError: the file is missing, damaged or truncated, or has no such channels.
    """
    names, pixels = read_pixels(path)
    if not {"R", "G", "B"} <= set(names):
        raise OutputError(f"{path}: expected channels R, G, B, found {', '.join(names)}")
    return np.ascontiguousarray(pixels[..., [names.index(name) for name in "RGB"]])


def read_environment(path: Path) -> Float32:
    """Read an environment map, a panorama of linear radiance, (h, 2 h, 3).

    Raises:
        OutputError: as `read_rgb`, or the file has another format or shape.
    """
    if path.suffix.lower() not in LINEAR_MAPS:
        raise OutputError(f"{path}: expected an environment map with linear light, {', '.join(LINEAR_MAPS)}")
    pixels = read_rgb(path)
    height, width, _ = pixels.shape
    if width != 2 * height:
        raise OutputError(f"{path}: expected a panorama, twice as wide as high, got {width} x {height} pixels")
    return pixels


def check_size(path: Path, width: int, height: int) -> None:
    """Refuse a size beyond any job, which a few bytes can claim, before memory is allocated for it."""
    if width * height > MOST_PIXELS:
        raise OutputError(f"{path}: damaged: it says that it has {width} x {height} pixels, more than any job")


def begins_well(path: Path) -> bool:
    """Whether a file begins like EXR, TIFF or HDR; OpenImageIO would try all its readers on any other."""
    try:
        with path.open("rb") as file:
            return file.read(4) in _HEADS
    except OSError:
        return False


def first_line(message: str, path: Path) -> str:
    """Shorten an OpenImageIO error to one line, without the path that the message around it already names."""
    lines = [line.strip() for line in message.replace(str(path), path.name).splitlines() if line.strip()]
    return lines[0] if lines else "no reason given"
