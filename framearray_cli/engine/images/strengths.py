"""How strong sources are, for hits on surfaces that shine."""

import numpy as np

from framearray_cli.base.arrays import Addresses, Float32, with_room

from ..frames.setup import FrameSetup
from .band import NOTHING_SHINES


def strengths(setup: FrameSetup) -> tuple[Float32, Addresses]:
    """The strengths of all sources, and the address of each one's; empty where nothing shines."""
    if not setup.shines:
        return np.empty(0, np.float32), NOTHING_SHINES
    found: Float32 = with_room(setup.lights.strength.shape, np.float32, fill=0)
    found[:] = setup.lights.strength
    return found, found.ctypes.data + found.strides[0] * np.arange(len(found), dtype=np.int64)
