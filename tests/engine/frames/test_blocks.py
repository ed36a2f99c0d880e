"""A memory limit cuts the lights into blocks; the images stay the same to the last bit."""

from pathlib import Path
from typing import Any

import numpy as np
import pytest
from support import tiny

from framearray_cli.array.images import read_image
from framearray_cli.base.errors import JobError
from framearray_cli.render.cell_memory import cells_memory
from framearray_cli.render.memory import light_blocks, mirror_share, require_memory, window_memory
from framearray_cli.render.render import render

LAMPS = {"frames": 7, "sources": [*tiny.TABLE["light"]["sources"], tiny.RED]}


MARKS = {"alpha": True, "position": True, "uv": True, "cryptomatte": True}


def job(folder: Path, memory: Any = None, output: Any = None, **samples: Any) -> Any:
    """A walk through the room of mirrors under 7 lights of three channels."""
    scene = tiny.save_glb(tiny.room_meshes(), folder / "room.glb")
    table = tiny.table(
        scene={"file": str(scene), "background": [0.2, 0.3, 0.4]},
        camera=tiny.WALK,
        light=LAMPS,
        reuse={"n_r": 1},
        samples=samples,
        output={"directory": str(folder / f"out{memory}"), **(output or {})},
        render={"threads": 2} | ({"memory": memory} if memory else {}),
    )
    return tiny.Job.model_validate(table)


@pytest.fixture(autouse=True)
def _program_of_no_size(monkeypatch: pytest.MonkeyPatch) -> None:
    """Limits in this file are some kilobytes, so the program itself does not count."""
    monkeypatch.setattr("framearray_cli.render.memory.program_memory", lambda: 0)


@pytest.mark.parametrize("output", [{}, MARKS])
def test_blocks_give_the_same_bytes(tmp_path: Path, output: dict[str, Any]) -> None:
    whole = job(tmp_path, output=output)
    inputs = tiny.prepared(whole)
    limit = window_memory(inputs, 3, 0.4)
    cut = job(tmp_path, limit, output=output)
    with tiny.planned(tiny.prepared(cut)) as (setup, _):
        assert len(light_blocks(tiny.prepared(cut), mirror_share(setup))) > 1
    summaries = [render(whole), render(cut)]
    files = sorted(file.name for file in whole.output.directory.glob("*.exr"))
    assert len(files) == 6 * 7 + 6 == len(list(cut.output.directory.glob("*.exr")))
    for name in files:
        assert (whole.output.directory / name).read_bytes() == (cut.output.directory / name).read_bytes(), name
    assert summaries[0].images == summaries[1].images == 42
    assert summaries[0].hits == summaries[1].hits
    assert np.max(read_image(whole.output.directory / files[0])) > 0


def test_blocks_are_as_few_and_as_even_as_can_be(tmp_path: Path) -> None:
    for size, expected in ((7, [7]), (6, [4, 3]), (4, [4, 3]), (3, [3, 3, 1]), (1, [1] * 7)):
        inputs = tiny.prepared(job(tmp_path, window_memory(tiny.prepared(job(tmp_path)), size)))
        assert [len(block) for block in light_blocks(inputs, 0.0)] == expected
        require_memory(inputs)


def test_a_limit_below_one_light_is_refused(tmp_path: Path) -> None:
    inputs = tiny.prepared(job(tmp_path, window_memory(tiny.prepared(job(tmp_path)), 1) - 1))
    with pytest.raises(JobError, match=r"rendering needs at least .* takes less"):
        require_memory(inputs)


def test_mirrors_are_seen_before_the_first_frame(tmp_path: Path) -> None:
    with tiny.planned(tiny.prepared(tiny.job())) as (setup, _):
        assert 0.1 < mirror_share(setup) < 1
    with tiny.planned(tiny.prepared(tiny.job(), tiny.room(mirrors=False))) as (setup, _):
        assert mirror_share(setup) == 0.0


def test_the_limit_is_that_of_the_whole_program(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """Memory that the program already holds is not available to frames."""
    inputs = tiny.prepared(job(tmp_path, window_memory(tiny.prepared(job(tmp_path)), 6) + 1000))
    monkeypatch.setattr("framearray_cli.render.memory.program_memory", lambda: 1000)
    assert [len(block) for block in light_blocks(inputs, 0.0)] == [4, 3]
    monkeypatch.setattr("framearray_cli.render.memory.program_memory", lambda: 2**40)
    with pytest.raises(JobError, match=r"needs at least 1,099,51\d,\d{3},\d{3} bytes"):
        require_memory(inputs)


def test_blocks_of_light_positions_hold_their_cells_once_more() -> None:
    inputs = tiny.prepared(tiny.job(indirect={"method": "cells", "samples": 2048}))
    with tiny.planned(inputs) as (setup, _):
        assert setup.cells is not None and setup.cells_at(range(3)) is setup.cells
        assert cells_memory(setup, 3) == setup.cells.light.nbytes > 0
        one = setup.for_lights(range(1)).cells
        assert one is not None and one.light.nbytes == cells_memory(setup, 1)
        fits_two = window_memory(inputs, 2)
        assert [len(block) for block in light_blocks(inputs, 0.0, fits_two)] == [2, 1]
        assert [len(block) for block in light_blocks(inputs, 0.0, fits_two, setup=setup)] == [1, 1, 1]
        fits_all = window_memory(inputs, 3)
        assert light_blocks(inputs, 0.0, fits_all, setup=setup) == [range(3)]
