"""What composing needs of each hit, and the pixels that hits fall into."""

from collections.abc import Callable
from dataclasses import dataclass, fields
from typing import Any

import numpy as np

from framearray_cli.base.arrays import Float32, Int32, with_room

from ..kernels.kernel import inlined
from ..kernels.simd import LANES

# Columns of a row of a hit, and of the sums of such rows; those from INDIRECT to REFLECTIVITY are of three channels.
WEIGHT, INDIRECT, LIGHT_INDEPENDENT, OBSCURANCE, REFLECTIVITY, LIT, HALF = 0, 1, 4, 7, 10, 13, 14

# In place of a half: each hit has its own.
BY_SAMPLE = -1

# The most bits that a whole number in a float32 has.
LIT_BITS = 24


@inlined
def lit_bit(n_lights: int, l: int) -> int:
    """The bit of LIT that tells of light position l: it stands for a packet of positions, or for 2, 4, ... of them."""
    packet, last = l >> 4, n_lights - 1 >> 4
    while last >= LIT_BITS:
        packet, last = packet >> 1, last >> 1
    return packet


@dataclass(slots=True, kw_only=True, eq=False)
class HitRecords:
    """What composing needs of n hits.

    Attributes:
        row: (n, LANES) a cache line a hit, so that one sum of lines is the sum of all: 1; R W; what is the same under
            every light; W; R; LIT, a whole number whose bits say in which packets of light positions there is light;
            HALF, 1 for an odd sample of its pixel, else 0.
        irradiance: (n, channels, n_lights).
    """

    row: Float32
    irradiance: Float32

    @property
    def arrays(self) -> dict[str, Float32]:
        """The arrays by name."""
        return {f.name: getattr(self, f.name) for f in fields(self)}

    def part(self, span: slice) -> "HitRecords":
        """The records of some hits; they share memory."""
        return HitRecords(
            row=self.row[span],
            irradiance=self.irradiance[span],
        )


@dataclass(slots=True, kw_only=True, eq=False)
class Placed:
    """Hits sorted by the pixel of one frame that they fall into; see `sort_by_pixel`."""

    start: Int32
    order: Int32


def _fresh(_name: str, shape: tuple[int, ...], dtype: Any) -> Any:
    return with_room(shape, dtype)


def empty_records(
    n: int, channels: int, n_lights: int, take: Callable[[str, tuple[int, ...], Any], Any] = _fresh
) -> HitRecords:
    """Allocate records of n hits; contents are arbitrary.

    Args:
        channels: of irradiance, 1 or 3.
        n_lights: light positions whose irradiance is stored.
        take: makes an array of a name, shape and dtype.
    """
    return HitRecords(
        row=take("row", (n, LANES), np.float32),
        irradiance=take("irradiance", (n, channels, n_lights), np.float32),
    )
