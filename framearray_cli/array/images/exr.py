"""Read and write EXR and TIFF with OpenImageIO, which raises nothing: every return value is checked here."""

import os
from fractions import Fraction
from functools import cache
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from framearray_cli.base.arrays import Float32
from framearray_cli.base.errors import OutputError
from framearray_cli.base.extras import extra
from framearray_cli.base.files import refusal, whole_file

from .attributes import FIXED_DATE, Attribute, Attributes
from .png import check_size

OIIO_NAMES = {"exr": "openexr", "tif": "tiff"}
# Of EXR, TIFF, large TIFF and Radiance.
_HEADS = (b"\x76\x2f\x31\x01", b"II*\0", b"MM\0*", b"II+\0", b"MM\0+", b"#?RA", b"#?RG")


def spec_of(shape: tuple[int, ...], names: list[str], kinds: list[str], attributes: Attributes) -> Any:
    """Describe an image of `shape` (h, w, channels) with "half" or "float" per channel."""
    library = oiio()
    height, width, channels = shape
    spec = library.ImageSpec(width, height, channels, "float" if "float" in kinds else "half")
    spec.channelnames = names
    if len(set(kinds)) > 1:
        spec.channelformats = kinds
    for name, value in {"DateTime": FIXED_DATE, **attributes}.items():
        _set_attribute(spec, name, value)
    return spec


def write_pixels(path: Path, format_name: str, spec: Any, pixels: NDArray[Any]) -> None:
    """Write pixels (h, w, channels) in a named format: a temporary file has no suffix to choose it by."""
    library = oiio()
    pixels = np.ascontiguousarray(pixels)  # a strided array can be stored wrongly without an error
    with whole_file(path) as part:
        output = library.ImageOutput.create(format_name)
        if output is None:
            raise OutputError(f"{path}: OpenImageIO cannot write {format_name}: {library.geterror()}")
        # All three calls run; the file is good only if none fails and no error was left behind.
        done = output.open(str(part), spec) and output.write_image(pixels)
        done = output.close() and done
        message = output.geterror()
        if not done or message:
            why = refusal(part, pixels.nbytes) or _first_line(message, part)
            raise OutputError(f"{path}: cannot be written: {why}")
        _check_end(path, part, pixels.nbytes)


def read_pixels(path: Path) -> tuple[list[str], Float32]:
    """Read all channels as float32; return their names and pixels (h, w, channels)."""
    library = oiio()
    if not os.path.isfile(path):
        raise OutputError(f"{path}: no such file")
    if not _begins_well(path):
        raise OutputError(f"{path}: not an image, or damaged: it does not begin like EXR, TIFF or HDR")
    source = library.ImageInput.open(str(path))
    if source is None:
        raise OutputError(f"{path}: not an image, or damaged: {_first_line(library.geterror(), path)}")
    spec = source.spec()
    check_size(path, spec.width, spec.height)
    pixels = source.read_image(library.FLOAT)
    message = source.geterror()
    source.close()
    if pixels is None or message:
        raise OutputError(f"{path}: damaged or cut short: {_first_line(message, path)}")
    return list(spec.channelnames), np.asarray(pixels, np.float32).reshape(spec.height, spec.width, -1)


def last_row(path: Path) -> tuple[int, int] | None:
    """Return width and height of an EXR or TIFF if its last row, which a truncated file lacks, can be read."""
    library = oiio()
    source = library.ImageInput.open(str(path)) if os.path.isfile(path) and _begins_well(path) else None
    if source is None:
        library.geterror()  # clears what the failed opening left behind
        return None
    spec = source.spec()
    row = source.read_scanlines(spec.height - 1, spec.height, 0, 0, spec.nchannels, library.UNKNOWN)
    message = source.geterror()
    source.close()
    return None if row is None or message else (spec.width, spec.height)


@cache
def oiio() -> Any:
    """Import OpenImageIO, with its own threads off: callers write several files at once instead."""
    with extra("images need OpenImageIO", "OpenImageIO", reason=True):
        import OpenImageIO
    OpenImageIO.attribute("threads", 1)
    OpenImageIO.attribute("exr_threads", -1)  # -1: compress in the calling thread; 1 would use another
    return OpenImageIO


def _set_attribute(spec: Any, name: str, value: Attribute) -> None:
    library = oiio()
    if isinstance(value, np.ndarray):
        rows = np.asarray(value.T, np.float32)  # row vectors in the file, see attributes.py
        spec.attribute(name, library.TypeDesc("matrix44"), tuple(rows.ravel().tolist()))
    elif isinstance(value, Fraction):
        spec.attribute(name, library.TypeDesc("rational"), (value.numerator, value.denominator))
    elif isinstance(value, tuple):
        spec.attribute(name, library.TypeDesc("vector"), tuple(float(x) for x in value))
    else:
        spec.attribute(name, value)


def _check_end(path: Path, part: Path, n_bytes: int) -> None:
    """Read the last row back (0.15 ms): a disk that is full when the last buffer is flushed goes unreported."""
    if last_row(part) is None:
        why = refusal(part, n_bytes) or "the file is cut short; is the disk full?"
        raise OutputError(f"{path}: cannot be written: {why}")


def _begins_well(path: Path) -> bool:
    """Whether a file begins like EXR, TIFF or HDR; OpenImageIO would try all its readers on any other."""
    try:
        with path.open("rb") as file:
            return file.read(4) in _HEADS
    except OSError:
        return False


def _first_line(message: str, path: Path) -> str:
    """Shorten an OpenImageIO error to one line, without the path that the message around it already names."""
    lines = [line.strip() for line in message.replace(str(path), path.name).splitlines() if line.strip()]
    return lines[0] if lines else "no reason given"
