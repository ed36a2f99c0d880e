"""The table `[indirect]`: what does not go together, and jobs without it."""

from pathlib import Path
from typing import Any

import pytest
from pydantic import ValidationError
from support import tiny

from framearray_cli.job.read import job_of_table, job_table

CELLS = {"method": "cells"}


@pytest.mark.parametrize("more", [{"cell": 0.1}, {"samples": 2048}, {"filter": 1}, {"exact": True}])
def test_keys_of_cells_need_cells(more: dict[str, float]) -> None:
    with pytest.raises(ValidationError, match='method = "cells" next to it'):
        tiny.job(indirect={"method": "obscurance", **more})
    tiny.job(indirect={**CELLS, **more})


@pytest.mark.parametrize("more", [{"cell": 0.1}, {"samples": 2048}, {"filter": 0}])
def test_paths_take_no_keys_of_cells(more: dict[str, float]) -> None:
    with pytest.raises(ValidationError, match="expected no value, as exact = true builds no cells"):
        tiny.job(indirect={**CELLS, "exact": True, **more})


@pytest.mark.parametrize("indirect", [{"method": "obscurance"}, CELLS, {**CELLS, "exact": True}])
def test_a_job_reads_back(indirect: dict[str, Any]) -> None:
    job = tiny.job(indirect=indirect)
    table = job_table(job)
    assert ("samples" in table["indirect"]) == (indirect == CELLS)
    assert job_of_table(table, Path("job"), job.output.directory).indirect == job.indirect
