"""Strips of rows: the images of all features have the same bytes as whole frames, whatever stops a render between."""

import gc
import re
import weakref
from contextlib import ExitStack
from pathlib import Path
from typing import Any

import numpy as np
import pytest
import tomli_w
from fuzz import jobseeds
from support import tiny
from support.divided import in_strips
from support.handed import contents

import framearray
import framearray_cli.render.division as dividing
from framearray_cli.array.folder import ArrayFolder
from framearray_cli.array.images import read_image
from framearray_cli.array.stripfiles import strip_files, write_strip
from framearray_cli.base.errors import OutputError
from framearray_cli.engine.frames.reach import NOWHERE
from framearray_cli.job.job import Job
from framearray_cli.render.division import _pilot_reach, _share, divide, look_at_hits
from framearray_cli.render.memory import window_memory
from framearray_cli.render.render import render
from framearray_cli.render.writer import ArrayWriter

TALL = tiny.walk(3, resolution=[64, 512], fov=120.0)
METHODS = {"method": "obscurance"}, {"method": "cells", "samples": 1024}


def written(folder: Path, table: dict[str, Any]) -> dict[str, bytes]:
    file = folder.with_suffix(".toml")
    file.write_text(tomli_w.dumps(table))
    framearray.render(file, output=folder, threads=2)
    return contents(folder)


def job(scene: Path, out: Path, form: str = "exr", **changes: Any) -> Job:
    tables = {"camera": tiny.walk(5, resolution=[40, 150]), "output": {"format": form}, "reuse": {"n_r": 1}}
    return tiny.job_of_file(scene, out, **tables | changes)


def thin_slices(patch: pytest.MonkeyPatch) -> None:
    for name in ("SLICE_BYTES", "FILED_BYTES"):
        patch.setattr(f"framearray_cli.render.rows.{name}", 1)


def test_all_features_have_the_same_bytes(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    tables = jobseeds.tables(str(jobseeds.with_scene(tmp_path)))
    for name, table in tables.items():
        if table.get("samples", {}).get("halves"):  # these are divided into blocks of light positions
            continue
        for k, method in enumerate(METHODS):
            resolution = [260, 130] if "around" in name else [40, 150]  # three strips, the last one thin
            given = {**table, "indirect": method, "camera": {**table["camera"], "resolution": resolution}}
            whole = written(tmp_path / f"{name}-{k}-whole", given)
            with monkeypatch.context() as patch:
                patch.setattr(dividing, "divide", in_strips(128 if k else 64))
                thin_slices(patch)
                found = written(tmp_path / f"{name}-{k}-strips", given)
            assert found.keys() == whole.keys(), name
            assert [file for file in whole if whole[file] != found[file]] == [], (name, method)
            assert strip_files(tmp_path / f"{name}-{k}-strips") == []


@pytest.fixture(scope="module")
def whole(scene: Path, tmp_path_factory: pytest.TempPathFactory) -> Path:
    out = tmp_path_factory.mktemp("whole")
    render(job(scene, out))
    return out


@pytest.mark.parametrize("form", ["exr", "png", "tif"])
def test_a_render_that_stopped_goes_on_with_the_rows_that_are_there(
    scene: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch, form: str
) -> None:
    render(job(scene, tmp_path / "whole", form))
    monkeypatch.setattr(dividing, "divide", in_strips(64))
    seen, found, stops = list[tuple[int, int]](), ArrayWriter.write, [3, 7, 12, 99]

    def write(self: Any, composed: Any, *given: Any) -> None:
        if len(seen) == stops[0]:
            stops.pop(0)
            raise OutputError("stopped by the test")
        seen.append((composed.c, len(composed.images[0])))
        found(self, composed, *given)

    monkeypatch.setattr(ArrayWriter, "write", write)
    while len(stops) > 1:
        with pytest.raises(OutputError, match="stopped by the test"):
            render(job(scene, tmp_path / "strips", form))
        assert strip_files(tmp_path / "strips")
    render(job(scene, tmp_path / "strips", form))
    assert contents(tmp_path / "strips") == contents(tmp_path / "whole")
    assert len(seen) < 15 + 2 + 3 * 2  # of frames that were composed when the render stopped some are lost
    assert strip_files(tmp_path / "strips") == []


def test_a_damaged_file_is_named_and_rendered_again(
    scene: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch, whole: Path
) -> None:
    stopped(job(scene, tmp_path), monkeypatch, 64)
    monkeypatch.setattr(dividing, "divide", in_strips(64))
    file = strip_files(tmp_path)[0]
    data = bytearray(file.read_bytes())
    data[len(data) // 2] ^= 255
    file.write_bytes(data)
    with pytest.raises(OutputError, match=f"{file.name}: is damaged, and was removed; run the same command again"):
        render(job(scene, tmp_path))
    render(job(scene, tmp_path))
    assert contents(tmp_path) == contents(whole)


def stopped(job: Job, monkeypatch: pytest.MonkeyPatch, rows: int, **given: Any) -> dict[str, int]:
    """Stop a render with strips before the last ones, and return when each file was written, by name."""
    with monkeypatch.context() as patch:
        patch.setattr(dividing, "divide", in_strips(rows))
        patch.setattr(ArrayWriter, "_write_image", lambda *_: (_ for _ in ()).throw(OutputError("stopped")))
        with pytest.raises(OutputError, match="stopped"):
            render(job, **given)
    return {file.name: file.stat().st_mtime_ns for file in strip_files(job.output.directory)}


def ends(names: Any) -> set[str]:
    return {re.sub(r"^strip-\w+-", "", name) for name in names}


def test_rows_that_the_division_of_today_cannot_use_are_removed(
    scene: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch, whole: Path
) -> None:
    """Those of cameras that another run may render stay."""
    one = job(scene, tmp_path)
    left = tmp_path / "records" / ".strip-0123456789abcdef-1-0-64.npz.89abcdef.part"
    first = stopped(one, monkeypatch, 96)
    assert ends(first) == {f"{c}-0-96.npz" for c in range(5)}
    left.write_bytes(b"")
    later = stopped(one, monkeypatch, 64, cameras=range(2))
    assert ends(later) == {f"{c}-{rows}.npz" for c in range(2) for rows in ("0-64", "64-128")} | {
        f"{c}-0-96.npz" for c in range(2, 5)
    }
    assert first.items() >= {name: time for name, time in later.items() if "-0-96" in name}.items()
    assert not left.exists()
    again = stopped(one, monkeypatch, 64, cameras=range(2))
    assert again == later  # what the division of today can use stays
    render(one, cameras=range(2, 5))  # without strips
    assert ends(file.name for file in strip_files(tmp_path)) == ends(name for name in later if "-0-96" not in name)
    render(one)
    assert contents(tmp_path) == contents(whole)
    assert strip_files(tmp_path) == []


def test_rows_of_a_camera_at_rest_stay_while_another_run_goes_on(
    scene: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """All runs share them."""
    camera = tiny.WALK | {"resolution": [40, 150], "frames": 5, "keys": tiny.WALK["keys"][:1]}
    one, folder = job(scene, tmp_path, camera=camera), ArrayFolder(tmp_path)
    first = stopped(one, monkeypatch, 96)
    with folder.exclusive(), ExitStack() as held:
        held.enter_context(folder.reserve([3, 4], "3-4"))
        keep = held.pop_all()
    with keep:
        assert stopped(one, monkeypatch, 64, cameras=range(2)).items() > first.items()
        render(one, cameras=[2])
        assert stopped(one, monkeypatch, 64, cameras=range(2)).items() > first.items()
    assert ends(stopped(one, monkeypatch, 64, cameras=range(2))) == {"0-0-64.npz", "0-64-128.npz"}
    render(one)
    assert strip_files(tmp_path) == []


@pytest.mark.parametrize("rows", [64, 200])
def test_values_beyond_a_half_are_kept(scene: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch, rows: int) -> None:
    """An image with some of them has floats, and the same bits however its rows are divided."""
    keys: Any = tiny.RED["keys"]
    light = {"sources": [tiny.RED | {"keys": [key | {"intensity": 3e6} for key in keys]}], "frames": 2}
    render(job(scene, tmp_path / "whole", light=light))
    render(job(scene, tmp_path / "exact", light=light, output={"half": "never"}))
    monkeypatch.setattr(dividing, "divide", in_strips(rows))
    thin_slices(monkeypatch)
    render(job(scene, tmp_path / "parts", light=light))
    assert contents(tmp_path / "parts") == contents(tmp_path / "whole")
    found = [read_image(file) for file in sorted((tmp_path / "whole").glob("tiny.c*.exr"))]
    assert max(image.max() for image in found) > 65504
    for image, file in zip(found, sorted((tmp_path / "exact").glob("tiny.c*.exr")), strict=True):
        expected = read_image(file)
        np.testing.assert_allclose(image, expected, rtol=0.02, atol=expected.mean() / 100)


@pytest.mark.parametrize("form", ["exr", "png", "jpg", "tif"])
def test_frames_are_coded_slice_by_slice(
    scene: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch, form: str
) -> None:
    """Slices change no byte, and no block has a whole image; what is not coded waits in files, which go."""
    render(job(scene, tmp_path / "whole", form))
    thin_slices(monkeypatch)
    heights, files, write = set[int](), list[Path](), ArrayWriter.write

    def watch(self: Any, composed: Any, cameras: Any, block: Any) -> None:
        heights.add(block.shape[1])
        write(self, composed, cameras, block)

    def watch_files(path: Path, *given: Any) -> None:
        files.append(path)
        write_strip(path, *given)

    monkeypatch.setattr(ArrayWriter, "write", watch)
    monkeypatch.setattr("framearray_cli.render.writer.write_strip", watch_files)
    render(job(scene, tmp_path / "slices", form))
    assert contents(tmp_path / "slices") == contents(tmp_path / "whole")
    assert heights == {64}
    assert len(files) == (5 * 2 if form == "tif" else 0)
    assert strip_files(tmp_path / "slices") == []


def test_the_memory_of_a_strip_is_free_before_the_next_one(
    scene: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """Also before Python looks for cycles of objects that nothing else refers to."""
    monkeypatch.setattr(dividing, "divide", in_strips(64))
    writers, begin = list[Any](), ArrayWriter.__init__

    def watch(self: Any, *given: Any, **named: Any) -> None:
        if given[0].directory == tmp_path:
            assert not any(writer() for writer in writers)
            writers.append(weakref.ref(self))
        begin(self, *given, **named)

    monkeypatch.setattr(ArrayWriter, "__init__", watch)
    gc.disable()
    try:
        render(job(scene, tmp_path))
    finally:
        gc.enable()
    assert len(writers) == 3


def test_a_restart_removes_the_rows(scene: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    old = stopped(job(scene, tmp_path), monkeypatch, 64)
    new = stopped(job(scene, tmp_path), monkeypatch, 64, restart=True)
    assert new.keys() == old.keys() and set(old.values()).isdisjoint(new.values())


def test_a_strip_that_pilots_do_not_meet_has_no_hits() -> None:
    with tiny.planned(tiny.prepared(tiny.job(camera=TALL))) as (setup, _):
        share = _share(setup, range(64, 128), (np.full((1, 1, 2), NOWHERE),), look_at_hits(setup, 1))
    assert share.hits == share.shown == 0


def test_a_render_is_divided_as_little_as_memory_allows(scene: Path, tmp_path: Path, monkeypatch: Any) -> None:
    """Each strip fits, none would with 64 rows more; together they hold every row once."""
    monkeypatch.setattr("framearray_cli.render.memory.program_memory", lambda: 0)
    inputs, found = tiny.prepared(job(scene, tmp_path, camera=TALL)), []
    with tiny.planned(inputs) as (setup, _):
        look = look_at_hits(setup, 1)
        whole = window_memory(inputs, 3, look)
        for limit in (whole, whole - 1, 0.7 * whole, 0.5 * whole):
            few = tiny.prepared(job(scene, tmp_path, camera=TALL, render={"memory": int(limit), "threads": 2}))
            division = divide(few, setup)
            assert [row for rows in division.strips for row in rows] == list(range(TALL["resolution"][1]))
            assert division.memory <= limit and division.blocks == [range(3)]
            for rows in division.strips[:-1]:
                longer = _share(setup, range(rows.start, min(rows.stop + 64, 512)), _pilot_reach(setup, 1), look)
                assert window_memory(few, 3, look, share=longer) > limit
            found.append(division)
    assert [len(division.strips) for division in found] == sorted(len(division.strips) for division in found)
    assert len(found[0].strips) == 1 and found[0].text == "" and found[0].hits == 1
    assert len(found[1].strips) == 2 and len(found[3].strips) > 2
    assert re.fullmatch(
        r"rendered in 2 strips of rows, which find \d+ % more hits; whole with \d+\.\d+ GiB of memory", found[1].text
    )
