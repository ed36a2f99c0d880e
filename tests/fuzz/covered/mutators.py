"""Mutations that know the kind of a file: those of the other fuzz runs, as functions of bytes."""

import json
from collections.abc import Callable
from random import Random

from .. import mutations, texts
from ..scenefiles import with_tree
from ..sceneseeds import split_glb

Mutate = Callable[[Random, bytes], bytes]
LONGEST_WORD = 200  # bytes


def data(rng: Random, found: bytes) -> bytes:
    """Bytes of any file."""
    if not found:
        return rng.randbytes(8)
    return mutations.BYTES[rng.choice([*mutations.BYTES])](rng, found, found)


def text(rng: Random, found: bytes) -> bytes:
    """Words and lines of a text, sometimes its bytes."""
    if max(map(len, found.split()), default=0) > LONGEST_WORD:
        return data(rng, found)  # long lines repeat a word, thousands of times
    match rng.randrange(4):
        case 0:
            return texts.TEXT[rng.choice([*texts.TEXT])](rng, found)
        case 1:
            return data(rng, found)
    return mutations.mutate_text(rng, found, rng.choice([*mutations.TEXT]))


def tree(rng: Random, found: bytes) -> bytes:
    """Values of a JSON file, or its text."""
    try:
        values = json.loads(found)
    except (ValueError, RecursionError):
        return text(rng, found)
    if rng.random() < 0.2 or not isinstance(values, dict | list):
        return text(rng, found)
    return _changed(rng, values) or data(rng, found)


def lines_of_json(rng: Random, found: bytes) -> bytes:
    """One line of a file of JSON lines."""
    lines = found.split(b"\n")
    at = rng.randrange(len(lines))
    lines[at] = tree(rng, lines[at])
    return b"\n".join(lines)


def glb(rng: Random, found: bytes) -> bytes:
    """Values of the tree of a GLB, or its bytes."""
    try:
        values, _ = split_glb(found)
    except (ValueError, RecursionError):
        return data(rng, found)
    if rng.random() < 0.2 or not isinstance(values, dict):
        return data(rng, found)
    changed = _changed(rng, values)
    return with_tree(found, changed) if changed else data(rng, found)


def _changed(rng: Random, values: object) -> bytes | None:
    """A tree with a change, as text; None where it is too deep to be written."""
    try:
        changed = mutations.mutate_tree(rng, values, rng.choice([*mutations.TREE]))
        return json.dumps(changed, default=str).encode("utf-8", "surrogatepass")
    except RecursionError:
        return None
