"""Errors of the program in the words of Python: "--cameras: expected ..." is about the argument `cameras` here."""

import re
from collections.abc import Iterator
from contextlib import contextmanager

from framearray_cli.base.errors import FrameArrayError, JobError

# Arguments of this package that an option of the command line is called by; "{}=..." where the option takes a value.
_SAME = ("at", "cameras", "columns", "exposure", "light", "output", "rows", "side", "threads", "width")
_ARGUMENTS = {name: name for name in _SAME} | {"restart": "restart=True", "set": "sets"}
_OPTION = re.compile(r"(^|[ (])(with )?--([a-z]+)(?![\w/-])")


def in_python(text: str) -> str:
    """Name arguments instead of options: "with --output" is "with output=..."."""

    def argument(found: re.Match[str]) -> str:
        before, preposition, option = found[1], found[2] or "", found[3]
        name = _ARGUMENTS.get(option)
        if name is None:
            return found[0]
        return f"{before}{preposition}{name}{'=...' if preposition and '=' not in name else ''}"

    return _OPTION.sub(argument, text)


@contextmanager
def arguments_named() -> Iterator[None]:
    """Name arguments instead of options in the errors of a block."""
    try:
        yield
    except FrameArrayError as error:
        rename_options(error)
        raise


def rename_options(error: BaseException) -> None:
    """Name arguments instead of options in an error of the program; leave others as they are."""
    if isinstance(error, JobError):
        error.file = in_python(error.file) if isinstance(error.file, str) else error.file
        error.problems = tuple(in_python(problem) for problem in error.problems)
        error.args = ("\n".join(f"{error.file}: {problem}" for problem in error.problems),)
    elif isinstance(error, FrameArrayError):
        error.args = tuple(in_python(one) if isinstance(one, str) else one for one in error.args)
