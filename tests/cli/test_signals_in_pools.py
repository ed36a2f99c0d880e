"""Ctrl-C and thread pools: when the exception leaves a pool, no thread of it computes any more."""

import os
import signal
import sys
import threading
import time
from collections.abc import Callable, Iterator
from queue import SimpleQueue
from typing import Any

import pytest

from framearray_cli.base import threads
from framearray_cli.base.platform import Stopped
from framearray_cli.base.threads import TaskPool, sleep_until_stopped, take
from framearray_cli.cli import signals as interrupts

pytestmark = pytest.mark.skipif(os.name == "nt", reason="signals of other kinds there")

TASK = 0.3  # seconds that a thread computes


@pytest.fixture(autouse=True)
def listening() -> Iterator[None]:
    previous = signal.signal(signal.SIGTERM, interrupts.stop)
    yield
    signal.setitimer(signal.ITIMER_REAL, 0)
    signal.signal(signal.SIGTERM, previous)


def compute(ended: list[int]) -> None:
    """A task as long as a kernel, which no exception ends."""
    time.sleep(TASK)
    ended.append(1)


def test_a_thread_that_a_signal_meets_as_it_starts_is_waited_for(monkeypatch: pytest.MonkeyPatch) -> None:
    """Its pool would forget it, free the scene that it traces in, and the process would crash as it ends."""
    start, ended = threading.Thread.start, list[int]()

    def meet(thread: threading.Thread) -> None:
        start(thread)
        if thread.name.startswith("met"):
            os.kill(os.getpid(), signal.SIGTERM)

    monkeypatch.setattr(threading.Thread, "start", meet)
    with pytest.raises(Stopped), TaskPool(1, thread_name_prefix="met") as pool:
        pool.submit(compute, ended)
        time.sleep(5)
    assert ended == [1]


def test_a_pool_that_a_signal_meets_as_it_ends_is_waited_for() -> None:
    ended = list[int]()
    timer = threading.Timer(TASK / 3, os.kill, [os.getpid(), signal.SIGTERM])
    with pytest.raises(Stopped):
        with TaskPool(1) as pool:
            pool.submit(compute, ended)
            timer.start()
        time.sleep(5)
    assert ended == [1]


def test_tasks_that_have_not_begun_are_dropped() -> None:
    ended, started = list[int](), time.monotonic()
    timer = threading.Timer(TASK / 3, os.kill, [os.getpid(), signal.SIGTERM])
    with pytest.raises(Stopped), TaskPool(1) as pool:
        timer.start()
        for _ in range(100):
            pool.submit(compute, ended)
        time.sleep(5)
    assert len(ended) <= 2
    assert time.monotonic() - started < 5


def test_a_pool_whose_thread_does_not_end_is_left(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(threads, "LONGEST_TASK", TASK / 3)
    forever = threading.Event()
    threading.Timer(TASK, os.kill, [os.getpid(), signal.SIGTERM]).start()  # after which the pool waits for long enough
    try:
        with pytest.raises(Stopped), TaskPool(1) as pool:
            pool.submit(forever.wait)
    finally:
        forever.set()


def test_a_thread_that_compiles_after_the_signal_is_not_waited_for(monkeypatch: pytest.MonkeyPatch) -> None:
    ended, stopped, begun = list[int](), list[Any](), list[int]()
    monkeypatch.setattr(interrupts, "PATIENCE", TASK / 3)
    monkeypatch.setattr(interrupts, "_exit_now", stopped.append)
    monkeypatch.setattr(interrupts, "is_compiling", lambda: bool(begun))
    with pytest.raises(Stopped):
        with TaskPool(1) as pool:
            pool.submit(compute, ended)
            threading.Timer(TASK / 6, os.kill, [os.getpid(), signal.SIGTERM]).start()
            threading.Timer(TASK / 3, begun.append, [1]).start()
        time.sleep(5)
    signal.setitimer(signal.ITIMER_REAL, 0)
    assert [type(end) for end in stopped] == [Stopped], "the process would have ended"


@pytest.mark.parametrize("times", [1, 2, 3])
def test_ctrl_c_waits_for_threads_however_often(times: int) -> None:
    """In a process without the handler of the program, where each is a `KeyboardInterrupt`."""
    ended, previous = list[int](), signal.signal(signal.SIGINT, signal.default_int_handler)
    for k in range(times):
        threading.Timer(TASK / 6 * (k + 1), os.kill, [os.getpid(), signal.SIGINT]).start()
    try:
        with pytest.raises(KeyboardInterrupt), TaskPool(1) as pool:
            pool.submit(compute, ended)
            time.sleep(5)
    finally:
        signal.signal(signal.SIGINT, previous)
    assert ended == [1]


@pytest.mark.parametrize("wait", [sleep_until_stopped, lambda: take(SimpleQueue())])
def test_a_signal_that_another_thread_gets_ends_a_wait(wait: Callable[[], None]) -> None:
    """The main thread is not woken then; once in some hundred renders it began to wait just after the signal."""
    threading.Timer(TASK, lambda: signal.pthread_kill(threading.get_ident(), signal.SIGTERM)).start()
    started = time.monotonic()
    with pytest.raises(Stopped):
        wait()
    assert time.monotonic() - started < 5


def test_a_signal_elsewhere_is_raised_at_once() -> None:
    with pytest.raises(Stopped):
        interrupts.stop(signal.SIGTERM, sys._getframe())
