"""A closed terminal, a reader that has gone, signals that come twice, or at the very end of a render."""

import os
import signal
import subprocess
import sys
import tomllib
from collections.abc import Iterator
from contextlib import suppress
from pathlib import Path

import pytest
from support import ROOT, tiny
from support.program import complete, finish, run, start, wait_for, write_job

from framearray_cli.cli import signals as interrupts
from framearray_cli.render import render, session

pty = pytest.importorskip("pty", reason="no such terminals there")

# Hours of frames.
LONG = {
    "ambient": {"paths": 64},
    "camera": tiny.WALK | {"resolution": [160, 120], "frames": 500},
    "light": {"frames": 16},
    "samples": {"hits": 16},
    "output": {"format": "exr"},
}
SHORT = LONG | {"camera": tiny.WALK | {"resolution": [60, 45]}}


def images(out: Path) -> int:
    return len(list(out.glob("*.l[0-9]*.exr")))


@pytest.fixture
def terminal() -> Iterator[tuple[int, int]]:
    """Open a terminal: the screen, and the program's end."""
    screen, program = pty.openpty()
    yield screen, program
    for end in (screen, program):
        with suppress(OSError):
            os.close(end)


def test_a_terminal_that_is_closed(terminal, tmp_path):
    """The render ends as after Ctrl-C, though nobody can read the message."""
    screen, program = terminal
    job = write_job(tmp_path, **LONG)

    def own() -> None:
        os.setsid()
        import fcntl
        import termios

        fcntl.ioctl(program, termios.TIOCSCTTY, 0)

    command = [sys.executable, "-m", "framearray_cli", "render", str(job)]
    environment = os.environ | {"PYTHONPATH": str(ROOT)}
    process = subprocess.Popen(
        command, stdin=program, stdout=program, stderr=program, preexec_fn=own, env=environment, text=True
    )
    os.close(program)
    out = tmp_path / "out"
    os.set_blocking(screen, False)

    def many() -> bool:
        with suppress(BlockingIOError):
            os.read(screen, 65536)
        return images(out) > 20

    wait_for(many, process)
    os.close(screen)
    assert process.wait(10) == 128 + signal.SIGHUP
    summary = tomllib.loads((out / "manifest.toml").read_text())["summary"]
    assert 0 < summary["images"] <= images(out)
    assert not [file for file in out.rglob(".*") if file.name != ".guard"]


def test_nohup_is_obeyed(monkeypatch):
    signal.signal(signal.SIGHUP, signal.SIG_IGN)
    interrupts.listen()
    assert signal.getsignal(signal.SIGHUP) == signal.SIG_IGN
    assert signal.getsignal(signal.SIGTERM) == interrupts.stop
    signal.signal(signal.SIGHUP, signal.SIG_DFL)
    interrupts.listen()
    assert signal.getsignal(signal.SIGHUP) == interrupts.stop


def contents(out: Path) -> dict[str, bytes]:
    return {file.name: file.read_bytes() for file in out.glob("tiny.*")}


@pytest.mark.parametrize("call", [pytest.param(1, marks=pytest.mark.slow, id="start"), pytest.param(2, id="end")])
@pytest.mark.parametrize("number", [signal.SIGINT, pytest.param(signal.SIGTERM, marks=pytest.mark.slow)])
def test_while_the_manifest_is_written(call, number, tmp_path, monkeypatch, capsys):
    job = write_job(tmp_path, **SHORT)
    assert run(capsys, "render", "-q", job, "-o", tmp_path / "whole").code == 0
    calls, write = [], render.write_manifest

    def stopping(*arguments: object) -> Path:
        calls.append(arguments)
        if len(calls) == call:
            raise interrupts.Stopped(number)
        return write(*arguments)

    with monkeypatch.context() as patch:
        for module in (render, session):
            patch.setattr(module, "write_manifest", stopping)
        result = run(capsys, "render", "-q", job)
    assert result.code == 128 + number
    assert result.err.splitlines()[0] == {2: "interrupted", 15: "terminated"}[number]
    assert images(tmp_path / "out") == (0 if call == 1 else 6 * 16)
    assert run(capsys, "render", "-q", job).code == 0
    assert contents(tmp_path / "out") == contents(tmp_path / "whole")
    assert tomllib.loads((tmp_path / "out/manifest.toml").read_text())["summary"]["finished"] is True


@pytest.mark.slow
def test_a_reader_that_has_gone(tmp_path):
    """`framearray render job.toml 2>&1 | head -1`"""
    process = start("render", write_job(tmp_path, **SHORT), stderr=subprocess.STDOUT)
    assert process.stdout is not None
    process.stdout.readline()
    process.stdout.close()
    assert process.wait(60) == 141
    complete("render", "-q", tmp_path / "job.toml")


@pytest.mark.slow
@pytest.mark.parametrize("number", [signal.SIGINT, signal.SIGTERM])
def test_a_signal_that_comes_twice(number, tmp_path):
    """The second ends the process at once; it leaves no half image, and does not disturb the next run."""
    job = write_job(tmp_path, **(LONG | {"camera": tiny.WALK | {"resolution": [80, 60], "frames": 30}}))
    out = tmp_path / "out"
    for _ in range(5):
        process = start("render", "-q", job)
        there = images(out)
        wait_for(lambda there=there: images(out) > there + 4, process)
        process.send_signal(number)
        process.send_signal(number)
        assert finish(process).code in (-number, 128 + number)
    complete("render", "-q", job)
    complete("render", "-q", job, "-o", tmp_path / "whole")
    assert contents(out) == contents(tmp_path / "whole")
