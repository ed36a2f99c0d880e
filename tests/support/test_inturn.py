"""Kernels of tests that run side by side are compiled once."""

import os
import subprocess
import sys
from pathlib import Path

import pytest

MODULE = """
import os, time
from pathlib import Path
from numba.extending import intrinsic
from numba import njit, types

@intrinsic
def noted(typingctx):
    Path("begun").open("a").write("x")
    end = time.monotonic() + float(os.environ["PATIENCE"])
    while Path("begun").read_text() == "x" and time.monotonic() < end:  # the other one may come meanwhile
        time.sleep(0.01)
    return types.intp(), lambda context, builder, signature, args: context.get_constant(types.intp, 42)

@njit(cache=True)
def inner():
    return noted()

@njit(cache=True)
def outer():
    return inner()
"""


@pytest.mark.skipif(sys.platform == "win32", reason="each compiles its own there")
@pytest.mark.parametrize(
    ("first", "patience", "compilations"),
    [("from support import inturn; inturn.compile_in_turn(); ", 2, 1), ("", 60, 2)],
)
def test_two_processes_compile_a_kernel_once(first: str, patience: int, compilations: int, tmp_path: Path) -> None:
    """A kernel that calls one of the same file; without taking turns it is compiled twice."""
    (tmp_path / "slow.py").write_text(MODULE)
    path = os.pathsep.join([str(tmp_path), *sys.path])
    environment = os.environ | {
        "PYTHONPATH": path,
        "NUMBA_CACHE_DIR": str(tmp_path / "cache"),
        "PATIENCE": str(patience),
    }
    call = [sys.executable, "-c", first + "import slow; assert slow.outer() == 42"]
    both = [subprocess.Popen(call, env=environment, cwd=tmp_path) for _ in range(2)]
    assert [process.wait(60) for process in both] == [0, 0]
    assert len((tmp_path / "begun").read_text()) == compilations
