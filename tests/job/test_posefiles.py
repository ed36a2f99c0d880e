"""Camera positions from transforms.json: conventions, round trips with our exports, messages."""

import json
import re
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest
import tomli_w
from support import tiny
from support.boxarrays import EYES, RESOLUTION, plain_manifest
from support.guide import job_file

from framearray_cli.array.manifest import Manifest, manifest_camera, matrix_rows
from framearray_cli.base.errors import JobError
from framearray_cli.base.forms.toml import inline
from framearray_cli.base.lens import Lens
from framearray_cli.job.camera import pose_key
from framearray_cli.job.job import Job
from framearray_cli.job.read import job_table, read_job
from framearray_cli.scene.paths.paths import Eyes, eyes
from framearray_cli.tools.export.format import Export, Selection
from framearray_cli.tools.export.nerf import write_transforms

LENSES = {
    "one": (Lens(fov=50.0),) * 4,
    "zoom": tuple(Lens(fov=50.0 + 3.7 * c) for c in range(4)),
    "shift": tuple(Lens(fov=60.0, shift=(0.1 * c, -0.03)) for c in range(4)),
    "wide pixels": (Lens(fov=40.0, pixel_aspect=1.3, shift=(0.0, 0.25)),) * 4,
}
OTHERS = {
    "orthographic": tuple(Lens(type="orthographic", height=2.0 + c, shift=(0.1, 0.0)) for c in range(4)),
    "panorama": (Lens(type="panorama"),) * 4,
}


def array_of(folder: Path, lenses: tuple[Lens, ...]) -> Manifest:
    cameras = tuple(manifest_camera(matrix_rows(eye), lens) for eye, lens in zip(EYES, lenses, strict=True))
    size = (60, 30) if lenses[0].type == "panorama" else RESOLUTION
    return replace(plain_manifest(folder), cameras=cameras, resolution=size)


def job_of(file: Path, more: str = "") -> Job:
    """Read a job that takes its cameras from a file."""
    table = {key: value for key, value in tiny.table().items() if key != "camera"}
    return read_job(job_file(file.parent, tomli_w.dumps(table), f"[camera]\nfile = {inline(str(file))}\n{more}"))


def exported(folder: Path, manifest: Manifest) -> Path:
    """Write the cameras of an array under all lights, as its export does."""
    selection = Selection(manifest=manifest, cameras=(0, 1, 2, 3), lights=((0,), (2,)))
    frames = [replace(frame, file=f"{frame.name}.png") for frame in selection.frames]
    folder.mkdir(exist_ok=True)
    write_transforms(Export(folder=folder, selection=selection, frames=frames))
    return folder / "transforms.json"


def is_same(found: Eyes, lenses: tuple[Lens, ...]) -> None:
    """Poses and lenses to within rounding of float64."""
    np.testing.assert_allclose(found.world_from_camera, EYES, rtol=0, atol=2e-15 * 8)
    for lens, wanted in zip(found.lenses, lenses, strict=True):
        assert lens.type == wanted.type
        for name in ("fov", "height", "pixel_aspect"):
            assert getattr(lens, name) == pytest.approx(getattr(wanted, name), rel=1e-13)
        assert lens.shift == pytest.approx(wanted.shift, abs=1e-14)


@pytest.mark.parametrize("lens", [*LENSES, *OTHERS])
def test_what_exports_write_is_read_back(tmp_path: Path, lens: str) -> None:
    lenses = (LENSES | OTHERS)[lens]
    manifest = array_of(tmp_path, lenses)
    job = job_of(exported(tmp_path / "export", manifest))
    assert job.camera.resolution == manifest.resolution and job.camera.frames == 4
    is_same(eyes(job), lenses)
    assert Job.model_validate(job_table(job)) == job


def test_an_axis_too_many_is_seen(tmp_path: Path) -> None:
    """The comparison above fails if a reader flips an axis."""
    file = exported(tmp_path, array_of(tmp_path, LENSES["one"]))
    table = json.loads(file.read_text())
    for frame in table["frames"]:
        for row in frame["transform_matrix"][:3]:
            row[0], row[1] = -row[0], -row[1]
    file.write_text(json.dumps(table))
    with pytest.raises(AssertionError):
        is_same(eyes(job_of(file)), LENSES["one"])


def frame(**more: Any) -> dict[str, Any]:
    return {"file_path": "./train/r_0", "transform_matrix": EYES[0].tolist(), **more}


def test_angles_only_as_in_nerf_need_the_size(tmp_path: Path) -> None:
    file = tmp_path / "transforms.json"
    file.write_text(json.dumps({"camera_angle_x": 0.7, "frames": [frame(), frame(transform_matrix=EYES[1].tolist())]}))
    job = job_of(file, "resolution = [80, 40]")
    assert job.camera.fov == pytest.approx(np.degrees(2 * np.arctan(np.tan(0.35) / 2)))
    with pytest.raises(JobError, match=re.escape("frames[0]: w, h: missing; give the size of the pictures")):
        job_of(file)


def test_the_keys_of_a_job_count_more_than_those_of_the_file(tmp_path: Path) -> None:
    file = exported(tmp_path, array_of(tmp_path, LENSES["zoom"]))
    job = job_of(file, "fov = 33.0\nresolution = [120, 80]")
    assert {lens.fov for lens in eyes(job).lenses} == {33.0} and job.camera.resolution == (120, 80)


def test_pictures_of_another_shape_need_a_lens_shift_of_their_own(tmp_path: Path) -> None:
    file = exported(tmp_path, array_of(tmp_path, LENSES["shift"]))
    with pytest.raises(JobError, match=re.escape("camera.resolution: expected the shape of [60, 40]")):
        job_of(file, "resolution = [80, 80]")
    assert job_of(file, "resolution = [80, 80]\nshift = [0.0, 0.1]").camera.shift == (0.0, 0.1)
    assert job_of(file, "resolution = [90, 60]").camera.keys[3].shift == pytest.approx((0.3, -0.03))


@pytest.mark.parametrize("length", [1e-200, 1e200])
def test_poses_of_any_scale_are_poses(length: float) -> None:
    found = pose_key("frame 1", np.column_stack([np.eye(3) * length, [1.0, 2.0, 3.0]]).tolist())
    assert found == {"eye": [1.0, 2.0, 3.0], "target": [1.0, 2.0, 0.0], "up": [0.0, 1.0, 0.0]}


BAD: list[tuple[dict[str, Any], str]] = [
    ({"frames": [frame(k1=0.02)], "w": 4, "h": 3, "fl_x": 5}, "frames[0]: k1: expected no lens distor"),
    (
        {"frames": [frame()], "camera_model": "OPENCV_FISHEYE"},
        'ORTHOPHOTO, got "OPENCV_FISHEYE"; undistort the pictures first',
    ),
    ({"frames": [frame()], "w": 4, "h": 3}, "frames[0]: fl_x: missing"),
    ({"frames": [frame()], "w": 4, "h": 3, "fl_x": -5}, "fl_x: expected a positive number, got -5"),
    ({"frames": [{}]}, "frames[0]: transform_matrix: missing"),
    ({"frames": []}, "expected 1 to 100000 camera positions, got 0"),
    (
        {"frames": [frame(transform_matrix=np.diag([1, -1, 1, 1]).tolist())], "w": 4, "h": 3, "fl_x": 5},
        "frames[0]: transform_matrix: expected a rotation and a translation, got a matrix that shears or mirrors",
    ),
    (
        {"frames": [frame(w=4), frame(w=5)], "h": 3, "fl_x": 5},
        "frames[1]: expected cameras of one model and size, got 4 x 3 and 5 x 3",
    ),
]


@pytest.mark.parametrize(("content", "problem"), BAD)
def test_a_file_that_is_no_path_is_refused(tmp_path: Path, content: Any, problem: str) -> None:
    file = tmp_path / "transforms.json"
    file.write_text(json.dumps(content))
    with pytest.raises(JobError, match=re.escape(problem)) as error:
        job_of(file)
    assert "camera.file: " in str(error.value)


def test_the_file_in_a_folder_is_named(tmp_path: Path) -> None:
    folder, name = tmp_path / "poses", "transforms.json"
    folder.mkdir()
    with pytest.raises(JobError, match=r"expected a file, got a folder$"):
        job_of(folder)
    (folder / name).write_text("")
    with pytest.raises(JobError, match=re.escape(f'expected a file, got a folder; give the "{name}" in it')):
        job_of(folder)
