"""Disks that are full or read-only, also as standard output."""

import os
import shutil
import subprocess
import tomllib
from collections.abc import Iterator
from pathlib import Path

import pytest
from support import tiny
from support.program import complete, finish, names, start, write_job

FULL = Path("/dev/full")


@pytest.fixture
def disk(tmp_path: Path) -> Iterator[Path]:
    """Mount a disk of 2 MB."""
    folder = tmp_path / "disk"
    folder.mkdir()
    mount = shutil.which("mount")
    if (
        mount is None
        or subprocess.run([mount, "-t", "tmpfs", "-o", "size=2m", "tmpfs", str(folder)], capture_output=True).returncode
    ):
        pytest.skip("this user may not mount a small disk")
    yield folder
    subprocess.run(["umount", str(folder)], check=True)


@pytest.mark.parametrize(
    "file_format", ["exr", "png", *(pytest.param(f, marks=pytest.mark.slow) for f in ("tif", "jpg"))]
)
def test_a_disk_that_becomes_full(file_format, disk, tmp_path):
    camera = tiny.WALK | {"resolution": [120, 90], "frames": N}
    output = {"format": file_format, "directory": "disk/out"}
    result = finish(start("render", "-q", write_job(tmp_path, camera=camera, output=output)))
    assert (result.code, result.out) == (4, "")
    lines = result.err.splitlines()
    assert lines[0].startswith(f"{disk / 'out'}{os.sep}")
    assert ": cannot be written: " in lines[0]
    assert lines[1].endswith(" are free on that disk")
    out = disk / "out"
    assert not list(out.glob(".*"))
    images = len(list(out.glob("*.l[0-9]*.*")))
    assert lines[2].startswith(f"{images} of {3 * N} images were written to {out}; ")
    summary = tomllib.loads((out / "manifest.toml").read_text())["summary"]
    assert summary["finished"] is False
    # without space for a new manifest the one from the start stays
    assert summary["images"] % 3 == 0 and summary["images"] <= images


N = 20  # frames; with three lights and layers more than the disk holds


def test_a_render_goes_on_once_there_is_space(disk, tmp_path):
    camera = tiny.WALK | {"resolution": [120, 90], "frames": N}
    whole = write_job(tmp_path, camera=camera, output={"format": "exr", "directory": "whole"})
    complete("render", "-q", whole)
    job = write_job(tmp_path, "job2.toml", camera=camera, output={"format": "exr", "directory": "disk/out"})
    assert finish(start("render", "-q", job)).code == 4
    subprocess.run(["mount", "-o", "remount,size=64m", str(disk)], check=True)
    complete("render", "-q", job)

    def contents(folder: Path) -> dict[str, bytes]:
        return {file.name: file.read_bytes() for file in folder.glob("tiny.*")}

    assert contents(disk / "out") == contents(tmp_path / "whole")
    assert len(contents(disk / "out")) == N * 4


def test_a_disk_that_is_full(disk, tmp_path):
    (disk / "fill").write_bytes(b"")
    with pytest.raises(OSError, match="No space left"), (disk / "fill").open("ab", buffering=0) as file:
        while file.write(bytes(65536)):
            pass
    (disk / "out").mkdir()
    result = finish(start("render", "-q", write_job(tmp_path, output={"directory": "disk/out"})))
    assert (result.code, result.out) == (4, "")
    assert result.err.splitlines()[0].endswith("cannot be written: No space left on device")
    assert names(disk / "out") <= {"records"}


def test_a_disk_that_is_read_only(disk, tmp_path):
    subprocess.run(["mount", "-o", "remount,ro", str(disk)], check=True)
    result = finish(start("render", "-q", write_job(tmp_path, output={"directory": "disk/out"})))
    assert (result.code, result.out) == (4, "")
    assert result.err.startswith(f"{disk / 'out'}: cannot make the folder: Read-only file system\n")


@pytest.mark.skipif(os.name == "nt" or (hasattr(os, "geteuid") and os.geteuid() == 0), reason="root may write anywhere")
def test_a_folder_that_may_not_be_written_to(tmp_path):
    (tmp_path / "out").mkdir(mode=0o555)
    result = finish(start("render", "-q", write_job(tmp_path)))
    assert (result.code, result.err) == (4, f"{tmp_path / 'out'}: cannot be written to: Permission denied\n")


@pytest.mark.skipif(not FULL.exists(), reason="no /dev/full")
@pytest.mark.parametrize("command", [["schema"], ["--version"], ["render", "job.toml"], ["check", "job.toml"]])
def test_output_that_cannot_be_printed(command, tmp_path):
    write_job(tmp_path)
    with FULL.open("w") as full:
        result = finish(start(*command, stdout=full, cwd=tmp_path))
    assert result.code == 4
    assert result.err.splitlines()[-1] == "standard output: cannot be written: No space left on device"


@pytest.mark.skipif(os.name == "nt", reason="no such pipes there")
def test_output_that_nobody_reads(tmp_path):
    process = start("check", write_job(tmp_path))
    assert process.stdout is not None
    process.stdout.close()
    assert process.stderr is not None
    assert "Traceback" not in process.stderr.read()
    assert process.wait(60) == 141
    process.stderr.close()
