"""Calls of kernels for no hits at all, which only load or compile them."""

from dataclasses import replace

import numpy as np

from ..features.indirect import CellLight
from ..hits.native import PixelSamples, extra_hits, flag_mirrors
from ..hits.outer import sort_by_pixel
from ..kernels.simd import LANES
from ..terms.bounces import reflect
from ..terms.cells.exact import no_cells
from ..terms.direct import direct
from ..terms.obscurance import apply_textures
from .frame import find_outer
from .records import FrameHits, HitsByPixel, empty_by_frame, split_columns
from .setup import Batch, FrameSetup, Scratch


def _no_batch(setup: FrameSetup) -> Batch:
    """A batch of no hits."""
    scratch, records = Scratch(setup, LANES), setup.empty_records(LANES)
    return Batch(setup=setup, c=0, hits=scratch.hits, n=0, scratch=scratch, records=records)


def load_direct(setup: FrameSetup) -> None:
    """Load or compile direct light."""
    batch = _no_batch(setup)
    tests, irradiance = batch.scratch.test_rays, batch.column("irradiance")
    direct(batch.hits, 0, setup.lights, setup.world.sight, tests, irradiance, False)


def load_gathering(setup: FrameSetup) -> None:
    """Load or compile what gathers light from cells."""
    cells = no_cells(setup.lights, setup.background)
    light = CellLight(settings=setup.indirect.settings, cells=cells, smooth=1)
    light.shade(_no_batch(replace(setup, indirect=light)))


def load_textures(setup: FrameSetup) -> None:
    """Load or compile what looks up textures: a quarter of what obscurances need."""
    apply_textures(setup.world.surfaces, setup.world.tracer, Scratch(setup, LANES).hit_rays, 0)


def load_outer(setup: FrameSetup) -> None:
    """Load or compile what finds the frames that see a hit, and its weights there."""
    batch, frames = _no_batch(setup), setup.frames_around(0, setup.n_r)
    pixel = np.empty((len(frames), 0), np.int32)
    find_outer(batch, frames, pixel, empty_by_frame(setup.frame_columns(), len(frames), 0))
    sort_by_pixel(pixel[0], 0, 0, np.zeros(1, np.int32), np.empty(0, np.int32))


def load_mirrors(setup: FrameSetup) -> None:
    """Load or compile what finds mirrors and follows them; nothing in a scene without."""
    if setup.depth:
        scratch, flags = Scratch(setup, LANES), np.zeros(setup.n_pixels, np.uint8)
        hits, packets = scratch.hits, scratch.hit_rays.packets
        samples = PixelSamples(setup.seed, setup.order[:0], per_pixel=1, first=0)
        extra_hits(setup.cams, 0, samples, 0, 0, setup.world, packets, hits)
        flag_mirrors(setup.cams, 0, setup.order, 0, 0, setup.world, packets, hits, flags)
        reflect(hits, 0, scratch.throughput[0], setup.world, packets, scratch.reflected[0], scratch.throughput[1])


def frame_without_hits(setup: FrameSetup, eye: int) -> FrameHits:
    """The hits of an eye that found none."""
    frames = setup.frames_around(eye, setup.n_r)
    nowhere = HitsByPixel(start=np.zeros(setup.n_zone + 1, np.int32), order=np.empty(0, np.int32))
    dense, _ = split_columns(setup.frame_columns())
    by_frame, records = empty_by_frame(dense, len(frames), 0), setup.empty_records(0)
    return FrameHits(eye=eye, records=records, frames=frames, by_frame=by_frame, places=dict.fromkeys(frames, nowhere))
