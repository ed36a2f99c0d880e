"""What stands in where a file gives no material, or colours that are not colours."""

import numpy as np

from ..arrays import Float32, Float64
from .model import GREY, Material, Notes

DEFAULT_NAME = "default"
COLOURED_NAME = "vertex colours"


def clean_colours(colours: Float64, notes: Notes) -> Float32:
    """Bring colours into [0, 1]: 0 to 255 is scaled, NaN becomes white."""
    bad = np.asarray(~np.isfinite(colours).all(axis=-1))
    if bad.any():
        notes.add("vertex colours that are not numbers are taken as white")
        colours = np.where(bad[..., None], 1.0, colours)
    if colours.size and colours.max() > 1.5:
        notes.add("vertex colours from 0 to 255 are scaled to 0 to 1")
        colours = colours / 255.0
    return np.clip(colours, 0.0, 1.0).astype(np.float32)


def default_material(coloured: bool, notes: Notes, name: str = "") -> Material:
    """What stands in for a missing material: white under vertex colours, grey otherwise."""
    if coloured:
        return Material(name=name or COLOURED_NAME, reflectivity=(1.0, 1.0, 1.0))
    notes.add(f"surfaces without material have a grey of reflectivity {GREY}")
    return Material(name=name or DEFAULT_NAME)
