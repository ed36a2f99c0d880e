"""The signals that end the program, as an exception."""

import signal


class Stopped(BaseException):
    """A signal asked the program to end, as Ctrl-C does."""

    def __init__(self, signum: int) -> None:
        super().__init__(signum)
        # what shells expect of a program that a signal ended
        self.exit_code = 128 + signum
        self.word = "interrupted" if signum == signal.SIGINT else "terminated"


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
