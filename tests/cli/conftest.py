"""Signal handlers, which are restored after each test, also under `nohup`; and a rendered array."""

import signal
from collections.abc import Iterator
from pathlib import Path

import pytest
from support.handed import JOB
from support.program import complete, write_job

SIGNALS = [getattr(signal, name) for name in ("SIGINT", "SIGTERM", "SIGHUP", "SIGALRM") if hasattr(signal, name)]


@pytest.fixture(autouse=True)
def _signals() -> Iterator[None]:
    if hasattr(signal, "SIGHUP"):  # every program that a test starts would inherit an ignored signal
        signal.signal(signal.SIGHUP, signal.SIG_DFL)
    before = [(number, signal.getsignal(number)) for number in SIGNALS]
    yield
    for number, handler in before:
        signal.signal(number, handler)


@pytest.fixture(scope="session")
def place(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """Return a folder with a job and its array, rendered in one run."""
    folder = tmp_path_factory.mktemp("place")
    job = write_job(folder, **JOB)
    complete("render", "-q", job, "-o", folder / "whole")
    return folder
