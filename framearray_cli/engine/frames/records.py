"""What composing reads of hits: a record per hit, and the hits of each pixel."""

from collections.abc import Callable
from dataclasses import dataclass, fields
from typing import Any

import numpy as np

from framearray_cli.base.arrays import Float32, Int32, with_room

from ..kernels.kernel import inlined
from ..kernels.simd import LANES

# Columns of a hit's row, and of sums of rows; those from INDIRECT to REFLECTIVITY are the first of three channels.
WEIGHT, INDIRECT, LIGHT_INDEPENDENT, OBSCURANCE, REFLECTIVITY, LIT, HALF = 0, 1, 4, 7, 10, 13, 14

# In place of a half, 0 or 1: each hit has its own, see HALF.
BY_SAMPLE = -1

# A float32 holds whole numbers of this many bits exactly.
LIT_BITS = 24


@inlined
def lit_bit(n_lights: int, l: int) -> int:
    """The bit of LIT for light position l; one bit stands for a packet of LANES positions, or for 2, 4, ... packets."""
    packet, last = l >> 4, n_lights - 1 >> 4
    while last >= LIT_BITS:
        packet, last = packet >> 1, last >> 1
    return packet


@dataclass(slots=True, kw_only=True, eq=False)
class HitRecords:
    """What composing reads of n hits.

    Attributes:
        row: (n, LANES) one cache line per hit, so that one vector sum adds all of it: WEIGHT 1; INDIRECT R W;
            LIGHT_INDEPENDENT radiance, the same under every light; OBSCURANCE W; REFLECTIVITY R; LIT, a whole number
            with a bit per packet of light positions, see `lit_bit`, set where any irradiance is not zero; HALF, 1 for
            an odd sample of its pixel, else 0.
        irradiance: (n, channels, n_lights) E[l].
    """

    row: Float32
    irradiance: Float32

    @property
    def arrays(self) -> dict[str, Float32]:
        """The arrays by name."""
        return {f.name: getattr(self, f.name) for f in fields(self)}

    def part(self, span: slice) -> "HitRecords":
        """The records of some of the hits; shares memory."""
        return HitRecords(row=self.row[span], irradiance=self.irradiance[span])


@dataclass(slots=True, kw_only=True, eq=False)
class HitsByPixel:
    """Hits sorted by the pixel of one frame that they fall into; see `sort_by_pixel`.

    Attributes:
        start: (n_pixels + 1,) hits order[start[p] : start[p + 1]] fall into pixel p.
        order: (n,) numbers of hits.
    """

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
        take: returns an array for a name, shape and dtype; by default a new one.
    """
    return HitRecords(
        row=take("row", (n, LANES), np.float32),
        irradiance=take("irradiance", (n, channels, n_lights), np.float32),
    )
