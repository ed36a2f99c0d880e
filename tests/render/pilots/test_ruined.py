"""Every ruined job is warned of, with number, place and remedy; good jobs are not."""

import numpy as np
import pytest
from support import ROOT, tiny
from support.ruined import CASES, Case, case, lit

from framearray_cli.job.job import Job
from framearray_cli.render.pilots.warn import find_warnings, range_warnings


def warnings_of(ruined: Case) -> tuple[str, ...]:
    job, scene = ruined.prepared_from()
    inputs = tiny.prepared(job, scene)
    with tiny.planned(inputs) as (setup, ambient):
        return find_warnings(inputs, setup, ambient)


@pytest.mark.parametrize("name", CASES)
def test_a_ruined_job_is_warned_of(name):
    found = warnings_of(CASES[name])
    assert any(all(word in text for word in CASES[name].words) for text in found), found
    assert len(found) <= 3


@pytest.mark.slow  # compiles kernels with maps
def test_a_sky_outside_a_closed_room():
    sky = {"type": "environment", "file": str(ROOT / "jobs" / "scenes" / "sky.exr"), "keys": [{"frame": 0}]}
    (found,) = warnings_of(case(light=lit(sky)))
    assert "reaches nothing that is seen: surfaces hide the sky" in found


def test_the_job_that_they_are_made_from_is_good():
    assert warnings_of(case()) == ()


def test_long_lengths_are_written_without_an_exponent() -> None:
    job = Job.model_validate(tiny.table(obscurance={"range": 13000.0}))
    (warning,) = range_warnings(job, 1133.7, np.empty(0))
    assert "13000 scene units, in a scene of 1130:" in warning
