"""Hits for tests: all native hits of an eye, or any number at one place."""

from typing import Any

import numpy as np

from framearray_cli.engine.frames.setup import FrameSetup
from framearray_cli.engine.hits.hits import SURFACE, Hits, empty_hits
from framearray_cli.engine.hits.native import PixelSamples, native_hits
from framearray_cli.engine.hits.rays import room_for_hits
from framearray_cli.engine.hits.row import LIT_BITS
from framearray_cli.engine.kernels.simd import LANES


def native(setup: FrameSetup, c: int, per_pixel: int, batch: int = 2048) -> Hits:
    """Find all native hits of a frame, in batches."""
    n, packets, parts = setup.n_pixels * per_pixel, room_for_hits(batch).packets, []
    for first in range(0, n, batch):
        hits, m = empty_hits(batch), min(batch, n - first)
        samples = PixelSamples(setup.seed, setup.order, per_pixel, 0)
        native_hits(setup.cams, c, samples, first, m, setup.world, True, packets, hits)
        parts.append([array[:m] for array in hits])
    return Hits(*(np.concatenate(arrays) for arrays in zip(*parts, strict=True)))


def points(n: int, position: Any, normal: Any) -> Hits:
    """Make n hits at one place of one orientation, each with its own stream."""
    hits = empty_hits(n)
    hits.kind[:] = SURFACE
    hits.position[:], hits.geometric[:], hits.shading[:] = position, normal, normal
    hits.offset[:] = 1e-5
    hits.reflectivity[:], hits.specular[:], hits.incoming[:] = 0.5, 0.0, -np.asarray(normal, np.float32)
    hits.key[:] = np.random.default_rng(1).integers(0, 2**63, n).astype(np.uint64)
    hits.pixel[:], hits.half[:] = 0, 0
    return hits


def lit_packets(irradiance: Any) -> Any:
    """Return which packets of light positions are not all zero, (n,): one bit per packet or shared by several."""
    n_packets = -(-irradiance.shape[2] // LANES)
    shared = 1
    while n_packets > shared * LIT_BITS:
        shared *= 2
    return sum(
        (irradiance[:, :, bit * shared * LANES : (bit + 1) * shared * LANES] != 0).any(axis=(1, 2)) * 2.0**bit
        for bit in range(-(-n_packets // shared))
    )
