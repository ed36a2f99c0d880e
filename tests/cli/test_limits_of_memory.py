"""Too little memory for a job: a message before the render; nothing kills a process."""

import os
import signal
import subprocess
import sys
import time
from collections.abc import Callable, Iterator
from pathlib import Path

import pytest
from support import tiny
from support.program import Result, finish, start, write_job

from framearray_cli.base.platform import python_command, python_environment

pytestmark = pytest.mark.skipif(sys.platform != "linux", reason="limits of other kinds there")

MIB = 2**20
LARGE = {"camera": tiny.WALK | {"resolution": [240, 180]}, "light": {"frames": 24}, "reuse": {"n_r": 3}}
# Renders without checking the free memory, to show what happens to the same job then.
BLIND = """
import sys
from framearray_cli.job.read import read_job
from framearray_cli.render import memory, render
from framearray_cli.render.automatic import choose
from pathlib import Path
for module in (choose, render):
    module.require_memory = lambda *_: None
memory.free_memory = lambda: 2**40
render.render(read_job(Path(sys.argv[1])))
"""


@pytest.fixture
def group() -> Iterator[Path]:
    """Make a control group below that of the tests."""
    own = {line.split(":", 2)[1]: line.split(":", 2)[2] for line in Path("/proc/self/cgroup").read_text().splitlines()}
    if "memory" not in own:
        pytest.skip("no control groups of version 1 here")
    folder = Path(f"/sys/fs/cgroup/memory{own['memory']}/framearray-{os.getpid()}")
    try:
        folder.mkdir()
    except OSError as error:
        pytest.skip(f"this user may not make control groups: {error}")
    yield folder
    end = time.monotonic() + 10
    while (folder / "cgroup.procs").read_text() and time.monotonic() < end:
        time.sleep(0.05)
    folder.rmdir()


def joined(group: Path, most: int) -> Callable[[], object]:
    """Return the function with which a process joins the group."""
    (group / "memory.limit_in_bytes").write_text(str(most))
    return lambda: (group / "cgroup.procs").write_text(str(os.getpid()))


def rendered(job: Path, out: Path, **options: object) -> Result:
    result = finish(start("render", "-q", job, **options))
    assert (out / "manifest.toml").exists() == (result.code == 0)
    return result


def test_a_group_that_is_too_small_is_reported_beforehand(group, tmp_path):
    """The same job is killed if it does not check."""
    job = write_job(tmp_path, output={"format": "exr"}, **LARGE)
    result = rendered(job, tmp_path / "out", preexec_fn=joined(group, 300 * MIB))
    assert result.code == 2
    assert result.err.startswith(f"{job}: rendering needs at least 0.")
    assert " GiB may be used; a smaller camera.resolution" in result.err
    assert not (tmp_path / "out").exists()
    command, environment = python_command(BLIND, [str(job)]), python_environment()
    blind = subprocess.run(command, env=environment, preexec_fn=joined(group, 300 * MIB), check=False)
    assert blind.returncode == -signal.SIGKILL


@pytest.mark.slow
@pytest.mark.parametrize("most", [250, 300, 350, 400, 450, 500, 600, 800])
def test_no_group_of_any_size_kills_a_render(most, group, tmp_path):
    job = write_job(tmp_path, output={"format": "exr"}, **LARGE)
    result = rendered(job, tmp_path / "out", preexec_fn=joined(group, most * MIB))
    assert result.code in (0, 2), result.err
    print(f"{most} MiB: {'rendered' if result.code == 0 else result.err.splitlines()[0]}")
