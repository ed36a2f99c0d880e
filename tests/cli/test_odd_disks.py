"""Disks and folders with a quota, without inodes, read-only, of another user, or with dangling links."""

import os
import re
import shutil
import subprocess
import sys
import tempfile
from collections.abc import Iterator
from contextlib import closing
from pathlib import Path

import pytest
from support import ROOT, tiny
from support.program import Result, finish, names, run, start, write_job
from support.smalldisk import mounted

pytestmark = pytest.mark.skipif(sys.platform != "linux", reason="disks are mounted in another way there")

WALK = tiny.WALK | {"resolution": [60, 45]}
LONG = "x" * 300
NOBODY = 65534


def contents(out: Path) -> dict[str, bytes]:
    return {file.name: file.read_bytes() for file in out.glob("tiny.*")}


@pytest.fixture
def array(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> Path:
    assert run(capsys, "render", "-q", write_job(tmp_path, camera=WALK, output={"format": "exr"})).code == 0
    return tmp_path / "out"


@pytest.fixture
def quota(tmp_path: Path) -> Iterator[Path]:
    """Make a folder that may hold 8 MB, on a larger disk: a Btrfs subvolume."""
    if not (shutil.which("mkfs.btrfs") and shutil.which("btrfs")):
        pytest.skip("no tools for Btrfs here")
    image, disk = tmp_path / "image", tmp_path / "btrfs"
    disk.mkdir()
    with image.open("wb") as file:
        file.truncate(300 * 2**20)
    subprocess.run(["mkfs.btrfs", "-q", str(image)], check=True)
    if subprocess.run(["mount", "-o", "loop", str(image), str(disk)], capture_output=True, check=False).returncode:
        pytest.skip("this user may not mount a disk")
    try:
        for command in (
            ["quota", "enable", disk],
            ["subvolume", "create", disk / "mine"],
            ["qgroup", "limit", "8m", disk / "mine"],
        ):
            subprocess.run(["btrfs", *map(str, command)], check=True, capture_output=True)
        yield disk / "mine"
    finally:
        subprocess.run(["umount", str(disk)], check=True)


@pytest.mark.slow
@pytest.mark.parametrize("image_format", ["exr", "png"])
def test_a_quota(image_format, quota, tmp_path, capsys):
    camera = tiny.WALK | {"resolution": [160, 120], "frames": 40}
    output = {"format": image_format, "directory": str(quota / "out")}
    job = write_job(tmp_path, camera=camera, light={"frames": 4}, output=output)
    ran = run(capsys, "render", "-q", job)
    assert ran.code == 4
    assert ran.err.splitlines()[0].endswith(": cannot be written: Disk quota exceeded")
    subprocess.run(["btrfs", "qgroup", "limit", "none", str(quota)], check=True)
    assert run(capsys, "render", "-q", job).code == 0
    assert run(capsys, "render", "-q", job, "-o", tmp_path / "whole").code == 0
    assert contents(quota / "out") == contents(tmp_path / "whole")


@pytest.mark.parametrize(
    "inodes", [2, pytest.param(8, marks=pytest.mark.slow), pytest.param(17, marks=pytest.mark.slow)]
)
def test_a_disk_that_takes_no_more_files(inodes, array, tmp_path, capsys):
    with closing(mounted(tmp_path / "disk", f"size=64m,nr_inodes={inodes}")) as disks:
        disk = next(disks)
        ran = run(capsys, "render", "-q", tmp_path / "job.toml", "-o", disk.folder / "out")
        assert ran.code == 4
        lines = ran.err.splitlines()
        assert lines[0].endswith(": No space left on device")
        assert any(re.fullmatch(r"that disk takes \d more files? \(inodes\)", line) for line in lines), lines
        disk.remount("size=64m,nr_inodes=1000")
        assert run(capsys, "render", "-q", tmp_path / "job.toml", "-o", disk.folder / "out").code == 0
        assert contents(disk.folder / "out") == contents(array)


@pytest.mark.parametrize("name", [LONG, pytest.param("circle", marks=pytest.mark.slow)])
def test_names_that_lead_nowhere(name, array, tmp_path, capsys):
    (tmp_path / "circle").symlink_to(tmp_path / "circle")
    place, job, scene = tmp_path / name, tmp_path / "job.toml", tmp_path / "tiny.glb"
    before = names(tmp_path)
    commands: list[list[str | Path]] = [
        ["render", job, "-o", place],
        ["render", job, "-o", place / "below"],
        ["render", place],
        ["check", job, "-o", place],
        ["verify", place],
        ["sheet", place, "-o", tmp_path / "a.png"],
        ["sheet", array, "-o", place / "a.png"],
        ["assemble", array, "walk", "-o", place / "a.mp4"],
        ["assemble", array, "walk", "-o", place],
        ["assemble", array, place, "-o", tmp_path / "a.mp4"],
        ["export", array, "-f", "colmap", "-o", place],
        ["view", array, "--export", place],
        ["view", array, "--cache", place, "--export", tmp_path / "page"],
        ["init", place],
        ["init", scene, "-o", place / "a.toml"],
    ]
    for command in commands:
        ran = run(capsys, *command)
        allowed = (0, 4) if command[0] == "check" else (2, 3, 4)
        assert ran.code in allowed, (command, ran)
        lines = [line for line in ran.err.splitlines() if not line.startswith("compiling")]  # `check` may be the first
        assert len(lines) <= 2, (command, ran)
    assert names(tmp_path) == before


@pytest.mark.parametrize("most", [5, pytest.param(8, marks=pytest.mark.slow)])
def test_few_open_files(most, tmp_path):
    import resource

    def limit() -> None:
        resource.setrlimit(resource.RLIMIT_NOFILE, (most, most))

    ran = finish(start("render", "-q", write_job(tmp_path, camera=WALK), preexec_fn=limit))
    if most == 8:
        assert (ran.code, ran.err) == (0, "")
    else:
        assert ran.code == 4
        assert ran.err.endswith(": Too many open files; `ulimit -n 1024` lets this program open more\n")


def test_an_array_on_a_disk_that_is_read_only(array, tmp_path, capsys):
    with closing(mounted(tmp_path / "disk")) as disks:
        disk = next(disks)
        shutil.copytree(array, disk.folder / "out")
        disk.remount("ro")
        out, job = disk.folder / "out", tmp_path / "job.toml"
        assert run(capsys, "verify", "-q", out).code == 0
        for command in (
            ["sheet", "-q", out, "-o", tmp_path / "a.png"],
            ["assemble", "-q", out, "light", "-o", tmp_path / "a.gif"],
            ["export", "-q", out, "-f", "nerfstudio", "-o", tmp_path / "nerf"],
            ["view", "-q", out, "--cache", tmp_path / "cache", "--export", tmp_path / "page"],
        ):
            ran = run(capsys, *command)
            assert (ran.code, ran.err) == (0, "")
        for command in (["render", "-q", job, "-o", out], ["render", "-q", job, "-o", out, "--restart"], ["view", out]):
            ran = run(capsys, *command)
            assert ran.code == 4
            assert "Read-only file system" in ran.err.splitlines()[0]
        assert ran.err.splitlines()[1] == "--cache FOLDER keeps what the page needs elsewhere"
        assert contents(out) == contents(array)


@pytest.mark.slow
@pytest.mark.skipif(not shutil.which("setpriv") or os.geteuid() != 0, reason="who is not root cannot become another")
def test_a_folder_of_somebody_else(array):
    """Run as another user, who may read the program anywhere, and write none of our files."""
    with tempfile.TemporaryDirectory() as name:  # other users may not enter pytest's own folders
        Path(name).chmod(0o755)
        shutil.copytree(array, Path(name) / "out")
        _somebody_else(Path(name))


def _somebody_else(folder: Path) -> None:
    array = folder / "out"
    rights = ["--inh-caps", "-all,+dac_read_search", "--ambient-caps", "+dac_read_search"]
    become = ["setpriv", f"--reuid={NOBODY}", f"--regid={NOBODY}", "--clear-groups", *rights, "--"]

    def run_as_nobody(*command: str | Path) -> Result:
        words = [*become, sys.executable, "-m", "framearray_cli", *map(str, command)]
        environment = os.environ | {"PYTHONPATH": str(ROOT)}
        return finish(subprocess.Popen(words, stdout=-1, stderr=-1, text=True, env=environment))

    assert run_as_nobody("verify", "-q", array).code == 0
    sheet = run_as_nobody("sheet", "-q", array, "-o", folder / "a.png")
    assert (sheet.code, sheet.err) == (4, f"{folder / 'a.png'}: cannot be written: Permission denied\n")
    page = run_as_nobody("view", array)
    assert page.code == 4 and page.err.startswith(f"{array / '.view'}: cannot make the folder: Permission denied\n")
