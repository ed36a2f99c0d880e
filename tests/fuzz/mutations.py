"""Ways to break a file: bytes, words of a text, values of a tree."""

import copy
import struct
from collections.abc import Callable, Iterator
from itertools import islice
from random import Random
from typing import Any

Bytes = Callable[[Random, bytes, bytes], bytes]

NUMBERS = ("-1", "0", "1e999", "-1e999", "nan", "inf", "1e38", "-1e38", "3.5e38", "1e-45", "1e308", "-0", "0.5")
NUMBERS += ("2147483647", "2147483648", "-2147483648", "4294967296", "9223372036854775808", "9" * 400, "0x10", "1_000")
WORDS = ("", "a", "..", "/", "//", "\0", "é", "\u2028", "\U0001f4a9", '"', "\\", "#", "%n%s", "x" * 5000, "1/2/3/4/5")
WORDS += ("../../../etc/passwd", "/dev/zero", "file:///etc/passwd", "None", "-", "+", ",", ";", "\t", "\v", "\ufeff")
VALUES: tuple[Any, ...] = (
    None,
    True,
    False,
    -1,
    0,
    1,
    2,
    5,
    255,
    65536,
    2**31 - 1,
    2**31,
    2**32,
    2**53,
    2**63,
    -(2**63),
)
VALUES += (
    10**30,
    0.5,
    -0.5,
    1e-320,
    1e38,
    1e39,
    1e308,
    float("nan"),
    float("inf"),
    float("-inf"),
    "",
    "0",
    "a",
    "\0",
    "é",
)
VALUES += (
    "x" * 3000,
    "../../etc/passwd",
    "data:,",
    "data:;base64,!",
    "http://a/b",
    [],
    {},
    [0],
    [None],
    [[]],
    {"a": 1},
)
VALUES += ([1, 2, 3], [0.0, 0.0, 0.0], [1e308] * 4, ["a"] * 3, [float("nan")] * 16, [0] * 100, {"extensions": {"": {}}})


def flip(rng: Random, data: bytes, _: bytes) -> bytes:
    out = bytearray(data)
    for _bit in range(rng.choice((1, 1, 2, 5, 20, 100))):
        out[rng.randrange(len(out))] ^= 1 << rng.randrange(8)
    return bytes(out)


def cut(rng: Random, data: bytes, _: bytes) -> bytes:
    return data[: rng.randrange(len(data))]


def insert(rng: Random, data: bytes, _: bytes) -> bytes:
    at = rng.randrange(len(data))
    return data[:at] + rng.randbytes(rng.choice((1, 2, 3, 4, 100))) + data[at:]


def drop(rng: Random, data: bytes, _: bytes) -> bytes:
    at = rng.randrange(len(data))
    return data[:at] + data[at + rng.choice((1, 2, 3, 4, 100)) :]


def repeat(rng: Random, data: bytes, _: bytes) -> bytes:
    at = rng.randrange(len(data))
    piece = data[at : at + rng.choice((1, 4, 50, 1000))]
    return data[:at] + piece * rng.choice((2, 3, 50)) + data[at:]


def fill(rng: Random, data: bytes, _: bytes) -> bytes:
    at, size = rng.randrange(len(data)), rng.choice((1, 4, 16, 500))
    return data[:at] + bytes([rng.choice((0, 255, 10, 32))]) * len(data[at : at + size]) + data[at + size :]


def splice(rng: Random, data: bytes, other: bytes) -> bytes:
    return data[: rng.randrange(len(data))] + other[rng.randrange(len(other)) :]


def number(rng: Random, data: bytes, _: bytes) -> bytes:
    """Put an extreme binary number anywhere."""
    values = [struct.pack("<I", v) for v in (0, 1, 0x7FFFFFFF, 0x80000000, 0xFFFFFFFF, 0xFFFF, rng.getrandbits(32))]
    values += [struct.pack("<f", v) for v in (float("nan"), float("inf"), -3e38, 1e-45, 1e20, -1.0)]
    at = rng.randrange(len(data)) // rng.choice((1, 4)) * 4 % len(data)
    return data[:at] + rng.choice(values) + data[at + 4 :]


BYTES: dict[str, Bytes] = {
    "bits flipped": flip,
    "cut short": cut,
    "bytes put in": insert,
    "bytes left out": drop,
    "a piece repeated": repeat,
    "a piece filled": fill,
    "two files joined": splice,
    "an extreme binary number": number,
}


def word(rng: Random, lines: list[str]) -> None:
    """Replace one word by another of the file, a number, or nonsense."""
    at = rng.randrange(len(lines))
    words = lines[at].split(" ")
    others = rng.choice(lines).split(" ")
    words[rng.randrange(len(words))] = rng.choice((rng.choice(NUMBERS), rng.choice(WORDS), rng.choice(others)))
    lines[at] = " ".join(words)


def lose_word(rng: Random, lines: list[str]) -> None:
    at = rng.randrange(len(lines))
    words = lines[at].split(" ")
    del words[rng.randrange(len(words))]
    lines[at] = " ".join(words)


def lose_line(rng: Random, lines: list[str]) -> None:
    del lines[rng.randrange(len(lines))]


def repeat_line(rng: Random, lines: list[str]) -> None:
    at = rng.randrange(len(lines))
    lines[at:at] = [lines[at]] * rng.choice((1, 2, 1000))


def swap_lines(rng: Random, lines: list[str]) -> None:
    a, b = rng.randrange(len(lines)), rng.randrange(len(lines))
    lines[a], lines[b] = lines[b], lines[a]


def join_lines(rng: Random, lines: list[str]) -> None:
    at = rng.randrange(len(lines))
    lines[at : at + 2] = [rng.choice(("", " ", "\\\n", "\r", "\0")).join(lines[at : at + 2])]


def long_line(rng: Random, lines: list[str]) -> None:
    at = rng.randrange(len(lines))
    words = lines[at].split(" ")
    lines[at] = " ".join([*words, *[words[-1]] * rng.choice((10, 1000, 20000))])


TEXT: dict[str, Callable[[Random, list[str]], None]] = {
    "a word changed": word,
    "a word left out": lose_word,
    "a line left out": lose_line,
    "a line repeated": repeat_line,
    "lines swapped": swap_lines,
    "lines joined": join_lines,
    "a line of many words": long_line,
}
MOST_PLACES = 20_000  # of a tree to break once more: a list repeated a hundred times, five times over, fills the memory
ENCODINGS = ("utf-16", "utf-16-be", "utf-32", "utf-8-sig", "latin-1", "utf-7")


def mutate_text(rng: Random, data: bytes, how: str) -> bytes:
    """Break the lines of a text in one way, once or a few times."""
    lines = data.decode("utf-8", "surrogateescape").split("\n")
    for _ in range(rng.choice((1, 1, 1, 3, 8))):
        if lines:
            TEXT[how](rng, lines)
    return rng.choice(("\n", "\n", "\n", "\r\n", "\r")).join(lines).encode("utf-8", "surrogateescape")


def recoded(rng: Random, data: bytes) -> bytes:
    """The same text in another encoding."""
    return data.decode("utf-8", "replace").encode(rng.choice(ENCODINGS), "replace")


def places(tree: Any) -> Iterator[tuple[Any, Any]]:
    """Every container of a tree with every key or index of it."""
    keys = list(tree) if isinstance(tree, dict) else range(len(tree)) if isinstance(tree, list) else ()
    for key in keys:
        yield tree, key
        yield from places(tree[key])


def mutate_tree(rng: Random, tree: Any, how: str) -> Any:
    """Break a JSON tree in one way, once or a few times, as long as it is not too large; returns a new tree."""
    tree = copy.deepcopy(tree)
    for _ in range(rng.choice((1, 1, 1, 2, 5))):
        found = list(islice(places(tree), MOST_PLACES + 1))
        if found and len(found) <= MOST_PLACES:
            TREE[how](rng, *rng.choice(found), found)
    return tree


Found = list[tuple[Any, Any]]


def _replace(rng: Random, box: Any, key: Any, found: Found) -> None:
    box[key] = copy.deepcopy(rng.choice(VALUES))


def _delete(rng: Random, box: Any, key: Any, found: Found) -> None:
    del box[key]


def _other(rng: Random, box: Any, key: Any, found: Found) -> None:
    """A value from elsewhere in the tree; never one that it lies in."""
    other, there = rng.choice(found)
    box[key] = copy.deepcopy(other[there])


def _nudge(rng: Random, box: Any, key: Any, found: Found) -> None:
    numbers = [(b, k) for b, k in found if isinstance(b[k], int | float) and not isinstance(b[k], bool)]
    if numbers:
        box, key = rng.choice(numbers)
        change = rng.choice((lambda v: v + 1, lambda v: v - 1, lambda v: -v, lambda v: v * 1000, lambda v: v + 0.5))
        box[key] = change(box[key])


def _again(rng: Random, box: Any, key: Any, found: Found) -> None:
    lists = [(b, k) for b, k in found if isinstance(b[k], list) and b[k]]
    if lists:
        box, key = rng.choice(lists)
        box[key] = box[key] * rng.choice((2, 3, 100))


def _rename(rng: Random, box: Any, key: Any, found: Found) -> None:
    if isinstance(box, dict):
        box[rng.choice((str(key) + "x", "extensions", "", "\0", "uri", "matrix", "children"))] = box.pop(key)


def _nest(rng: Random, box: Any, key: Any, found: Found) -> None:
    for _ in range(rng.choice((1, 3, 300))):
        box[key] = [box[key]] if rng.random() < 0.5 else {"extras": box[key]}


TREE: dict[str, Callable[[Random, Any, Any, Found], None]] = {
    "a value replaced": _replace,
    "a key left out": _delete,
    "a value from elsewhere": _other,
    "a number changed": _nudge,
    "a list repeated": _again,
    "a key renamed": _rename,
    "a value nested": _nest,
}
