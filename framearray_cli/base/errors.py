"""All errors the user can meet, each with the exit code of the command that meets it.

A message says: file, place in it, what was expected, what was found, what to do if that is not plain.
Only `cli.py` turns an error into an exit.
"""

from collections.abc import Sequence
from pathlib import Path


class FrameArrayError(Exception):
    """Base of every error that is the input's or the machine's fault, not ours."""

    exit_code = 1


class JobError(FrameArrayError):
    """A job file, a movie path file or a command line that cannot be used."""

    exit_code = 2

    def __init__(self, file: Path | str, problems: Sequence[str]) -> None:
        """Hold every problem of one file; each reads `key.path: expected ..., got ...`."""
        self.file = file
        self.problems = tuple(problems)
        super().__init__("\n".join(f"{file}: {problem}" for problem in self.problems))


class SceneError(FrameArrayError):
    """A scene file that is missing, broken, or holds nothing that can be rendered."""

    exit_code = 3


class OutputError(FrameArrayError):
    """An output folder, image, manifest or movie that cannot be written or read."""

    exit_code = 4


class CheckError(FrameArrayError):
    """A check that was asked for and failed."""

    exit_code = 5


class LimitError(FrameArrayError):
    """The system lets this process have less than it needs: memory, address space, threads."""

    exit_code = 2


class MissingExtraError(FrameArrayError):
    """An optional package is needed and not installed; the message names the extra."""

    exit_code = 2


class BusyError(OutputError):
    """Another run works on the same cameras of a folder."""


class WorkerError(FrameArrayError):
    """Workers that cannot render, or that were lost with what they had not finished."""

    exit_code = 4
