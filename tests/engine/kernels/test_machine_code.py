"""Machine code on disk: one process compiles a kernel, others load it; clocks, a second process, compiler passes."""

import ctypes
import os
import signal
import subprocess
import sys
import threading
import time
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import numba
import numpy as np
import psutil
import pytest
from numba.core import codegen, untyped_passes
from numba.core.dispatcher import Dispatcher
from support.program import python

from framearray_cli.engine.kernels import calls, second_process, start
from framearray_cli.engine.kernels.clock import compile_clock, is_compiling
from framearray_cli.engine.kernels.kernel import inlined, kernel, outlined
from framearray_cli.engine.kernels.machine_code import Claim

LOADING = """
import sys
from framearray_cli.engine.hits.native import pixel_order
order = pixel_order(4, 4)
loaded = [name for name in ("numba.np.arrayobj", "numba.typed.typedlist") if name in sys.modules]
import scipy
from framearray_cli.engine.terms.bounces import count_mirrors
print(sorted(order.tolist()) == list(range(16)), loaded)
"""


def doubled(x: int) -> int:
    return 2 * x


@pytest.mark.skipif(not start.is_tried(), reason="another numba loads kernels in its own way")
def test_the_first_run_prepares_to_compile_and_the_second_does_not(tmp_path: Path) -> None:
    lines = [python(LOADING, NUMBA_CACHE_DIR=str(tmp_path)) for _ in range(2)]
    assert lines == ["True ['numba.np.arrayobj', 'numba.typed.typedlist']", "True []"]


def plus_one(x: int) -> int:
    return int(doubled_kernel(x)) + 1


doubled_kernel: Any = kernel(doubled)


@pytest.mark.skipif(not start.is_tried(), reason="another numba compiles a callee into its caller")
def test_a_kernel_calls_another_one_by_its_address(own_cache: Path) -> None:
    """Its file does not contain the other one's code; from disk, it loads the other one."""
    caller: Any = kernel(plus_one)
    assert caller(20) == 41
    (code,) = caller.inspect_llvm().values()
    assert not [line for line in code.splitlines() if line.startswith("define") and "doubled" in line]
    files = {file.name.partition("-")[0]: file.read_bytes() for file in own_cache.rglob("*.kernel")}
    assert set(files) == {f"{plus_one.__module__.rpartition('.')[2]}.{name}" for name in ("plus_one", "doubled")}
    program = f"""
import sys
sys.path.insert(0, {str(Path(__file__).parent)!r})
from {Path(__file__).stem} import doubled_kernel, kernel, plus_one
caller = kernel(plus_one)
print(caller(20), sum(caller.stats.cache_hits.values()), sum(doubled_kernel.stats.cache_hits.values()))
"""
    for _ in range(2):  # compiled for this name of the module, and loaded
        found = python(program, PYTHONPATH=os.pathsep.join(sys.path))
    assert found == "41 1 1"


@pytest.mark.skipif(not start.is_tried(), reason="another numba compiles a callee before its caller")
def test_a_kernel_is_there_for_other_threads_as_soon_as_its_callees_are(monkeypatch: pytest.MonkeyPatch) -> None:
    there: list[int] = []
    fill = calls.fill_slots

    def fill_slots(callees: Any) -> None:
        there.append(len(caller.overloads))
        fill(callees)
        there.append(len(doubled_kernel.overloads))

    monkeypatch.setattr("framearray_cli.engine.kernels.machine_code.fill_slots", fill_slots)
    caller: Any = kernel(plus_one)
    assert caller(20) == 41
    assert there[0] == 0 and there[-1] == 1


@pytest.mark.skipif(not start.is_tried(), reason="another numba asks the compiled callee")
def test_an_annotation_says_what_a_kernel_returns() -> None:
    """Another number of the same kind would be read from other bytes."""

    def wrong(x: float) -> int:
        return x + 0.5  # type: ignore[return-value]

    def number(x: float) -> float:
        return x + 0.5

    called: Any = kernel(wrong)
    right: Any = kernel(number)
    with pytest.raises(TypeError, match="wrong: returns float64, its annotation int64"):
        kernel(lambda x: called(x))(1.0)
    assert kernel(lambda x: right(x))(1.0) == 1.5, "float leaves the number of bits open, so numba is asked"


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
# A kernel that takes a while: LLVM inlines calls one by one.
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


def test_a_process_that_must_not_wait_does_other_kernels(holder: "subprocess.Popen[str]", tmp_path: Path) -> None:
    claim = Claim(made_up)
    with pytest.raises(second_process.KernelTakenError), second_process.without_waiting():
        claim.take(tmp_path)
    holder.kill()
    assert claim.take(tmp_path) in (True, False)
    claim.give_back()


@pytest.mark.skipif(not start.is_tried(), reason="another numba compiles callees one by one")
def test_callees_that_another_process_compiles_come_last(monkeypatch: pytest.MonkeyPatch) -> None:
    order: list[str] = []

    def fill(address: Any, callee: Any) -> None:
        if callee == "busy" and not order.count("busy"):
            order.append("busy")
            second_process.expect_to_wait()
        order.append(f"{callee} filled")

    monkeypatch.setattr(calls, "_fill", fill)
    slot = calls._Slot(ctypes.c_void_p(), ("", "", (), None))
    monkeypatch.setattr(calls, "_slots", {"a": slot, "b": slot})
    calls.fill_slots([("a", "busy"), ("b", "free")])  # type: ignore[list-item]
    assert order == ["busy", "free filled", "busy filled"]


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
    assert python(ALGEBRA).splitlines() == ["False", "[[7.0, 10.0], [15.0, 22.0]] True", "True True"]


def test_each_clock_reports_once_and_measures_its_own_time() -> None:
    begun: list[str] = []
    started = time.perf_counter()
    with compile_clock(lambda: begun.append("outer")) as outer, compile_clock(lambda: begun.append("inner")) as inner:
        for k in range(3):
            numba.njit(lambda x, k=k: x + k)(1)
            assert not is_compiling()
    wall = time.perf_counter() - started
    assert sorted(begun) == ["inner", "outer"]
    assert 0 < inner.seconds <= wall and 0 < outer.seconds <= wall
    before = outer.seconds
    numba.njit(lambda x: x - 1)(1)
    assert outer.seconds == before, "a clock that has ended measures nothing"


def test_kernels_count_once_and_functions_of_others_never() -> None:
    """A kernel that is compiled for two kinds of arguments is one; numba compiles functions of its own, too."""
    counts: list[int] = []

    def own(x):
        return x + 1

    own.__module__ = "framearray_cli.made_up"
    with compile_clock(compiled=counts.append) as clock:
        numba.njit(lambda x: x + 2)(1)
        assert clock.kernels == 0
        kernel = numba.njit(own)
        kernel(1)
        kernel(1.5)
    assert clock.kernels == 1
    assert counts == [1]


def test_what_began_to_compile_before_a_clock_does_not_count() -> None:
    """Another thread may compile when a clock starts; its end raised an error there."""
    from numba.core import event

    with compile_clock() as clock:
        event.end_event("numba:compile", data={"dispatcher": None})
    assert (clock.seconds, clock.kernels) == (0.0, 0)
    assert not is_compiling()


PARENT = """
import subprocess, sys
from framearray_cli.engine.kernels import second_process
second_process.offer("from framearray_cli.engine.kernels.second_process import end_with_parent; end_with_parent()\\n"
             "import time; time.sleep(60)")
second_process.start()
print(second_process._started[0][1].pid, flush=True)
if sys.argv[1] == "stopped":
    second_process.stop()
    second_process._started[0][1].wait(10)
sys.stdin.read()
"""


@pytest.fixture
def offered(monkeypatch: pytest.MonkeyPatch) -> list[str]:
    """The command that a test offered; a second core is free."""
    found: list[str] = []
    monkeypatch.delenv(second_process.PROCESSES, raising=False)
    monkeypatch.setattr(second_process, "available_cores", lambda: 2)
    monkeypatch.setattr(second_process, "kept_kernels", lambda: 36)
    monkeypatch.setattr(second_process, "kernel_folder", lambda: Path())
    monkeypatch.setattr(second_process, "_offered", found)
    monkeypatch.setattr(second_process, "_started", [])
    return found


@pytest.mark.parametrize("how", ["stopped", "ended", "killed"])
def test_it_ends_when_asked_and_with_the_process_that_started_it(tmp_path: Path, how: str) -> None:
    environment = os.environ | {"NUMBA_CACHE_DIR": str(tmp_path)}
    environment.pop(second_process.PROCESSES, None)
    if second_process.available_cores() < 2:
        pytest.skip("one core")
    parent = subprocess.Popen(
        [sys.executable, "-c", PARENT, how], stdin=subprocess.PIPE, stdout=subprocess.PIPE, text=True, env=environment
    )
    assert parent.stdout is not None
    child = psutil.Process(int(parent.stdout.readline()))
    if how == "killed":
        parent.kill()
    if how == "stopped":
        child.wait(timeout=20)
        assert parent.poll() is None
    parent.communicate("")
    child.wait(timeout=20)


def test_nothing_is_offered_where_no_core_is_free(offered: list[str], monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(second_process, "available_cores", lambda: 1)
    second_process.offer("pass")
    assert offered == []
    monkeypatch.setattr(second_process, "available_cores", lambda: 2)
    monkeypatch.setenv(second_process.PROCESSES, "1")
    second_process.offer("pass")
    assert offered == []


def test_it_starts_once_and_only_when_a_kernel_is_missing(
    offered: list[str], monkeypatch: pytest.MonkeyPatch, tmp_path: Path
) -> None:
    started: list[list[str]] = []

    class Process:
        def __init__(self, command: list[str], **_options: Any) -> None:
            started.append(command)

    monkeypatch.setattr(subprocess, "Popen", Process)
    second_process.offer("pass", ["argument"])
    assert started == []
    second_process.start()
    second_process.start()
    assert [command[1:] for command in started] == [["-c", "pass", "argument"]]
    monkeypatch.setattr(second_process, "kept_kernels", lambda: 0)
    second_process.offer("pass")
    assert len(started) == 2, "on an empty disk at once"
    old, new = tmp_path / "old", tmp_path / "new"
    old.write_text("")
    os.utime(old, (time.time() - 100,) * 2)
    new.write_text("")
    os.utime(new, (time.time() + 1,) * 2)
    assert not second_process.has_made(old)
    assert second_process.has_made(new)


def test_it_does_not_start_without_memory(offered: list[str], monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(second_process, "free_memory", lambda: second_process.NEEDS - 1)
    second_process.offer("pass")
    second_process.start()
    assert second_process._started == []


pytestmark = pytest.mark.usefixtures("own_cache")  # what an earlier run compiled counts for nothing
SCALE = 3


def collatz(n: int, most: int = 50) -> tuple[int, int]:
    steps, largest = 0, n
    while n > 1 and steps < most:
        n = n // 2 if n % 2 == 0 else 3 * n + 1
        largest = max(largest, n)
        steps += 1
    return steps, largest


collatz_inlined: Any = inlined(collatz)


@inlined
def twice(n: int, more: int) -> int:
    """Inlines another function two times, by position and by name, and changes its own argument."""
    steps, _ = collatz_inlined(n)
    n += more
    _, largest = collatz_inlined(n, most=5)
    return steps * SCALE + largest


def summed(numbers: Any, out: Any) -> None:
    for i in range(len(numbers)):
        first = twice(numbers[i], 1)
        steps, largest = collatz_inlined(numbers[i])
        second = twice(steps, SCALE) if largest > 20 else 0
        out[i] = first - second


def expected(numbers: Any) -> list[int]:
    def twice_(n: int, more: int) -> int:
        return collatz(n)[0] * SCALE + collatz(n + more, 5)[1]

    found = []
    for n in numbers.tolist():
        steps, largest = collatz(n)
        found.append(twice_(n, 1) - (twice_(steps, SCALE) if largest > 20 else 0))
    return found


@outlined
def rare(n: int) -> int:
    return n * n + 1


@inlined
def usual(n: int) -> int:
    return rare(n) if n > SCALE else n


def usual_of(numbers: Any, out: Any) -> None:
    for i in range(len(numbers)):
        out[i] = usual(numbers[i])


def test_an_outlined_function_stays_a_call_within_an_inlined_one() -> None:
    numbers, out, of = np.arange(6), np.zeros(6, np.int64), kernel(usual_of)
    of(numbers, out)
    assert out.tolist() == [0, 1, 2, 3, 17, 26]
    (code,) = of.inspect_llvm().values()
    calls = [line for line in code.splitlines() if " call " in line]
    assert any("rare" in line for line in calls)
    assert not any("usual" in line for line in calls if "usual_of" not in line)


def test_calls_of_one_inlined_function_have_their_own_variables() -> None:
    numbers, out = np.arange(1, 60), np.zeros(59, np.int64)
    kernel(summed)(numbers, out)
    assert out.tolist() == expected(numbers)
    again = np.zeros_like(out)
    kernel(summed)(numbers.astype(np.int32), again)  # compiled once more, from the same analysis
    assert again.tolist() == expected(numbers)


@pytest.mark.skipif(not start.is_tried(), reason="another numba compiles each function by itself")
def test_a_part_is_translated_once_for_its_types(monkeypatch: Any) -> None:
    """By five calls in two kernels, with a default of its own."""
    translated: list[str] = []
    translate = untyped_passes.TranslateByteCode.run_pass

    def run_pass(self: Any, state: Any) -> Any:
        translated.append(state.func_id.func_name)
        return translate(self, state)

    def part(n: int, more: int = 1) -> int:
        return n + more

    called: Any = inlined(part)

    def add(n: int) -> int:
        return int(called(n) + called(n + 1) + called(n + 2, 5))

    def multiply(n: int) -> int:
        return int(called(n) * called(n))

    monkeypatch.setattr(untyped_passes.TranslateByteCode, "run_pass", run_pass)
    assert (kernel(add)(1), kernel(multiply)(2)) == (2 + 3 + 8, 9)
    assert (translated.count("part"), translated.count("add")) == (2, 1)


def test_other_versions_of_numba_compile_parts_as_kernels(monkeypatch: Any) -> None:
    monkeypatch.setattr(start, "TRIED", "0.1")
    own: Any = inlined(collatz)

    def one_more(n: int) -> int:
        return int(own(n)[0] + 1)

    assert isinstance(own, Dispatcher)
    assert kernel(one_more)(6) == collatz(6)[0] + 1


@kernel
def _signed(positive: bool, x: float) -> float:
    return x if positive else -x


def test_a_kernel_is_compiled_once_for_true_and_false() -> None:
    """Written in another kernel or computed there."""

    def both(flag: bool) -> float:
        return 4.0 * _signed(True, 1.0) + 2.0 * _signed(False, 1.0) + _signed(flag, 1.0)  # type: ignore[no-any-return]

    called = kernel(both)
    assert (called(True), called(False)) == (3.0, 1.0)
    found: Any = _signed
    assert len(found.signatures) == 1
