"""Kernels from disk run without what numba needs to compile, and other kernels can inline them."""

import os
import subprocess
import sys
from pathlib import Path
from typing import Any

import pytest
from numba import types
from numba.core import codegen

from framearray_cli.engine.kernels import start
from framearray_cli.engine.kernels.kernel import kernel, step

PROGRAM = """
import sys
from framearray_cli.engine.hits.native import pixel_order
order = pixel_order(4, 4)
loaded = [name for name in ("numba.np.arrayobj", "numba.typed.typedlist") if name in sys.modules]
import scipy
from framearray_cli.engine.terms.mirrors import count_mirrors
print(sorted(order.tolist()) == list(range(16)), loaded)
"""


def doubled(x: int) -> int:
    return 2 * x


@pytest.mark.skipif(not start.is_tried(), reason="another numba loads kernels in its own way")
def test_the_first_run_prepares_to_compile_and_the_second_does_not(tmp_path: Path) -> None:
    environment = {**os.environ, "NUMBA_CACHE_DIR": str(tmp_path)}
    lines = [
        subprocess.run([sys.executable, "-c", PROGRAM], env=environment, capture_output=True, text=True, check=True)
        for _ in range(2)
    ]
    compiled = "['numba.np.arrayobj', 'numba.typed.typedlist']"
    assert [run.stdout.strip() for run in lines] == [f"True {compiled}", "True []"]


@pytest.mark.parametrize("kind", [kernel, step])
def test_a_kernel_from_disk_is_inlined_into_one_that_is_compiled(kind: Any, own_cache: Path) -> None:
    kept: Any = kind(doubled)
    kept.compile((types.int64,))
    assert len(list(own_cache.rglob("*.nbi"))) == 1
    loaded: Any = kind(doubled)

    def plus_one(x: int) -> int:
        return int(loaded(x)) + 1

    caller: Any = kernel(plus_one)
    assert caller(20) == 41 and sum(loaded.stats.cache_hits.values()) == 1
    (code,) = caller.inspect_llvm().values()
    assert not [line for line in code.splitlines() if " call " in line and "doubled" in line]


def made_code(function: Any) -> Any:
    """The machine code of a kernel that was compiled for one kind of arguments, as numba holds it."""
    (made,) = function.overloads.values()
    return made._asdict()["library"]


def test_other_versions_of_numba_load_kernels_in_their_own_way(
    own_cache: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(start, "TRIED", "0.1")
    for found in (0, 1):
        function: Any = kernel(doubled)
        assert function(21) == 42 and sum(function.stats.cache_hits.values()) == found
    assert type(made_code(function)) is codegen.JITCodeLibrary


def test_a_function_that_is_not_there_has_no_address(own_cache: Path) -> None:
    kernel(doubled)(1)
    loaded: Any = kernel(doubled)
    assert loaded(21) == 42 and sum(loaded.stats.cache_hits.values()) == 1
    (made,), code = loaded.overloads.values(), made_code(loaded)
    assert code.get_pointer_to_function("no such function") == 0
    assert code.get_pointer_to_function(made.fndesc.llvm_cpython_wrapper_name) != 0
