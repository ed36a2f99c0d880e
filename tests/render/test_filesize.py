"""Size of the files of an array against the free space of its disk, before the first frame is rendered."""

from pathlib import Path
from typing import Any

import pytest
from support import tiny

from framearray_cli.base.errors import JobError, OutputError
from framearray_cli.job.job import Job
from framearray_cli.render import trial
from framearray_cli.render.events import Event, Warned
from framearray_cli.render.render import render
from framearray_cli.render.trial import lacking_space

FRAMES = 6


def job(scene: Path, out: Path, **changes: Any) -> Job:
    camera = tiny.walk(FRAMES, resolution=[60, 45])
    return tiny.job_of_file(scene, out, camera=camera, output={"format": "exr", "compression": "none"}, **changes)


def warnings(job: Job, **given: Any) -> list[str]:
    found: list[str] = []

    def receive(event: Event) -> None:
        if isinstance(event, Warned):
            found.append(event.text)

    render(job, receive, **given)
    return found


def images(folder: Path) -> list[Path]:
    return [file for file in folder.iterdir() if file.suffix == ".exr"]


@pytest.fixture
def free(scene: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Any:
    """Have the disk hold a number of frames, besides those that are there."""
    render(job(scene, tmp_path / "whole"))
    frame = sum(file.stat().st_size for file in images(tmp_path / "whole")) / FRAMES

    def leave(frames: float) -> None:
        monkeypatch.setattr(trial, "free_space", lambda folder: int(frames * frame))

    return leave


def test_too_little_space_is_a_warning(scene: Path, tmp_path: Path, free: Any) -> None:
    free(FRAMES - 2)
    (text,) = warnings(job(scene, tmp_path / "out"))
    assert text.startswith("the images need about ") and text.endswith('free; output.compression = "dwaa" needs less')
    assert len(images(tmp_path / "out")) == len(images(tmp_path / "whole"))
    with pytest.raises(JobError, match="the images need about"):
        render(job(scene, tmp_path / "strict"), strict=True)


def test_files_that_are_there_need_no_space(scene: Path, tmp_path: Path, free: Any) -> None:
    render(job(scene, tmp_path / "out"), cameras=range(3))
    free(FRAMES - 2)
    assert warnings(job(scene, tmp_path / "out")) == []
    assert len(images(tmp_path / "out")) == len(images(tmp_path / "whole"))


def test_a_disk_without_space_for_the_first_frames_is_refused(scene: Path, tmp_path: Path, free: Any) -> None:
    free(2)
    with pytest.raises(OutputError, match=f"^{tmp_path / 'out'}: the images need about .* KiB, the disk has .* free; "):
        render(job(scene, tmp_path / "out"))
    assert images(tmp_path / "out") == []
    assert warnings(job(scene, tmp_path / "out"), cameras=[0]) == []  # a single frame fits


def test_a_large_disk_costs_no_trial(scene: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(trial, "frame_bytes", lambda *_: pytest.fail("was estimated"))
    assert warnings(job(scene, tmp_path)) == []


@pytest.mark.parametrize(
    ("changes", "remedy"),
    [
        ({"output": {"compression": "zip"}}, 'output.compression = "dwaa"'),
        ({"output": {"compression": "zip", "alpha": True}}, "a smaller camera.resolution"),
        ({"output": {"compression": "dwaa"}}, "a smaller camera.resolution"),
        ({"output": {"compression": "zip", "half": "never"}}, 'output.half = "auto"'),
        ({"output": {"format": "tif"}}, 'output.format = "exr"'),
        ({"output": {"format": "png"}}, "a smaller camera.resolution"),
    ],
)
def test_the_remedy_fits_the_job(changes: dict[str, Any], remedy: str) -> None:
    changes["output"] = {"format": "exr", **changes["output"]}
    text = lacking_space(tiny.job(**changes), 3 * 2**30, 2**30)
    assert text == f"the images need about 3.0 GiB, the disk has 1.0 GiB free; {remedy} needs less"
    assert lacking_space(tiny.job(**changes), 2**30, 2**30) == ""
