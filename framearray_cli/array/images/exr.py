"""Write EXR and TIFF with OpenImageIO, which raises nothing: every return value is checked here."""

import os
from fractions import Fraction
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from framearray_cli.base.errors import OutputError
from framearray_cli.base.files import refusal, whole_file
from framearray_cli.base.openimage import begins_well, first_line, oiio

from .attributes import FIXED_DATE, Attribute, Attributes

OIIO_NAMES = {"exr": "openexr", "tif": "tiff"}


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
            why = refusal(part, pixels.nbytes) or first_line(message, part)
            raise OutputError(f"{path}: cannot be written: {why}")
        _check_end(path, part, pixels.nbytes)


def last_row(path: Path) -> tuple[int, int] | None:
    """Return width and height of an EXR or TIFF if its last row, which a truncated file lacks, can be read."""
    library = oiio()
    source = library.ImageInput.open(str(path)) if os.path.isfile(path) and begins_well(path) else None
    if source is None:
        library.geterror()  # clears what the failed opening left behind
        return None
    spec = source.spec()
    row = source.read_scanlines(spec.height - 1, spec.height, 0, 0, spec.nchannels, library.UNKNOWN)
    message = source.geterror()
    source.close()
    return None if row is None or message else (spec.width, spec.height)


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
