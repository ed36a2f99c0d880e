"""Fingerprints of what went into a render: equal inputs, equal text."""

import hashlib
from pathlib import Path

from .errors import OutputError
from .files import reason


def fingerprint(*parts: bytes | memoryview | Path) -> str:
    """Hash the job and the scene: "sha256:" and 64 hexadecimal digits.

    Each part counts with its length, so that moving bytes from one part to the next changes the result. The content
    of a file counts, its name does not.

    Raises:
        OutputError: a file cannot be read.
    """
    total = hashlib.sha256()
    for part in parts:
        if isinstance(part, Path):
            try:
                with part.open("rb") as file:
                    digest = hashlib.file_digest(file, "sha256").digest()
            except OSError as error:
                raise OutputError(f"{part}: cannot be read for its fingerprint: {reason(error)}") from error
        else:
            digest = hashlib.sha256(part).digest()
        total.update(digest)  # all of one length, so no part runs into the next
    return f"sha256:{total.hexdigest()}"
