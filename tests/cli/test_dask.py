"""`render --dask`: workers that the user started, which die, lack libraries, or lose their scheduler."""

import json
import os
import signal
import subprocess
import sys
import time
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path

import pytest
from support import ROOT
from support.handed import JOB, N, finished, restarted, same
from support.program import complete, finish, is_prompt, start, wait_for, write_job

import framearray_cli
from framearray_cli.base.files import digest
from framearray_cli.base.platform import python_command, python_environment

pytest.importorskip("distributed", reason="Dask distributed is not installed (extra dask)")
pytestmark = pytest.mark.skipif(sys.platform == "win32", reason="no kill -9 there")


class Cluster:
    """A scheduler in a process, and workers that tests start one by one and nothing replaces."""

    def __init__(self, folder: Path) -> None:
        self._file, self._log = folder / "scheduler.json", (folder / "log").open("wb")
        self.scheduler = self._run("scheduler", "--host", "127.0.0.1", "--port", "0", "--no-dashboard")
        self.workers: list[subprocess.Popen[bytes]] = []
        end = time.monotonic() + 60
        while not (self._file.exists() and self._file.read_bytes().endswith(b"}")):  # it is there before it is written
            assert self.scheduler.poll() is None and time.monotonic() < end
            time.sleep(0.02)
        self.address = str(json.loads(self._file.read_text())["address"])

    def _run(self, what: str, *options: str, python_path: Path = ROOT) -> subprocess.Popen[bytes]:
        command = [sys.executable, "-m", f"distributed.cli.dask_{what}", "--scheduler-file", str(self._file), *options]
        path = os.pathsep.join([str(python_path), os.environ.get("PYTHONPATH", "")])
        environment = os.environ | {"PYTHONPATH": path}
        # Python looks for modules first in the folder where it starts
        return subprocess.Popen(command, stdout=self._log, stderr=self._log, env=environment, cwd=self._file.parent)

    def start_worker(self, python_path: Path = ROOT) -> subprocess.Popen[bytes]:
        options = ("--no-nanny", "--nthreads", "1", "--no-dashboard")
        self.workers.append(self._run("worker", *options, python_path=python_path))
        return self.workers[-1]

    def close(self) -> None:
        for process in (*self.workers, self.scheduler):
            process.kill()
            process.wait()
        self._log.close()


@contextmanager
def cluster(folder: Path, workers: int = 2) -> Iterator[Cluster]:
    found = Cluster(folder)
    try:
        for _ in range(workers):
            found.start_worker()
        yield found
    finally:
        found.close()


@pytest.mark.slow
def test_other_workers_take_over_from_one_that_dies(place, tmp_path):
    """The other one renders the rest; then one joins that was not there at the start."""
    out = tmp_path / "out"
    with cluster(tmp_path) as dask:
        process = start("render", "-q", place / "job.toml", "--dask", dask.address, "--chunk", 4, "-o", out)
        wait_for(lambda: len(finished(out)) >= 5, process)
        dask.workers[0].send_signal(signal.SIGKILL)
        dask.start_worker()
        result = finish(process)
    assert (result.code, result.out, result.err) == (0, "", "")
    assert same(out, place / "whole")
    times = finished(out)
    assert len(times) == N and set(times.values()) == {1}
    assert sum(restarted(out).values()) <= 1
    assert not list((out / "records").glob(".parts-*"))


@pytest.mark.slow
@pytest.mark.parametrize("number", [signal.SIGTERM, signal.SIGKILL])
def test_workers_stop_when_nobody_wants_their_chunks(number, place, tmp_path):
    out = tmp_path / "out"
    with cluster(tmp_path) as dask:
        command = ["render", "-q", place / "job.toml", "--dask", dask.address, "--chunk", 12, "-o", out]
        process = start(*command)
        wait_for(lambda: len(finished(out)) >= 4, process)
        process.send_signal(number)
        result = finish(process)
        assert result.code == (143 if number == signal.SIGTERM else -number)
        time.sleep(3.0)  # the scheduler notices, and so do the workers
        there = finished(out)
        time.sleep(2.0)
        assert finished(out) == there and len(there) < N
        assert finish(start(*command)).code == 0
        assert same(out, place / "whole")
        assert not list((out / "records").glob(".parts-*"))


@pytest.mark.slow
def test_a_scheduler_that_goes_away(place, tmp_path):
    out = tmp_path / "out"
    with cluster(tmp_path) as dask:
        process = start("render", "-q", place / "job.toml", "--dask", dask.address, "--chunk", 12, "-o", out)
        wait_for(lambda: len(finished(out)) >= 4, process)
        dask.scheduler.kill()
        result = finish(process)
    assert result.code == 4
    assert result.err.splitlines()[0] == "the Dask scheduler has gone away"
    assert result.err.splitlines()[1].endswith("; the same command goes on with the rest")
    assert len(result.err.splitlines()) == 2
    complete("render", "-q", place / "job.toml", "-o", out)
    assert same(out, place / "whole")


@pytest.mark.slow
def test_a_worker_without_the_program(place, tmp_path):
    """The worker has another version of the package."""
    (tmp_path / "old/framearray_cli").mkdir(parents=True)
    (tmp_path / "old/framearray_cli/__init__.py").write_text('__version__ = "0.0.1"\n')
    with cluster(tmp_path, workers=1) as dask:
        dask.start_worker(python_path=tmp_path / "old")
        time.sleep(3.0)
        result = finish(start("render", "-q", place / "job.toml", "--dask", dask.address, "-o", tmp_path / "out"))
    assert result.code == 4
    assert f"lacks framearray {framearray_cli.__version__}; install it there" in result.err
    assert len(result.err.splitlines()) == 1


def test_errors_that_mean_a_missing_program():
    from framearray_cli.render.parts.dask import lacks_program

    words = RuntimeError("Error during deserialization of the task")
    words.__cause__ = ModuleNotFoundError("No module named 'framearray_cli'")
    assert lacks_program(words) and lacks_program(Exception(repr(words.__cause__)))
    assert not lacks_program(ValueError("something else")) and not lacks_program(None)


@pytest.mark.parametrize(
    "address", ["nonsense", "ftp://a:1", pytest.param("tcp://127.0.0.1:9", marks=pytest.mark.slow)]
)
def test_wrong_addresses(address, tmp_path):
    started = time.monotonic()
    result = finish(start("render", write_job(tmp_path, **JOB), "--dask", address))
    assert is_prompt(time.monotonic() - started, 15.0)
    assert result.code == 2
    assert result.err.startswith(
        f'--dask {address}: expected the address of a Dask scheduler, such as "tcp://host:8786"; '
    )
    assert len(result.err.splitlines()) == 2
    assert not (tmp_path / "out").exists()


def test_what_a_worker_must_see(tmp_path):
    from framearray_cli.render.parts.chunk import worker_problem

    scene, probe = tmp_path / "scene.glb", tmp_path / "out/records/.parts-1"
    scene.write_bytes(b"scene")
    probe.parent.mkdir(parents=True)
    probe.touch()
    good = {
        "version": framearray_cli.__version__,
        "table": {"scene": {"file": str(scene)}},
        "folder": str(tmp_path / "out"),
        "probe": str(probe),
        "scene": digest(scene),
    }
    assert worker_problem(good) == ""
    assert "has framearray" in worker_problem(good | {"version": "0.0.1"})
    assert f"does not see the output folder {tmp_path / 'out'}" in worker_problem(good | {"probe": str(probe) + "2"})
    assert "does not see the scene" in worker_problem(
        good | {"table": {"scene": {"file": str(tmp_path / "other.glb")}}}
    )
    scene.write_bytes(b"scenf")
    assert "has another file" in worker_problem(good)


def test_dask_is_not_loaded_without_it(tmp_path, capsys):
    run = "from framearray_cli.cli.main import main\ntry: main()\nfinally: print('distributed' in sys.modules)"
    code = f"import sys; {run}"
    job = write_job(tmp_path, **(JOB | {"camera": {"resolution": [24, 18]}}))
    command, environment = python_command(code, ["render", "-q", str(job)]), python_environment()
    assert subprocess.run(command, capture_output=True, text=True, env=environment, check=True).stdout == "False\n"
