"""Disks that are or become full, read-only, limited or faulty: one message, whole files, and how a render goes on."""

import errno
import os
import random
import re
import shutil
import subprocess
import sys
import tempfile
from collections.abc import Iterator
from contextlib import closing
from pathlib import Path
from typing import Any

import PIL.features
import pytest
from support import ROOT, tiny
from support.handed import contents, manifest
from support.program import Result, complete, finish, names, run, start, write_job
from support.smalldisk import PAGE, SmallDisk, mounted

LINUX = pytest.mark.skipif(sys.platform != "linux", reason="other limits and names there")
WALK = tiny.WALK | {"resolution": [60, 45]}
NOBODY = 65534


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


@LINUX
def test_a_name_that_leads_nowhere(array, tmp_path, capsys):
    (tmp_path / "circle").symlink_to(tmp_path / "circle")
    place, job, scene = tmp_path / "circle", tmp_path / "job.toml", tmp_path / "tiny.glb"
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


@LINUX
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


def test_a_disk_that_is_read_only(disk, array, tmp_path, capsys):
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
    new = run(capsys, "render", "-q", job, "-o", disk.folder / "new")
    assert (new.code, new.out) == (4, "")
    assert new.err.startswith(f"{disk.folder / 'new'}: cannot make the folder: Read-only file system\n")


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


TWICE = WALK | {"frames": 12}
GROUPS = {"light": {"sources": [{**tiny.TABLE["light"]["sources"][0], "group": "lamp"}, {**tiny.RED, "group": "wall"}]}}
KINDS: dict[str, dict[str, Any]] = {
    "exr": {"output": {"format": "exr"}},
    "png": {"output": {"format": "png"}},
    "groups": {"output": {"format": "exr"}, **GROUPS},
}


@pytest.fixture
def disk(tmp_path: Path) -> Iterator[SmallDisk]:
    yield from mounted(tmp_path / "disk")


def job(folder: Path, kind: str, out: str) -> Path:
    changes = dict(KINDS[kind])
    output = changes.pop("output") | {"directory": out}
    return write_job(folder, f"{out.replace('/', '-')}.toml", camera=TWICE, output=output, reuse={"n_r": 1}, **changes)


def whole(folder: Path, kind: str, capsys: pytest.CaptureFixture[str]) -> Path:
    """Render an array without interruption."""
    assert run(capsys, "render", "-q", job(folder, kind, "whole")).code == 0
    return folder / "whole"


def check_failure(result: Result, out: Path, capsys: pytest.CaptureFixture[str]) -> None:
    """Check that there is one message, and that all images are whole."""
    assert (result.code, result.out) == (4, "")
    first, *rest = result.err.splitlines()
    assert first.startswith(f"{out}"), first
    assert first.endswith("No space left on device") or ": the images need about " in first, first
    if images := len(list(out.glob("tiny.c*.l[0-9]*"))):
        assert rest[-1].startswith(f"{images} of 36 images were written to {out}; "), rest
    assert all(" free on that disk" in line or "the same command goes on" in line for line in rest), rest
    assert not [file for file in out.rglob(".*") if file.name != ".guard"], "nothing half"
    if (out / "manifest.toml").exists():
        found = run(capsys, "verify", out)
        assert found.code in (0, 5)
        wrong = found.out.splitlines()[:-1]
        assert all(re.match(r"cameras? [\d,-]+: never (begun|finished), ", line) for line in wrong), wrong


def fill_and_go_on(disk: SmallDisk, kind: str, space: int, right: Path, capsys: pytest.CaptureFixture[str]) -> bool:
    """Render with little space, then with enough; return whether the space was too little."""
    out, file = disk.folder / "out", job(disk.folder.parent, kind, "disk/out")
    disk.leave(space)
    result = run(capsys, "render", "-q", file)
    if result.code:
        check_failure(result, out, capsys)
    disk.free()
    again = run(capsys, "render", "-q", file)
    assert (again.code, again.err) == (0, "")
    assert contents(out) == contents(right)
    assert manifest(out) == manifest(right)
    assert run(capsys, "verify", "-q", out).code == 0
    assert run(capsys, "render", "-q", "--restart", file, "--cameras", "0").code == 0, "the folder is fit for another"
    for path in sorted(out.rglob("*"), reverse=True):
        path.unlink() if path.is_file() else path.rmdir()
    out.rmdir()
    return result.code == 4


@pytest.mark.parametrize(("kind", "share"), [("exr", 0.6), ("png", 0.8), ("groups", 0.3)])
def test_a_disk_that_becomes_full_on_the_way(kind, share, disk, tmp_path, capsys):
    right = whole(tmp_path, kind, capsys)
    assert fill_and_go_on(disk, kind, int(share * size(right)), right, capsys)


@pytest.mark.slow
@pytest.mark.parametrize("kind", KINDS)
@pytest.mark.parametrize("seed", range(4))
def test_a_disk_that_becomes_full_at_random_points(kind, seed, disk, tmp_path, capsys):
    """Anywhere; in the first 40 KiB, where the render makes locks, manifest and records; in the last, where it writes
    the manifest again.
    """
    right, rng = whole(tmp_path, kind, capsys), random.Random(seed)
    most = size(right)
    spaces = [rng.randrange(most) for _ in range(8)]
    spaces += [PAGE * k for k in rng.sample(range(10), 4)] + [most - PAGE * rng.randrange(10) for _ in range(4)]
    full = sum(fill_and_go_on(disk, kind, space, right, capsys) for space in spaces)
    print(f"{kind}, seed {seed}: {len(spaces)} of {len(spaces)} went on to the same bytes, {full} of them were full")
    assert full >= 10


MOVIES = ("mp4", "webm", "mov", "gif", "webp", *(["avif"] if PIL.features.check("avif") else []))
FULL = "No space left on device"
# The file that a command writes, and the command without its array or job.
FILES = {
    **{f"movie.{kind}": ["assemble", "OUT", "walk", "--force", "-o"] for kind in MOVIES},
    "sheet.png": ["sheet", "OUT", "--force", "-o"],
    "sheet.exr": ["sheet", "OUT", "--force", "-o"],
    "page.zip": ["view", "OUT", "--force", "--cache", "CACHE", "--export"],
    "job.toml": ["init", "SCENE", "--force", "-o"],
}
FOLDERS = {
    "frames": ["assemble", "OUT", "walk", "--force", "-o", "frames/f.####.png"],
    "nerf": ["export", "OUT", "-f", "nerfstudio", "--force", "-o", "nerf"],
    "colmap": ["export", "OUT", "-f", "colmap", "--force", "-o", "colmap"],
    "rti": ["export", "OUT", "-f", "rti", "--force", "-o", "rti"],
    "page": ["view", "OUT", "--force", "--cache", "CACHE", "--export", "page"],
    "cache": ["view", "OUT", "--force", "--cache", "cache", "--export", "PAGE"],
}


@pytest.fixture(scope="module")
def exr_array(tmp_path_factory: pytest.TempPathFactory) -> Path:
    folder = tmp_path_factory.mktemp("array")
    complete("render", "-q", write_job(folder, camera=WALK, output={"format": "exr"}))
    return folder / "out"


def words(command: list[str], exr_array: Path, place: Path) -> list[str]:
    """Return a command with its files filled in; lower-case names at its end are on the disk."""
    known = {
        "OUT": exr_array,
        "SCENE": exr_array.parent / "tiny.glb",
        "CACHE": place.parent / "cache",
        "PAGE": place.parent / "p",
    }
    filled = [str(known.get(word, word)) for word in command]
    return [str(place / word) if i and command[i - 1] in ("-o", "--cache", "--export") and word == command[i] else word
            for i, word in enumerate(filled)]  # fmt: skip


SHARES = pytest.mark.parametrize(
    "share", [0.0, pytest.param(0.3, marks=pytest.mark.slow), pytest.param(0.7, marks=pytest.mark.slow)]
)


def size(folder: Path) -> int:
    return sum(-(-f.stat().st_size // PAGE) * PAGE for f in folder.rglob("*") if f.is_file() and f.name != "ballast")


@SHARES
@pytest.mark.parametrize(
    "name", [pytest.param(name, marks=[pytest.mark.slow] if name == "job.toml" else []) for name in FILES]
)
def test_a_file(name, share, exr_array, disk, capsys):
    file = disk.folder / name
    command = [*words(FILES[name], exr_array, disk.folder), str(file)]
    assert run(capsys, *command).code == 0
    taken = size(disk.folder)
    file.write_bytes(b"former")
    disk.leave(int(share * (taken - PAGE)))
    result = run(capsys, *command)
    assert (result.code, result.err) == (4, f"{file}: cannot be written: {FULL}\n")
    assert file.read_bytes() == b"former"
    assert names(disk.folder) == {name, "ballast"}


@SHARES
@pytest.mark.parametrize("name", FOLDERS)
def test_a_folder(name, share, exr_array, disk, capsys):
    command = words(FOLDERS[name], exr_array, disk.folder)
    assert run(capsys, *command).code == 0
    folder = disk.folder / name
    before = {path.relative_to(folder): path.read_bytes() for path in folder.rglob("*") if path.is_file()}
    taken = size(disk.folder)
    if name == "cache":
        for file in folder.rglob("*.jpg"):
            file.unlink()
        before = {path: data for path, data in before.items() if path.suffix != ".jpg"}
    disk.leave(int(share * taken))
    result = run(capsys, *command)
    assert result.code == 4, result
    assert result.err.startswith(f"{disk.folder}") and result.err.endswith(f": {FULL}\n")
    assert result.err.count("\n") == 1
    after = {path.relative_to(folder): path.read_bytes() for path in folder.rglob("*") if path.is_file()}
    assert after.items() >= before.items() if name == "cache" else after == before
    assert names(disk.folder) == {name, "ballast"}
    disk.free()
    assert run(capsys, *command).code == 0, "it goes on once there is space"


@pytest.mark.parametrize("command", [["schema"], ["verify", "OUT"]])
def test_commands_that_write_nothing(command, exr_array, disk, capsys, monkeypatch):
    disk.leave(0)
    monkeypatch.chdir(disk.folder)
    assert run(capsys, *words(command, exr_array, disk.folder)).code == 0


def test_repairing_on_a_full_disk(disk, tmp_path, capsys):
    assert run(capsys, "render", "-q", write_job(tmp_path, camera=WALK, output={"directory": "disk/out"})).code == 0
    out = disk.folder / "out"
    before = contents(out)
    (out / "tiny.c0001.l001.png").write_bytes(b"")
    (out / "tiny.c0004.l002.png").unlink()
    disk.leave(0)
    result = run(capsys, "verify", "-q", "--repair", out)
    assert result.code == 4
    assert result.err.splitlines()[0].endswith(f": {FULL}")
    assert run(capsys, "verify", "-q", out).out.count("tiny.c000") == 2, "nothing else was harmed"
    disk.free()
    assert run(capsys, "verify", "-q", "--repair", out).code == 0
    assert contents(out) == before


@pytest.mark.slow
def test_a_report(disk, tmp_path, capsys):
    pytest.importorskip("matplotlib")
    job = write_job(tmp_path, output={"format": "exr"})
    command = ["report", "-q", job, "--cameras", "0", "--light", "0", "-o", disk.folder / "report"]
    for space in (0, 100_000):
        disk.leave(space)
        result = run(capsys, *command)
        assert result.code == 4
        assert result.err.endswith(f": {FULL}\n") and result.err.count("\n") == 1
    assert not [file for file in disk.folder.rglob("*.part")]


FULL_FILE = Path("/dev/full")


def test_a_disk_that_is_full(disk, tmp_path, capsys):
    (disk.folder / "out").mkdir()
    disk.leave(0)
    result = run(capsys, "render", "-q", write_job(tmp_path, output={"directory": "disk/out"}))
    assert (result.code, result.out) == (4, "")
    assert result.err.splitlines()[0].endswith("cannot be written: No space left on device")
    assert names(disk.folder / "out") <= {"records"}


@pytest.mark.skipif(os.name == "nt" or (hasattr(os, "geteuid") and os.geteuid() == 0), reason="root may write anywhere")
def test_a_folder_that_may_not_be_written_to(tmp_path):
    (tmp_path / "out").mkdir(mode=0o555)
    result = finish(start("render", "-q", write_job(tmp_path)))
    assert (result.code, result.err) == (4, f"{tmp_path / 'out'}: cannot be written to: Permission denied\n")


@pytest.mark.skipif(not FULL_FILE.exists(), reason="no /dev/full")
@pytest.mark.parametrize(
    "command",
    [["schema"], ["--version"], ["render", "job.toml"], ["check", "job.toml"], ["check", "job.toml", "--json"]],
)
def test_output_that_cannot_be_printed(command, tmp_path):
    write_job(tmp_path)
    with FULL_FILE.open("w") as full:
        result = finish(start(*command, stdout=full, cwd=tmp_path))
    assert result.code == 4
    assert result.err.splitlines()[-1] == "standard output: cannot be written: No space left on device"


# Minimum number of calls that write in a whole render; the library sees OpenEXR rename its files, but not write them.
CALLS = {"exr": 50, "png": 85}


@pytest.fixture(scope="module")
def library(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """Compile `tests/cli/faults.c`, which stands between the program and the system's own functions."""
    if sys.platform != "linux" or not shutil.which("cc"):
        pytest.skip("no C compiler here")
    target = tmp_path_factory.mktemp("faults") / "faults.so"
    source = Path(__file__).with_name("faults.c")
    subprocess.run(["cc", "-shared", "-fPIC", "-O1", "-o", str(target), str(source), "-ldl"], check=True)
    return target


def faulty(library: Path, number: int, after: int, out: Path, job: Path) -> Result:
    """Render while calls that write into a folder fail, from some call on."""
    faults = {"FAULT_FOLDER": str(out), "FAULT_AFTER": str(after), "FAULT_ERRNO": str(number)}
    with pytest.MonkeyPatch.context() as patch:
        for name, value in {"LD_PRELOAD": str(library), **faults}.items():
            patch.setenv(name, value)
        return finish(start("render", "-q", job))


def fail_and_go_on(
    library: Path, kind: str, number: int, after: int, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    job = write_job(tmp_path, camera=WALK | {"frames": 8}, reuse={"n_r": 1}, output={"format": kind})
    out = tmp_path / "out"
    if not (tmp_path / "whole").exists():
        assert run(capsys, "render", "-q", job, "-o", tmp_path / "whole").code == 0
    result = faulty(library, number, after, out, job)
    assert result.code == 4, result
    lines = result.err.splitlines()
    assert lines[0].startswith(f"{out}") and lines[0].endswith(f": {os.strerror(number)}"), result.err
    assert len(lines) <= 2 and not [file for file in out.rglob(".*") if file.name != ".guard"]
    if (out / "manifest.toml").exists():
        wrong = run(capsys, "verify", out).out.splitlines()[:-1]
        assert all(re.search(r"^cameras? [\d,-]+: never (begun|finished), ", line) for line in wrong), wrong
    assert run(capsys, "render", "-q", job).code == 0
    assert contents(out) == contents(tmp_path / "whole")
    shutil.rmtree(out)


@pytest.mark.slow
@pytest.mark.parametrize("number", [errno.EIO, errno.ESTALE, errno.EDQUOT], ids=errno.errorcode.get)
@pytest.mark.parametrize("kind", CALLS)
def test_a_disk_that_fails_at_random_points(kind, number, library, tmp_path, capsys):
    """Like a broken disk, a folder of a server that is down, or a quota."""
    points = random.Random(number).sample(range(CALLS[kind]), 12)
    for after in [0, *points]:
        fail_and_go_on(library, kind, number, after, tmp_path, capsys)
    print(f"{kind}, {os.strerror(number)}: {len(points) + 1} points, the same bytes after each")
