"""What is wrong with a job."""

from pathlib import Path
from typing import Any

import pytest
import tomli_w

from framearray_cli.base.errors import JobError
from framearray_cli.job.read import read_job
from support import tiny


def problems_of_source(source: dict[str, Any], folder: Path) -> list[str]:
    """The problems of the only source of a job, without its place."""
    file = folder / "job.toml"
    table = tiny.table() | {"light": {"sources": [source]}, "scene": {"file": "a.glb"}}
    file.write_text(tomli_w.dumps(table), encoding="utf-8")
    with pytest.raises(JobError) as caught:
        read_job(file)
    return [problem.removeprefix("light.sources[0].") for problem in caught.value.problems]
