"""Fingerprints of what went into a render: equal inputs, equal text."""

import hashlib


def fingerprint(*parts: bytes | memoryview) -> str:
    """Hash the job and the scene: "sha256:" and 64 hexadecimal digits.

    Each part counts with its length, so that moving bytes from one part to the next changes the result.
    """
    total = hashlib.sha256()
    for part in parts:
        total.update(hashlib.sha256(part).digest())  # all of one length, so no part runs into the next
    return f"sha256:{total.hexdigest()}"
