"""Renders from Python: events, cancelling, jobs of every kind."""

import threading
from pathlib import Path

import numpy as np
import pytest
from support.public import N_C, table, write_job

import framearray
from framearray import JobError, SceneError
from framearray_cli.array.manifest_toml import read_manifest


@pytest.fixture(scope="module")
def job(tmp_path_factory: pytest.TempPathFactory) -> Path:
    return write_job(tmp_path_factory.mktemp("job"))


@pytest.fixture(scope="module")
def rendered(job: Path) -> tuple[framearray.FrameArray, list[framearray.Event]]:
    """The array, and the events of its render, which came one by one in this thread."""
    events: list[framearray.Event] = []
    here = threading.get_ident()

    def note(event: framearray.Event) -> None:
        assert threading.get_ident() == here
        events.append(event)

    return framearray.render(job, on_event=note), events


def test_events_tell_a_render(rendered: tuple[framearray.FrameArray, list[framearray.Event]]) -> None:
    array, events = rendered
    assert array.is_complete and array.folder.name == "array"
    first, last = events[0], events[-1]
    assert isinstance(first, framearray.Started) and isinstance(last, framearray.Finished)
    assert (first.name, first.cameras, first.images, first.resolution) == ("room", N_C, 28, (24, 18))
    assert first.folder == array.folder and first.triangles > 100
    assert last.summary.finished and last.summary.written == 28
    [scanned] = [event for event in events if isinstance(event, framearray.Scanned)]
    assert (scanned.kept, scanned.wanted, scanned.damaged) == (0, 28, {})
    frames = [event.camera for event in events if isinstance(event, framearray.FrameWritten)]
    assert sorted(frames) == list(range(N_C))
    progress = [event for event in events if isinstance(event, framearray.Progress)]
    written = [event.written for event in progress]
    assert written == sorted(written) and written[-1] == 28 and {event.wanted for event in progress} == {28}
    assert any("triangles" in event.text for event in events if isinstance(event, framearray.Noted))


def test_a_cancelled_render_goes_on_with_the_same_bytes(job: Path, rendered, tmp_path: Path) -> None:
    run = framearray.rendering(job, output=tmp_path, threads=1)
    for event in run:
        if isinstance(event, framearray.FrameWritten):
            break
    with pytest.raises(framearray.RenderCancelled, match="room: the render was cancelled"):
        run.result()
    there = framearray.open(tmp_path)
    assert not there.is_complete and not there.summary["finished"] and there.summary["images"] > 0
    with pytest.raises(RuntimeError, match="can be read once"):
        next(iter(run))
    kept: list[int] = []
    framearray.render(
        job, output=tmp_path, on_event=lambda e: kept.append(e.kept) if isinstance(e, framearray.Scanned) else None
    )
    assert kept == [there.summary["images"]]
    whole, _ = rendered
    images = sorted(file.name for file in whole.folder.glob("*.exr"))
    assert images == sorted(file.name for file in tmp_path.glob("*.exr"))
    assert all((whole.folder / name).read_bytes() == (tmp_path / name).read_bytes() for name in images)


def test_an_error_in_a_callback_ends_the_render(job: Path, tmp_path: Path) -> None:
    def fail(event: framearray.Event) -> None:
        raise KeyboardInterrupt

    with pytest.raises(KeyboardInterrupt):
        framearray.render(job, output=tmp_path / "out", on_event=fail)
    assert not [thread for thread in threading.enumerate() if thread.name == "framearray-render"]


def test_a_render_that_is_cancelled_before_it_begins_reads_nothing(job: Path, tmp_path: Path) -> None:
    run = framearray.rendering(job, output=tmp_path / "out")
    run.cancel()
    with pytest.raises(framearray.RenderCancelled):
        run.result()
    assert not (tmp_path / "out").exists()


def test_jobs_as_tables_and_with_options(job: Path, rendered, tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.chdir(job.parent)
    tables = table()
    tables["camera"]["resolution"] = np.array([24, 18])  # arrays and tuples do, too
    array = framearray.render(tables, output=tmp_path, cameras="1-2", sets=["name=other"])
    assert array.name == "other" and not array.is_complete
    whole, _ = rendered
    np.testing.assert_array_equal(array.picture(1, 2), whole.picture(1, 2))
    with pytest.raises(framearray.OutputError, match="no such file"):
        array.picture(0, 2)
    wanted = "choose another folder with output=..., or remove that array with restart=True$"
    with pytest.raises(framearray.OutputError, match=wanted):
        framearray.render(job, output=tmp_path)
    assert read_manifest(tmp_path).name == "other"


@pytest.mark.parametrize(
    ("given", "options", "error", "message"),
    [
        ({"name": "x"}, {}, JobError, "job: camera: missing"),
        ("nowhere.toml", {}, JobError, "nowhere.toml: no such file"),
        (None, {"cameras": [4]}, JobError, r"cameras: expected one of 4 camera positions \(0 to 3"),
        (None, {"cameras": []}, JobError, "^cameras: expected at least one camera position, got an empty list"),
        (None, {"cameras": "9"}, JobError, "^cameras: expected one of 4 camera positions"),
        (None, {"threads": 0}, JobError, "^threads: expected a whole number from 1 to 1024, got 0$"),
        (None, {"sets": "hits"}, JobError, '^sets: expected KEY=VALUE, .*, got "hits"$'),
        (None, {"sets": ["camera.fov=wide"]}, JobError, r"\(given by sets camera.fov=wide\)"),
        (None, {"sets": ['scene.file="none.glb"']}, SceneError, "none.glb"),
    ],
)
def test_jobs_that_cannot_be_rendered(job: Path, given, options, error, message, tmp_path: Path) -> None:
    with pytest.raises(error, match=message):
        framearray.render(given or job, output=tmp_path / "out", **options)
    assert not (tmp_path / "out").exists()


def test_a_job_is_checked_without_a_file(job: Path) -> None:
    checked = framearray.check(job)
    assert checked.array.images == 28 and checked.array.resolution == (24, 18)
    assert framearray.check(job, sets="camera.resolution=[12, 9]").array.resolution == (12, 9)
    assert checked.scene.triangles > 100 and checked.seconds > 0 and isinstance(checked.warnings, tuple)


def test_every_public_name_is_there() -> None:
    """The list for type checkers, that of `__all__` and that of `dir` agree."""
    assert set(dir(framearray)) == set(framearray.__all__)
    assert all(getattr(framearray, name) is not None for name in framearray.__all__)
    with pytest.raises(AttributeError, match="has no attribute 'nothing'"):
        getattr(framearray, "nothing")  # noqa: B009  # what a user would write as an attribute
