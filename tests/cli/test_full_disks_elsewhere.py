"""Commands that read an array and write to a full disk: one message, and the old file stays."""

from collections.abc import Iterator
from pathlib import Path

import PIL.features
import pytest
from support import tiny
from support.program import names, run, write_job
from support.smalldisk import PAGE, SmallDisk, mounted

WALK = tiny.WALK | {"resolution": [60, 45]}
AVIF = PIL.features.check("avif")
FULL = "No space left on device"
# The file that a command writes, and the command without its array or job.
FILES = {
    "movie.mp4": ["assemble", "OUT", "walk", "--force", "-o"],
    "movie.webm": ["assemble", "OUT", "walk", "--force", "-o"],
    "movie.mov": ["assemble", "OUT", "walk", "--force", "-o"],
    "movie.gif": ["assemble", "OUT", "walk", "--force", "-o"],
    "movie.webp": ["assemble", "OUT", "walk", "--force", "-o"],
    **({"movie.avif": ["assemble", "OUT", "walk", "--force", "-o"]} if AVIF else {}),
    "sheet.png": ["sheet", "OUT", "--force", "-o"],
    "sheet.exr": ["sheet", "OUT", "--force", "-o"],
    "job.toml": ["init", "SCENE", "--force", "-o"],
}
FOLDERS = {
    "frames": ["assemble", "OUT", "walk", "--force", "-o", "frames/f.####.png"],
    "nerf": ["export", "OUT", "-f", "nerfstudio", "--force", "-o", "nerf"],
    "colmap": ["export", "OUT", "-f", "colmap", "--force", "-o", "colmap"],
    "cinema.cdb": ["export", "OUT", "-f", "cinema", "--force", "-o", "cinema"],
    "page": ["view", "OUT", "--force", "--cache", "CACHE", "--export", "page"],
    "offline": ["view", "OUT", "--force", "--cache", "CACHE", "--offline", "--export", "offline"],
    "cache": ["view", "OUT", "--force", "--cache", "cache", "--export", "PAGE"],
}


@pytest.fixture
def disk(tmp_path: Path) -> Iterator[SmallDisk]:
    yield from mounted(tmp_path / "disk")


@pytest.fixture(scope="module")
def array(tmp_path_factory: pytest.TempPathFactory) -> Path:
    from framearray_cli.cli.main import main

    folder = tmp_path_factory.mktemp("array")
    with pytest.MonkeyPatch.context():
        try:
            main(["render", "-q", str(write_job(folder, camera=WALK, output={"format": "exr"}))])
        except SystemExit as end:
            assert not end.code
    return folder / "out"


def words(command: list[str], array: Path, place: Path) -> list[str]:
    """Return a command with its files filled in; lower-case names at its end are on the disk."""
    known = {
        "OUT": array,
        "SCENE": array.parent / "tiny.glb",
        "CACHE": place.parent / "cache",
        "PAGE": place.parent / "p",
    }
    filled = [str(known.get(word, word)) for word in command]
    return [str(place / word) if i and command[i - 1] in ("-o", "--cache", "--export") and word == command[i] else word
            for i, word in enumerate(filled)]  # fmt: skip


def size(folder: Path) -> int:
    return sum(-(-f.stat().st_size // PAGE) * PAGE for f in folder.rglob("*") if f.is_file() and f.name != "ballast")


@pytest.mark.parametrize(
    "share", [0.0, pytest.param(0.3, marks=pytest.mark.slow), pytest.param(0.7, marks=pytest.mark.slow)]
)
@pytest.mark.parametrize(
    "name", [pytest.param(name, marks=[pytest.mark.slow] if name == "job.toml" else []) for name in FILES]
)
def test_a_file(name, share, array, disk, capsys):
    file = disk.folder / name
    command = [*words(FILES[name], array, disk.folder), str(file)]
    assert run(capsys, *command).code == 0
    taken = size(disk.folder)
    file.write_bytes(b"former")
    disk.leave(int(share * (taken - PAGE)))
    result = run(capsys, *command)
    assert (result.code, result.err) == (4, f"{file}: cannot be written: {FULL}\n")
    assert file.read_bytes() == b"former"
    assert names(disk.folder) == {name, "ballast"}


@pytest.mark.parametrize(
    "share", [0.0, pytest.param(0.3, marks=pytest.mark.slow), pytest.param(0.7, marks=pytest.mark.slow)]
)
@pytest.mark.parametrize("name", FOLDERS)
def test_a_folder(name, share, array, disk, capsys):
    command = words(FOLDERS[name], array, disk.folder)
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
def test_commands_that_write_nothing(command, array, disk, capsys, monkeypatch):
    disk.leave(0)
    monkeypatch.chdir(disk.folder)
    assert run(capsys, *words(command, array, disk.folder)).code == 0


def test_repairing_on_a_full_disk(disk, tmp_path, capsys):
    assert run(capsys, "render", "-q", write_job(tmp_path, camera=WALK, output={"directory": "disk/out"})).code == 0
    out = disk.folder / "out"
    before = {file.name: file.read_bytes() for file in out.glob("tiny.*")}
    (out / "tiny.c0001.l001.png").write_bytes(b"")
    (out / "tiny.c0004.l002.png").unlink()
    disk.leave(0)
    result = run(capsys, "verify", "-q", "--repair", out)
    assert result.code == 4
    assert result.err.splitlines()[0].endswith(f": {FULL}")
    assert run(capsys, "verify", "-q", out).out.count("tiny.c000") == 2, "nothing else was harmed"
    disk.free()
    assert run(capsys, "verify", "-q", "--repair", out).code == 0
    assert {file.name: file.read_bytes() for file in out.glob("tiny.*")} == before


@pytest.mark.slow
def test_a_report(disk, tmp_path, capsys):
    pytest.importorskip("flip_evaluator")
    pytest.importorskip("matplotlib")
    job = write_job(tmp_path, output={"format": "exr"})
    command = ["report", "-q", job, "--cameras", "0", "--light", "0", "--times", "1", "-o", disk.folder / "report"]
    disk.leave(0)
    result = run(capsys, *command)
    assert result.code == 4
    assert result.err.endswith(f": {FULL}\n") and result.err.count("\n") == 1
    disk.leave(100_000)
    result = run(capsys, *command)
    assert result.code == 4
    assert result.err.endswith(f": {FULL}\n") and result.err.count("\n") == 1
    assert not [file for file in disk.folder.rglob("*.part")]
