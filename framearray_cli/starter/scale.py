"""Guess the unit of length of a scene, and which axis points up, where its file leaves that open."""

import math
from dataclasses import dataclass

import numpy as np

from framearray_cli.base.arrays import Float64

METRES = {"m": 1.0, "cm": 0.01, "mm": 0.001, "in": 0.0254, "ft": 0.3048}
NAMES = {"m": "metre", "cm": "centimetre", "mm": "millimetre", "in": "inch", "ft": "foot"}
# How much less likely a unit is than the metre before anything is measured, logarithms: glTF prescribes the metre.
GLTF = {"m": 0.0, "cm": -2.5, "mm": -2.5, "in": -2.5, "ft": -4.0}
OTHERS = {"m": 0.0, "cm": -0.3, "mm": -0.7, "in": -0.7, "ft": -1.5}
# Heights of rooms: most are 2.6 m high, times or over 1.2; a fifth are halls of 4.5 m, times or over 1.8.
ROOM_METRES, ROOM_SPREAD, HALL_METRES, HALL_SPREAD, HALLS = 2.6, 0.2, 4.5, 0.6, 0.2
STREET_METRES, STREET_SPREAD = 12.0, 1.0  # heights of what stands along a street
LEAST_LIKELY = 0.005  # with a lower density of every unit, the unit is none of them
PRINTED, LEAST_PRINTED = (".stl", ".3mf"), 3.0  # formats of print shops, in millimetres; smaller is in another unit
STEP = 0.005  # share of the extent within which corners are at one level
LOWEST = 0.2  # share of the extent in which the floor lies
FLATTER, MORE_FEET = 0.75, 1.5  # a scene lies on its side if its extents and corners differ that much


@dataclass(frozen=True, slots=True, kw_only=True)
class Unit:
    """A unit of length.

    Attributes:
        name: "m", "cm", "mm", "in" or "ft".
        density: how likely the size is in it, and in all.
    """

    name: str
    density: float

    @property
    def metre(self) -> float:
        """Its length in this unit."""
        return 1 / METRES[self.name]


def unit_of(metres: float | None) -> Unit | None:
    """The unit of a length that the file gives; None if it gives none, or one without a name."""
    for name, length in METRES.items():
        if metres is not None and math.isclose(metres, length, rel_tol=1e-3):
            return Unit(name=name, density=1.0)
    return None


def guess_unit(height: float, suffix: str, *, roofless: bool = False) -> Unit | None:
    """Guess the unit from the height of a room, or of a place under the sky; None if none makes it plausible.

    Args:
        suffix: of the scene file; glTF prescribes the metre.
    """
    prior = GLTF if suffix.lower() in (".glb", ".gltf") else OTHERS
    density = _street_density if roofless else _room_density
    found = [
        Unit(name=name, density=math.exp(weight) * density(height * METRES[name])) for name, weight in prior.items()
    ]
    best = max(found, key=lambda unit: unit.density)
    return best if best.density >= LEAST_LIKELY else None


def unit_of_a_thing(size: float, suffix: str) -> Unit | None:
    """The unit that the format prescribes or implies; None if it leaves that open."""
    if suffix.lower() in (".glb", ".gltf"):
        return Unit(name="m", density=1.0)
    return Unit(name="mm", density=1.0) if suffix.lower() in PRINTED and size >= LEAST_PRINTED else None


def _room_density(metres: float) -> float:
    low = _bell(math.log(metres / ROOM_METRES) / ROOM_SPREAD) / ROOM_SPREAD
    return (1 - HALLS) * low + HALLS * _bell(math.log(metres / HALL_METRES) / HALL_SPREAD) / HALL_SPREAD


def _street_density(metres: float) -> float:
    return _bell(math.log(metres / STREET_METRES) / STREET_SPREAD) / STREET_SPREAD


def _bell(x: float) -> float:
    return math.exp(-x * x / 2)


def lies_on_its_side(corners: Float64) -> bool:
    """Whether z points up in a scene in which y should: it is flat along z, and many things begin at its bottom there.

    Args:
        corners: (n, 3).
    """
    extent = np.ptp(corners, axis=0)
    return bool(
        extent[2] < FLATTER * extent[1] and _share_of_feet(corners[:, 2]) > MORE_FEET * _share_of_feet(corners[:, 1])
    )


def _share_of_feet(level: Float64) -> float:
    """Largest share of the corners that lie at one level near the bottom: feet of tables and walls on the floor."""
    low, extent = float(level.min()), float(np.ptp(level))
    if extent <= 0:
        return 0.0
    near = level[level <= low + LOWEST * extent]
    return int(np.bincount(((near - low) / (STEP * extent)).astype(np.int64)).max()) / len(level)
