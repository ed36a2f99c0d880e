"""`render --workers`: the bytes of one run, also when workers are killed, and clear errors."""

import concurrent.futures
import random
import signal
import subprocess
import sys
import time
from pathlib import Path

import psutil
import pytest
from support import tiny
from support.handed import JOB, WALK, N, finished, lines, manifest, restarted, same
from support.program import complete, finish, is_prompt, run, start, wait_for, write_job
from support.smalldisk import mounted

from framearray_cli.base.platform import python_command, python_environment
from framearray_cli.render.parts.queue import ChunkDiedError, start_local

pytestmark = pytest.mark.skipif(sys.platform == "win32", reason="no kill -9 there")


def workers_of(process: subprocess.Popen[str]) -> list[psutil.Process]:
    """Return the worker processes of a render, in no order."""
    try:
        children = psutil.Process(process.pid).children(recursive=True)
        return [child for child in children if "parts.chunk" in " ".join(child.cmdline())]
    except psutil.NoSuchProcess:
        return []


def images(out: Path) -> int:
    return len(list(out.glob("tiny.c*")))


@pytest.mark.slow
@pytest.mark.parametrize(
    "changes",
    [
        {},
        {"reuse": {"n_r": "auto"}, "samples": {"hits": "auto"}, "ambient": {"paths": 512}},
        {"samples": {"error": 0.1, "hits": None}},
        {"samples": {"halves": True, "hits": 4}},
        {"camera": WALK | {"keys": WALK["keys"][:1]}},
        {"reuse": {"n_r": 2, "weights": "area"}},
        {"reuse": {"n_r": 2, "weights": "area"}, "indirect": tiny.CELLS},
    ],
    ids=["plain", "auto", "error", "halves", "still", "area", "cells"],
)
def test_the_bytes_are_those_of_the_whole(changes, tmp_path):
    job = write_job(tmp_path, **(JOB | {"camera": WALK | {"resolution": [24, 18]}} | changes))
    whole = finish(start("render", job, "-o", tmp_path / "whole"))
    parts = finish(start("render", job, "--workers", 2, "--chunk", 7, "-o", tmp_path / "parts"))
    assert (whole.code, parts.code) == (0, 0)
    assert same(tmp_path / "parts", tmp_path / "whole")
    assert len(finished(tmp_path / "parts")) == N and not restarted(tmp_path / "parts")
    printed = [line for line in whole.err.splitlines() if line.startswith(("ambient", "automatic", "error"))]
    assert bool(printed) == ("indirect" not in changes), "no ambient light is estimated where images need none"
    assert set(printed) <= set(parts.err.splitlines())
    notes = [result.err.count("note: indirect light differs from paths by") for result in (whole, parts)]
    assert notes == [int("indirect" in changes)] * 2


def test_a_difference_is_found(place, tmp_path):
    """The comparison can fail."""
    for name in ("whole", "other"):
        (tmp_path / name).mkdir()
        for file in (place / "whole").glob("*.*"):
            (tmp_path / name / file.name).write_bytes(file.read_bytes())
    assert same(tmp_path / "other", tmp_path / "whole")
    file = next((tmp_path / "other").glob("tiny.c*"))
    data = bytearray(file.read_bytes())
    data[-1] ^= 1
    file.write_bytes(data)
    assert not same(tmp_path / "other", tmp_path / "whole")
    file.unlink()
    assert not same(tmp_path / "other", tmp_path / "whole")


@pytest.mark.parametrize(
    ("seed", "kills"),
    [(1, 1), *(pytest.param(seed, kills, marks=pytest.mark.slow) for seed, kills in [(2, 1), (3, 2), (4, 3), (5, 5)])],
)
def test_a_killed_worker_costs_its_chunk(seed, kills, place, tmp_path):
    rng, out = random.Random(seed), tmp_path / "out"
    process = start("render", "-q", place / "job.toml", "--workers", 2, "--chunk", 6, "-o", out)
    for kill in range(1, kills + 1):
        enough = 3 * N * (kill - 1 + rng.uniform(0.2, 0.8)) / kills
        wait_for(lambda enough=enough: images(out) >= enough, process)
        rng.choice(workers_of(process)).send_signal(signal.SIGKILL)
    result = finish(process)
    assert (result.code, result.out, result.err) == (0, "", "")
    assert same(out, place / "whole")
    times = finished(out)
    assert len(times) == N and set(times.values()) == {1}, "what was finished was not rendered anew"
    again = restarted(out)
    assert sum(again.values()) <= kills
    print(f"{kills} kills; chunks restarted: {again}")


@pytest.mark.slow
def test_a_chunk_that_kills_all_workers_is_given_up(place, tmp_path):
    """The program tries again as long as the chunk makes progress."""
    out = tmp_path / "out"
    process = start("render", "-q", place / "job.toml", "--workers", 1, "--chunk", N, "-o", out)
    for kill in range(3):  # kill each after planning and before its first image
        wait_for(lambda kill=kill: sum(restarted(out).values()) + bool(lines(out)) > kill, process)
        workers_of(process)[0].kill()
    result = finish(process)
    assert (result.code, result.out) == (4, "")
    assert result.err.startswith("cameras 0-23: workers died on them again and again")
    assert "run fewer workers; the last was ended by SIGKILL" in result.err
    assert finish(start("render", "-q", place / "job.toml", "--workers", 1, "-o", out)).code == 0
    assert same(out, place / "whole")


@pytest.mark.slow
@pytest.mark.parametrize("number", [signal.SIGINT, signal.SIGTERM, signal.SIGHUP])
def test_a_signal_ends_all_workers(number, place, tmp_path):
    """Send it to all processes, as a terminal does with Ctrl-C."""
    out = tmp_path / "out"
    process = start("render", place / "job.toml", "--workers", 2, "--chunk", 6, "-o", out, start_new_session=True)
    wait_for(lambda: len(finished(out)) >= 4, process)
    workers, sent = workers_of(process), time.monotonic()
    for one in [process, *workers]:
        one.send_signal(number)
    result = finish(process, seconds=60)
    assert is_prompt(time.monotonic() - sent, 5.0)
    assert result.code == 128 + number
    word = "interrupted" if number == signal.SIGINT else "terminated"
    done = sum(finished(out).values()) * 3
    kept = f"{done} of {3 * N} images were written to {out}; the same command goes on with the rest"
    assert result.err.splitlines()[-2:] == [word, kept]
    assert len(workers) == 2 and not any(worker.is_running() for worker in workers)
    assert manifest(out)["summary"]["images"] == done
    assert not [file for file in out.rglob(".*") if file.name != ".guard"]
    complete("render", "-q", place / "job.toml", "-o", out)
    assert same(out, place / "whole")


@pytest.mark.slow
def test_a_full_disk_is_reported_as_without_workers(place, tmp_path):
    for disk in mounted(tmp_path / "disk", "size=1m"):
        out = disk.folder / "out"
        result = finish(start("render", "-q", place / "job.toml", "-o", out, "--workers", 2, "--chunk", 6))
        assert (result.code, result.out) == (4, "")
        first, free, kept = result.err.splitlines()
        assert first.startswith(f"{out}/") and ": cannot be written: " in first
        assert free.endswith(" are free on that disk")
        done = sum(finished(out).values()) * 3
        assert kept == f"{done} of {3 * N} images were written to {out}; the same command goes on with the rest"
        disk.remount("size=64m")
        assert finish(start("render", "-q", place / "job.toml", "-o", out, "--workers", 2, "--chunk", 6)).code == 0
        assert same(out, place / "whole")


def test_memory_is_shared(tmp_path):
    job = write_job(tmp_path, **(JOB | {"render": {"memory": "1 GiB"}}))
    result = finish(start("render", job, "--workers", 8))  # earlier tests would count as memory of the program
    assert result.code == 2
    assert "8 workers share 1.0 GiB, fewer have more each" in result.err
    assert not (tmp_path / "out/manifest.toml").exists()


def test_options_that_do_not_go_together(tmp_path, capsys):
    job = write_job(tmp_path, **JOB)
    for options in (["--chunk", "3"], ["--workers", "2", "--dask", "tcp://a:1"], ["--dask", " "], ["--workers", "0"]):
        result = run(capsys, "render", job, *options)
        assert result.code == 2 and "--" in result.err
    assert not (tmp_path / "out").exists()


def test_a_worker_that_cannot_begin_is_reported_with_its_last_words(tmp_path, monkeypatch):
    """Its code here is broken, so it ends at once."""
    monkeypatch.setattr("framearray_cli.render.parts.queue.CODE", "import framearray_cli.nothing_of_this_name")
    words = r"the last ended with exit code 1: ModuleNotFoundError: .*nothing_of"
    with start_local(1) as crew, pytest.raises(ChunkDiedError, match=words):
        handed = crew.submit({}, (0,))
        concurrent.futures.wait([handed], timeout=60)
        crew.result(handed)


@pytest.mark.slow
@pytest.mark.parametrize("when", ["working", "starting"])
def test_workers_end_with_the_program(when, place, tmp_path):
    """Kill -9 of the program that hands out the chunks."""
    out = tmp_path / "out"
    process = start("render", "-q", place / "job.toml", "--workers", 2, "--chunk", 6, "-o", out)
    wait_for(lambda: len(workers_of(process)) == 2 and (when == "starting" or len(finished(out)) >= 4), process)
    workers = workers_of(process)
    process.kill()
    process.communicate()
    gone, alive = psutil.wait_procs(workers, timeout=20)
    assert len(gone) == 2 and not alive
    assert finish(start("render", "-q", place / "job.toml", "--workers", 2, "-o", out)).code == 0
    assert same(out, place / "whole")


@pytest.mark.slow
def test_workers_need_no_dask(tmp_path):
    """After a plain install."""
    job = write_job(
        tmp_path, **(JOB | {"camera": WALK | {"resolution": [24, 18], "frames": 2, "keys": WALK["keys"][:1]}})
    )
    hidden = "import sys; sys.modules['distributed'] = None; from framearray_cli.cli.main import main; main()"
    command = python_command(hidden, ["render", str(job), "--workers", "1"])
    done = subprocess.run(command, capture_output=True, text=True, env=python_environment(), timeout=120, check=False)
    assert (done.returncode, len(finished(tmp_path / "out"))) == (0, 2), done.stderr
    assert "1 worker, 1 chunk" in done.stderr
