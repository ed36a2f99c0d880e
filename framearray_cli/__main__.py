"""Where the command `framearray` starts; `python -m framearray_cli` is the same."""

import gc
import os
import signal
import sys
from contextlib import suppress


def main() -> None:
    """Load the command line and run it; Ctrl-C while it loads ends the process without a traceback.

    Loaded modules are some hundred thousand objects that all stay. Looking through them for garbage again and again
    while they load, and taking them apart one by one when all is done, would take half a second.
    """
    signal.signal(signal.SIGINT, signal.SIG_DFL)
    gc.set_threshold(100_000, 50, 50)
    from framearray_cli.cli.main import main as run

    try:
        run()
    except SystemExit as end:
        if end.code is None or isinstance(end.code, int):
            _leave(end.code or 0)
        raise
    _leave(0)


def _leave(exit_code: int) -> None:
    """End the process at once; the files that it wrote are closed."""
    for stream in (sys.stdout, sys.stderr):
        with suppress(OSError, ValueError):
            stream.flush()
    os._exit(exit_code)


if __name__ == "__main__":
    main()
