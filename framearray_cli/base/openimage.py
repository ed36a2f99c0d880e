"""The door to OpenImageIO, which reads and writes images. It raises nothing: every return value is checked here."""

import os
import tempfile
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from functools import cache
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from .arrays import Float32
from .errors import OutputError
from .extras import extra
from .files import refusal, whole_file
from .units import MOST_EMISSION, counted

MOST_PIXELS = 16384**2  # of an image; no job may have more
# EXR and TIFF files carry a date. A fixed one makes files of equal images equal.
FIXED_DATE = "2000:01:01 00:00:00"
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
    """Read all channels as float32; return their names and pixels (h, w, channels), of an EXR its display window.

    Raises:
        OutputError: the file is missing, damaged or truncated.
    """
    library, source = oiio(), _opened(path)
    spec, is_exr = source.spec(), source.format_name() == "openexr"
    check_size(path, spec.width, spec.height)
    check_size(path, spec.full_width, spec.full_height)
    pixels = source.read_image(library.FLOAT)
    message = _error_of(source)
    source.close()
    if pixels is None or message:
        raise OutputError(f"{path}: damaged or cut short: {first_line(message, path)}")
    with _only_text(path):
        names = list(spec.channelnames)
        "".join(names).encode()
    pixels = np.asarray(pixels, np.float32).reshape(spec.height, spec.width, -1)
    return names, _display_window(spec, pixels) if is_exr else pixels


def holds_floats(data: bytes) -> bool:
    """Return True if bytes begin like an EXR or HDR."""
    return data[:4] in (_HEADS[0], *_HEADS[-2:])


def pixels_of(data: bytes, checked: Callable[[int, int], None]) -> tuple[list[str], Float32] | None:
    """Read the bytes of an EXR or HDR as `read_pixels` does; None if they are neither.

    Args:
        checked: is called with width and height before any pixel is read.

    Raises:
        OutputError: as `read_pixels`.
    """
    if not holds_floats(data):
        return None
    with tempfile.TemporaryDirectory() as folder:
        path = Path(folder, "image.exr" if data[:4] == _HEADS[0] else "image.hdr")
        path.write_bytes(data)
        try:
            source = _opened(path)
            spec = source.spec()
            source.close()
            checked(max(spec.width, spec.full_width), max(spec.height, spec.full_height))
            return read_pixels(path)
        except OutputError as error:
            raise OutputError(str(error).removeprefix(f"{path}: ")) from error


def _display_window(spec: Any, pixels: Float32) -> Float32:
    """The display window of an EXR, black outside its data window (h, w, channels)."""
    x, y, height, width = spec.x - spec.full_x, spec.y - spec.full_y, spec.full_height, spec.full_width
    if (x, y, *pixels.shape[:2]) == (0, 0, height, width):
        return pixels
    found = np.zeros((height, width, pixels.shape[2]), np.float32)
    part = pixels[max(-y, 0) : max(height - y, 0), max(-x, 0) : max(width - x, 0)]
    found[max(y, 0) : max(y, 0) + part.shape[0], max(x, 0) : max(x, 0) + part.shape[1]] = part
    return found


def _opened(path: Path) -> Any:
    """Open an EXR, TIFF or HDR."""
    if not os.path.isfile(path):  # a pipe would wait forever
        raise OutputError(f"{path}: no such file")
    if not begins_well(path):
        raise OutputError(f"{path}: not an image, or damaged: it does not begin like EXR, TIFF or HDR")
    source = oiio().ImageInput.open(str(path))
    if source is None:
        raise OutputError(f"{path}: not an image, or damaged: {first_line(_error_of(oiio()), path)}")
    return source


@contextmanager
def _only_text(path: Path) -> Iterator[None]:
    """Refuse a file with names that are not UTF-8: OpenImageIO 3.1 cannot hand them on, 3.2 puts surrogates in them."""
    try:
        yield
    except UnicodeError:
        raise OutputError(f"{path}: damaged: its header has names that are not UTF-8") from None


def _error_of(source: Any) -> str:
    """Return the library's message on the last failure; it may quote names in a file that are no text."""
    try:
        return str(source.geterror())
    except UnicodeDecodeError as error:
        return error.object.decode("utf-8", "replace")


def read_texts(path: Path, prefix: str | tuple[str, ...]) -> dict[str, str]:
    """Read the texts in the header of an EXR whose names begin like `prefix`, or like one of several.

    Raises:
        OutputError: the file is missing or damaged.
    """
    source = _opened(path)
    with _only_text(path):
        found = {entry.name: entry.value for entry in source.spec().extra_attribs if entry.name.startswith(prefix)}
        texts = {name: value for name, value in found.items() if isinstance(value, str)}
        "".join([*texts, *texts.values()]).encode()
    source.close()
    return texts


def read_rgb(path: Path) -> Float32:
    """Read the channels R, G and B of an EXR, TIFF or HDR as linear radiance, (h, w, 3).

    Raises:
        OutputError: the file is missing, damaged or truncated, or has no such channels.
    """
    names, pixels = read_pixels(path)
    if not {"R", "G", "B"} <= set(names):
        raise OutputError(f"{path}: expected channels R, G, B, found {', '.join(names)}")
    if names == ["R", "G", "B"]:  # without layers: no copy, which takes as long as reading a file
        return pixels
    return np.ascontiguousarray(pixels[..., [names.index(name) for name in "RGB"]])


def read_environment(path: Path) -> tuple[Float32, str]:
    """Read an environment map, a panorama of linear radiance, (h, 2 h, 3); also return the note of `mend_radiance`.

    Raises:
        OutputError: as `read_pixels`, or the file has another format or shape, or nothing in it shines.
    """
    if path.suffix.lower() not in LINEAR_MAPS:
        raise OutputError(f"{path}: expected an environment map with linear light, {', '.join(LINEAR_MAPS)}")
    names, pixels = read_pixels(path)
    channels = colour_channels(names)
    if not channels:
        raise OutputError(f"{path}: expected channels R, G, B, or one, found {', '.join(names)}")
    if channels != list(range(len(names))):
        pixels = np.ascontiguousarray(pixels[..., channels])
    height, width, _ = pixels.shape
    if width != 2 * height:
        raise OutputError(f"{path}: expected a panorama, twice as wide as high, got {width} x {height} pixels")
    return mend_panorama(path, pixels)


def colour_channels(names: list[str]) -> list[int]:
    """Numbers of red, green and blue of the first layer that has them, or of a single grey channel; none of others."""
    found = {name.upper(): number for number, name in enumerate(names)}
    for name in found:
        layer = name[:-1]
        if name == f"{layer}R" and layer[-1:] in ("", ".") and {f"{layer}G", f"{layer}B"} <= set(found):
            return [found[f"{layer}{channel}"] for channel in "RGB"]
    colours = [number for name, number in found.items() if name != "A"]
    return 3 * colours if len(colours) == 1 else []


def mend_radiance(pixels: Float32) -> tuple[Float32, str]:
    """Repair texels that are no radiance.

    Channels below 0 become 0, channels above MOST_EMISSION become MOST_EMISSION. Texels with a channel that is infinite
    or not a number become the mean of all others.

    Args:
        pixels: (h, w, k).

    Returns:
        The pixels, the very array if nothing is repaired; and a note on the repair, or "".

    Raises:
        OutputError: no texel is finite.
    """
    if pixels.min(initial=0.0) >= 0 and pixels.max(initial=0.0) <= MOST_EMISSION:  # False for NaN
        return pixels, ""
    finite = np.isfinite(pixels).all(axis=-1)
    if not finite.any():
        raise OutputError("expected radiance, got no finite texel")
    low, high = (pixels < 0).any(axis=-1) & finite, (pixels > MOST_EMISSION).any(axis=-1) & finite
    found = np.clip(pixels, np.float32(0.0), np.float32(MOST_EMISSION))
    found[~finite] = found[finite].mean(axis=0, dtype=np.float64)
    counts = [
        (int(low.sum()), "negative in {} (taken as 0)"),
        (int(high.sum()), f"above {MOST_EMISSION:g} in {{}} (taken as {MOST_EMISSION:g})"),
        (int((~finite).sum()), "not finite in {} (taken as the mean of the others)"),
    ]
    kinds = [text.format(counted(n, "texel")) for n, text in counts if n]
    return found, f"radiance is {', '.join(kinds)}"


def mend_panorama(name: Path | str, pixels: Float32) -> tuple[Float32, str]:
    """Repair the radiance of a panorama as `mend_radiance` does; the note begins with its name.

    Raises:
        OutputError: nothing in it shines.
    """
    try:
        found, note = mend_radiance(pixels)
    except OutputError as error:
        raise OutputError(f"{name}: {error}") from error
    if not found.any():
        got = "no radiance above 0" if note else "radiance 0 everywhere"
        raise OutputError(f"{name}: expected an environment that shines, got {got}")
    return found, f"{Path(name).name}: {note}" if note else ""


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
    try:
        source = _opened(path)
    except OutputError:
        return None
    spec = source.spec()
    row = source.read_scanlines(spec.height - 1, spec.height, 0, 0, spec.nchannels, oiio().UNKNOWN)
    message = _error_of(source)
    source.close()
    return None if row is None or message else (spec.width, spec.height)


def check_size(path: Path, width: int, height: int) -> None:
    """Refuse a size beyond any job, which a few bytes can claim, before memory is allocated for it."""
    if width * height > MOST_PIXELS:
        raise OutputError(f"{path}: damaged: it says that it has {width} x {height} pixels, more than any job")


def begins_well(path: Path) -> bool:
    """Return True if a file begins like EXR, TIFF or HDR; OpenImageIO would try all its readers on any other."""
    try:
        with path.open("rb") as file:
            return file.read(4) in _HEADS
    except OSError:
        return False


def first_line(message: str, path: Path) -> str:
    """Shorten an OpenImageIO error to one line, without the path that the message around it already names."""
    lines = [line.strip() for line in message.replace(str(path), path.name).splitlines() if line.strip()]
    return lines[0] if lines else "no reason given"


def _check_end(path: Path, part: Path, n_bytes: int) -> None:
    """Read the last row back (0.15 ms): a disk that is full when the last buffer is flushed goes unreported."""
    if last_row(part) is None:
        why = refusal(part, n_bytes) or "the file is cut short; is the disk full?"
        raise OutputError(f"{path}: cannot be written: {why}")
