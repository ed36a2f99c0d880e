"""Signals that ask the program to end, as Ctrl-C does: one exception, whatever the program is doing."""

import os
import signal
import threading
from contextlib import suppress
from types import FrameType

from framearray_cli.base.errors import OutputError
from framearray_cli.base.signals import Stopped
from framearray_cli.engine.kernels.clock import is_compiling

from .screen import err, out, say

PATIENCE = 1.0  # seconds that threads get to end by themselves after a signal
# Callbacks from C and optional imports, in which every exception is caught.
FORGETFUL = ("numba", "llvmlite", "importlib", "_frozen_importlib", "_frozen_importlib_external")


def listen() -> None:
    """Turn signals into `Stopped` from now on; a terminal may close without consequence where `nohup` says so."""
    for name in ("SIGINT", "SIGTERM", "SIGHUP"):
        number = getattr(signal, name, None)  # Windows lacks the last
        if number is not None and (name != "SIGHUP" or signal.getsignal(number) != signal.SIG_IGN):
            signal.signal(number, stop)


def stop(signum: int, frame: FrameType | None) -> None:
    """Turn a signal into an exception, so that everything is tidied up; a second signal ends the process at once."""
    signal.signal(signum, signal.SIG_DFL)
    if is_compiling():  # that cannot be stopped, and would be waited for
        timer = threading.Timer(PATIENCE, _leave, [Stopped(signum)])
        timer.daemon = True
        timer.start()
    if hasattr(signal, "setitimer"):
        signal.signal(signal.SIGALRM, lambda _, frame: _interrupt(signum, frame))
    _interrupt(signum, frame)


def _interrupt(signum: int, frame: FrameType | None) -> None:
    """Raise `Stopped`, unless that would be forgotten now; then in a moment, and again should it be forgotten."""
    busy = False
    while frame is not None and not busy:
        busy = frame.f_globals.get("__name__", "").partition(".")[0] in FORGETFUL
        frame = frame.f_back
    if hasattr(signal, "setitimer"):
        signal.setitimer(signal.ITIMER_REAL, 0.02 if busy else 2 * PATIENCE)
        if busy:
            return
    raise Stopped(signum)


def _leave(stopped: Stopped) -> None:
    """End the process whatever its threads are doing."""
    with suppress(OutputError, OSError):  # a terminal that was closed
        out.show_cursor()
        say(err, [stopped.word])
    os._exit(stopped.exit_code)
