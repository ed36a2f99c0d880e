"""Mutations that know the kind of a file: those of the other fuzz runs, as functions of bytes."""

import json
from collections.abc import Callable
from random import Random

from support.scenes import glb_of, split_glb

from .. import texts
from ..tables import mutated_json

Mutate = Callable[[Random, bytes], bytes]
LONGEST_WORD = 200  # bytes


def data(rng: Random, found: bytes) -> bytes:
    """Bytes of any file."""
    return rng.choice([*texts.BYTES.values()])(rng, found)


def text(rng: Random, found: bytes) -> bytes:
    """Words and lines of a text, sometimes its bytes."""
    if max(map(len, found.split()), default=0) > LONGEST_WORD:
        return data(rng, found)  # long lines repeat a word, thousands of times
    return rng.choice([*(texts.BYTES if rng.random() < 0.3 else texts.LINES).values()])(rng, found)


def tree(rng: Random, found: bytes) -> bytes:
    """Values of a JSON file, or its text."""
    try:
        values = json.loads(found)
        if rng.random() < 0.8 and isinstance(values, dict | list):
            return mutated_json(rng, values)[1]
    except (ValueError, RecursionError):
        pass
    return text(rng, found)


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
        if rng.random() < 0.8 and isinstance(values, dict):
            return with_tree(found, mutated_json(rng, values)[1])
    except (ValueError, RecursionError):
        pass
    return data(rng, found)


def with_tree(data: bytes, text: bytes) -> bytes:
    """A glTF with another JSON."""
    return glb_of(text, split_glb(data)[1]) if data[:4] == b"glTF" else text
