"""EXR files without compression, encoded here: a header, a table of offsets, and a block per row.

OpenImageIO takes 1.5 ms for a picture of 400 x 300 that is not compressed, most of it for copies from buffer to buffer;
one copy into place takes a fifth. The bytes are those that OpenImageIO writes, which tests compare. Layout: "OpenEXR
File Layout" of the OpenEXR documentation.
"""

import struct
from fractions import Fraction
from typing import Any

import numpy as np
from numpy.typing import NDArray

from framearray_cli.base.openimage import FIXED_DATE

from .attributes import Attribute, Attributes

_MAGIC, _VERSION, _LONG_NAMES = 20000630, 2, 0x400
_SHORT_NAME = 31  # bytes; longer names need a flag
_HALF, _FLOAT = 1, 2  # OpenEXR's types of pixels
_ALIGNED = 8  # rows start at a multiple of this in memory
# Names that OpenImageIO stores as they are; others it may rename, or keep to itself.
_PLAIN_NAMES = {"Software", "worldToCamera", "worldToNDC", "framesPerSecond", "colorInteropID"}
_OWN = "framearray:"


def can_encode(attributes: Attributes) -> bool:
    """Whether `encode_plain_exr` knows all attributes."""
    return all(name in _PLAIN_NAMES or name.startswith(_OWN) for name in attributes)


def encode_plain_exr(pixels: NDArray[Any], names: list[str], attributes: Attributes) -> memoryview:
    """Encode pixels (h, w, channels), halves or float32, as a file of EXR that is not compressed.

    Args:
        names: of the channels.
        attributes: for which `can_encode`.
    """
    height, width, _ = pixels.shape
    kind, word = (_HALF, np.dtype("<u2")) if pixels.dtype == np.float16 else (_FLOAT, np.dtype("<u4"))
    head = _header(width, height, kind, sorted(names), attributes)
    row_bytes = len(names) * width * word.itemsize
    step, first = 8 + row_bytes, len(head) + 8 * height
    before = -first % _ALIGNED
    data = np.empty(before + first + height * step, np.uint8)
    data[before : before + len(head)] = np.frombuffer(head, np.uint8)
    offsets = (first + step * np.arange(height)).astype("<u8")
    data[before + len(head) : before + first] = offsets.view(np.uint8)
    # a row: its number, its size, and each channel's values, channels by name
    rows = data[before + first :].reshape(height, step)
    rows[:, :4] = np.arange(height, dtype="<i4").view(np.uint8).reshape(height, 4)
    rows[:, 4:8] = np.frombuffer(struct.pack("<i", row_bytes), np.uint8)
    values, source = rows[:, 8:].view(word), pixels.view(word.newbyteorder("="))
    for k, channel in enumerate(sorted(range(len(names)), key=names.__getitem__)):
        values[:, k * width : (k + 1) * width] = source[..., channel]
    return data[before:].data


def _header(width: int, height: int, kind: int, names: list[str], attributes: Attributes) -> bytes:
    """Encode the header; attributes stand in the order of their names."""
    window = struct.pack("<4i", 0, 0, width - 1, height - 1)
    channels = b"".join(name.encode() + b"\0" + struct.pack("<iB3xii", kind, 0, 1, 1) for name in names) + b"\0"
    entries = {
        "capDate": ("string", FIXED_DATE.encode()),
        "channels": ("chlist", channels),
        "compression": ("compression", b"\0"),
        "dataWindow": ("box2i", window),
        "displayWindow": ("box2i", window),
        "lineOrder": ("lineOrder", b"\0"),
        "pixelAspectRatio": ("float", struct.pack("<f", 1)),
        "screenWindowCenter": ("v2f", struct.pack("<2f", 0, 0)),
        "screenWindowWidth": ("float", struct.pack("<f", 1)),
        **{name: _encode(value) for name, value in attributes.items() if not isinstance(value, str) or value},
    }
    longest = max(len(name.encode()) for name in (*entries, *names))
    parts = [struct.pack("<ii", _MAGIC, _VERSION | (_LONG_NAMES if longest > _SHORT_NAME else 0))]
    for name in sorted(entries, key=str.encode):
        type_name, value = entries[name]
        parts.append(name.encode() + b"\0" + type_name.encode() + b"\0" + struct.pack("<i", len(value)) + value)
    return b"".join(parts) + b"\0"


def _encode(value: Attribute) -> tuple[str, bytes]:
    """OpenEXR's type of an attribute, and its bytes."""
    if isinstance(value, np.ndarray):
        return "m44f", np.ascontiguousarray(value.T, "<f4").tobytes()  # row vectors in the file, see attributes.py
    if isinstance(value, Fraction):
        return "rational", struct.pack("<iI", value.numerator, value.denominator)
    if isinstance(value, str):
        return "string", value.encode()
    if isinstance(value, tuple):
        return "v3f", struct.pack("<3f", *value)
    return ("int", struct.pack("<i", value)) if isinstance(value, int) else ("float", struct.pack("<f", value))
