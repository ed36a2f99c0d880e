"""Signals that end the program, such as Ctrl-C: raise one exception, at any stage of the program."""

import os
import signal
import sys
import threading
import time
from contextlib import suppress
from types import FrameType

from framearray_cli.base.errors import OutputError
from framearray_cli.base.platform import Stopped, ending_signals, is_hangup, on_alarm, set_alarm
from framearray_cli.engine.kernels.clock import is_compiling

from .screen import err, say

PATIENCE = 1.0  # seconds that threads have to end after a signal
MOMENT = 0.02  # seconds until `Stopped` is raised where it can be
# Modules with callbacks from C and optional imports, which catch every exception, or make another one of it (pydantic).
FORGETFUL = ("numba", "llvmlite", "importlib", "_frozen_importlib", "_frozen_importlib_external", "pydantic")
# Where Python's own locks are just taken or released: an exception would leave them locked for ever, and threads that
# wait for them would end a pool only after the second try. None of these functions waits long.
TAKING_LOCKS = ("__enter__", "__exit__", "_release_save", "_acquire_restore")


def listen() -> None:
    """Turn signals into `Stopped` from now on; under `nohup` go on when the terminal closes."""
    watch_for_lost()
    for number in ending_signals():
        if not is_hangup(number) or signal.getsignal(number) != signal.SIG_IGN:
            signal.signal(number, stop)


def watch_for_lost() -> None:
    """Raise `Stopped` again in a moment where Python cannot raise it, in a destructor for instance."""
    hook = sys.unraisablehook
    if getattr(hook, "__module__", None) == __name__:  # already
        return

    def lost(what: "sys.UnraisableHookArgs") -> None:
        if isinstance(what.exc_value, Stopped) and set_alarm(MOMENT):
            on_alarm(_Ending(what.exc_value.signum).interrupt)
        else:
            hook(what)

    sys.unraisablehook = lost


def stop(signum: int, frame: FrameType | None) -> None:
    """Raise an exception on a signal, so that everything is cleaned up; a second signal ends the process at once."""
    signal.signal(signum, signal.SIG_DFL)
    ending = _Ending(signum)
    on_alarm(ending.interrupt)
    ending.interrupt(frame)


class _Ending:
    """End of the process after a signal."""

    def __init__(self, signum: int) -> None:
        self._signum = signum
        self._timer: threading.Timer | None = None
        self._due = time.monotonic()  # when to raise `Stopped`

    def interrupt(self, frame: FrameType | None) -> None:
        """Raise `Stopped`; where it would be caught and lost now, raise it in a moment, and again if it is lost.

        Between, look for threads that begin to compile.
        """
        if is_compiling() and self._timer is None:  # nothing stops a thread that compiles; the process would wait
            self._timer = threading.Timer(PATIENCE, _exit_now, [Stopped(self._signum)])
            self._timer.daemon = True
            self._timer.start()
        if time.monotonic() < self._due and set_alarm(PATIENCE / 4):
            return
        busy = _takes_lock(frame)
        while frame is not None and not busy:
            busy = frame.f_globals.get("__name__", "").partition(".")[0] in FORGETFUL
            frame = frame.f_back
        if set_alarm(MOMENT if busy else PATIENCE / 4) and busy:
            return
        self._due = time.monotonic() + 2 * PATIENCE
        raise Stopped(self._signum)


def _takes_lock(frame: FrameType | None) -> bool:
    """True if the innermost function takes or releases a lock of `threading`."""
    return frame is not None and frame.f_globals.get("__name__") == "threading" and frame.f_code.co_name in TAKING_LOCKS


def _exit_now(stopped: Stopped) -> None:
    """End the process without waiting for its threads."""
    with suppress(OutputError, OSError):  # a terminal that was closed
        err.show_cursor()
        say(err, [stopped.word])
    os._exit(stopped.exit_code)
