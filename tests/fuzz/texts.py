"""Mutations of a file's bytes."""

from collections.abc import Callable
from random import Random

BIG = 10_000_000  # bytes


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


def cut_out(rng: Random, data: bytes) -> bytes:
    start = rng.randrange(len(data) + 1)
    return data[:start] + data[start + rng.choice((1, 2, 10, 100)) :]


def repeated(rng: Random, data: bytes) -> bytes:
    start = rng.randrange(len(data) + 1)
    return data[: start + rng.choice((1, 10, 100))] * rng.choice((1, 2)) + data[start:]


def _lines(change: Callable[[Random, list[bytes]], None]) -> Callable[[Random, bytes], bytes]:
    def mutation(rng: Random, data: bytes) -> bytes:
        lines = data.split(b"\n")
        change(rng, lines)
        return b"\n".join(lines)

    return mutation


def _drop(rng: Random, lines: list[bytes]) -> None:
    del lines[rng.randrange(len(lines))]


def _double(rng: Random, lines: list[bytes]) -> None:
    lines.insert(rng.randrange(len(lines) + 1), rng.choice(lines))


def _swap(rng: Random, lines: list[bytes]) -> None:
    i, j = rng.randrange(len(lines)), rng.randrange(len(lines))
    lines[i], lines[j] = lines[j], lines[i]


def recoded(rng: Random, data: bytes) -> bytes:
    """Another encoding of the same text, with letters that are not ASCII."""
    text = "# Grüße, 漢字\n" + data.decode("utf-8", "replace")
    encoding = rng.choice(
        ("utf-16", "utf-16-le", "utf-16-be", "utf-32", "latin-1", "utf-7", "utf-8-sig", "cp1252", "shift-jis")
    )
    return text.encode(encoding, "replace")


def other_line_ends(rng: Random, data: bytes) -> bytes:
    return data.replace(b"\n", rng.choice((b"\r\n", b"\r", b"\n\r", b"\x0c", b"\x85", "\u2028".encode())))


def nested(rng: Random, data: bytes) -> bytes:
    """Brackets, tables or dotted keys, ten thousand deep."""
    n = rng.choice((10_000, 100_000))
    head = rng.choice((b"\n[x]\n", b"\n"))
    deep = (
        b"x = " + b"[" * n, b"x = " + b"[" * n + b"]" * n, b"x = " + b"{ a = " * n + b"1" + b" }" * n,
        b"x" + b".a" * n + b" = 1", b"[x" + b".a" * n + b"]", b"[[x" + b".a" * n + b"]]\ny = 1",
        b'x = """' + b"\\\n" * n + b'"""', b"x = " + b"-" * n + b"1", b"x = " + b"1" * n, b"x = 1." + b"1" * n,
        b"x = 1e" + b"9" * n, b"[" * n, b"x" * n + b" = 1", b"#" * n,
    )  # fmt: skip
    return rng.choice((data + head + rng.choice(deep), rng.choice(deep) + b"\n" + data))


def big(rng: Random, data: bytes) -> bytes:
    """Ten megabytes, or as much as is still read, of keys or of one value."""
    size = rng.choice((BIG, 4 * 2**20 - len(data) - 40))
    match rng.randrange(6):
        case 0:
            more = b"\n" + b"".join(b"k%d = 1\n" % k for k in range(size // 12))[: size - 2] + b"\n"
        case 1:
            more = b'\nnote = "' + b"x" * (size - 20) + b'"\n'
        case 2:
            more = b"\n" * size
        case 3:
            more = b"\nnotes = [" + b"1," * (size // 2 - 20) + b"]\n"
        case 4:
            more = b"\n" + b"".join(b"[t%d]\n" % k for k in range(size // 10))[: size - 2]
        case _:
            more = b"\n" + b"".join(b"[[list]]\n" for k in range(size // 9))
    return rng.choice((data + more, more + data))


def nothing(rng: Random, data: bytes) -> bytes:
    return rng.choice((b"", b"\n", b"#", b"\xef\xbb\xbf", b"\0", b"\xff" * 100, b" " * 1000))


def noise(rng: Random, data: bytes) -> bytes:
    return rng.randbytes(rng.choice((1, 10, 1000)))


TEXT: dict[str, Callable[[Random, bytes], bytes]] = {
    "cut short": cut_short,
    "flipped bits": flipped,
    "other characters": other_bytes,
    "a piece cut out": cut_out,
    "a piece repeated": repeated,
    "a line missing": _lines(_drop),
    "a line twice": _lines(_double),
    "two lines exchanged": _lines(_swap),
    "another encoding": recoded,
    "other line ends": other_line_ends,
    "empty": nothing,
    "random bytes": noise,
}
LARGE: dict[str, Callable[[Random, bytes], bytes]] = {"nested deeply": nested, "megabytes": big}


def mutated_bytes(rng: Random, data: bytes, large: float = 0.05) -> tuple[str, bytes]:
    """A file's bytes, changed, and how; a share of them become large."""
    name, change = rng.choice(list((LARGE if rng.random() < large else TEXT).items()))
    return name, change(rng, data)
