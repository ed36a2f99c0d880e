"""A disk with simulated faults: a C library makes calls that write return an error.

`tests/cli/faults.c` stands between the program and the system's own functions.
"""

import errno
import os
import random
import re
import shutil
import subprocess
import sys
from pathlib import Path

import pytest
from support import tiny
from support.program import Result, finish, run, start, write_job

pytestmark = pytest.mark.skipif(sys.platform != "linux" or not shutil.which("cc"), reason="no C compiler here")

N = 8
WALK = tiny.WALK | {"frames": N, "resolution": [60, 45]}
# Minimum number of calls that write in a whole render; the library sees OpenEXR rename its files, but not write them.
CALLS = {"exr": 50, "png": 85}


@pytest.fixture(scope="module")
def library(tmp_path_factory: pytest.TempPathFactory) -> Path:
    target = tmp_path_factory.mktemp("faults") / "faults.so"
    source = Path(__file__).with_name("faults.c")
    subprocess.run(["cc", "-shared", "-fPIC", "-O1", "-o", str(target), str(source), "-ldl"], check=True)
    return target


def contents(out: Path) -> dict[str, bytes]:
    return {file.name: file.read_bytes() for file in out.glob("tiny.*")}


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
    job = write_job(tmp_path, camera=WALK, reuse={"n_r": 1}, output={"format": kind})
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
@pytest.mark.parametrize("number", [errno.EIO, errno.ESTALE])
def test_a_disk_that_fails(number, library, tmp_path, capsys):
    """Like a broken disk, or a folder of a server that is down."""
    fail_and_go_on(library, "png", number, 30, tmp_path, capsys)


@pytest.mark.slow
@pytest.mark.parametrize("number", [errno.EIO, errno.ESTALE, errno.EDQUOT], ids=errno.errorcode.get)
@pytest.mark.parametrize("kind", CALLS)
def test_a_disk_that_fails_at_random_points(kind, number, library, tmp_path, capsys):
    points = random.Random(number).sample(range(CALLS[kind]), 12)
    for after in [0, *points]:
        fail_and_go_on(library, kind, number, after, tmp_path, capsys)
    print(f"{kind}, {os.strerror(number)}: {len(points) + 1} points, the same bytes after each")
