"""A disk that becomes full at any point: one message, finished files stay whole, and the same command continues."""

import random
import re
import tomllib
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import pytest
from support import tiny
from support.program import Result, run, write_job
from support.smalldisk import PAGE, SmallDisk, mounted

N = 12
WALK = tiny.WALK | {"frames": N, "resolution": [60, 45]}
GROUPS = {"light": {"sources": [{**tiny.TABLE["light"]["sources"][0], "group": "lamp"}, {**tiny.RED, "group": "wall"}]}}
KINDS: dict[str, dict[str, Any]] = {
    "exr": {"output": {"format": "exr"}},
    "png": {"output": {"format": "png"}},
    "groups": {"output": {"format": "exr"}, **GROUPS},
}
# Keys of the summary that differ between runs; the job decides all others.
EFFORT = ("seconds", "peak_memory", "rays", "rays_per_pixel_image")


@pytest.fixture
def disk(tmp_path: Path) -> Iterator[SmallDisk]:
    yield from mounted(tmp_path / "disk")


def job(folder: Path, kind: str, out: str) -> Path:
    changes = dict(KINDS[kind])
    output = changes.pop("output") | {"directory": out}
    return write_job(folder, f"{out.replace('/', '-')}.toml", camera=WALK, output=output, reuse={"n_r": 1}, **changes)


def contents(out: Path) -> dict[str, bytes]:
    return {file.name: file.read_bytes() for file in out.glob("tiny.*")}


def manifest(out: Path) -> dict[str, Any]:
    """Return the table of a manifest without times, memory and folder."""
    table = tomllib.loads((out / "manifest.toml").read_text())
    table["summary"] = {key: value for key, value in table["summary"].items() if key not in EFFORT}
    del table["job"]["output"]["directory"]
    return table


def whole(folder: Path, kind: str, capsys: pytest.CaptureFixture[str]) -> Path:
    """Render an array without interruption."""
    assert run(capsys, "render", "-q", job(folder, kind, "whole")).code == 0
    return folder / "whole"


def check_failure(result: Result, out: Path, capsys: pytest.CaptureFixture[str]) -> None:
    """Check that there is one message, and that all images are whole."""
    assert (result.code, result.out) == (4, "")
    first, *rest = result.err.splitlines()
    assert first.startswith(f"{out}") and first.endswith("No space left on device"), first
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


def size_of(out: Path) -> int:
    """Return the bytes that an array takes on a disk."""
    return sum(-(-file.stat().st_size // PAGE) * PAGE for file in out.rglob("*") if file.is_file())


@pytest.mark.parametrize(("kind", "share"), [("exr", 0.6), ("groups", 0.3)])
def test_a_disk_that_becomes_full_on_the_way(kind, share, disk, tmp_path, capsys):
    right = whole(tmp_path, kind, capsys)
    assert fill_and_go_on(disk, kind, int(share * size_of(right)), right, capsys)


@pytest.mark.slow
@pytest.mark.parametrize("kind", KINDS)
@pytest.mark.parametrize("seed", range(4))
def test_a_disk_that_becomes_full_at_random_points(kind, seed, disk, tmp_path, capsys):
    """Anywhere; in the first 40 KiB, where the render makes locks, manifest and records; in the last, where it writes
    the manifest again.
    """
    right, rng = whole(tmp_path, kind, capsys), random.Random(seed)
    most = size_of(right)
    spaces = [rng.randrange(most) for _ in range(8)]
    spaces += [PAGE * k for k in rng.sample(range(10), 4)] + [most - PAGE * rng.randrange(10) for _ in range(4)]
    full = sum(fill_and_go_on(disk, kind, space, right, capsys) for space in spaces)
    print(f"{kind}, seed {seed}: {len(spaces)} of {len(spaces)} went on to the same bytes, {full} of them were full")
    assert full >= 10
