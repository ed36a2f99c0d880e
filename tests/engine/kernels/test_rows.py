"""Rows of packets, whatever the width of a packet."""

import os
import subprocess
import sys
from pathlib import Path

import numba as nb
import numpy as np
import pytest
from PIL import Image
from support import ROOT

from framearray_cli.array.folder import read_array
from framearray_cli.array.record import read_records
from framearray_cli.engine.embree import library
from framearray_cli.engine.kernels.simd import load_row, memory, store_row, width_of_packets

ROWS, RAYS = 5, 48


@pytest.mark.parametrize("width", [16, 8, 4])
@pytest.mark.parametrize("dtype", [np.float32, np.int32])
def test_sixteen_rays_are_one_packet_or_several(width, dtype, monkeypatch):
    monkeypatch.setattr(memory, "packet_width", lambda: width)

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


@pytest.mark.parametrize("widths", [(4, 8, 16), (4, 8), (4,), ()])
def test_the_widest_native_packets_are_used(widths, monkeypatch):
    monkeypatch.delenv("FRAMEARRAY_PACKETS", raising=False)
    monkeypatch.setattr(library, "embree_properties", lambda: library.EmbreeProperties("", widths))
    assert library.packet_width.__wrapped__() == (widths[-1] if widths else 16)


def test_embree_names_its_widths():
    """With AVX2 only there are no packets of 16, with SSE2 none of 8."""
    program = "from framearray_cli.engine.embree.library import embree_properties as find; print(find().packet_widths)"

    def found(isa):
        environment = os.environ | {"FRAMEARRAY_EMBREE": f"isa={isa}"}
        return subprocess.check_output([sys.executable, "-c", program], cwd=ROOT, env=environment, text=True).strip()

    if found("avx2") == "()":
        pytest.skip("no such instructions on this processor")
    assert (found("avx2"), found("sse2")) == ("(4, 8)", "(4,)")


# The program, with the flag of coherent rays or without.
PROGRAM = """
import runpy
from framearray_cli.engine.embree import embreescene
embreescene._COHERENT *= {coherent}
runpy.run_module("framearray_cli", run_name="__main__")
"""
CELLS = ("reuse.weights=area", "indirect.method=cells")


def rendered(folder: Path, *settings: str, coherent: bool = True) -> list[Path]:
    """Render the smoke job in packets of 16, 8 and 4 rays; kernels are compiled for one width, so each in a process."""
    folders = [folder / str(width) for width in (16, 8, 4)]
    for out in folders:
        command = [sys.executable, "-c", PROGRAM.format(coherent=int(coherent))]
        command += ["render", "-q", "jobs/smoke.toml", "-o", str(out)]
        command += [part for setting in settings for part in ("--set", setting)]
        subprocess.run(command, cwd=ROOT, env=os.environ | {"FRAMEARRAY_PACKETS": out.name}, check=True)
    return folders


def files_of(out: Path) -> dict[str, bytes]:
    return {file.name: file.read_bytes() for file in out.glob("smoke.*")}


@pytest.mark.slow
@pytest.mark.parametrize("settings", [(), ("reuse.weights=area",)])
def test_a_small_array_is_the_same_for_every_width(settings, tmp_path):
    """Where triangles meet, Embree may choose another one for another width: the smoke job has no such pixel."""
    found = [files_of(out) for out in rendered(tmp_path, *settings)]
    assert found[0]
    assert found[0] == found[1] == found[2]


@pytest.mark.slow
def test_light_from_cells_is_the_same_for_every_width_but_at_edges(tmp_path):
    """Without the flag of coherent rays all images are equal. With it, of 634,420 gather rays 6 or 16 meet another
    triangle where they pass an edge; the cells are still the same, and few pixels see such a ray."""
    without = [files_of(out) for out in rendered(tmp_path / "without", *CELLS, coherent=False)]
    assert without[0]
    assert without[0] == without[1] == without[2]

    folders = rendered(tmp_path / "with", *CELLS)
    arrays = [read_array(out) for out in folders]
    assert all(arrays)
    cells = [
        {run.cells for run in read_records(out, array.fingerprint).runs}
        for out, array in zip(folders, arrays, strict=True)
    ]
    assert len(cells[0]) == 1 and cells[0] == cells[1] == cells[2]
    names = sorted(file.name for file in folders[0].glob("smoke.*.png"))
    whole, *others = (np.stack([np.asarray(Image.open(out / name), int) for name in names]) for out in folders)
    for other in others:
        assert np.abs(other - whole).max() <= 1
        assert (other != whole).mean() < 256 * 1e-6
