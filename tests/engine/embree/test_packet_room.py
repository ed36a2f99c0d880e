"""Embree may write behind a packet of shadow rays; that memory must not belong to another array."""

import os
import subprocess
import sys

import pytest
from support import ROOT

pytest.importorskip("fcntl", reason="no protected pages there")

# Packets at the very end of a page, behind which nothing may be read or written.
PROGRAM = """
import ctypes, mmap
import numpy as np
from framearray_cli.engine.embree import packets as module
from framearray_cli.engine.embree.library import embree_library

def at_the_end_of_a_page(n, dtype):
    size = n * np.dtype(dtype).itemsize
    room = -(-size // mmap.PAGESIZE) * mmap.PAGESIZE
    memory = mmap.mmap(-1, room + mmap.PAGESIZE)
    start = ctypes.addressof(ctypes.c_char.from_buffer(memory))
    assert not ctypes.CDLL(None).mprotect(ctypes.c_void_p(start + room), mmap.PAGESIZE, 0)
    return np.frombuffer(memory, dtype, n, room - size)

library = embree_library()
device = library.rtcNewDevice(b"isa=avx2") or library.rtcNewDevice(None)
scene = library.rtcNewScene(device)
vertices = np.array([0, 0, 0, 1, 0, 0, 0, 1, 0, 0, 0, 0, 0], np.float32)
indices = np.arange(3, dtype=np.uint32)
geometry = library.rtcNewGeometry(device, 0)
library.rtcSetSharedGeometryBuffer(geometry, 1, 0, 0x9003, vertices.ctypes.data, 0, 12, 3)
library.rtcSetSharedGeometryBuffer(geometry, 0, 0, 0x5003, indices.ctypes.data, 0, 12, 1)
library.rtcCommitGeometry(geometry)
library.rtcAttachGeometryByID(scene, geometry, 0)
library.rtcCommitScene(scene)
lanes = module.aligned_zeros(16).view(np.int32)
lanes[:] = -1
module.np = type("", (), dict(vars(np), zeros=staticmethod(at_the_end_of_a_page)))
rays = module.empty_packets(48, module.{rows})
rays[:, module.ORIGIN] = rays[:, module.ORIGIN + 1] = 0.2
rays[:, module.ORIGIN + 2], rays[:, module.DIRECTION + 2], rays[:, module.TFAR] = 1, -1, 10
for packet in rays:
    library.{function}(lanes.ctypes.data, scene, packet.ctypes.data, None)
print((rays[:, module.TFAR] < 10).all())
"""


@pytest.mark.parametrize(("rows", "function"), [("RAY_ROWS", "rtcOccluded16"), ("HIT_ROWS", "rtcIntersect16")])
def test_what_embree_writes_stays_in_the_memory_of_the_packets(rows, function):
    program = PROGRAM.format(rows=rows, function=function)
    environment = os.environ | {"FRAMEARRAY_PACKETS": "16"}  # even where Embree has none
    ran = subprocess.run([sys.executable, "-c", program], cwd=ROOT, env=environment, capture_output=True, text=True)
    assert (ran.returncode, ran.stdout.strip()) == (0, "True"), ran.stderr
