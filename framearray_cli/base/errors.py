"""All errors that a user can see, each with the exit code of a command that it ends.

A message names the file, the place in it, what was expected, what was found, and the remedy if that is not obvious.
Only `cli/main.py` turns an error into an exit.
"""

from collections.abc import Sequence
from pathlib import Path


class FrameArrayError(Exception):
    """Base of all errors that the input or the machine causes, not a bug."""

    exit_code = 1


class JobError(FrameArrayError):
    """A job file, a movie path file or a command line that cannot be used."""

    exit_code = 2

    def __init__(self, file: Path | str, problems: Sequence[str]) -> None:
        """Take every problem of one file; each reads `key.path: expected ..., got ...`."""
        self.file = file
        self.problems = tuple(problems)
        super().__init__("\n".join(f"{file}: {problem}" for problem in self.problems))


class SceneError(FrameArrayError):
    """A scene file that is missing, broken, or holds nothing that can be rendered."""

    exit_code = 3


class OutputError(FrameArrayError):
    """An output folder, image, manifest or movie that cannot be written or read."""

    exit_code = 4


class ReaderGoneError(FrameArrayError):
    """The output has no reader any more, as after `| head`; the exit code equals a process's that SIGPIPE ended."""

    exit_code = 141


class CheckError(FrameArrayError):
    """A check that the user asked for failed."""

    exit_code = 5


class MissingExtraError(FrameArrayError):
    """An optional library is needed and not installed; the message names the extra."""

    exit_code = 2


class BusyError(OutputError):
    """Another run is rendering the same cameras into the same folder."""


class WorkerError(FrameArrayError):
    """Workers cannot render, or were lost with unfinished work."""

    exit_code = 4
