"""Machine code on disk: one process compiles a kernel, others load it without what numba needs only to compile."""

import os
import signal
import subprocess
import sys
import threading
import time
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import pytest
from numba import types
from numba.core import codegen

from framearray_cli.engine.kernels import start
from framearray_cli.engine.kernels.clock import compile_clock
from framearray_cli.engine.kernels.kernel import kernel, step
from framearray_cli.engine.kernels.machine_code import Claim

LOADING = """
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
        subprocess.run([sys.executable, "-c", LOADING], env=environment, capture_output=True, text=True, check=True)
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


# Compiles a kernel of its own with the kernels of the program; prints whether it was loaded from disk.
SLOWLY = """
import sys
sys.path.insert(0, sys.argv[1])
from slow import add
from framearray_cli.engine.kernels.clock import compile_clock
with compile_clock() as clock:
    assert add(2) == 5
print(sum(add.stats.cache_hits.values()), sum(add.stats.cache_misses.values()))
"""
# A kernel that takes a while: numba unrolls calls of inlined functions one by one.
SLOW = "from framearray_cli.engine.kernels.kernel import inlined, kernel\n\n\n" + "".join(
    f"@inlined\ndef f{k}(x):\n    return f{k - 1}(x) + f{k - 1}(x) - f{k - 1}(x)\n\n\n"
    if k
    else "@inlined\ndef f0(x):\n    return x\n\n\n"
    for k in range(6)
)
SLOW += "@kernel\ndef add(x):\n    return f5(x) + 3\n"


def _run(folder: Path) -> subprocess.Popen[str]:
    environment = os.environ | {"NUMBA_CACHE_DIR": str(folder / "kernels")}
    return subprocess.Popen(
        [sys.executable, "-c", SLOWLY, str(folder)], stdout=subprocess.PIPE, text=True, env=environment
    )


def test_of_two_processes_one_compiles(tmp_path: Path) -> None:
    (tmp_path / "slow.py").write_text(SLOW)
    processes = [_run(tmp_path) for _ in range(2)]
    results = [process.communicate(timeout=120)[0].split() for process in processes]
    assert sorted(results) == [["0", "1"], ["1", "0"]]


def made_up() -> None:
    """A kernel's function."""


HOLD = """
import sys, time
from pathlib import Path
from types import FunctionType
sys.path.insert(0, sys.argv[1])
from test_machine_code import made_up
from framearray_cli.engine.kernels.machine_code import Claim
claim = Claim(made_up)
assert not claim.take(Path(sys.argv[2]))
print("taken", flush=True)
time.sleep(60)
"""


@pytest.fixture
def holder(tmp_path: Path) -> "Iterator[subprocess.Popen[str]]":
    """A process that holds the claim on `made_up` in a folder."""
    environment = os.environ | {"PYTHONPATH": os.pathsep.join(sys.path)}
    process = subprocess.Popen(
        [sys.executable, "-c", HOLD, str(Path(__file__).parent), str(tmp_path)],
        stdout=subprocess.PIPE, text=True, env=environment,
    )  # fmt: skip
    assert process.stdout is not None
    assert process.stdout.readline() == "taken\n"
    yield process
    process.kill()
    process.communicate()


def test_a_claim_ends_with_its_process(holder: "subprocess.Popen[str]", tmp_path: Path) -> None:
    """A process that waits goes on as soon as the other is killed, and its wait counts as compiling."""
    threading.Timer(0.3, holder.send_signal, [signal.SIGKILL]).start()
    claim, started = Claim(made_up), time.perf_counter()
    with compile_clock() as clock:
        assert claim.take(tmp_path)
    assert 0.2 < time.perf_counter() - started < 10
    assert clock.seconds > 0.2
    claim.give_back()
    holder.wait()
    assert not claim.take(tmp_path), "nobody has it now"
    claim.give_back()


def test_waiting_ends(holder: "subprocess.Popen[str]", tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """A process that holds a claim for ever, such as a stopped one, delays others once."""
    monkeypatch.setattr("framearray_cli.engine.kernels.machine_code.PATIENCE", 0.2)
    claim = Claim(made_up)
    assert claim.take(tmp_path)
    claim.give_back()


def test_a_folder_that_cannot_be_locked_gives_claims_at_once(tmp_path: Path) -> None:
    (tmp_path / "file").write_text("")
    claim = Claim(made_up)
    assert not claim.take(tmp_path / "file" / "kernels")
    claim.give_back()


ALGEBRA = """
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
    run = subprocess.run([sys.executable, "-c", ALGEBRA], capture_output=True, text=True, check=True)
    assert run.stdout.splitlines() == ["False", "[[7.0, 10.0], [15.0, 22.0]] True", "True True"]
