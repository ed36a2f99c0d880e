"""Mutations of a file's bytes, and of the words and lines of a text."""

import struct
from collections.abc import Callable
from random import Random

NUMBERS = ("-1", "0", "1e999", "-1e999", "nan", "inf", "1e38", "-1e38", "3.5e38", "1e-45", "1e308", "-0", "0.5")
NUMBERS += ("2147483647", "2147483648", "-2147483648", "4294967296", "9223372036854775808", "9" * 400, "0x10", "1_000")
WORDS = ("", "a", "..", "/", "//", "\0", "é", "\u2028", "\U0001f4a9", '"', "\\", "#", "%n%s", "x" * 5000, "1/2/3/4/5")
WORDS += ("../../../etc/passwd", "/dev/zero", "file:///etc", "null", "-", "+", ",", ";", "\t", "\v", "\ufeff")


def cut_short(rng: Random, data: bytes) -> bytes:
    return data[: rng.randrange(len(data) + 1)]


def flipped(rng: Random, data: bytes) -> bytes:
    changed = bytearray(data)
    for _ in range(rng.choice((1, 1, 2, 8, 64))):
        if changed:
            changed[rng.randrange(len(changed))] ^= 1 << rng.randrange(8)
    return bytes(changed)


def other_bytes(rng: Random, data: bytes) -> bytes:
    """Some bytes become others that mean something in TOML, JSON or nothing at all."""
    changed = bytearray(data)
    for _ in range(rng.choice((1, 2, 5))):
        if changed:
            changed[rng.randrange(len(changed))] = rng.choice(b"\0\n\r\t\"'#=.,[]{}-+_eE019\\\x7f\x80\xc3\xff")
    return bytes(changed)


def put_in(rng: Random, data: bytes) -> bytes:
    start = rng.randrange(len(data) + 1)
    return data[:start] + rng.randbytes(rng.choice((1, 2, 3, 4, 100))) + data[start:]


def cut_out(rng: Random, data: bytes) -> bytes:
    start = rng.randrange(len(data) + 1)
    return data[:start] + data[start + rng.choice((1, 2, 3, 4, 10, 100)) :]


def repeated(rng: Random, data: bytes) -> bytes:
    start = rng.randrange(len(data) + 1)
    return data[:start] + data[start : start + rng.choice((1, 4, 50, 1000))] * rng.choice((2, 3, 50)) + data[start:]


def filled(rng: Random, data: bytes) -> bytes:
    start, size = rng.randrange(len(data) + 1), rng.choice((1, 4, 16, 500))
    return data[:start] + bytes([rng.choice((0, 255, 10, 32))]) * len(data[start : start + size]) + data[start + size :]


def other_number(rng: Random, data: bytes) -> bytes:
    """Put an extreme binary number anywhere, most often where one may be."""
    values = [struct.pack("<I", v) for v in (0, 1, 0x7FFFFFFF, 0x80000000, 0xFFFFFFFF, 0xFFFF, rng.getrandbits(32))]
    values += [struct.pack("<f", v) for v in (float("nan"), float("inf"), -3e38, 1e-45, 1e20, -1.0)]
    start = rng.randrange(len(data) + 1) // rng.choice((1, 4)) * 4
    return data[:start] + rng.choice(values) + data[start + 4 :]


def nothing(rng: Random, data: bytes) -> bytes:
    return rng.choice((b"", b"\n", b"#", b"\xef\xbb\xbf", b"\0", b"\xff" * 100, b" " * 1000))


def noise(rng: Random, data: bytes) -> bytes:
    return rng.randbytes(rng.choice((1, 10, 1000)))


def _lines(change: Callable[[Random, list[str]], None]) -> Callable[[Random, bytes], bytes]:
    """Change the lines of a text in one way, once or a few times."""

    def mutation(rng: Random, data: bytes) -> bytes:
        lines = data.decode("utf-8", "surrogateescape").split("\n")
        for _ in range(rng.choice((1, 1, 1, 3, 8))):
            if lines:
                change(rng, lines)
        return "\n".join(lines).encode("utf-8", "surrogateescape")

    return mutation


def _words(change: Callable[[Random, list[str], list[str]], None]) -> Callable[[Random, bytes], bytes]:
    """Change the words of a line; the words of another line are at hand."""

    def change_line(rng: Random, lines: list[str]) -> None:
        at = rng.randrange(len(lines))
        words = lines[at].split(" ")
        change(rng, words, rng.choice(lines).split(" "))
        lines[at] = " ".join(words)

    return _lines(change_line)


def _other_word(rng: Random, words: list[str], others: list[str]) -> None:
    words[rng.randrange(len(words))] = rng.choice((rng.choice(NUMBERS), rng.choice(WORDS), rng.choice(others)))


def _drop_word(rng: Random, words: list[str], others: list[str]) -> None:
    del words[rng.randrange(len(words))]


def _repeat_word(rng: Random, words: list[str], others: list[str]) -> None:
    words += [words[-1]] * rng.choice((10, 1000, 20000))


def _drop(rng: Random, lines: list[str]) -> None:
    del lines[rng.randrange(len(lines))]


def _repeat(rng: Random, lines: list[str]) -> None:
    at = rng.randrange(len(lines))
    lines[at:at] = [rng.choice(lines)] * rng.choice((1, 2, 1000))


def _swap(rng: Random, lines: list[str]) -> None:
    i, j = rng.randrange(len(lines)), rng.randrange(len(lines))
    lines[i], lines[j] = lines[j], lines[i]


def _join(rng: Random, lines: list[str]) -> None:
    at = rng.randrange(len(lines))
    lines[at : at + 2] = [rng.choice(("", " ", "\\\n", "\r", "\0")).join(lines[at : at + 2])]


def recoded(rng: Random, data: bytes) -> bytes:
    """Another encoding of the same text, with letters that are not ASCII."""
    text = "# Grüße, 漢字\n" + data.decode("utf-8", "replace")
    encoding = rng.choice(
        ("utf-16", "utf-16-le", "utf-16-be", "utf-32", "latin-1", "utf-7", "utf-8-sig", "cp1252", "shift-jis")
    )
    return text.encode(encoding, "replace")


def other_line_ends(rng: Random, data: bytes) -> bytes:
    return data.replace(b"\n", rng.choice((b"\r\n", b"\r", b"\n\r", b"\x0c", b"\x85", "\u2028".encode())))


BYTES: dict[str, Callable[[Random, bytes], bytes]] = {
    "cut short": cut_short,
    "flipped bits": flipped,
    "other characters": other_bytes,
    "bytes put in": put_in,
    "a piece cut out": cut_out,
    "a piece repeated": repeated,
    "a piece filled": filled,
    "an extreme binary number": other_number,
    "empty": nothing,
    "random bytes": noise,
}
LINES: dict[str, Callable[[Random, bytes], bytes]] = {
    "a word changed": _words(_other_word),
    "a word missing": _words(_drop_word),
    "a line of many words": _words(_repeat_word),
    "a line missing": _lines(_drop),
    "a line repeated": _lines(_repeat),
    "two lines exchanged": _lines(_swap),
    "two lines joined": _lines(_join),
    "another encoding": recoded,
    "other line ends": other_line_ends,
}
TEXT = BYTES | LINES
