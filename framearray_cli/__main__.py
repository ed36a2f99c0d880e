"""Entry point of the command `framearray`, and of `python -m framearray_cli`."""

import gc
import os
import signal
import sys
from contextlib import suppress


def main() -> None:
    """Load the command line and run it; Ctrl-C while it loads ends the process without a traceback.

    Loaded modules hold some hundred thousand objects, all of them until the end. It would take half a second to search
    them for garbage while they load and to free them one by one at the end.
    """
    signal.signal(signal.SIGINT, signal.SIG_DFL)
    gc.set_threshold(200_000, 50, 50)
    from framearray_cli.cli.main import main as run

    try:
        run()
    except SystemExit as end:
        if end.code is None or isinstance(end.code, int):
            _leave(end.code or 0)
        raise
    _leave(0)


def _leave(exit_code: int) -> None:
    """End the process at once; all its files are closed by now."""
    for stream in (sys.stdout, sys.stderr):
        with suppress(OSError, ValueError):
            stream.flush()
    os._exit(exit_code)


if __name__ == "__main__":
    main()
