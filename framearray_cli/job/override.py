"""`--set KEY=VALUE`: keys of a job that a command line replaces before the job is checked."""

import os
import re
from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any

from framearray_cli.base.errors import JobError
from framearray_cli.base.forms.schema import Schema, file_schema, find, variants
from framearray_cli.base.forms.table import Place
from framearray_cli.base.forms.toml import parse_value
from framearray_cli.base.forms.words import shown

from .job import Job

OPTION = "--set"
_WANTED = "expected KEY=VALUE, such as camera.resolution=[640,480] or light.sources[0].keys[1].intensity=20"
_STEP = re.compile(r"""(?:^|\.)(?:([A-Za-z0-9_-]+)|"([^"\\]+)"|'([^']+)')|\[(-?\d{1,6})\]""")
_FILES = ("a file name", "a list of folders")  # relative to the current folder, as on all of a command line


@dataclass(frozen=True, slots=True)
class Setting:
    """One option: where its value goes, and the option as it was typed."""

    place: Place
    value: str
    text: str


def read_settings(texts: Sequence[str]) -> list[Setting]:
    """Read "KEY=VALUE" texts: keys with dots between them, `[0]` for an item of a list.

    Raises:
        JobError: a text is not of that form; the error lists all that are not.
    """
    problems, found = [], []
    for text in texts:
        place, rest = _read_key(text)
        if not place or not rest.startswith("="):
            problems.append(f"{_WANTED}, got {shown(text)}")
        found.append(Setting(place, rest[1:].strip(), text))
    if problems:
        raise JobError(OPTION, problems)
    return found


def _read_key(text: str) -> tuple[Place, str]:
    """Split a text into the place at its beginning, and the rest."""
    place: list[int | str] = []
    end = 0
    while match := _STEP.match(text, end):
        if place and match[4] is None and not match[0].startswith("."):
            break
        place.append(int(match[4]) if match[4] is not None else match[1] or match[2] or match[3])
        end = match.end()
    return tuple(place), text[end:].lstrip()


def put_settings(table: dict[str, Any], settings: Sequence[Setting]) -> None:
    """Put values into the tables of a job file, one after the other; tables that are missing are made.

    Raises:
        JobError: a key leads through something that is no table, or to an item that its list lacks.
    """
    problems = [problem for setting in settings if (problem := _put(table, setting))]
    if problems:
        raise JobError(OPTION, problems)


def _put(table: dict[str, Any], setting: Setting) -> str | None:
    """Put one value into a table; return what is wrong, if anything."""
    root = file_schema(Job)
    node: Any = table
    typed: list[int | str] = []  # the place, with the kinds of tables that have several
    for k, step in enumerate(setting.place):
        where = find(root, tuple(typed))[0] or "the job"
        if isinstance(step, int):
            if not isinstance(node, list):
                return f"{where}: expected a list for [{step}], got {shown(node)}"
            if not -len(node) <= step < len(node):
                return f"{where}: expected an item from 0 to {len(node) - 1}, got [{step}]"
            step %= len(node)
        elif isinstance(node, list):
            return f'{where}: expected an item, such as {where}[{_index(step)}], got "{step}"'
        elif not isinstance(node, dict):
            return f'{where}: expected a table for the key "{step}", got {shown(node)}'
        typed.append(step)
        if k == len(setting.place) - 1:
            node[step] = _value(setting.value, find(root, tuple(typed))[1])
            return None
        node = node.setdefault(step, {}) if isinstance(node, dict) else node[step]
        kind = node.get("type") if isinstance(node, dict) else None
        if kind in variants(root, find(root, tuple(typed))[1]):
            typed.append(kind)
    return None


def _index(step: str) -> str:
    """The number of the item that was probably meant."""
    return step if step.isdecimal() else "0"


def _value(text: str, schema: Schema) -> Any:
    """Read a TOML value; what is none is text, and so is anything where only text is expected."""
    try:
        found = parse_value(text)
    except ValueError:
        found = text
    if not isinstance(found, str) and schema.get("type") == "string":
        found = text
    return _from_here(found) if schema.get("x-words") in _FILES else found


def _from_here(names: Any) -> Any:
    """Make file names absolute."""
    if isinstance(names, list):
        return [_from_here(name) for name in names]
    return os.path.abspath(names) if isinstance(names, str) and names.strip() and "\0" not in names else names


def name_settings(problems: Sequence[str], settings: Sequence[Setting]) -> list[str]:
    """Add to each problem of a job the option that its key came from, if any."""
    return [problem + _origin(problem.partition(": ")[0], settings) for problem in problems]


def _origin(key: str, settings: Sequence[Setting]) -> str:
    """Return "(given by --set KEY=VALUE)" if the key, or one above it, was set."""
    place, _ = _read_key(key)
    for setting in reversed(settings):
        if setting.place == place[: len(setting.place)]:
            return f" (given by {OPTION} {setting.text})"
    return ""
