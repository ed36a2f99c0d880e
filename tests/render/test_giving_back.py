"""A render gives memory back when other programs need it: it goes on in smaller parts, with the same images."""

from pathlib import Path
from typing import Any

import pytest
from support import tiny
from support.divided import in_blocks
from support.handed import contents

import framearray_cli.render.division as dividing
from framearray_cli.array.stripfiles import strip_files
from framearray_cli.job.job import Job
from framearray_cli.render import render as rendering
from framearray_cli.render.division import divide, look_at_hits
from framearray_cli.render.events import Event, FramesBegun, ImagesWritten, Noted, Warned
from framearray_cli.render.memory import window_memory
from framearray_cli.render.writer import ArrayWriter

FRAMES, LIGHTS, HEIGHT = 4, 3, 512
TALL = tiny.walk(FRAMES, resolution=[48, HEIGHT], fov=120.0)
GIVEN = "other programs need memory; the images that are missing take less from here on"


def tall(scene: Path, out: Path, **changes: Any) -> Job:
    return tiny.job_of_file(scene, out, camera=TALL, reuse={"n_r": 1}, **changes)


class Machine:
    """A machine whose other programs need memory at some eyes, and that has less of it after each time."""

    def __init__(self, patch: pytest.MonkeyPatch, job: Job, eyes: set[int], limits: list[float]) -> None:
        self.seen, self.rows, self.said = 0, list[tuple[int, range]](), list[Event]()
        self.divisions = list[tuple[range, ...]]()
        inputs = tiny.prepared(job)
        with tiny.planned(inputs) as (setup, _):
            whole = window_memory(inputs, LIGHTS, look_at_hits(setup, 1))
        write = ArrayWriter.write

        def is_scarce(held: int) -> bool:
            self.seen += 1
            return self.seen - 1 in eyes

        def divided(*given: Any, **more: Any) -> Any:
            found = divide(*given, **more)
            self.divisions.append(found.strips)
            return found

        def written(writer: ArrayWriter, composed: Any, *given: Any) -> None:
            self.rows.append((composed.c, composed.rows))
            write(writer, composed, *given)

        patch.setattr(rendering, "is_scarce", is_scarce)
        patch.setattr(
            dividing, "memory_limit", lambda *_: int(whole * (limits.pop(0) if len(limits) > 1 else limits[0]))
        )
        patch.setattr(dividing, "divide", divided)
        patch.setattr(ArrayWriter, "write", written)

    def render(self, job: Job) -> None:
        rendering.render(job, self.said.append)

    @property
    def texts(self) -> list[str]:
        return [event.text for event in self.said if isinstance(event, Noted | Warned)]


@pytest.fixture(scope="module")
def whole(scene: Path, tmp_path_factory: pytest.TempPathFactory) -> dict[str, bytes]:
    out = tmp_path_factory.mktemp("whole")
    rendering.render(tall(scene, out))
    return contents(out)


def test_a_whole_render_goes_on_in_strips_with_the_images_that_it_has(
    scene: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch, whole: dict[str, bytes]
) -> None:
    """Eye -1 to 2 are found, so frames 0 and 1 are there; then the rest is divided into less than a half each."""
    machine = Machine(monkeypatch, tall(scene, tmp_path), {4}, [1.0, 0.45])
    machine.render(tall(scene, tmp_path))
    assert machine.divisions[0] == (range(HEIGHT),) and len(machine.divisions[1]) > 2
    assert [c for c, rows in machine.rows if len(rows) == HEIGHT] == [0, 1]
    assert {c for c, rows in machine.rows if len(rows) < HEIGHT} == {2, 3}
    assert GIVEN in machine.texts
    assert any(f"frames are rendered in {len(machine.divisions[1])} strips of rows" in text for text in machine.texts)
    assert sum(event.images for event in machine.said if isinstance(event, ImagesWritten)) == FRAMES * LIGHTS
    assert sum(isinstance(event, FramesBegun) for event in machine.said) == 1
    assert contents(tmp_path) == whole
    assert strip_files(tmp_path) == []


def test_finished_strips_keep_their_rows(
    scene: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch, whole: dict[str, bytes]
) -> None:
    """Each strip has six eyes: memory is short at the third eye of the second one."""
    machine = Machine(monkeypatch, tall(scene, tmp_path), {8}, [0.7, 0.3])
    machine.render(tall(scene, tmp_path))
    first, second = machine.divisions
    assert first[0] == second[0] and len(second) > len(first) > 1
    assert [c for c, rows in machine.rows if rows.start == 0] == list(range(FRAMES))
    assert contents(tmp_path) == whole


def test_a_machine_whose_memory_stays_short_is_asked_a_few_times_only(
    scene: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch, whole: dict[str, bytes]
) -> None:
    machine = Machine(monkeypatch, tall(scene, tmp_path), set(range(10**6)), [1.0])
    machine.render(tall(scene, tmp_path))
    assert machine.texts.count(GIVEN) == rendering.MOST_DIVISIONS
    assert contents(tmp_path) == whole


@pytest.mark.parametrize("limited", [True, False])
def test_jobs_with_a_limit_and_parts_of_few_light_positions_keep_what_they_have(
    scene: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch, whole: dict[str, bytes], limited: bool
) -> None:
    job = tall(scene, tmp_path, render={"memory": 2**34}) if limited else tall(scene, tmp_path)
    machine = Machine(monkeypatch, job, set(range(10**6)), [1.0])
    if not limited:
        monkeypatch.setattr(dividing, "divide", in_blocks(range(2), range(2, LIGHTS)))
    machine.render(job)
    assert machine.texts.count(GIVEN) == 0
    assert contents(tmp_path) == whole
