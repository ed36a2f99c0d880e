"""What composing reads of hits: a record per hit, and the hits of each pixel."""

from collections.abc import Callable
from dataclasses import dataclass, field, fields, replace
from typing import Any

import numpy as np

from framearray_cli.base.arrays import Float32, Int32, with_room

from ..hits.emission import EMISSION_COLUMNS, SOURCE, TEXTURE
from ..kernels.kernel import inlined
from ..kernels.simd import LANES
from ..terms.cells.gather import COLOUR, LEVEL, LIGHT

# Columns of a hit's row, and of sums of rows; those from INDIRECT to REFLECTIVITY are the first of three channels.
WEIGHT, INDIRECT, LIGHT_INDEPENDENT, OBSCURANCE, REFLECTIVITY, LIT, HALF, CLEAR = 0, 1, 4, 7, 10, 13, 14, 15

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
            an odd sample of its pixel, else 0; CLEAR, the share of what lies outside the scene that shows: 1 where the
            ray escaped, else 0.
        irradiance: (n, channels, n_lights) E[l].
        emission: (n, EMISSION_COLUMNS) what the hit sends out itself, tinted by mirrors, see `record_emission`; (n, 0)
            where nothing shines.
        indirect: (n, LIGHT + channels n_lights) indirect light read from cells, see `gather_cells`; (n, 0) without.
        gloss: (n, columns) what composing needs of hits on glossy surfaces, see `keep_gloss`; (n, 0) without.
        sun_hours: (n, n_days) hours of direct sun, see `find_sun_hours`; not written behind mirrors. (n, 0) without.
        marks: (n, columns) object, material, position and texture coordinates, see `inputs/marks.py`; (n, 0) without.
    """

    row: Float32
    irradiance: Float32
    indirect: Float32 = field(default_factory=lambda: np.empty((0, 0), np.float32))
    emission: Float32 = field(default_factory=lambda: np.empty((0, 0), np.float32))
    gloss: Float32 = field(default_factory=lambda: np.empty((0, 0), np.float32))
    sun_hours: Float32 = field(default_factory=lambda: np.empty((0, 0), np.float32))
    marks: Float32 = field(default_factory=lambda: np.empty((0, 0), np.float32))

    @property
    def arrays(self) -> dict[str, Float32]:
        """The arrays by name; those that may have no columns only if they have some."""
        return {f.name: getattr(self, f.name) for f in fields(self) if getattr(self, f.name).shape[1]}

    @property
    def light(self) -> Float32:
        """Direct irradiance, and that of cells, in units of the lights' colour, (n, n_lights, 1 or 3)."""
        direct: Float32 = np.swapaxes(self.irradiance, 1, 2)
        return direct + self.gathered if self.indirect.shape[1] else direct

    @property
    def gathered(self) -> Float32:
        """Irradiance of cells, in units of the lights' colour, (n, n_lights, 3)."""
        known = np.where(self.indirect[:, LEVEL, None] > 0, self.indirect, np.float32(0.0))  # else not written
        by_light = np.swapaxes(known[:, LIGHT:].reshape(self.irradiance.shape), 1, 2)
        found: Float32 = by_light * known[:, None, COLOUR : COLOUR + 3]
        return found

    def own_light(self, strength: Float32, colour: Float32) -> Float32:
        """Radiance that the hits send out themselves, (n, n_lights, 3); (n, 1, 3) zeros where nothing shines.

        Args:
            strength, colour: of `LightArrays`.
        """
        if not self.emission.shape[1]:
            return np.zeros((len(self.row), 1, 3), np.float32)
        source = self.emission[:, SOURCE].astype(np.int64)
        radiance = np.swapaxes(strength, 1, 2)[np.maximum(source, 0)] * colour
        found: Float32 = radiance * self.emission[:, None, TEXTURE:]
        return found

    def through(self, shares: Float32) -> "HitRecords":
        """What is left of the hits behind glass; shares all memory that it can.

        Args:
            shares: (n, 3) of light that passes the glass; (0, 3) where there is none.
        """
        behind = np.flatnonzero((shares != 1.0).any(axis=1))
        if not len(behind):
            return self
        dimmed, row, emission = shares[behind], self.row.copy(), self.emission
        for column in (INDIRECT, LIGHT_INDEPENDENT, REFLECTIVITY):
            row[behind, column : column + 3] *= dimmed
        row[behind, CLEAR] *= dimmed.mean(axis=1)
        if emission.shape[1]:
            emission = emission.copy()
            emission[behind, TEXTURE:] *= dimmed
        return replace(self, row=row, emission=emission)

    def part(self, span: slice) -> "HitRecords":
        """The records of some of the hits; shares memory."""
        return HitRecords(**{f.name: getattr(self, f.name)[span] for f in fields(self)})


@dataclass(slots=True, kw_only=True, eq=False)
class HitsByPixel:
    """Hits sorted by the pixel of one frame that they fall into; see `sort_by_pixel`.

    Attributes:
        start: (n_pixels + 1,) hits order[start[p] : start[p + 1]] fall into pixel p.
        order: (n,) numbers of hits.
    """

    start: Int32
    order: Int32


def fresh_array(_name: str, shape: tuple[int, ...], dtype: Any) -> Any:
    """Allocate a new array; its contents are arbitrary."""
    return with_room(shape, dtype)


def empty_records(
    n: int,
    channels: int,
    n_lights: int,
    columns: int = 0,
    shining: bool = False,
    days: int = 0,
    gloss: int = 0,
    marks: int = 0,
    take: Callable[[str, tuple[int, ...], Any], Any] = fresh_array,
) -> HitRecords:
    """Allocate records of n hits; contents are arbitrary.

    Args:
        channels: of irradiance, 1 or 3.
        n_lights: light positions whose irradiance is stored.
        columns: of `indirect`.
        shining: whether hits may send out light themselves.
        days: whose hours of sun are counted.
        gloss, marks: columns of these.
        take: returns an array for a name, shape and dtype; by default a new one.
    """
    none = np.empty((n, 0), np.float32)
    return HitRecords(
        row=take("row", (n, LANES), np.float32),
        irradiance=take("irradiance", (n, channels, n_lights), np.float32),
        indirect=take("indirect", (n, columns), np.float32) if columns else none,
        emission=take("emission", (n, EMISSION_COLUMNS), np.float32) if shining else none,
        gloss=take("gloss", (n, gloss), np.float32) if gloss else none,
        sun_hours=take("sun_hours", (n, days), np.float32) if days else none,
        marks=take("marks", (n, marks), np.float32) if marks else none,
    )
