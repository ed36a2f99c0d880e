"""DWA compression of EXR: an encoder for OpenEXR's format that needs a seventh of OpenEXR's time.

DWA codes colour like JPEG: a curve (gamma 2.2, above 1 a logarithm), luma and two chroma channels, the DCT of blocks of
8 x 8 pixels, rounded coefficients, runs of zeros, a Huffman code. Files contain coefficients as halves, so an encoder
may round as it likes. Here all coefficients are multiples of one step, which gives the least mean square error for a
size, and all chunks of an image share one Huffman code.
"""

import struct
import zlib
from functools import cache
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from framearray_cli.base.arrays import Float32, Images, Int32, Keys

from ..kernels.kernel import index, inlined, kernel, step
from ..kernels.simd import (
    LANES,
    ctz,
    gather,
    integers,
    lane_numbers,
    load,
    select,
    store,
    words,
)

LINES = {"dwaa": 32, "dwab": 256}  # scan lines of a chunk
CODED = 64  # scan lines that share a Huffman code, or all lines of a chunk
STEP = 1 / 512  # of coefficients, in units of the curve; docs/guide/output.md has sizes and errors

_Words = NDArray[np.uint16]  # halves as bits, or symbols of the Huffman code
_Counts = NDArray[np.int64]

_STRIP = 8 * LANES  # pixels in a line of the blocks that are transformed together
_PLANE = 64 * LANES  # coefficients of a channel of these blocks
_MIDDLE = 1 << 15  # place of coefficient 0 in the table of halves
_ZEROS = 0xFF00  # symbol for zeros up to the end of a block; with a number from 2 in its low bits for that many zeros
_N_SYMBOLS = 1 << 16
_LONGEST_CODE = 24  # bits
_LEVEL = 1  # of deflate
# Of the channels: name, place among the colours that are transformed together, lossy; type half.
_CLASSES = b"".join(name + bytes([0, place << 4 | 1 << 2, 1]) for place, name in enumerate((b"R", b"G", b"B"), 1))
_ORDER = [
    0, 1, 8, 16, 9, 2, 3, 10, 17, 24, 32, 25, 18, 11, 4, 5, 12, 19, 26, 33, 40, 48,
    41, 34, 27, 20, 13, 6, 7, 14, 21, 28, 35, 42, 49, 56, 57, 50, 43, 36, 29, 22, 15, 23,
    30, 37, 44, 51, 58, 59, 52, 45, 38, 31, 39, 46, 53, 60, 61, 54, 47, 55, 62, 63,
]  # fmt: skip
_PLACE = np.argsort(_ORDER)  # place of each coefficient in the zigzag order of a file
_HALF, _ZERO = np.float32(0.5), np.float32(0.0)
_C1, _C2, _C3, _C4, _C5, _C6, _C7 = (np.float32(0.5 * np.cos(np.pi * k / 16)) for k in range(1, 8))


class _Tables(NamedTuple):
    """Tables of the kernels.

    Attributes:
        curve: (65536,) value of each half on the curve.
        scale: coefficients per step.
        halves: (65536,) bits of the half of each multiple of the step, from -_MIDDLE on.
        runs: (64,) symbol of each number of zeros before another coefficient.
    """

    curve: Float32
    scale: np.float32
    halves: _Words
    runs: _Words


class _Room(NamedTuple):
    """Scratch for the blocks that are transformed together, a lane each.

    Attributes:
        strip: (3, _STRIP) a line of R, G and B on the curve.
        planes: (3, 64, LANES) luma and chroma, then their coefficients.
        steps: (3, 64, LANES) coefficients in units of the step, in zigzag order.
        masks: (3, LANES) a bit for each coefficient that is not 0.
    """

    strip: Float32
    planes: Float32
    steps: Int32
    masks: Keys


class _Symbols(NamedTuple):
    """A transformed image.

    Attributes:
        ac: symbols of all coefficients but the first of each block.
        starts: first symbol of each chunk; the end of all.
        dc: first coefficients, as halves: chunk by chunk, in each by channel.
        counts: (65537,) how often each symbol occurs.
    """

    ac: _Words
    starts: _Counts
    dc: _Words
    counts: _Counts


class _Code(NamedTuple):
    """A Huffman code.

    Attributes:
        words: (65537,) of each symbol: the code's length in the lowest 6 bits, the code above them.
        first, last: symbols.
        table: lengths of the codes of these symbols, packed.
    """

    words: Keys
    first: int
    last: int
    table: bytes


def dwa_chunks(image: Images, lines: int) -> list[bytes]:
    """Encode an image (h, w, 3) of finite halves as chunks of a file of EXR, of that many lines each; see `LINES`.

    Groups of chunks have a code each: images of a multiple of `CODED` lines can be encoded in parts.
    """
    together = max(lines, CODED)
    return [
        chunk
        for top in range(0, image.shape[0], together)
        for chunk in _chunks_of_one_code(image[top : top + together], lines)
    ]


def _chunks_of_one_code(image: Images, lines: int) -> list[bytes]:
    height, width, _ = image.shape
    symbols = _transformed(image, lines)
    code, chunks, dc = _huffman_code(symbols.counts), [], 0
    for k, top in enumerate(range(0, height, lines)):
        rows = image[top : top + lines]
        n_dc = 3 * _blocks(len(rows), width)
        chunk = _chunk(_coded(symbols, k, code), symbols.dc[dc : dc + n_dc])
        plain = rows[..., ::-1].transpose(0, 2, 1)  # B, G, R of each line; a file stores what does not get smaller so
        chunks.append(chunk if len(chunk) < plain.nbytes else plain.tobytes())
        dc += n_dc
    return chunks


def _blocks(height: int, width: int) -> int:
    """Return the number of blocks of some lines."""
    return -(-height // 8) * -(-width // 8)


def _chunk(ac: tuple[int, bytes], dc: _Words) -> bytes:
    """Join the parts of a chunk: sizes, classes of channels, coefficients.

    Args:
        ac: number of symbols, and their code.
    """
    low_high = np.concatenate([dc.view(np.uint8)[::2], dc.view(np.uint8)[1::2]])
    deltas = np.diff(low_high, prepend=np.uint8(128)) + np.uint8(128)
    means = zlib.compress(deltas.tobytes(), _LEVEL)
    sizes = struct.pack("<11Q", 2, 0, 0, len(ac[1]), len(means), 0, 0, 0, ac[0], len(dc), 0)
    return b"".join([sizes, struct.pack("<H", len(_CLASSES) + 2), _CLASSES, ac[1], means])


def _transformed(image: Images, lines: int) -> _Symbols:
    """Return the symbols of an image."""
    height, width, _ = image.shape
    tops = range(0, height, lines)
    n_blocks = sum(_blocks(min(lines, height - top), width) for top in tops)
    found = _Symbols(
        ac=np.empty(3 * 63 * n_blocks + 1, np.uint16),  # one more: kernels write a symbol before they know if it counts
        starts=np.zeros(len(tops) + 1, np.int64),
        dc=np.empty(3 * n_blocks, np.uint16),
        counts=np.zeros(_N_SYMBOLS + 1, np.int64),
    )
    room = _Room(
        strip=np.empty(3 * _STRIP, np.float32),
        planes=np.empty(3 * _PLANE, np.float32),
        steps=np.empty(3 * _PLANE, np.int32),
        masks=np.empty(3 * LANES, np.uint64),
    )
    _transform(np.ascontiguousarray(image).view(np.uint16), lines, _tables(), room, found)
    return found


@cache
def _tables() -> _Tables:
    values = np.arange(_N_SYMBOLS, dtype=np.uint16).view(np.float16).astype(np.float64)
    values[~np.isfinite(values)] = 0.0
    size = np.abs(values)
    curve = np.copysign(np.where(size <= 1, size ** (1 / 2.2), np.log(np.maximum(size, 1)) / 2.2 + 1), values)
    return _Tables(
        curve=curve.astype(np.float16).astype(np.float32),  # as decoders have it
        scale=np.float32(1 / STEP),
        halves=(np.arange(-_MIDDLE, _MIDDLE) * STEP).astype(np.float16).view(np.uint16),
        runs=np.array([0, 0, *range(_ZEROS + 2, _ZEROS + 64)], np.uint16),
    )


@kernel
def _transform(pixels: NDArray[np.uint16], lines: int, tables: _Tables, room: _Room, out: _Symbols) -> None:
    """Transform an image, chunk by chunk.

    Args:
        pixels: (h, w, 3) bits of halves.
        out: overwritten; `counts` is 0 before.
    """
    height, width = pixels.shape[0], pixels.shape[1]
    across, total, dc = (width + 7) // 8, 0, 0
    for top in range(0, height, lines):
        blocks = (min(lines, height - top) + 7) // 8 * across  # of a channel of the chunk
        for block in range(0, blocks, across):
            for first in range(0, across, LANES):
                _coefficients(pixels, top + block // across * 8, 8 * first, tables, room)
                for lane in range(min(LANES, across - first)):
                    for c in range(3):
                        mean = room.steps[index(c * _PLANE + lane)]
                        out.dc[index(dc + c * blocks + block + first + lane)] = tables.halves[index(mean + _MIDDLE)]
                        total = _list_symbols(c, lane, tables, room, out, total)
        dc += 3 * blocks
        out.starts[top // lines + 1] = total


@step
def _coefficients(pixels: NDArray[np.uint16], top: int, left: int, tables: _Tables, room: _Room) -> None:
    """Compute the coefficients of LANES blocks; beyond the edges of the image its last pixels repeat."""
    height, width, strip, planes = pixels.shape[0], pixels.shape[1], room.strip, room.planes
    inside = min(_STRIP, width - left)
    for y in range(8):
        row = index(min(top + y, height - 1))
        for x in range(inside):
            for c in range(3):
                strip[index(c * _STRIP + x)] = tables.curve[index(pixels[row, index(left + x), c])]
        for x in range(inside, _STRIP):
            for c in range(3):
                strip[index(c * _STRIP + x)] = strip[index(c * _STRIP + inside - 1)]
        for x in range(8):
            place = lane_numbers() * np.int32(8) + np.int32(x)
            r, g, b = gather(strip, place), gather(strip, place + _STRIP), gather(strip, place + 2 * _STRIP)
            to = LANES * (8 * y + x)
            store(planes, to, r * np.float32(0.2126) + g * np.float32(0.7152) + b * np.float32(0.0722))
            store(planes, to + _PLANE, b * _HALF - r * np.float32(0.1146) - g * np.float32(0.3854))
            store(planes, to + 2 * _PLANE, r * _HALF - g * np.float32(0.4542) - b * np.float32(0.0458))
    for c in range(3):
        for k in range(8):
            _dct(planes, c * _PLANE + 8 * LANES * k, LANES)
        for k in range(8):
            _dct(planes, c * _PLANE + LANES * k, 8 * LANES)
        none = words(lane_numbers() * np.int32(0))
        mask = none
        for k in range(64):
            value = load(planes, c * _PLANE + LANES * k) * tables.scale
            n = integers(value + select(value > _ZERO, _HALF, -_HALF))
            store(room.steps, c * _PLANE + LANES * _PLACE[k], n)
            mask = mask | select(n == np.int32(0), none, np.uint64(1) << np.uint64(_PLACE[k]))
        store(room.masks, LANES * c, mask)


@inlined
def _dct(planes: Float32, at: int, stride: int) -> None:
    """Replace eight vectors by their discrete cosine transform (type II, orthonormal)."""
    v0, v1, v2 = load(planes, at), load(planes, at + stride), load(planes, at + 2 * stride)
    v3, v4, v5 = load(planes, at + 3 * stride), load(planes, at + 4 * stride), load(planes, at + 5 * stride)
    v6, v7 = load(planes, at + 6 * stride), load(planes, at + 7 * stride)
    s0, s1, s2, s3 = v0 + v7, v1 + v6, v2 + v5, v3 + v4
    d0, d1, d2, d3 = v0 - v7, v1 - v6, v2 - v5, v3 - v4
    e0, e1, f0, f1 = s0 + s3, s1 + s2, s0 - s3, s1 - s2
    store(planes, at, (e0 + e1) * _C4)
    store(planes, at + stride, d0 * _C1 + d1 * _C3 + d2 * _C5 + d3 * _C7)
    store(planes, at + 2 * stride, f0 * _C2 + f1 * _C6)
    store(planes, at + 3 * stride, d0 * _C3 - d1 * _C7 - d2 * _C1 - d3 * _C5)
    store(planes, at + 4 * stride, (e0 - e1) * _C4)
    store(planes, at + 5 * stride, d0 * _C5 - d1 * _C1 + d2 * _C7 + d3 * _C3)
    store(planes, at + 6 * stride, f0 * _C6 - f1 * _C2)
    store(planes, at + 7 * stride, d0 * _C7 - d1 * _C5 + d2 * _C3 - d3 * _C1)


@inlined
def _list_symbols(c: int, lane: int, tables: _Tables, room: _Room, out: _Symbols, total: int) -> int:
    """Append the symbols of a block's coefficients but the first to `total` symbols; return their new number."""
    # --- loop state ---
    left = room.masks[index(LANES * c + lane)] >> np.uint64(1)  # coefficients to come that are not 0
    at = c * _PLANE + LANES + lane
    while left != np.uint64(0):
        zeros: int = ctz(left)
        run, some = index(tables.runs[index(zeros)]), int(zeros > 0)
        out.ac[index(total)] = run  # overwritten by the next one if there are none
        out.counts[run] += some
        at += LANES * zeros
        symbol = index(tables.halves[index(room.steps[index(at)] + _MIDDLE)])
        out.ac[index(total + some)] = symbol
        out.counts[symbol] += 1
        total += some + 1
        at += LANES
        left = left >> np.uint64(zeros) >> np.uint64(1)
    zeros = 64 - (at - c * _PLANE) // LANES
    end, some = _ZEROS if zeros > 1 else 0, int(zeros > 0)
    out.ac[index(total)] = end
    out.counts[index(end)] += some
    return total + some


def _coded(symbols: _Symbols, k: int, code: _Code) -> tuple[int, bytes]:
    """Return the number of symbols of chunk k, and their code behind its header."""
    first, end = int(symbols.starts[k]), int(symbols.starts[k + 1])
    coded = np.empty((end - first) * _LONGEST_CODE // 32 + 1, np.uint32)
    n_bits = _write_codes(symbols.ac, first, end, code.words, coded)
    data = coded.byteswap().tobytes()[: -(-n_bits // 8)]
    return end - first, struct.pack("<5I", code.first, code.last, len(code.table), n_bits, 0) + code.table + data


@kernel
def _write_codes(symbols: _Words, first: int, end: int, codes: Keys, out: NDArray[np.uint32]) -> int:
    """Write the codes of some symbols, the first bit highest; return the number of bits."""
    # --- loop state ---
    held, n, at = np.uint64(0), np.uint64(0), 0  # bits that are not written, their number, words written
    for i in range(first, end):
        code = codes[index(symbols[index(i)])]
        length = code & np.uint64(63)
        held = (held << length) | (code >> np.uint64(6))
        n += length
        full = n >> np.uint64(5)
        n &= np.uint64(31)
        out[index(at)] = np.uint32(held >> n)  # overwritten until it is full: a branch would be slower
        at += int(full)
    out[index(at)] = np.uint32(held << (np.uint64(32) - n))
    return 32 * at + int(n)


def _huffman_code(counts: _Counts) -> _Code:
    """Make the code of all symbols that occur, and of one more, for repeated symbols, which files must have."""
    last = int(np.flatnonzero(counts).max()) + 1
    counts[last] = 1
    used = np.flatnonzero(counts)
    order = np.argsort(counts[used], kind="stable")
    tree, rising = np.empty((3, 2 * len(used)), np.int64), counts[used[order]]
    while _build_tree(rising, tree) > _LONGEST_CODE:
        rising = (rising + 1) // 2  # flattens the tree
    lengths = np.empty(len(used), np.int64)
    lengths[order] = tree[2, : len(used)]
    codes, table = np.zeros(len(counts), np.uint64), np.empty(len(used) + len(counts) // 200, np.uint32)
    n_bits = _number_codes(used, lengths, codes, np.zeros(_LONGEST_CODE + 2, np.int64), table)
    return _Code(codes, int(used[0]), last, table.byteswap().tobytes()[: -(-n_bits // 8)])


@kernel
def _build_tree(counts: _Counts, tree: _Counts) -> int:
    """Join the two rarest nodes, leaves or joined ones, until one is left; return the greatest depth of a leaf.

    Args:
        counts: (n,) of leaves, rising; at least two.
        tree: (3, 2 n) overwritten: counts, parents and depths of all nodes, leaves first.
    """
    # --- loop state ---
    n, leaf, joined, deepest = len(counts), 0, len(counts), 0
    for k in range(n):
        tree[0, index(k)] = counts[index(k)]
    for new in range(n, 2 * n - 1):
        total = 0
        for _ in range(2):
            if joined == new or (leaf < n and tree[0, index(leaf)] <= tree[0, index(joined)]):
                rarest, leaf = leaf, leaf + 1
            else:
                rarest, joined = joined, joined + 1
            total += tree[0, index(rarest)]
            tree[1, index(rarest)] = new
        tree[0, index(new)] = total
    tree[2, index(2 * n - 2)] = 0
    for k in range(2 * n - 3, -1, -1):
        tree[2, index(k)] = tree[2, index(tree[1, index(k)])] + 1
        deepest = max(deepest, tree[2, index(k)])
    return deepest


@kernel
def _number_codes(used: _Counts, lengths: _Counts, codes: Keys, next_code: _Counts, table: NDArray[np.uint32]) -> int:
    """Number the codes of some symbols, the longest codes from 0 on, and pack their lengths; return the bits of these.

    A length has 6 bits, 2 to 5 symbols without a code 6, and 6 to 261 such symbols 14.

    Args:
        used: symbols, rising.
        codes: of all symbols, see `_Code.words`; overwritten for these.
        next_code: (_LONGEST_CODE + 2,) zeros.
    """
    # --- loop state ---
    n_bits, expected = 0, used[0]
    for k in range(len(used)):
        next_code[index(lengths[index(k)] - 1)] += 1  # number of codes, at the place of the next shorter ones
    for length in range(_LONGEST_CODE - 1, 0, -1):
        next_code[index(length)] = (next_code[index(length)] + next_code[index(length + 1)]) >> 1
    for k in range(len(used)):
        symbol, length = used[index(k)], lengths[index(k)]
        codes[index(symbol)] = np.uint64(next_code[index(length)] << 6 | length)
        next_code[index(length)] += 1
        while expected < symbol:
            run = min(symbol - expected, 261)
            expected += run
            if run < 6:
                n_bits = _put(table, n_bits, 6, 0 if run == 1 else 57 + run)
            else:
                n_bits = _put(table, n_bits, 14, 63 << 8 | run - 6)
        n_bits = _put(table, n_bits, 6, length)
        expected = symbol + 1
    return n_bits


@inlined
def _put(out: NDArray[np.uint32], at: int, n: int, value: int) -> int:
    """Write n bits at a bit, the highest first; return the next one. Words before it are written, the rest is not."""
    word, shift = at // 32, 64 - at % 32 - n
    both = np.uint64(value) << np.uint64(shift)
    before = np.uint64(out[index(word)]) << np.uint64(32) if at % 32 else np.uint64(0)
    both |= before
    out[index(word)] = np.uint32(both >> np.uint64(32))
    out[index(word + 1)] = np.uint32(both & np.uint64(0xFFFFFFFF))
    return at + n
