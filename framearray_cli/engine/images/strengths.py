"""How strong sources are, for hits on surfaces that shine."""

import numpy as np

from framearray_cli.base.arrays import Addresses, Float32, with_room

from ..frames.setup import FrameSetup
from .band import NOTHING_SHINES


def strengths(setup: FrameSetup) -> tuple[Float32, Addresses]:
    """The strengths of all sources at the kept lights, and the address of each one's; empty where nothing shines."""
    if not setup.shines:
        return np.empty(0, np.float32), NOTHING_SHINES
    kept = setup.lights.strength[:, :, setup.kept.start : setup.kept.stop]
    found: Float32 = with_room(kept.shape, np.float32, fill=0)
    found[:] = kept
    return found, found.ctypes.data + found.strides[0] * np.arange(len(found), dtype=np.int64)
