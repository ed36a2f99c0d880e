"""Reflected hits: the same ones in the same order, whatever the size of batches."""

from dataclasses import replace
from typing import Any

import numpy as np
import pytest
from support import tiny

from framearray_cli.engine.frames.frame import find_frame
from framearray_cli.engine.frames.passes import Allotment, blocks_of
from framearray_cli.engine.frames.pool import BATCH, LARGEST_BATCH, TracePool
from framearray_cli.engine.frames.setup import FrameSetup

SIZE = (64, 48)
# 3 hits per pixel and 5 more where mirrors are seen: batches end within the hits of a pixel
JOB: dict[str, Any] = {
    "camera": {"resolution": list(SIZE)},
    "samples": {"hits": 3, "obscurance": 1},
    "specular": {"depth": 3, "hits": 8},
}


def allotted(setup: FrameSetup) -> FrameSetup:
    """Another number of hits in every block, as with a wanted error."""
    blocks = blocks_of(*SIZE)
    hits = 5 + 2 * np.random.default_rng(3).random((setup.n_frames, blocks.n))
    return replace(setup, allotment=Allotment(blocks=blocks, hits=hits.astype(np.float32)))


def reflected_hits(setup: FrameSetup, n_threads: int) -> tuple[int, Any]:
    """The size of batches, and the rows of the reflected hits, pixel by pixel."""
    with TracePool(setup, n_threads) as pool:
        found = find_frame(setup, 0, pool)
        assert found.mirrored and found.mirror_places
        rows = found.mirrored.row[found.mirror_places.order]
        return pool.batch, (
            found.mirror_places.start.copy(),
            rows,
            found.mirrored.irradiance[found.mirror_places.order],
        )


@pytest.mark.parametrize("change", [lambda setup: setup, allotted], ids=["hits", "error"])
def test_reflected_hits_do_not_depend_on_the_size_of_batches(change: Any, monkeypatch: pytest.MonkeyPatch) -> None:
    """Mirrors on two walls face each other: paths have several bounces."""
    with tiny.planned(tiny.prepared(tiny.job(**JOB))) as (setup, _):
        setup = change(setup)
        batch, small = reflected_hits(setup, 2)
        monkeypatch.setattr("framearray_cli.engine.frames.pool.BATCHES_PER_THREAD", 1)
        for n_threads, expected in ((2, 2 * BATCH), (1, LARGEST_BATCH)):
            larger, large = reflected_hits(setup, n_threads)
            assert (batch, larger) == (BATCH, expected)
            for one, other in zip(small, large, strict=True):
                np.testing.assert_array_equal(one, other)
    deepest = np.diff(small[0]).max()
    assert len(small[1]) > 2 * BATCH and deepest > 8, "more reflected hits in a pixel than native ones: several bounces"
