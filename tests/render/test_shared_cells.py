"""Cells in the folder of an array: solved once for all parts, and images with light from others are refused."""

import json
from concurrent.futures import Future
from contextlib import contextmanager
from dataclasses import replace
from pathlib import Path
from threading import Event
from typing import Any

import numpy as np
import pytest
from support import tiny
from support.handed import contents
from support.tiny import WALK

from framearray_cli.array.celltable import FILE, HEAD, CellTable, read_table, remove_table, table_file, write_table
from framearray_cli.array.integrity import verify
from framearray_cli.array.manifest_toml import read_manifest
from framearray_cli.array.record import FOLDER, read_records, record_files, seal, unseal
from framearray_cli.base.errors import OutputError
from framearray_cli.cli.commands.verify import verified_lines
from framearray_cli.engine.terms.cells.lookup import are_sound
from framearray_cli.job.job import Job
from framearray_cli.render import cells, plan
from framearray_cli.render.cells import NAMES, SharedCells
from framearray_cli.render.estimate import check, cost_lines
from framearray_cli.render.events import FramesBegun
from framearray_cli.render.parts import run as parts
from framearray_cli.render.parts.chunk import render_chunk
from framearray_cli.render.render import render

OTHER = "sha256:" + 64 * "0"


@pytest.fixture
def solved(monkeypatch: pytest.MonkeyPatch) -> list[str]:
    """What was solved and compared, in turn."""
    return _counted(monkeypatch)


def _counted(monkeypatch: pytest.MonkeyPatch, factor: float = 1.0) -> list[str]:
    """Count what is solved and compared; `factor`: of the light, as if another machine rounded differently."""
    done, build, compare = list[str](), plan.build_cells, plan.compare_with_paths

    def count_build(work: Any) -> Any:
        done.append("solve")
        built = build(work)
        built.cells.light[:] *= np.float32(factor)
        return built

    def count_comparison(*given: Any) -> Any:
        done.append("compare")
        return compare(*given)

    monkeypatch.setattr(plan, "build_cells", count_build)
    monkeypatch.setattr(plan, "compare_with_paths", count_comparison)
    return done


def job(scene: Path, out: Path, **more: Any) -> Job:
    tables = {"scene": {"background": [0.3, 0.4, 0.5]}, "camera": WALK | {"resolution": [8, 6]}, "reuse": {"n_r": 1}}
    return tiny.job_of_file(scene, out, **tables | {"indirect": tiny.CELLS} | more)


def digests(folder: Path) -> set[str]:
    return {run.cells for run in read_records(folder, read_manifest(folder).fingerprint).runs}


def key_of(folder: Path) -> str:
    with np.load(table_file(folder)) as found:
        return str(json.loads(found[HEAD].tobytes())["key"])


def with_digest(record: Path, digest: str) -> None:
    """Have a record say that its runs had other cells."""
    lines = [line for line in map(unseal, record.read_bytes().splitlines()) if line]
    lines = [line | ({"cells": digest} if "fingerprint" in line else {}) for line in lines]
    record.write_bytes(b"".join(seal(line) + b"\n" for line in lines))


def test_parts_use_one_table_and_it_goes_with_the_last(scene: Path, tmp_path: Path, solved: list[str]) -> None:
    first = render(job(scene, tmp_path), cameras=(0, 1))
    assert solved == ["solve", "compare"]
    assert table_file(tmp_path).is_file()
    del solved[:]
    second = render(job(scene, tmp_path), cameras=(2,))
    last = render(job(scene, tmp_path))
    assert not solved and len(digests(tmp_path)) == 1
    assert first.notes == second.notes == last.notes == tuple(read_manifest(tmp_path).summary["notes"])
    assert [file.name for file in (tmp_path / FOLDER).iterdir() if not file.name.endswith((".jsonl", ".guard"))] == []


def test_jobs_without_cells_keep_none(scene: Path, tmp_path: Path, solved: list[str]) -> None:
    for name, table in (("a", {"method": "obscurance"}), ("b", {"method": "cells", "exact": True})):
        render(job(scene, tmp_path / name, indirect=table), cameras=(0,))
        assert not solved and not table_file(tmp_path / name).exists()


def test_coarse_pictures_leave_the_table_alone(scene: Path, tmp_path: Path) -> None:
    for name, coarse in (("a", False), ("b", True)):
        render(job(scene, tmp_path / name), cameras=(0,), coarse=coarse)
    assert digests(tmp_path / "a") == digests(tmp_path / "b")


@pytest.mark.parametrize("harm", ["flip", "cut", "garbage", "empty", "folder", "key"])
def test_a_damaged_table_is_solved_again(harm: str, scene: Path, tmp_path: Path, solved: list[str]) -> None:
    render(job(scene, tmp_path), cameras=(0,))
    file = table_file(tmp_path)
    data = file.read_bytes()
    key = key_of(tmp_path)
    known = read_table(tmp_path, key)
    assert known
    harmed = {
        "flip": data[: len(data) // 2] + bytes([data[len(data) // 2] ^ 4]) + data[len(data) // 2 + 1 :],
        "cut": data[:-1],
        "garbage": b"\xff\n" * 100,
        "empty": b"",
    }
    file.unlink()
    if harm == "folder":
        file.mkdir()
        with pytest.raises(OutputError, match=FILE):
            render(job(scene, tmp_path), cameras=(1,))
        return
    if harm == "key":
        write_table(tmp_path, replace(known, key=OTHER))
    else:
        file.write_bytes(harmed[harm])
    del solved[:]
    render(job(scene, tmp_path), cameras=(1,))
    assert solved == ["solve", "compare"]
    again = read_table(tmp_path, key)
    assert again and again.digest == known.digest


def test_a_table_of_other_cells_than_those_of_the_images_is_replaced(
    scene: Path, tmp_path: Path, solved: list[str]
) -> None:
    """As a run leaves it on a machine that rounds differently, whose images have gone."""
    render(job(scene, tmp_path), cameras=(0,))
    found = read_table(tmp_path, key_of(tmp_path))
    assert found
    found.numbers["light"][:] *= np.float32(1.001)
    mine = cells._from_table(found, 3)
    assert mine is None, "its digest is not that of its numbers"
    write_table(tmp_path, CellTable(key=found.key, digest=OTHER, note="", accuracy={}, numbers=found.numbers))
    del solved[:]
    render(job(scene, tmp_path), cameras=(1,))
    again = read_table(tmp_path, found.key)
    assert solved == ["solve", "compare"] and again and again.digest == found.digest


def test_a_run_with_other_cells_is_refused_and_leaves_nothing(
    scene: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    render(job(scene, tmp_path), cameras=(0,))
    before, (record,) = contents(tmp_path), record_files(tmp_path)
    remove_table(tmp_path)
    _counted(monkeypatch, 1.001)
    with pytest.raises(OutputError, match=r"processors of another kind.*another version.*damaged; render the rest"):
        render(job(scene, tmp_path), cameras=(1, 2))
    assert contents(tmp_path) == before and record_files(tmp_path) == [record] and not table_file(tmp_path).exists()


@pytest.mark.parametrize("seen", [True, False])
def test_of_two_parts_with_different_cells_one_fails(
    seen: bool, scene: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """Also where a part does not see at its beginning what the other one has noted, on a slow network disk."""
    failed = []

    def other() -> None:
        remove_table(tmp_path)
        with monkeypatch.context() as patched:
            _counted(patched, 1.001)
            if not seen:
                patched.setattr(SharedCells, "require_same", lambda *_: None)
            try:
                render(job(scene, tmp_path), cameras=(2, 3))
            except OutputError as error:
                failed.append(str(error))

    def during(event: object) -> None:
        if isinstance(event, FramesBegun):
            other()

    try:
        render(job(scene, tmp_path), during, cameras=(0, 1))
    except OutputError as error:
        failed.append(str(error))
    assert len(failed) == 1
    assert ("expected the cells of the images that are there" if seen else "expected the same cells") in failed[0]


def test_two_parts_that_solve_at_once_take_what_was_kept_first(
    scene: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    build, begun = plan.build_cells, Event()

    def meanwhile(work: Any) -> Any:
        if not begun.is_set():
            begun.set()
            render(job(scene, tmp_path), cameras=(2, 3))
            built = build(work)
            built.cells.light[:] *= np.float32(1.001)
            return built
        return build(work)

    monkeypatch.setattr(plan, "build_cells", meanwhile)
    render(job(scene, tmp_path), cameras=(0, 1))
    assert len(digests(tmp_path)) == 1


def test_mixed_records_are_refused_where_the_array_is_summed_up(scene: Path, tmp_path: Path) -> None:
    for part in ((0, 1), (2, 3, 4, 5)):
        render(job(scene, tmp_path), cameras=part)
    assert verify(tmp_path, 2, lambda *_: None).whole
    with_digest(record_files(tmp_path)[0], OTHER)
    with pytest.raises(OutputError, match="expected the same cells of all images"):
        render(job(scene, tmp_path))
    found = verify(tmp_path, 2, lambda *_: None)
    assert not found.whole and not found.wrong
    (line,) = verified_lines(found)
    assert "got sha256:000000000000 in records/0-1.jsonl" in line and "remove records/2-5.jsonl" in line
    record_files(tmp_path)[0].unlink()
    render(job(scene, tmp_path))
    assert verify(tmp_path, 2, lambda *_: None).whole


def test_restart_removes_the_table_and_what_killed_runs_left(scene: Path, tmp_path: Path) -> None:
    render(job(scene, tmp_path), cameras=(0,))
    left = tmp_path / FOLDER / f".{FILE}.01234567.part"
    left.touch()
    key, table = key_of(tmp_path), {"method": "cells", "samples": 2048}
    render(job(scene, tmp_path, indirect=table), cameras=(0,), restart=True)
    assert key_of(tmp_path) != key and not left.exists()


def test_check_knows_the_size_of_the_table(scene: Path, tmp_path: Path) -> None:
    whole = job(scene, tmp_path)
    found = check(whole)
    render(whole, cameras=(0,))
    assert found.disk_cells == pytest.approx(table_file(tmp_path).stat().st_size, rel=0.05)
    assert "of cells until it is finished" in cost_lines(found)[1]


def test_cells_from_a_file_are_checked_before_kernels_read_them() -> None:
    inputs = tiny.prepared(tiny.job(indirect={"method": "cells", "samples": 1024}))
    with tiny.planned(inputs) as (setup, _):
        good = setup.indirect.cells
    assert good and are_sound(good, inputs.n_lights) and not are_sound(good, inputs.n_lights + 1)
    beyond = np.int32(len(good.other))
    far = good.slots.copy()
    far[1::2] = beyond
    for harmed in (
        good._replace(slots=far),
        good._replace(slots=good.slots[:-2]),
        good._replace(slots=np.zeros_like(good.slots)),
        good._replace(other=np.full_like(good.other, beyond)),
        good._replace(other=np.full_like(good.other, -2)),
        good._replace(tint=good.tint[1:]),
        good._replace(light=good.light.astype(np.float64)),
        good._replace(grid=good.grid._replace(edge=float("nan"))),
        *(good._replace(**{name: getattr(good, name)[..., None]}) for name in NAMES if name != "slots"),
    ):
        assert not are_sound(harmed, inputs.n_lights)


class _Here:
    """A crew of one worker: this process."""

    def count(self) -> int:
        return 1

    def require_fit(self, common: dict[str, Any]) -> None: ...

    def listen(self, topic: str, receive: Any) -> None:
        self._receive = receive

    def submit(self, common: dict[str, Any], cameras: tuple[int, ...]) -> Any:
        chunk: Future[dict[str, Any]] = Future()
        chunk.set_result(render_chunk(common, cameras, 1, self._receive, Event()))
        return chunk

    def result(self, handed: Any) -> dict[str, Any]:
        found: dict[str, Any] = handed.result()
        return found

    def cancel(self, handed: Any) -> None: ...


def test_workers_take_the_cells_of_the_program_that_hands_out_the_chunks(
    scene: Path, tmp_path: Path, solved: list[str], monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(parts, "start_local", contextmanager(lambda _: iter([_Here()])))
    summary = parts.render_in_parts(job(scene, tmp_path), parts.WorkerOptions(chunk=2))
    assert solved == ["solve", "compare"]
    assert sum("differs from paths" in note for note in summary.notes) == 1
    assert read_manifest(tmp_path).summary["finished"] and not table_file(tmp_path).exists()
    render(job(scene, tmp_path / "whole"))
    assert contents(tmp_path) == contents(tmp_path / "whole") != {}
