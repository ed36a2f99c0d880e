"""The frame rate in the header of an image file: read and replaced, every other byte stays.

The result has the bytes that a render at the new rate writes, as only EXR and PNG keep the rate.
"""

import re
import struct
import zlib
from collections.abc import Iterator
from fractions import Fraction

RATE = b"framesPerSecond"  # OpenEXR's name; PNG has it as text
_EXR, _PNG = b"\x76\x2f\x31\x01", b"\x89PNG\r\n\x1a\n"
_HEAD, _WORD, _CHUNK, _RATIONAL = 8, 4, 12, struct.Struct("<iI")


def frame_rate_of(data: bytes) -> Fraction | None:
    """Return the frames per second in an image file; None if it holds none, or is damaged."""
    try:
        if data.startswith(_EXR):
            return next((Fraction(*_RATIONAL.unpack_from(data, at)) for at in _exr_rates(data)), None)
        if data.startswith(_PNG):
            return next((read_rate(text.decode("ascii")) for _, _, text in _png_rates(data)), None)
    except (ValueError, ZeroDivisionError, struct.error):
        return None
    return None


def read_rate(text: str) -> Fraction:
    """Read a rate as `str` writes it, "24" or "24000/1001".

    Raises:
        ValueError, ZeroDivisionError: the text is no such fraction of two numbers of at most nine digits.
    """
    if not re.fullmatch(r"\d{1,9}(/\d{1,9})?", text, re.ASCII):
        raise ValueError(f"expected a rate such as 24000/1001, got {text[:60]!r}")
    return Fraction(text)


def with_frame_rate(data: bytes, rate: Fraction) -> bytes:
    """Return an image file with another frame rate; as it is if it holds none."""
    if frame_rate_of(data) in (None, rate):
        return data
    if data.startswith(_EXR):
        at = next(_exr_rates(data))
        return data[:at] + _RATIONAL.pack(rate.numerator, rate.denominator) + data[at + _RATIONAL.size :]
    start, end, _ = next(_png_rates(data))
    body = b"tEXt" + RATE + b"\0" + str(rate).encode()
    return data[:start] + struct.pack(">I", len(body) - _WORD) + body + struct.pack(">I", zlib.crc32(body)) + data[end:]


def _exr_rates(data: bytes) -> Iterator[int]:
    """Yield where the rate stands among the attributes of an EXR: name, type, size, value; an empty name ends them."""
    at = _HEAD
    while (name_end := data.index(b"\0", at)) > at:
        type_end = data.index(b"\0", name_end + 1)
        (size,) = struct.unpack_from("<i", data, type_end + 1)
        value = type_end + 1 + _WORD
        if data[at:name_end] == RATE and data[name_end + 1 : type_end] == b"rational" and size == _RATIONAL.size:
            yield value
        if size < 0:
            raise ValueError("an attribute of negative size")
        at = value + size


def _png_rates(data: bytes) -> Iterator[tuple[int, int, bytes]]:
    """Yield start, end and text of each chunk of a PNG that holds the rate."""
    at = _HEAD
    while at + _CHUNK <= len(data):
        size, kind = struct.unpack_from(">I4s", data, at)
        end = at + _CHUNK + size
        keyword, _, text = data[at + 2 * _WORD : end - _WORD].partition(b"\0")
        if kind == b"tEXt" and keyword == RATE:
            yield at, end, text
        at = end
