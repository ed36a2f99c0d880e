"""Reference page of the command line: `make docs` writes it."""

import sys
from pathlib import Path
from typing import cast

import typer
from typer.core import TyperGroup

from framearray_cli.cli.help import PAGES, parameter_rows
from framearray_cli.cli.main import app

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
    "sheet": "[Contact sheets](../guide/output.md#contact-sheets)",
    "export": "[Export](../guide/export.md)",
    "report": "[Noise and time](../guide/noise.md#measuring-settings)",
    "openjd": "[Farms](../guide/farms.md#on-a-farm)",
    "compile": "[The first run](../start/install.md#the-first-run)",
    "schema": "[Job file](job-file.md), [manifest](manifest.md)",
}


def command_page() -> str:
    """Return the page: a section per command, with its text, example, arguments and options."""
    commands, lines = cast(TyperGroup, typer.main.get_command(app)).commands, [INTRODUCTION]
    for name, page in PAGES.items():
        command = commands[name]
        context = typer.Context(command, info_name=f"framearray {name}")
        text = " ".join((command.help or "").split())
        lines += [f"## framearray {name}\n", f"{text}\n", f"    {page.example}\n"]
        arguments, options = parameter_rows(command, context)
        rows = [
            f"| `{name.replace('|', '/')}` | {_cell(text)} |"
            for name, text in (*arguments, *options)
            if "--help" not in name
        ]
        lines += ["| Argument or option | Meaning |", "|---|---|", *rows, ""]
        lines += [f"More: {MORE[name]}.\n"] if name in MORE else []
    return "\n".join(lines).rstrip() + "\n"


def _cell(text: str) -> str:
    places = "[places](conventions.md#places-and-ranges)"
    return text.replace("reference/conventions.md", places).replace("  [required]", " Required.")


if __name__ == "__main__":
    (Path(sys.argv[1]) / "command-line.md").write_text(command_page(), encoding="utf-8")
