"""Calls of kernels for no hits at all, which only load or compile them."""

from dataclasses import replace

import numpy as np

from ..hits.native import Samples, extra_hits, flag_mirrors
from ..hits.outer import sort_by_pixel
from ..kernels.simd import LANES
from ..terms.cells.exact import no_cells
from ..terms.cells.gather import Gathered, gather_cells, gather_settings
from ..terms.direct import direct
from ..terms.mirrors import reflect
from ..terms.obscurance import apply_textures
from .frame import FrameHits, find_outer
from .glass import NO_GLASS, NO_PANE
from .records import HitsByPixel
from .scratch import Scratch
from .setup import FrameSetup


def load_direct(setup: FrameSetup) -> None:
    """Load or compile direct light."""
    scratch, records = Scratch(setup, LANES), setup.empty_records(LANES)
    direct(scratch.hits, 0, setup.lights, setup.world.sight, scratch.test_rays, records.irradiance, False)


def load_gathering(setup: FrameSetup) -> None:
    """Load or compile what gathers light from cells."""
    setup = replace(setup, cells=no_cells(setup.lights, setup.background), smooth=1)
    scratch, records = Scratch(setup, LANES), setup.empty_records(LANES)
    assert scratch.gather is not None and scratch.near is not None and setup.cells is not None
    out = Gathered(scratch.obscurance, scratch.skylight, records.indirect, scratch.constant, scratch.closeness)
    gather_cells(
        scratch.hits, 0, gather_settings(setup.obscurance), setup.world, setup.lights, setup.cells, scratch.hit_rays,
        scratch.gather, scratch.test_rays, scratch.near, scratch.mirrors, out, False,
    )  # fmt: skip


def load_textures(setup: FrameSetup) -> None:
    """Load or compile what looks up textures: a quarter of what obscurances need."""
    apply_textures(setup.world.surfaces, setup.world.tracer, Scratch(setup, LANES).hit_rays, 0)


def load_outer(setup: FrameSetup) -> None:
    """Load or compile what finds the frames that see a hit, and its weights there."""
    scratch, frames = Scratch(setup, LANES), setup.frames_around(0, setup.n_r)
    pixel, weight = np.empty((len(frames), 0), np.int32), np.empty((len(frames), 0), np.float32)
    find_outer(setup, 0, 0, scratch, frames, pixel, weight, np.empty((len(frames), 0), np.uint8))
    sort_by_pixel(pixel[0], 0, 0, np.zeros(1, np.int32), np.empty(0, np.int32))


def load_mirrors(setup: FrameSetup) -> None:
    """Load or compile what finds mirrors and follows them; nothing in a scene without."""
    if setup.depth:
        scratch, flags = Scratch(setup, LANES), np.zeros(setup.n_pixels, np.uint8)
        hits, packets = scratch.hits, scratch.hit_rays.packets
        samples = Samples(setup.seed, setup.order[:0], per_pixel=1, first=0)
        extra_hits(setup.cams, 0, samples, 0, 0, setup.world, packets, hits)
        flag_mirrors(setup.cams, 0, setup.order, 0, 0, setup.world, packets, hits, flags)
        reflect(hits, 0, scratch.throughput[0], setup.world, packets, scratch.reflected[0], scratch.throughput[1])


def frame_without_hits(setup: FrameSetup, c: int) -> FrameHits:
    """The hits of an eye that found none."""
    nothing, frames = np.empty(0, np.float32), setup.frames_around(c, setup.n_r)
    nowhere = HitsByPixel(start=np.zeros(setup.n_pixels + 1, np.int32), order=np.empty(0, np.int32))
    return FrameHits(
        c=c,
        records=setup.empty_records(0),
        places=dict.fromkeys(frames, nowhere),
        weights=dict.fromkeys(frames, nothing),
        within=dict.fromkeys(frames, np.empty(0, np.uint8)),
        through=dict.fromkeys(frames, NO_GLASS),
        front=dict.fromkeys(frames, NO_PANE),
        mirrored=None,
        mirror_places=None,
        mirror_hits=np.zeros((2, 0), np.int32),
        normal=np.empty((0, 3), np.float32),
        depth=nothing,
        pooled={},
    )
