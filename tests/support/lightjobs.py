"""Files of the tiny job with another light, and the problems of those that are wrong."""

from pathlib import Path
from typing import Any

import pytest
import tomli_w

from framearray_cli.base.errors import JobError
from framearray_cli.job.job import Job
from framearray_cli.job.read import read_job
from support import tiny


def read_lit(folder: Path, *sources: Any, **more: Any) -> Job:
    """Read a job file with these sources and other keys of `[light]`; its scene is no file."""
    file = folder / "job.toml"
    table = tiny.table() | {"light": {"sources": list(sources)} | more, "scene": {"file": "a.glb"}}
    file.write_text(tomli_w.dumps(table), encoding="utf-8")
    return read_job(file)


def problems(folder: Path, *sources: Any, **more: Any) -> list[str]:
    """Read one that is wrong."""
    with pytest.raises(JobError) as caught:
        read_lit(folder, *sources, **more)
    return list(caught.value.problems)
