"""Where the command `framearray` starts; `python -m framearray_cli` is the same."""

import signal


def main() -> None:
    """Load the command line and run it; Ctrl-C while it loads ends the process without a traceback."""
    signal.signal(signal.SIGINT, signal.SIG_DFL)
    from .cli import main as run

    run()


if __name__ == "__main__":
    main()
