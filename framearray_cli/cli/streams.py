"""`-` in place of a file to write: standard output; `-.exr` says the format too."""

import re
import shutil
import sys
import tempfile
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path

import typer

from framearray_cli.base.errors import FrameArrayError, OutputError
from framearray_cli.base.files import reason, require_new

from .document import outcome


def is_stdout(name: str) -> bool:
    """Return whether an option `--output` names standard output."""
    return re.fullmatch(r"-(\.[A-Za-z0-9]+)?", name) is not None


def refuse_json(name: str) -> None:
    """Refuse `--json` where standard output is to hold a file."""
    if is_stdout(name) and outcome.wanted:
        raise typer.BadParameter("expected a file, as --json prints on standard output", param_hint="--output")


@contextmanager
def output_file(target: Path, suffix: str, *, force: bool) -> Iterator[Path]:
    """Yield the file to write: the target, or one whose bytes go to standard output when it is whole.

    Args:
        target: "-" and "-.exr" mean standard output.
        suffix: of what goes there, unless the target says so.
        force: replace a file that exists.

    Raises:
        OutputError: the file exists, or standard output is a terminal or cannot be written to.
    """
    if not is_stdout(str(target)):
        require_new(target, force=force)
        yield target
        return
    refuse_json(str(target))
    if sys.stdout.isatty():
        raise OutputError("standard output: expected a file or a pipe, got a terminal; give a name with --output")
    with tempfile.TemporaryDirectory() as folder:
        file = Path(folder, f"output{target.suffix if target.suffix else suffix}")
        try:
            yield file
        except FrameArrayError as error:  # the user knows no file but "-.exr"
            error.args = tuple(str(one).replace(str(file), str(target)) for one in error.args)
            raise
        try:
            with file.open("rb") as whole:
                shutil.copyfileobj(whole, sys.stdout.buffer)
            sys.stdout.buffer.flush()
        except BrokenPipeError:  # the reader has gone
            raise
        except OSError as error:
            raise OutputError(f"standard output: cannot be written: {reason(error)}") from error
