"""Restore the signal handlers that the command line sets after each test, also under `nohup`."""

import signal
from collections.abc import Iterator

import pytest

SIGNALS = [getattr(signal, name) for name in ("SIGINT", "SIGTERM", "SIGHUP", "SIGALRM") if hasattr(signal, name)]


@pytest.fixture(autouse=True)
def _signals() -> Iterator[None]:
    if hasattr(signal, "SIGHUP"):  # every program that a test starts would inherit an ignored signal
        signal.signal(signal.SIGHUP, signal.SIG_DFL)
    before = [(number, signal.getsignal(number)) for number in SIGNALS]
    yield
    for number, handler in before:
        signal.signal(number, handler)
