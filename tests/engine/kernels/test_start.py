"""The first kernel loads no linear algebra; other functions of the process find it all the same."""

import subprocess
import sys

PROGRAM = """
import sys
import numba, numpy as np
from framearray_cli.engine.hits.native import pixel_order
pixel_order(4, 4)
print("scipy.linalg" in sys.modules)
square = numba.njit(lambda a: a @ a)
print(square(np.array([[1.0, 2.0], [3.0, 4.0]])).tolist(), "scipy.linalg" in sys.modules)
from numba.np import arraymath, linalg
print(arraymath.ensure_blas is linalg.ensure_blas, arraymath._HAVE_BLAS)
"""


def test_linear_algebra_is_loaded_when_it_is_needed() -> None:
    run = subprocess.run([sys.executable, "-c", PROGRAM], capture_output=True, text=True, check=True)
    assert run.stdout.splitlines() == ["False", "[[7.0, 10.0], [15.0, 22.0]] True", "True True"]
