"""The table `[indirect]`: what does not go together, and jobs without it."""

from pathlib import Path

import pytest
from pydantic import ValidationError
from support import tiny

from framearray_cli.job.read import job_of_table, job_table

CELLS = {"method": "cells"}


def test_cells_show_no_obscurance_to_denoise() -> None:
    with pytest.raises(ValidationError, match="expected false with indirect"):
        tiny.job(denoise={"obscurance": True}, indirect=CELLS)
    tiny.job(denoise={"obscurance": True})


@pytest.mark.parametrize("key", ["cell", "samples"])
def test_keys_of_cells_need_cells(key: str) -> None:
    with pytest.raises(ValidationError, match='expected method = "cells" or "local" beside it'):
        tiny.job(indirect={key: 2048})
    tiny.job(indirect={"method": "local", key: 2048})


@pytest.mark.parametrize("method", ["obscurance", "local"])
def test_the_filter_needs_gather_rays(method: str) -> None:
    with pytest.raises(ValidationError, match='expected method = "cells" beside it: it smooths'):
        tiny.job(indirect={"method": method, "filter": 1})
    tiny.job(indirect={"method": "cells", "filter": 1})


@pytest.mark.parametrize("more", [{"cell": 0.1}, {"samples": 2048}, {"filter": 0}])
def test_paths_take_no_keys_of_cells(more: dict[str, float]) -> None:
    with pytest.raises(ValidationError, match="expected no value, as exact = true builds no cells"):
        tiny.job(indirect={**CELLS, "exact": True, **more})


@pytest.mark.parametrize("method", ["obscurance", "local"])
def test_paths_take_the_place_of_cells(method: str) -> None:
    with pytest.raises(ValidationError, match='expected false, or method = "cells" beside it'):
        tiny.job(indirect={"method": method, "exact": True})


def test_a_job_with_paths_reads_back() -> None:
    job = tiny.job(indirect={**CELLS, "exact": True})
    table = job_table(job)
    assert table["indirect"] == {"method": "cells", "exact": True}
    assert job_of_table(table, Path("job"), job.output.directory).indirect == job.indirect


def test_a_job_without_cells_is_written_as_before() -> None:
    assert "indirect" not in job_table(tiny.job())
    assert job_table(tiny.job(indirect=CELLS))["indirect"] == {"method": "cells", "samples": 2**20, "filter": 2}
