"""Shared by all tests; its place lets them import the helpers beside it."""

import os
import signal

import psutil
import pytest

_MOST_WORKERS = 4
_WORKER_BYTES = 2 << 30


def pytest_configure() -> None:
    """Set up each process that runs tests."""
    if signal.getsignal(signal.SIGINT) == signal.SIG_IGN:
        # as a shell starts what runs in the background; programs that tests start would ignore it, too
        signal.signal(signal.SIGINT, signal.default_int_handler)
    if os.environ.get("FRAMEARRAY_EMBREE"):  # `make test-avx2`
        from support import instructionset

        instructionset.force_embreex()
    if os.environ.get("PYTEST_XDIST_WORKER"):
        from support import inturn

        inturn.compile_in_turn()


@pytest.hookimpl(optionalhook=True)
def pytest_xdist_auto_num_workers() -> int:
    """How many processes `-n auto` takes: a core and memory for each."""
    cores = len(os.sched_getaffinity(0)) if hasattr(os, "sched_getaffinity") else os.cpu_count() or 1
    return max(1, min(cores, _MOST_WORKERS, psutil.virtual_memory().available // _WORKER_BYTES))
