"""Fingerprints of the input of a render, and checksums of files and lines."""

import hashlib
from collections.abc import Iterable
from pathlib import Path


def fingerprint(*parts: bytes | memoryview) -> str:
    """Hash parts of a job and a scene: "sha256:" and 64 hexadecimal digits.

    Each part is hashed on its own first, so moving bytes from one part to the next changes the result.
    """
    total = hashlib.sha256()
    for part in parts:
        total.update(hashlib.sha256(part).digest())
    return f"sha256:{total.hexdigest()}"


def digest(path: Path) -> tuple[int, str]:
    """Size and checksum of a file: XXH3 of 128 bits, which detects damage and runs at the speed of memory.

    Raises:
        OSError: it cannot be read.
    """
    import xxhash

    with path.open("rb") as file:
        total = xxhash.xxh3_128()
        size = 0
        while block := file.read(1 << 22):
            total.update(block)
            size += len(block)
    return size, total.hexdigest()


def data_digest(data: bytes) -> tuple[int, str]:
    """Size and checksum of a file with this content, as `digest` returns them."""
    import xxhash

    return len(data), xxhash.xxh3_128_hexdigest(data)


def joint_digest(parts: Iterable[bytes | memoryview]) -> str:
    """Checksum of all bytes of some parts, one after the other, as `digest` has it of a file."""
    import xxhash

    total = xxhash.xxh3_128()
    for part in parts:
        total.update(part)
    found: str = total.hexdigest()
    return found


def line_digest(line: bytes) -> bytes:
    """Digest a line of a record: XXH3 of 64 bits, 16 hexadecimal digits."""
    import xxhash

    return xxhash.xxh3_64_hexdigest(line).encode()
