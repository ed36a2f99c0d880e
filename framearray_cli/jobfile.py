"""TOML text -> Job, or one JobError with every problem; and Job -> plain tables."""

import tomllib
from pathlib import Path
from typing import Any

from pydantic import ValidationError

from .errors import JobError
from .eyefile import EyeFileError, read_eyes
from .files import read_at_most
from .job import Job
from .jobvalues import absolute, long_key, shown
from .problems import problems_of

LARGEST_FILE = 4 * 1024 * 1024  # bytes; a hand-written job is a thousand times smaller, so more is the wrong file


def read_job(path: Path) -> Job:
    """Read a job file; names of files in it start at its folder.

    Raises:
        JobError: the file cannot be read, or has problems; all of them are told at once.
    """
    table = load_toml(path)
    job_file = path.absolute()
    table, problems = _with_eyes(table, job_file)
    try:
        job = Job.model_validate(table, context={"job_file": job_file})
    except ValidationError as error:
        problems = problems_of(error, Job) + problems
    if problems:
        raise JobError(path, problems)
    return job


def job_table(job: Job) -> dict[str, Any]:
    """Write a job as plain tables, complete, with absolute file names; reading them gives an equal job."""
    table: dict[str, Any] = _plain(job.model_dump(exclude_none=True))
    if job.ambient.intensity is not None:  # it stands instead of the other two
        table["ambient"] = {"intensity": table["ambient"]["intensity"]}
    del table["samples"]["most_hits" if job.samples.error is None else "hits"]  # of these two ways, the other is taken
    return table


def job_of_table(table: dict[str, Any], file: Path, directory: Path) -> Job:
    """The job that `job_table` wrote, with its images in a folder of its own.

    Args:
        file: where the table stands, for messages.

    Raises:
        JobError: the table is no job, of this program at least.
    """
    try:
        job = Job.model_validate(table | {"output": table.get("output", {}) | {"directory": str(directory)}})
    except ValidationError as error:
        raise JobError(file, [f"job.{problem}" for problem in problems_of(error, Job)]) from error
    return job


def _plain(value: Any) -> Any:
    """Turn tuples into lists and paths into text."""
    if isinstance(value, dict):
        return {key: _plain(item) for key, item in value.items()}
    if isinstance(value, tuple):
        return [_plain(item) for item in value]
    return str(value) if isinstance(value, Path) else value


def _with_eyes(table: dict[str, Any], job_file: Path) -> tuple[dict[str, Any], list[str]]:
    """Replace `camera.file` by the keys it holds, so that a job is complete without it."""
    camera = table.get("camera")
    if not isinstance(camera, dict) or not isinstance(camera.get("file"), str) or "keys" in camera:
        return table, []  # nothing to replace, or a problem that the check of the whole job tells
    name = camera["file"]
    if not name.strip() or "\0" in name:
        return table, []
    try:
        keys = read_eyes(absolute(Path(name), job_file))
    except EyeFileError as error:
        return table, [f"camera.file: {shown(name)}: {problem}" for problem in error.args]
    rest = {key: value for key, value in camera.items() if key != "file"}
    frames, problems = rest.get("frames"), []
    if isinstance(frames, int) and frames != len(keys):
        problems = [f"camera.frames: expected {len(keys)}, the number of eyes in {shown(name)}, got {shown(frames)}"]
        del rest["frames"]
    return {**table, "camera": {**rest, "keys": keys}}, problems


def load_toml(path: Path) -> dict[str, Any]:
    """Read a TOML file into plain tables.

    Raises:
        JobError: the file is missing, not a file, too big, not UTF-8, not TOML or nested too deeply.
    """
    data = _read_bytes(path)
    text = _decode(path, data)
    if problem := long_key(text):
        raise JobError(path, [problem])
    try:
        return tomllib.loads(text)
    except tomllib.TOMLDecodeError as error:
        raise JobError(path, [f"not valid TOML: {error}"]) from error
    except RecursionError as error:
        raise JobError(path, ["tables or lists are nested too deeply"]) from error
    except ValueError as error:  # a number of more digits than Python reads
        raise JobError(path, ["a number has too many digits"]) from error


def _read_bytes(path: Path) -> bytes:
    """Read a whole file whose size is checked first."""
    try:
        if path.is_dir():
            raise JobError(path, ["expected a TOML file, got a folder"])
        data = read_at_most(path, LARGEST_FILE)
    except FileNotFoundError as error:
        raise JobError(path, ["no such file"]) from error
    except (OSError, ValueError) as error:  # ValueError: a NUL in the name
        reason = error.strerror if isinstance(error, OSError) and error.strerror else str(error)
        raise JobError(path, [f"cannot be read: {reason}"]) from error
    if data is None:
        raise JobError(path, [f"expected a TOML file of at most {LARGEST_FILE >> 20} MB, got a bigger one"])
    return data


def _decode(path: Path, data: bytes) -> str:
    """Decode UTF-8, with or without the mark that Windows editors put first."""
    if data.startswith((b"\xff\xfe", b"\xfe\xff")):
        raise JobError(path, ["expected UTF-8 text, got UTF-16; save the file as UTF-8"])
    if b"\0" in data:
        raise JobError(path, ["expected UTF-8 text, got a binary file"])
    try:
        return data.decode("utf-8-sig")
    except UnicodeDecodeError as error:
        line = data.count(b"\n", 0, error.start) + 1
        found = f"byte 0x{data[error.start]:02x} in line {line}"
        raise JobError(path, [f"expected UTF-8 text, got {found}; save the file as UTF-8"]) from error
