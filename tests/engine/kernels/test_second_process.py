"""The second process that compiles: when it starts, and that it ends with the first."""

import os
import subprocess
import sys
import time
from pathlib import Path
from typing import Any

import psutil
import pytest

from framearray_cli.engine.kernels import second_process

PARENT = """
import subprocess, sys
from framearray_cli.engine.kernels import second_process
second_process.offer("from framearray_cli.engine.kernels.second_process import end_with_parent; end_with_parent()\\n"
             "import time; time.sleep(60)")
second_process.start()
print(second_process._started[0][1].pid, flush=True)
if sys.argv[1] == "stopped":
    second_process.stop()
    second_process._started[0][1].wait(10)
sys.stdin.read()
"""


@pytest.fixture
def offered(monkeypatch: pytest.MonkeyPatch) -> list[str]:
    """The command that a test offered; a second core is free."""
    found: list[str] = []
    monkeypatch.delenv(second_process.PROCESSES, raising=False)
    monkeypatch.setattr(second_process, "available_cores", lambda: 2)
    monkeypatch.setattr(second_process, "kept_kernels", lambda: 36)
    monkeypatch.setattr(second_process, "kernel_folder", lambda: Path())
    monkeypatch.setattr(second_process, "_offered", found)
    monkeypatch.setattr(second_process, "_started", [])
    return found


@pytest.mark.parametrize("how", ["stopped", "ended", "killed"])
def test_it_ends_when_asked_and_with_the_process_that_started_it(tmp_path: Path, how: str) -> None:
    environment = os.environ | {"NUMBA_CACHE_DIR": str(tmp_path)}
    environment.pop(second_process.PROCESSES, None)
    if second_process.available_cores() < 2:
        pytest.skip("one core")
    parent = subprocess.Popen(
        [sys.executable, "-c", PARENT, how], stdin=subprocess.PIPE, stdout=subprocess.PIPE, text=True, env=environment
    )
    assert parent.stdout is not None
    child = psutil.Process(int(parent.stdout.readline()))
    if how == "killed":
        parent.kill()
    if how == "stopped":
        child.wait(timeout=20)
        assert parent.poll() is None
    parent.communicate("")
    child.wait(timeout=20)


def test_nothing_is_offered_where_no_core_is_free(offered: list[str], monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(second_process, "available_cores", lambda: 1)
    second_process.offer("pass")
    assert offered == []
    monkeypatch.setattr(second_process, "available_cores", lambda: 2)
    monkeypatch.setenv(second_process.PROCESSES, "1")
    second_process.offer("pass")
    assert offered == []


def test_it_starts_once_and_only_when_a_kernel_is_missing(
    offered: list[str], monkeypatch: pytest.MonkeyPatch, tmp_path: Path
) -> None:
    started: list[list[str]] = []

    class Process:
        def __init__(self, command: list[str], **_options: Any) -> None:
            started.append(command)

    monkeypatch.setattr(subprocess, "Popen", Process)
    second_process.offer("pass", ["argument"])
    assert started == []
    second_process.start()
    second_process.start()
    assert [command[1:] for command in started] == [["-c", "pass", "argument"]]
    monkeypatch.setattr(second_process, "kept_kernels", lambda: 0)
    second_process.offer("pass")
    assert len(started) == 2, "on an empty disk at once"
    old, new = tmp_path / "old", tmp_path / "new"
    old.write_text("")
    os.utime(old, (time.time() - 100,) * 2)
    new.write_text("")
    os.utime(new, (time.time() + 1,) * 2)
    assert not second_process.has_made(old)
    assert second_process.has_made(new)


def test_it_does_not_start_without_memory(offered: list[str], monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(second_process, "free_memory", lambda: second_process.NEEDS - 1)
    second_process.offer("pass")
    second_process.start()
    assert second_process._started == []
