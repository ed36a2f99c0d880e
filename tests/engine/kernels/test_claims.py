"""Claims on kernels: of processes that need the same one, one compiles it."""

import os
import signal
import subprocess
import sys
import threading
import time
from collections.abc import Iterator
from pathlib import Path

import pytest

from framearray_cli.engine.kernels.claims import Claim
from framearray_cli.engine.kernels.clock import compile_clock

# Compiles a kernel of its own with the kernels of the program; prints whether it was loaded from disk.
PROGRAM = """
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
        [sys.executable, "-c", PROGRAM, str(folder)], stdout=subprocess.PIPE, text=True, env=environment
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
from test_claims import made_up
from framearray_cli.engine.kernels.claims import Claim
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
    monkeypatch.setattr("framearray_cli.engine.kernels.claims.PATIENCE", 0.2)
    claim = Claim(made_up)
    assert claim.take(tmp_path)
    claim.give_back()


def test_a_folder_that_cannot_be_locked_gives_claims_at_once(tmp_path: Path) -> None:
    (tmp_path / "file").write_text("")
    claim = Claim(made_up)
    assert not claim.take(tmp_path / "file" / "kernels")
    claim.give_back()
