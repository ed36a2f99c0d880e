"""The table `[indirect]`: what does not go together, and jobs without it."""

from pathlib import Path
from typing import Any

import pytest
from pydantic import ValidationError
from support import tiny

from framearray_cli.job.read import job_of_table, job_table

CELLS = {"method": "cells"}


@pytest.mark.parametrize(
    ("method", "reason"),
    [("cells", "whose images show no obscurance"), ("local", "which multiplies the obscurance")],
)
def test_there_is_no_picture_of_obscurance_to_denoise(method: str, reason: str) -> None:
    with pytest.raises(ValidationError, match=f'expected false with indirect.method = "{method}", {reason}'):
        tiny.job(denoise={"obscurance": True}, indirect={"method": method})
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


@pytest.mark.parametrize("indirect", [{"method": "obscurance"}, CELLS, {**CELLS, "exact": True}])
def test_a_job_reads_back(indirect: dict[str, Any]) -> None:
    job = tiny.job(indirect=indirect)
    table = job_table(job)
    assert ("samples" in table["indirect"]) == (indirect == CELLS)
    assert job_of_table(table, Path("job"), job.output.directory).indirect == job.indirect
