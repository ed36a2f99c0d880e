"""Counts in a crate, the binary form of USD, checked before the library takes memory for what they claim.

A crate begins with a mark, a version and the place of its table of contents: name, place and length of each section.
Each section begins with the number of its values. They are packed, but one byte cannot stand for any number of them.
"""

import mmap
import struct
from collections.abc import Callable
from pathlib import Path

from framearray_cli.base.units import counted

MARK, PACKAGE = b"PXR-USDC", b"PK"
HEAD, SECTION = struct.Struct("<8s8sq"), struct.Struct("<16sqq")
COUNTED = (b"TOKENS", b"STRINGS", b"FIELDS", b"FIELDSETS", b"PATHS", b"SPECS")
# Whole numbers take at least two bits each, then LZ4 makes one byte of at most 255.
MOST_PER_BYTE = 1024
MOST_SECTIONS = 64

Read = Callable[[int, int], bytes]


def check_crates(file: Path) -> None:
    """Check a crate, or those in a package, which holds them as they are.

    Raises:
        ValueError: a section claims more than it can hold, or lies outside the file.
    """
    if not file.stat().st_size:
        return
    with file.open("rb") as opened, mmap.mmap(opened.fileno(), 0, access=mmap.ACCESS_READ) as data:
        package = data[: len(PACKAGE)] == PACKAGE
        first = data.find(MARK) if package else 0
        while first >= 0:
            check_crate(_reader(data, first), len(data) - first)
            first = data.find(MARK, first + 1) if package else -1


def _reader(data: mmap.mmap, first: int) -> Read:
    return lambda offset, length: data[first + offset : first + offset + length]


def check_crate(read: Read, size: int) -> None:
    """Check a crate of `size` bytes; other files are fine.

    Raises:
        ValueError: a section claims more than it can hold, or lies outside the file.
    """
    head = read(0, HEAD.size)
    if len(head) < HEAD.size or not head.startswith(MARK):
        return
    contents = HEAD.unpack(head)[2]
    if not HEAD.size <= contents <= size - 8:
        raise ValueError("its table of contents lies outside the file")
    (count,) = struct.unpack("<Q", read(contents, 8))
    if count > min(MOST_SECTIONS, (size - contents - 8) // SECTION.size):
        raise ValueError(f"its table of contents claims {counted(count, 'section')}")
    for k in range(count):
        name, start, length = SECTION.unpack(read(contents + 8 + k * SECTION.size, SECTION.size))
        if start < 0 or length < 0 or start + length > size:
            raise ValueError("a section of it lies outside the file")
        name = name.rstrip(b"\0")
        claims = read(start, 16) if name in COUNTED else b""
        numbers = struct.unpack(f"<{len(claims) // 8}Q", claims[: len(claims) // 8 * 8])
        most = max(numbers[: 2 if name == b"TOKENS" else 1], default=0)  # of tokens, then of their characters
        if most > MOST_PER_BYTE * length:
            raise ValueError(
                f"its section {name.decode()} claims {counted(most, 'value')} in {counted(length, 'byte')}"
            )
