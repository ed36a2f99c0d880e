"""Help screens and errors of the command line in words of our own, whichever version of typer reads the command line.

Only attributes and methods of typer's commands and parameters that all its versions have are used here.
"""

import re
import sys
from collections.abc import Iterator, Sequence
from contextlib import contextmanager
from dataclasses import dataclass
from difflib import get_close_matches
from pathlib import Path
from typing import Any, cast

import typer
from typer.core import TyperCommand, TyperGroup

from .completions import WORDS

# typer brings its own copy of click since 0.26: UsageError is a base of the one class that all versions export.
UsageError = cast("type[Exception]", typer.BadParameter.__mro__[1])

WIDE = 100  # columns of a help screen, at most
WIDEST_NAME = 24  # columns; the text of a longer one begins on the next line
LONGEST_METAVAR = 30  # columns of the value of an option; narrow screens have 50
SOURCE = Path(__file__).resolve().parents[2]  # the folder of the package: a checkout, or site-packages
DOCUMENTATION = "share/doc/framearray"  # where a wheel puts the pages, below the prefix of the Python


@dataclass(frozen=True, slots=True)
class CommandPage:
    """Help of a command: a summary that fits in one line of the list of commands, and an example."""

    summary: str
    example: str


# In the order of use.
PAGES = {
    "init": CommandPage("Write a first job for a scene.", "framearray init room.glb"),
    "check": CommandPage("Check a job; estimate its memory, disk and time.", "framearray check room.toml"),
    "render": CommandPage("Render a job into a frame array.", "framearray render room.toml --output out/room"),
    "verify": CommandPage("Find damaged and missing files of an array.", "framearray verify out/room --repair"),
    "view": CommandPage("Walk through an array in the browser.", "framearray view out/room"),
    "assemble": CommandPage("Cut a movie out of an array.", "framearray assemble out/room walk -o walk.mp4"),
    "sheet": CommandPage("Draw a contact sheet of an array.", "framearray sheet out/room -o sheet.jpg"),
    "export": CommandPage("Export an array for other tools.", "framearray export out/room -f nerfstudio -o room-nerf"),
    "report": CommandPage("Measure speed and error of settings.", "framearray report room.toml --error 0.05"),
    "openjd": CommandPage("Write a template for a render farm.", "framearray openjd room.toml"),
    "schema": CommandPage("Print the JSON Schema of files.", "framearray schema > job.schema.json"),
    "compile": CommandPage("Compile all kernels now, for later commands.", "framearray compile"),
    "doctor": CommandPage("Report versions, processor, memory and extras.", "framearray doctor"),
}
FIRST_STEPS = ("framearray init room.glb", "framearray render room.toml", "framearray view out/room")


class Command(TyperCommand):
    """A command whose help and usage are the same with every version of typer."""

    def parse_args(self, ctx: Any, args: list[str]) -> list[str]:
        ctx.meta[WORDS] = list(args)  # the parser forgets them where the last option lacks its value
        with _context(ctx):
            return super().parse_args(ctx, args)

    def collect_usage_pieces(self, ctx: Any) -> list[str]:
        return ["[OPTIONS]", *(_argument_usage(one) for one in self.get_params(ctx) if _is_argument(one))]

    def format_help(self, ctx: Any, formatter: Any) -> None:
        page = PAGES.get(self.name or "")
        _write_screen(self, ctx, formatter, [page.example] if page else [])


class Group(TyperGroup):
    """The program: its commands in order of use."""

    def parse_args(self, ctx: Any, args: list[str]) -> list[str]:
        with _context(ctx):
            return super().parse_args(ctx, args)

    def collect_usage_pieces(self, ctx: Any) -> list[str]:
        return ["[OPTIONS]", "COMMAND [ARGUMENTS]"]

    def list_commands(self, ctx: Any) -> list[str]:
        order = list(PAGES)
        return sorted(self.commands, key=lambda name: order.index(name) if name in order else len(order))

    def resolve_command(self, ctx: Any, args: list[str]) -> Any:
        if args[0] not in self.commands and not args[0].startswith("-"):
            near = get_close_matches(args[0], self.commands, n=1)
            advice = f"did you mean {near[0]}?" if near else f"known are {', '.join(self.list_commands(ctx))}"
            raise typer.BadParameter(f"no such command {args[0]}; {advice}", ctx=ctx)
        return super().resolve_command(ctx, args)

    def format_help(self, ctx: Any, formatter: Any) -> None:
        _write_screen(self, ctx, formatter, FIRST_STEPS, self.list_commands(ctx))


@contextmanager
def _context(ctx: Any) -> Iterator[None]:
    """Add to an error of the command line which command it is about."""
    try:
        yield
    except UsageError as error:
        known: Any = error  # `UsageError` has no type of its own here
        if known.ctx is None:
            known.ctx = ctx
        raise


def documentation() -> str | None:
    """Return where the pages of the documentation lie: in the checkout, or where the wheel was installed."""
    for folder in (SOURCE / "docs", Path(sys.prefix) / DOCUMENTATION):
        if (folder / "reference" / "command-line.md").is_file():
            return str(folder / "index.md")
    return None


def usage_lines(error: Any) -> list[str]:
    """Word an error of the command line: usage, where to find help, and what is wrong."""
    lines = [f"Error: {usage_problem(error)}"]
    if error.ctx is not None:
        lines[:0] = [error.ctx.get_usage(), f"`{error.ctx.command_path} --help` shows more.", ""]
    return lines


def usage_problem(error: Any) -> str:
    """Word what is wrong with a command line: "--threads: expected ..., got 0"."""
    kind, param = type(error).__name__, getattr(error, "param", None)
    hint = getattr(error, "param_hint", None) or (_parameter_name(param) if param is not None else "")
    hint = hint if isinstance(hint, str) else " / ".join(hint)
    if param is not None and error.ctx and "ENVIRONMENT" in str(error.ctx.get_parameter_source(param.name)):
        hint = f"environment variable {param.envvar}"
    if kind == "MissingParameter":
        names = str(getattr(param, "metavar", None) or "").split("|")
        one_of = f"; expected {', '.join(names[:-1])} or {names[-1]}" if len(names) > 1 else ""
        return f"missing {'argument' if param is not None and _is_argument(param) else 'option'} {hint}{one_of}"
    if kind == "NoSuchOption":
        known = [name for one in error.ctx.command.get_params(error.ctx) for name in one.opts] if error.ctx else []
        near = get_close_matches(error.option_name, known, n=1)
        return f"no such option {error.option_name}" + (f"; did you mean {near[0]}?" if near else "")
    text = str(error.message)
    if kind == "BadOptionUsage":
        return f"{error.option_name}: expected {'a value, got none' if 'requires' in text else 'no value'}"
    if extra := re.search(r"unexpected extra arguments? ?(?:\(s\) )?\((.*)\)$", text):
        return f"one argument too many, or more: {extra[1]}"
    return f"{hint}: {text}" if hint else text


def _write_screen(command: Any, ctx: Any, formatter: Any, examples: Sequence[str], names: Sequence[str] = ()) -> None:
    """Write a help screen: usage, text, arguments, options, commands, examples, documentation."""
    formatter.write_usage(ctx.command_path, " ".join(command.collect_usage_pieces(ctx)))
    formatter.write_paragraph()
    with formatter.indentation():
        formatter.write_text(command.help or "")
    arguments, options = parameter_rows(command, ctx)
    commands = [(name, PAGES[name].summary if name in PAGES else "") for name in names]
    for title, rows in (("Arguments", arguments), ("Options", options), ("Commands", commands)):
        if rows:
            with formatter.section(title):
                formatter.write_dl(rows, WIDEST_NAME)
    if examples:
        with formatter.section(f"Example{'s' if len(examples) > 1 else ''}"):
            for example in examples:
                formatter.write(f"  {example}\n")
    if (place := documentation()) is not None:
        formatter.write(f"\nDocumentation: {place}\n")


def parameter_rows(command: Any, ctx: Any) -> tuple[list[tuple[str, str]], list[tuple[str, str]]]:
    """Return name and text of each argument and of each option of a command."""
    shown = [one for one in command.get_params(ctx) if not getattr(one, "hidden", False)]
    arguments = [(_parameter_name(one), one.help or "") for one in shown if _is_argument(one)]
    return arguments, [(_option_name(one), _option_text(one)) for one in shown if not _is_argument(one)]


def _is_argument(param: Any) -> bool:
    return bool(param.param_type_name == "argument")


def _parameter_name(param: Any) -> str:
    """Return what a user types: "JOB", "--output / -o"."""
    return str(param.metavar or param.name.upper()) if _is_argument(param) else " / ".join(param.opts)


def _argument_usage(param: Any) -> str:
    name = _parameter_name(param)
    return name if param.required else f"[{name}]"


def _option_name(param: Any) -> str:
    """Return all names of an option and its value: "-o, --output FOLDER"."""
    names = ", ".join(sorted(param.opts, key=len))
    if param.secondary_opts:
        names += f", {', '.join(param.secondary_opts)}"
    metavar = str(param.metavar or "")
    metavar = (
        metavar if len(metavar) <= LONGEST_METAVAR else "NAME"
    )  # of many words, which the help of the option lists
    return f"{names} {metavar}" if metavar and not param.is_flag else names


def _option_text(param: Any) -> str:
    """Return the help of an option, whether it is required, and its default."""
    default = param.default
    if param.required:
        return f"{param.help}  [required]"
    if getattr(param, "show_default", False) and isinstance(default, (int, float, str)) and not param.is_flag:
        return f"{param.help}  [default: {f'{default:g}' if isinstance(default, float) else default}]"
    return param.help or ""
