"""Kernels read hits a packet at a time: what is behind the last hit must be memory of the same array."""

from typing import Any

import numpy as np
import pytest
from support import tiny

from framearray_cli.engine.kernels.simd import LANES
from framearray_cli.engine.terms.ambient import intensity as ambient
from framearray_cli.engine.terms.ambient.intensity import BATCH, Workspace


def test_hits_of_walks_have_room_for_whole_packets(monkeypatch: pytest.MonkeyPatch) -> None:
    lights = tiny.prepared(tiny.job()).light_arrays
    work, n, given = Workspace(lights), BATCH // 2 + 3, []
    work.walkers[0].step[:n] = 0

    def direct(hits: Any, *rest: Any) -> int:
        given.append(hits)
        return 0

    monkeypatch.setattr(ambient, "direct", direct)
    monkeypatch.setattr(ambient, "deposit", lambda *_: None)
    work.add_direct(n, lights, None)  # type: ignore[arg-type,unused-ignore]
    assert len(given) == 1
    for array in given[0]:
        whole = array if array.base is None else array.base
        assert len(whole) >= -(-n // LANES) * LANES
        assert whole.flags.c_contiguous and isinstance(whole, np.ndarray)
