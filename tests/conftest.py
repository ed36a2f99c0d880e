"""Configuration of all tests."""

import gc
import os
import signal
from pathlib import Path
from typing import Any

import numpy as np
import psutil
import pytest
from hypothesis import settings

_MOST_WORKERS = 4
_WORKER_BYTES = 2 << 30
# Folders of tests that compile kernels, and the one whose programs need them compiled. Each of two processes begins
# with one half of the tests: while the first compiles, the second runs tests of the rooms that have no kernels.
_COMPILING, _COMPILED = ("engine", "stat", "hard", "render", "starter", "report", "bench"), ("cli",)
_TESTS = Path(__file__).parent
# States of the random generators of modules, as they are before the module's first test.
_states = dict[int, Any]()

# Every run tries the same examples, however busy the machine; `--hypothesis-profile search` tries others.
settings.register_profile("same", deadline=None, derandomize=True)
settings.register_profile("search", deadline=None)
settings.load_profile("same")


def pytest_configure() -> None:
    """Set up each process that runs tests."""
    gc.set_threshold(200_000, 50, 50)  # as the program does: searches of all tests for garbage took a sixth of the time
    os.environ.setdefault("FRAMEARRAY_COMPILERS", "1")  # the processes of tests take all cores
    if signal.getsignal(signal.SIGINT) == signal.SIG_IGN:
        # a shell in the background has it ignored, and programs that tests start would inherit that
        signal.signal(signal.SIGINT, signal.default_int_handler)
    if os.environ.get("FRAMEARRAY_EMBREE"):  # `make test-avx2`
        from support import instructionset

        instructionset.force_embreex()


@pytest.hookimpl(optionalhook=True)
def pytest_xdist_auto_num_workers() -> int:
    """Return the number of processes of `-n auto`: each needs a core and memory."""
    cores = len(os.sched_getaffinity(0)) if hasattr(os, "sched_getaffinity") else os.cpu_count() or 1
    return max(1, min(cores, _MOST_WORKERS, psutil.virtual_memory().available // _WORKER_BYTES))


def pytest_collection_modifyitems(items: list[pytest.Item]) -> None:
    """Put tests in an order in which no process waits long for another one's kernels."""

    def turn(item: pytest.Item) -> int:
        folder = item.path.relative_to(_TESTS).parts[0]
        return 0 if folder in _COMPILING else 2 if folder in _COMPILED else 1

    items.sort(key=turn)


@pytest.fixture(autouse=True)
def _same_random_numbers(request: pytest.FixtureRequest) -> None:
    """Give a test the same numbers of its module's generators whichever tests its process ran before."""
    for value in vars(request.module).values():
        if isinstance(value, np.random.Generator):
            value.bit_generator.state = _states.setdefault(id(value), value.bit_generator.state)


def pytest_addoption(parser: pytest.Parser) -> None:
    """Let `make golden` write the wording of all commands anew."""
    parser.addoption("--golden", action="store_true", help="write tests/cli/golden/ anew")
