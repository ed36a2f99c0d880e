"""Rows of packets, whatever the width of a packet."""

import os
import subprocess
import sys

import numba as nb
import numpy as np
import pytest
from support import ROOT

from framearray_cli.engine import embree_c
from framearray_cli.engine.kernels.simd import load_row, rows, store_row, width_of_packets

ROWS, RAYS = 5, 48


@pytest.mark.parametrize("width", [16, 8, 4])
@pytest.mark.parametrize("dtype", [np.float32, np.int32])
def test_sixteen_rays_are_one_packet_or_several(width, dtype, monkeypatch):
    monkeypatch.setattr(rows, "packet_width", lambda: width)

    @nb.njit
    def copy(source, target):
        for first in range(0, source.shape[0] * width_of_packets(), 16):
            for row in range(source.shape[1] - 1):
                store_row(target, first, row, load_row(source, first, row))
            store_row(target, first, source.shape[1] - 1, dtype(7))

    # number of each ray and row, laid out by packets
    number = 100 * np.arange(RAYS)[:, None] + np.arange(ROWS)
    source = np.ascontiguousarray(number.reshape(RAYS // width, width, ROWS).transpose(0, 2, 1)).astype(dtype)
    target = np.zeros_like(source)
    copy(source, target)
    assert (target[:, :-1] == source[:, :-1]).all()
    assert (target[:, -1] == 7).all()


@pytest.mark.parametrize("widths", [(16, 8, 4), (8, 4), (4,), ()])
def test_the_widest_native_packets_are_used(widths, monkeypatch):
    monkeypatch.delenv("FRAMEARRAY_PACKETS", raising=False)
    monkeypatch.setattr(embree_c, "native_widths", lambda: widths)
    assert embree_c.packet_width.__wrapped__() == (widths[0] if widths else 16)


def test_embree_names_its_widths():
    """With AVX2 only there are no packets of 16, with SSE2 none of 8."""
    program = "from framearray_cli.engine.embree_c import native_widths; print(native_widths())"

    def found(isa):
        environment = os.environ | {"FRAMEARRAY_EMBREE": f"isa={isa}"}
        return subprocess.check_output([sys.executable, "-c", program], cwd=ROOT, env=environment, text=True).strip()

    if found("avx2") == "()":
        pytest.skip("no such instructions on this processor")
    assert (found("avx2"), found("sse2")) == ("(8, 4)", "(4,)")


@pytest.mark.slow
@pytest.mark.parametrize("settings", [(), ("reuse.weights=area",), ("reuse.weights=area", "indirect.method=cells")])
def test_a_small_array_is_the_same_for_every_width(settings, tmp_path):
    """Kernels are compiled for one width, so each needs a process of its own.

    Where triangles meet, Embree may choose another one for another width: the smoke job has no such pixel.
    """
    found = []
    for width in (16, 8, 4):
        out = tmp_path / str(width)
        command = [sys.executable, "-m", "framearray_cli", "render", "-q", "jobs/smoke.toml", "-o", str(out)]
        command += [part for setting in settings for part in ("--set", setting)]
        subprocess.run(command, cwd=ROOT, env=os.environ | {"FRAMEARRAY_PACKETS": str(width)}, check=True)
        found.append({file.name: file.read_bytes() for file in out.glob("smoke.*")})
    assert found[0]
    assert found[0] == found[1] == found[2]
