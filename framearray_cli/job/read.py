"""Job file -> `Job`, or one error with every problem; and `Job` -> plain tables."""

from collections.abc import Sequence
from pathlib import Path
from typing import Any

from pydantic import ValidationError

from framearray_cli.base.errors import JobError
from framearray_cli.base.forms.kinds import load_kind
from framearray_cli.base.forms.problems import problems_of
from framearray_cli.base.forms.toml import STDIN, shown_file
from framearray_cli.base.forms.words import shown

from .eyefile import read_eyes
from .ies import read_photometry
from .job import Job
from .lens import plain_lens
from .override import Setting, name_settings, put_settings, read_settings
from .poses import EyeRows
from .positionfile import read_positions
from .rowfile import RowFileError
from .rowsource import FORMS
from .values import absolute


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
        JobError: as `read_job`, with "job" in place of a file.
    """
    return _checked_job(table, read_settings(sets), None, Path("job"))


def _checked_job(table: dict[str, Any], settings: Sequence[Setting], job_file: Path | None, name: Path) -> Job:
    """Read a job from its tables.

    Args:
        job_file: file names are relative to its folder; None: to the current one.
        name: of the job in messages.
    """
    put_settings(table, settings)
    table, problems = _with_eyes(table, job_file)
    table, more = _with_positions(table, job_file)
    problems += more + _profile_problems(table, job_file)
    try:
        job = Job.model_validate(table, context={"job_file": job_file})
    except ValidationError as error:
        problems = problems_of(error, Job) + problems
    if problems:
        raise JobError(name, name_settings(problems, settings))
    return job


def job_table(job: Job) -> dict[str, Any]:
    """Write a job as complete plain tables with absolute file names; reading them gives an equal job."""
    table: dict[str, Any] = _toml_value(job.model_dump(exclude_none=True))
    plain_lens(table["camera"])
    if job.ambient.intensity is not None:  # excludes `method` and `paths`
        table["ambient"] = {"intensity": table["ambient"]["intensity"]}
    if job.indirect.method == "obscurance":  # as in jobs of versions without this table
        del table["indirect"]
    elif job.indirect.exact:  # excludes the keys of cells
        table["indirect"] = {"method": "cells", "exact": True}
    else:
        del table["indirect"]["exact"]
    for key in ("sun_hours", "alpha", "position", "uv", "cryptomatte"):  # as in jobs of versions without these keys
        if not table["output"].get(key):
            table["output"].pop(key, None)
    for source in table["light"].get("sources", ()):
        if source.get("almanac") == "pvlib":  # as in jobs of versions without this key
            del source["almanac"]
    del table["samples"]["most_hits" if job.samples.error is None else "hits"]  # a job has either
    return table


def job_of_table(table: dict[str, Any], file: Path, directory: Path) -> Job:
    """Read the job that `job_table` wrote, and direct its output to another folder.

    Args:
        file: the file that holds the table, for messages.

    Raises:
        JobError: the table is no job of this version.
    """
    sources = [_with_almanac(source) for source in table.get("light", {}).get("sources", ())]
    table = table | {"light": table["light"] | {"sources": sources}} if sources else table
    try:
        job = Job.model_validate(table | {"output": table.get("output", {}) | {"directory": str(directory)}})
    except ValidationError as error:
        raise JobError(file, [f"job.{problem}" for problem in problems_of(error, Job)]) from error
    return job


def _with_almanac(source: dict[str, Any]) -> dict[str, Any]:
    """Name the almanac of a sun that `job_table`, or a version without this key, left out."""
    return {"almanac": "pvlib"} | source if source.get("type") == "sun" else source


def _toml_value(value: Any) -> Any:
    """Turn tuples into lists and paths into text."""
    if isinstance(value, dict):
        return {key: _toml_value(item) for key, item in value.items()}
    if isinstance(value, tuple):
        return [_toml_value(item) for item in value]
    return str(value) if isinstance(value, Path) else value


def _with_eyes(table: dict[str, Any], job_file: Path | None) -> tuple[dict[str, Any], list[str]]:
    """Replace `camera.file` by its keys, so that the job is complete without the file."""
    camera = table.get("camera")
    if not isinstance(camera, dict) or not isinstance(camera.get("file"), str) or "keys" in camera:
        return table, []  # nothing to replace, or a problem that the validation of the job reports
    name = camera["file"]
    if not name.strip() or "\0" in name:
        return table, []
    try:
        found = read_eyes(absolute(Path(name), job_file), _size(camera.get("resolution")))
    except RowFileError as error:
        return table, [f"camera.file: {shown(name)}: {problem}" for problem in error.args]
    return _merged_eyes(table, camera, found, name)


def _merged_eyes(
    table: dict[str, Any], camera: dict[str, Any], found: EyeRows, name: str
) -> tuple[dict[str, Any], list[str]]:
    """Join what a job and its file of camera positions say; the job's own keys count, but for the type."""
    rest = {key: value for key, value in camera.items() if key != "file"}
    keys = [{key: value for key, value in row.items() if key not in rest} for row in found.keys]
    problems, file = [], shown(name)
    frames, kind, size = rest.get("frames"), rest.get("type"), _size(rest.get("resolution"))
    if isinstance(frames, int) and frames != len(keys):
        problems.append(
            f"camera.frames: expected {len(keys)}, the number of camera positions in {file}, got {shown(frames)}"
        )
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
    return {**table, "camera": {**found.camera, **rest, "keys": keys}}, problems


def _size(value: object) -> tuple[int, int] | None:
    """Return a resolution, if it is one."""
    whole = (
        isinstance(value, list | tuple) and len(value) == 2 and all(type(side) is int and side > 0 for side in value)
    )
    return (value[0], value[1]) if whole else None  # type: ignore[index]  # it is a pair


def _with_positions(table: dict[str, Any], job_file: Path | None) -> tuple[dict[str, Any], list[str]]:
    """Replace `file` of light sources by keys, so that the job is complete without the files."""
    light = table.get("light")
    sources = light.get("sources") if isinstance(light, dict) else None
    if not isinstance(light, dict) or not isinstance(sources, list):
        return table, []
    problems: list[str] = []
    found = [_with_rows(source, f"light.sources[{i}].file", job_file, problems) for i, source in enumerate(sources)]
    return {**table, "light": {**light, "sources": found}}, problems


def _profile_problems(table: dict[str, Any], job_file: Path | None) -> list[str]:
    """Check the files of measured lamps, of sources that have them."""
    light = table.get("light")
    sources = light.get("sources") if isinstance(light, dict) else None
    problems = []
    for i, source in enumerate(sources if isinstance(sources, list) else ()):
        name = source.get("ies") if isinstance(source, dict) and source.get("type") in ("point", "spot") else None
        if not isinstance(name, str) or not name.strip() or "\0" in name:
            continue  # none, or a problem that the validation of the job reports
        try:
            read_photometry(absolute(Path(name), job_file))
        except RowFileError as error:
            problems += [f"light.sources[{i}].ies: {shown(name)}: {problem}" for problem in error.args]
    return problems


def _with_rows(source: Any, place: str, job_file: Path | None, problems: list[str]) -> Any:
    """Replace `file` of one source, with the strength and colour beside it, if it is as it should be."""
    if not isinstance(source, dict) or "keys" in source or str(source.get("type")) not in FORMS:
        return source  # nothing to replace, or a problem that the validation of the job reports
    name = source.get("file")
    if not isinstance(name, str) or not name.strip() or "\0" in name:
        return source
    own = ("file", *FORMS[source["type"]].values)
    common = {key: source[key] for key in own[1:] if key in source}
    try:
        keys = read_positions(absolute(Path(name), job_file), source["type"], common, strong="ies" in source)
    except RowFileError as error:
        problems += [f"{place}: {shown(name)}: {problem}" for problem in error.args]
        return source
    return {key: value for key, value in source.items() if key not in own} | {"keys": keys}
