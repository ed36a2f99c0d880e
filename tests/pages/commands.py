"""Reference page of the command line: `make docs` writes it."""

import sys
from pathlib import Path
from typing import Any, cast

import typer
from typer.core import TyperGroup

from framearray_cli.cli.main import PAGES, app

LONGEST_METAVAR = 30
INTRODUCTION = """\
# The command line

<!-- Made by `make docs` from framearray_cli/cli/commands/; edit there. -->

`framearray --help` (`-h`) lists the commands, `framearray COMMAND --help` the options below. `framearray --version`
(`-V`) prints the version. [Conventions](conventions.md) has PLACES, standard output, `--set`, `--force`, environment
variables and exit codes.
"""
# Pages about a command.
MORE = {
    "init": "[A first array](../start/first-array.md)",
    "check": "[Warnings](../guide/troubleshooting.md#warnings)",
    "render": "[Rendering](../guide/output.md#rendering-into-a-folder), [parts and farms](../guide/farms.md)",
    "verify": "[Checking files](../guide/output.md#checking-files)",
    "view": "[The page](../guide/page.md)",
    "assemble": "[Movies](../guide/movies.md), [sums of light positions](../guide/lights.md#sums-of-light-positions)",
    "still": "[Stills](../guide/movies.md#stills), [texts](../guide/movies.md#texts)",
    "sheet": "[Contact sheets](../guide/output.md#contact-sheets)",
    "export": "[Export](../guide/export.md)",
    "report": "[Noise and time](../guide/noise.md#measuring-settings)",
    "compile": "[The first run](../start/install.md#the-first-run)",
    "schema": "[Job file](job-file.md), [manifest](manifest.md)",
}


def command_page() -> str:
    """Return the page: a section per command, with its text, example, arguments and options."""
    commands, lines = cast(TyperGroup, typer.main.get_command(app)).commands, [INTRODUCTION]
    for run, _, example in PAGES:
        name = run.__name__
        command = commands[name]
        text = " ".join((command.help or "").split())
        lines += [f"## framearray {name}\n", f"{text}\n", f"    {example}\n"]
        rows = [f"| `{_name(one).replace('|', '/')}` | {_cell(_text(one))} |" for one in command.params]
        lines += ["| Argument or option | Meaning |", "|---|---|", *rows, ""]
        lines += [f"More: {MORE[name]}.\n"] if name in MORE else []
    return "\n".join(lines).rstrip() + "\n"


def _name(param: Any) -> str:
    """Return all names of an option and its value: "-o, --output FOLDER"."""
    if param.param_type_name == "argument":
        return str(param.metavar or param.name.upper())
    names = ", ".join([*sorted(param.opts, key=len), *param.secondary_opts])
    metavar = str(param.metavar or "")
    metavar = metavar if len(metavar) <= LONGEST_METAVAR else "NAME"  # of many words, which the help lists
    return f"{names} {metavar}" if metavar and not param.is_flag else names


def _text(param: Any) -> str:
    """Return the help of a parameter, whether it is required, and its default."""
    default = param.default
    if param.param_type_name == "argument":
        return str(param.help)
    if param.required:
        return f"{param.help}  [required]"
    if param.show_default and isinstance(default, (int, float, str)) and not param.is_flag:
        return f"{param.help}  [default: {f'{default:g}' if isinstance(default, float) else default}]"
    return str(param.help)


def _cell(text: str) -> str:
    places = "[places](conventions.md#places-and-ranges)"
    return text.replace("reference/conventions.md", places).replace("  [required]", " Required.")


if __name__ == "__main__":
    (Path(sys.argv[1]) / "command-line.md").write_text(command_page(), encoding="utf-8")
