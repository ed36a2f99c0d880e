"""Signal handlers that the command line sets are put back after each test; tests mean the same under `nohup`."""

import signal
from collections.abc import Iterator

import pytest

SIGNALS = [getattr(signal, name) for name in ("SIGINT", "SIGTERM", "SIGHUP", "SIGALRM") if hasattr(signal, name)]


@pytest.fixture(autouse=True)
def _signals() -> Iterator[None]:
    if hasattr(signal, "SIGHUP"):  # what is ignored here would be ignored by every program that a test starts
        signal.signal(signal.SIGHUP, signal.SIG_DFL)
    before = [(number, signal.getsignal(number)) for number in SIGNALS]
    yield
    for number, handler in before:
        signal.signal(number, handler)
