"""Signals that ask the program to end, as Ctrl-C does: one exception, whatever the program is doing."""

import os
import signal
import threading
from contextlib import suppress
from types import FrameType

from .compiling import is_compiling
from .errors import OutputError
from .screen import err, out, say

PATIENCE = 1.0  # seconds that threads get to end by themselves after a signal
# Callbacks from C and optional imports, in which every exception is caught.
FORGETFUL = ("numba", "llvmlite", "importlib", "_frozen_importlib", "_frozen_importlib_external")


class Stopped(BaseException):
    """A signal asked the program to end, as Ctrl-C does."""

    def __init__(self, signum: int) -> None:
        super().__init__(signum)
        # what shells expect of a program that a signal ended
        self.exit_code = 128 + signum
        self.word = "interrupted" if signum == signal.SIGINT else "terminated"


def listen() -> None:
    """Turn signals into `Stopped` from now on; a terminal may close without consequence where `nohup` says so."""
    for name in ("SIGINT", "SIGTERM", "SIGHUP"):
        number = getattr(signal, name, None)  # Windows lacks the last
        if number is not None and (name != "SIGHUP" or signal.getsignal(number) != signal.SIG_IGN):
            signal.signal(number, stop)


def stopped_by(error: BaseException | None) -> Stopped | None:
    """The signal that an exception goes back to, if any.

    Python's own locks may fail when a signal interrupts them at the wrong moment ("cannot release un-acquired lock");
    the error that they raise then comes while `Stopped` is handled.
    """
    while error is not None and not isinstance(error, Stopped):
        error = error.__context__
    return error


def forget() -> None:
    """Raise no `Stopped` again for a signal that was heard."""
    if hasattr(signal, "setitimer"):
        signal.setitimer(signal.ITIMER_REAL, 0)


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
