"""Job file -> `Job`, or one error with every problem; `Job` -> plain tables; keys that a command line replaces.

Options `--set KEY=VALUE` replace keys before the job is checked.
"""

import os
import re
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from pydantic import ValidationError
from pydantic_core import to_jsonable_python

from framearray_cli.base.errors import JobError
from framearray_cli.base.files import absolute
from framearray_cli.base.forms.problems import problems_of
from framearray_cli.base.forms.schema import Schema, file_schema, find, variants
from framearray_cli.base.forms.table import Place, changed
from framearray_cli.base.forms.toml import STDIN, load_kind, parse_value, shown_file
from framearray_cli.base.forms.words import shown

from .camera import KEYS_OF_TYPE, EyeRows, read_eyes
from .ies import read_photometry
from .job import Job
from .rowfile import RowFileError, read_positions
from .sensors import read_points
from .sources import ROW_KEYS

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


def with_options(job: Job, threads: int | None, output: Path | None = None, folders: Sequence[Path] = ()) -> Job:
    """Return the job with another number of threads, another folder for images, and more folders of the scene."""
    if threads is not None:
        job = changed(job, render=changed(job.render, threads=threads))
    if folders:
        job = changed(job, scene=changed(job.scene, folders=(*job.scene.folders, *folders)))
    if output is None:
        return job
    return changed(job, output=job.output.model_copy(update={"directory": output.absolute()}))  # keep links


def read_job(path: Path, sets: Sequence[str] = ()) -> Job:
    """Read a job file; file names in it are relative to its folder, those in `sets` to the current one.

    Args:
        path: the file; "-": standard input, in the current folder.
        sets: "KEY=VALUE" texts that replace keys of the file before it is checked.

    Raises:
        JobError: the file cannot be read or has problems; the error lists all of them.
    """
    settings = read_settings(sets)
    table = load_kind(path, "job")
    job_file = shown_file(path) if path == STDIN else path.absolute()
    return _checked_job(table, settings, job_file, shown_file(path))


def job_from_table(table: dict[str, Any], sets: Sequence[str] = ()) -> Job:
    """Check a job that is given as the tables of a job file; file names in it are relative to the current folder.

    Args:
        table: plain tables, lists and values, which are changed.
        sets: as in `read_job`.

    Raises:
        JobError: as `read_job`, with "job" instead of a file.
    """
    return _checked_job(table, read_settings(sets), None, Path("job"))


def _checked_job(table: dict[str, Any], settings: Sequence[Setting], job_file: Path | None, name: Path) -> Job:
    """Read a job from its tables.

    Args:
        job_file: file names are relative to its folder; None: to the current one.
        name: of the job in messages.
    """
    if unset := [problem for setting in settings if (problem := _put(table, setting))]:
        raise JobError(OPTION, unset)
    problems: list[str] = []
    camera, light = table.get("camera"), table.get("light")
    if isinstance(camera, dict):
        table = {**table, "camera": _with_eyes(camera, job_file, problems)}
    if isinstance(light, dict) and isinstance(sources := light.get("sources"), list):
        found = [_with_rows(source, f"light.sources[{i}]", job_file, problems) for i, source in enumerate(sources)]
        table = {**table, "light": {**light, "sources": found}}
    if isinstance(sensors := table.get("sensors"), list):
        found = [_with_points(each, f"sensors[{i}]", job_file, problems) for i, each in enumerate(sensors)]
        table = {**table, "sensors": found}
    try:
        job = Job.model_validate(table, context={"job_file": job_file})
    except ValidationError as error:
        problems = problems_of(error, Job) + problems
    if problems:
        raise JobError(name, [problem + _origin(problem, settings) for problem in problems])
    return job


def job_table(job: Job) -> dict[str, Any]:
    """Write a job as complete plain tables with absolute file names; reading them gives an equal job."""
    table: dict[str, Any] = to_jsonable_python(job.model_dump(exclude_none=True))
    if "fov" not in KEYS_OF_TYPE[job.camera.type] or any("fov" in key for key in table["camera"]["keys"]):
        table["camera"].pop("fov", None)
    if job.ambient.intensity is not None:  # excludes `method` and `paths`
        table["ambient"] = {"intensity": table["ambient"]["intensity"]}
    if job.indirect.exact or job.indirect.method == "obscurance":  # excludes the keys of cells
        table["indirect"] = {"method": job.indirect.method, "exact": job.indirect.exact}
    if not job.sensors:
        del table["sensors"]
    del table["samples"]["most_hits" if job.samples.error is None else "hits"]  # a job has either
    return table


def job_of_table(table: dict[str, Any], file: Path, directory: Path) -> Job:
    """Read the job that `job_table` wrote, and direct its output to another folder.

    Args:
        file: the file that holds the table, for messages.

    Raises:
        JobError: the table is no job of this version.
    """
    try:
        job = Job.model_validate(table | {"output": table.get("output", {}) | {"directory": str(directory)}})
    except ValidationError as error:
        raise JobError(file, [f"job.{problem}" for problem in problems_of(error, Job)]) from error
    return job


def _file_of(table: dict[str, Any], key: str, job_file: Path | None) -> Path | None:
    """Return the file that a key names; None without one, or for a name that the validation of the job reports."""
    name = table.get(key)
    return absolute(Path(name), job_file) if isinstance(name, str) and name.strip() and "\0" not in name else None


def _with_eyes(camera: dict[str, Any], job_file: Path | None, problems: list[str]) -> dict[str, Any]:
    """Replace `camera.file` by its keys, so that the job is complete without the file."""
    file = _file_of(camera, "file", job_file)
    if file is None or "keys" in camera:
        return camera  # nothing to replace, or a problem that the validation of the job reports
    try:
        found = read_eyes(file, _size(camera.get("resolution")))
    except RowFileError as error:
        problems += [f"camera.file: {shown(camera['file'])}: {problem}" for problem in error.args]
        return camera
    return _merged_eyes(camera, found, problems)


def _merged_eyes(camera: dict[str, Any], found: EyeRows, problems: list[str]) -> dict[str, Any]:
    """Join the keys of a job and of its file of camera positions; the job's own keys win, but for the type."""
    file = shown(camera["file"])
    rest = {key: value for key, value in camera.items() if key != "file"}
    rows = [{"frame": c} | {key: row[key] for key in row if key not in rest} for c, row in enumerate(found.keys)]
    frames, kind, size = rest.get("frames"), rest.get("type"), _size(rest.get("resolution"))
    if isinstance(frames, int) and frames != len(rows):
        text = f"expected {len(rows)}, the number of camera positions in {file}, got {shown(frames)}"
        problems.append(f"camera.frames: {text}")
        del rest["frames"]
    if kind is not None and found.camera.get("type", kind) != kind:
        problems.append(f"camera.type: expected {shown(found.camera['type'])}, as in {file}, got {shown(kind)}")
        del rest["type"]
    if found.off_centre and size and found.resolution and "shift" not in rest:
        width, height = found.resolution
        if abs(size[0] * height - size[1] * width) > max(width, height):  # beyond rounding to pixels
            problems.append(
                f"camera.resolution: expected the shape of [{width}, {height}], for which {file} says where the axis "
                f"meets the picture, got {list(size)}; or give camera.shift"
            )
    return {**found.camera, **rest, "keys": rows}


def _size(value: object) -> tuple[int, int] | None:
    """Return a resolution, if it is one."""
    match value:
        case [int(width), int(height)] if width > 0 and height > 0 and bool not in (type(width), type(height)):
            return width, height
    return None


def _with_rows(source: Any, place: str, job_file: Path | None, problems: list[str]) -> Any:
    """Replace `file` of a source, and the values next to it, by keys; check the file of a measured lamp."""
    if not isinstance(source, dict) or (kind := str(source.get("type"))) not in ROW_KEYS:
        return source  # nothing to replace, or a problem that the validation of the job reports
    key = ""
    try:
        if (file := _file_of(source, key := "file", job_file)) is not None and "keys" not in source:
            values = ROW_KEYS[kind].row_values()
            common = {name: source[name] for name in values if name in source}
            keys = read_positions(file, kind, common, strong="ies" in source)
            source = {name: source[name] for name in source if name not in ("file", *values)} | {"keys": keys}
        if kind in ("point", "spot") and (file := _file_of(source, key := "ies", job_file)) is not None:
            read_photometry(file)
    except RowFileError as error:
        problems += [f"{place}.{key}: {shown(source[key])}: {problem}" for problem in error.args]
    return source


def _with_points(sensors: Any, place: str, job_file: Path | None, problems: list[str]) -> Any:
    """Replace `file` of a list of sensors by its points."""
    file = _file_of(sensors, "file", job_file) if isinstance(sensors, dict) else None
    if file is None or "points" in sensors:
        return sensors
    try:
        points = read_points(file)
    except RowFileError as error:
        problems += [f"{place}.file: {shown(sensors['file'])}: {problem}" for problem in error.args]
        return sensors
    return {key: value for key, value in sensors.items() if key != "file"} | {"points": points}


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


def _put(table: dict[str, Any], setting: Setting) -> str | None:
    """Put one value into a table, and make those that are missing; return what is wrong, if anything."""
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
            return f'{where}: expected an item, such as {where}[{step if step.isdecimal() else 0}], got "{step}"'
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


def _origin(problem: str, settings: Sequence[Setting]) -> str:
    """Return "(given by --set KEY=VALUE)" if the key of a problem, or one above it, was set."""
    place, _ = _read_key(problem.partition(": ")[0])
    for setting in reversed(settings):
        if setting.place == place[: len(setting.place)]:
            return f" (given by {OPTION} {setting.text})"
    return ""
