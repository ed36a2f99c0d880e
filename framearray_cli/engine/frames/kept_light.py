"""The light that hits keep until the last frame that shows them is composed, without the packets that are dark.

The light of a hit is a run of bytes in a block. Indirect light comes first, if the hit has any: its colour c and its
mean as float32, then g of all packets of light positions; then E of the packets that LIT names, see `hits/row.py`. A
packet holds sixteen light positions of each channel. A packed column of the hit, if it has one, ends where its light
begins.

E is kept as float32: all hits on a floor in the sun have the same, which rounding would change in one direction. g is a
mean over a few random rays, so that rounding adds nothing to means: it is kept as short numbers of 16 bits, 7 of them
exponent, rounded to nearest, which are off by at most 0.1 %.

An address in the column `light` says where it is, with the flags INDIRECT_LIGHT and PACKED in its last bits; 0 if a
hit has neither light nor a packed column.
"""

from queue import Empty, SimpleQueue

import numpy as np

from framearray_cli.base.arrays import Addresses, Bytes, Flags, Float32, Int32

from ..hits.row import LIT, lit_bit
from ..inputs.cameras import OUTSIDE
from ..kernels.kernel import inlined, kernel
from ..kernels.simd import LANES, lane_numbers, load, put_shorts, select, store
from ..terms.cells.gather import LEVEL, LIGHT
from .records import ADDRESS, ArrayPool, Column, HitRecords, StoredLight, empty_records
from .setup import FrameSetup

HEAD_BYTES = 4 * LIGHT  # of indirect light: colour and mean
PACKET_BYTES, SHORT_BYTES = 4 * LANES, 2 * LANES  # of one channel of E, and of g
BLOCK_BYTES = 1 << 18
ALL = np.empty(0, np.bool_)
NO_LIGHT = np.empty((0, 0), np.float32)
INDIRECT_LIGHT, PACKED = 1, 2  # flags of addresses: there is indirect light, or a packed column
FLAGS = INDIRECT_LIGHT | PACKED


def direct_bytes(light: StoredLight) -> int:
    """The bytes of all packets of a hit's direct light."""
    return light.channels * -(-light.n_lights // LANES) * PACKET_BYTES


@inlined
def indirect_bytes(channels: int, n_lights: int) -> int:
    """The bytes of a hit's indirect light."""
    return HEAD_BYTES + channels * ((n_lights + LANES - 1) // LANES) * SHORT_BYTES


@kernel
def pack_light(
    irradiance: Float32, indirect: Float32, packed: Float32, row: Float32, shown: Flags, first: int,
    block: Bytes, used: int, base: int, address: Addresses,
) -> tuple[int, int]:  # fmt: skip
    """Write the light and the packed column of n hits into a block, from the first on, until it is full.

    Args:
        irradiance: (>= n, channels, n_lights) E[l].
        indirect: (>= n, LIGHT + channels n_lights), see `Gathered`; or (0, 0).
        packed: (>= n, columns), or (0, 0).
        row: (>= n, LANES).
        shown: (>= n,) of others nothing is written; or (0,): all.
        used: bytes of the block that are taken; `base`: its address.
        address: (n,) overwritten.

    Returns:
        the first hit that did not fit, or n, and the bytes that are taken.
    """
    n, channels, n_lights = address.shape[0], irradiance.shape[1], irradiance.shape[2]
    numbers, words, columns = block.view(np.float32), block.view(np.int32), packed.view(np.int32)
    most = indirect_bytes(channels, n_lights) + channels * ((n_lights + LANES - 1) // LANES) * PACKET_BYTES
    most += 4 * packed.shape[1]
    for i in range(first, n):
        if used + most > block.shape[0]:
            return i, used
        address[i] = 0
        if shown.shape[0] > 0 and not shown[i]:
            continue
        # 1. The packed column, and indirect light.
        has_column = packed.shape[0] > 0 and packed[i, 0] > 0.0
        for column in range(packed.shape[1] if has_column else 0):
            words[used // 4 + column] = columns[i, column]
        start = used = used + (4 * packed.shape[1] if has_column else 0)
        gathered = indirect.shape[0] > 0 and indirect[i, LEVEL] > 0.0
        if gathered:
            head = block[used : used + HEAD_BYTES].view(np.float32)
            for column in range(LIGHT):
                head[column] = indirect[i, column]
            used += HEAD_BYTES
            for l in range(0, n_lights, LANES):
                for channel in range(channels):
                    g = load(indirect, i * indirect.shape[1] + LIGHT + channel * n_lights + l)
                    put_shorts(block, used, select(lane_numbers() < np.int32(n_lights - l), g, np.float32(0.0)))
                    used += SHORT_BYTES
        # 2. Direct light, where there is any.
        lit = int(row[i, LIT])
        for l in range(0, n_lights if lit != 0 else 0, LANES):
            if (lit >> lit_bit(n_lights, l)) & 1:
                for channel in range(channels):
                    e = load(irradiance, (i * channels + channel) * n_lights + l)
                    store(numbers, used // 4, select(lane_numbers() < np.int32(n_lights - l), e, np.float32(0.0)))
                    used += PACKET_BYTES
        flags = (INDIRECT_LIGHT if gathered else 0) | (PACKED if has_column else 0)
        if used > start or has_column:
            address[i] = base + start + flags
    return n, used


def block_bytes(light: StoredLight, packed: int = 0) -> int:
    """The bytes of a block; at least sixteen hits with packed columns of so many bytes fit into one."""
    return max(BLOCK_BYTES, 16 * (packed + HEAD_BYTES + 2 * direct_bytes(light)))


class LightStore:
    """Blocks of light of some hits; threads fill blocks of their own.

    Attributes:
        column: the packed column of the hits, which is kept next to their light; None if they have none.
    """

    def __init__(self, arrays: ArrayPool, light: StoredLight, column: Column | None = None) -> None:
        self._arrays, self._blocks, self.column = arrays, list[Bytes](), column
        self._size = block_bytes(light, column.nbytes if column else 0)
        self._open: SimpleQueue[tuple[Bytes, int]] = SimpleQueue()

    def keep(self, light: HitRecords, kept: HitRecords, shown: Flags = ALL) -> None:
        """Keep the light of hits.

        Args:
            light: columns of a batch.
            kept: its column `ADDRESS` is overwritten.
            shown: hits that any frame shows; ALL: all.
        """
        done, n, address = 0, len(kept.row), kept[ADDRESS.name]
        indirect, packed = light.arrays.get("indirect", NO_LIGHT), light[self.column.name] if self.column else NO_LIGHT
        while done < n:
            block, used = self._take()
            done, used = pack_light(
                light.irradiance, indirect, packed, kept.row, shown, done, block, used, block.ctypes.data, address
            )
            if done == n:
                self._open.put((block, used))

    def _take(self) -> tuple[Bytes, int]:
        """A block that no other thread fills, and the bytes of it that are taken."""
        try:
            return self._open.get_nowait()
        except Empty:
            block = self._arrays.take_block(self._size)
            self._blocks.append(block)
            return block, 0

    def put_back(self) -> None:
        """Return all blocks to the pool; their light must not be read afterwards."""
        for block in self._blocks:
            self._arrays.give_block(block)
        self._blocks.clear()


def keep_reflected(
    found: list[tuple[Int32, HitRecords]], store: LightStore, setup: FrameSetup
) -> list[tuple[Int32, HitRecords]]:
    """Keep the light of reflected hits in the setup's zone; return the pixels of all and what is kept of them."""
    result, loose = [], ("irradiance", "indirect", store.column.name if store.column else "")
    for pixels, light in found:
        own = {name: array for name, array in light.arrays.items() if name not in loose}
        kept = HitRecords(own | empty_records([ADDRESS], len(pixels)).arrays)
        store.keep(light, kept, setup.in_zone(pixels) != OUTSIDE if setup.strip else ALL)
        result.append((pixels, kept))
    return result
