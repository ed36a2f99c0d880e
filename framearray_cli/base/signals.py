"""Signals that end the program, as an exception."""

import signal

from .platform import set_alarm


class Stopped(BaseException):
    """A signal asked the program to end, as Ctrl-C does."""

    def __init__(self, signum: int) -> None:
        super().__init__(signum)
        self.signum = signum
        # the exit code that shells expect after a signal
        self.exit_code = 128 + signum
        self.word = "interrupted" if signum == signal.SIGINT else "terminated"


def stopped_by(error: BaseException | None) -> Stopped | None:
    """The signal that caused an exception, if any.

    A signal at the wrong moment can make one of Python's own locks fail ("cannot release un-acquired lock"); its error
    then has `Stopped` as its context.
    """
    while error is not None and not isinstance(error, Stopped):
        error = error.__context__
    return error


def cancel_alarm() -> None:
    """Cancel the timer that would raise `Stopped` again for a signal that has been handled."""
    set_alarm(0.0)
