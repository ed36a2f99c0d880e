"""Ctrl-C, SIGTERM and closed terminals at every stage: a prompt end, the right exit code, only whole files."""

import importlib
import os
import signal
import subprocess
import sys
import threading
import time
import tomllib
from collections.abc import Callable, Iterator
from contextlib import suppress
from pathlib import Path
from types import ModuleType

import psutil
import pytest
from pydantic import BaseModel, field_serializer
from support import tiny
from support.handed import contents
from support.program import complete, finish, is_prompt, run, start, wait_for, write_job

from framearray_cli.array.images import read_image
from framearray_cli.cli import main as cli
from framearray_cli.cli import signals as interrupts
from framearray_cli.render import render, session

pytestmark = pytest.mark.skipif(os.name == "nt", reason="signals of other kinds there")

PROMPT = 2.0  # seconds on an idle machine
ASLEEP = 40  # polls in a row, 5 ms each, that find a process asleep where it waits for input
# long enough to be stopped at every stage: a minute of walks, then hours of frames
LONG = {
    "ambient": {"paths": 2**24},
    "camera": tiny.WALK | {"resolution": [160, 120], "frames": 500},
    "light": {"frames": 16},
    "reuse": {"n_r": 1},
    "samples": {"hits": 16},
    "output": {"format": "exr"},
}


def stop(process: subprocess.Popen[str], number: signal.Signals, log: Path | None = None) -> list[str]:
    """Send a signal; the process must end promptly. Return what it prints on standard error then.

    Args:
        log: file that standard error goes to; None: a pipe.
    """
    started = time.monotonic()
    process.send_signal(number)
    result = finish(process, seconds=60)
    took = time.monotonic() - started
    assert is_prompt(took, PROMPT), f"ended after {took:.1f} s"
    word = {signal.SIGINT: "interrupted", signal.SIGTERM: "terminated"}[number]
    assert result.code == 128 + number
    lines = (log.read_text() if log else result.err).splitlines()
    assert not [line for line in lines if line.startswith("Traceback")]
    return lines[lines.index(word) :]


def check_files(out: Path, format_suffix: str) -> int:
    """Check that there is no half file, and that the manifest lists what there is; return the number of images."""
    assert not list(out.glob(".*"))
    images = sorted(out.glob(f"*.l[0-9]*.{format_suffix}"))
    for image in images:
        assert read_image(image).shape == (120, 160, 3)
    summary = tomllib.loads((out / "manifest.toml").read_text())["summary"]
    assert summary["finished"] is False
    assert 0 < summary["images"] <= len(images), "the manifest counts cameras whose images are complete"
    return len(images)


def has_printed(log: Path, text: str) -> Callable[[], bool]:
    return lambda: text in log.read_text()


def has_loaded(process: subprocess.Popen[str]) -> Callable[[], bool]:
    """Whether the program has loaded the libraries that it renders with, so that its signal handlers are set."""
    maps, started = Path(f"/proc/{process.pid}/maps"), time.monotonic()
    if not maps.exists():  # no Linux
        return lambda: time.monotonic() > started + 3
    return lambda: "llvmlite" in maps.read_text()


def start_long_render(tmp_path: Path, **changes: object) -> tuple[subprocess.Popen[str], Path]:
    """Start a long render; return it and the file that its progress goes to."""
    log = tmp_path / "log"
    with log.open("w") as file:
        return start("render", write_job(tmp_path, **(LONG | changes)), stderr=file), log


def test_while_loading(tmp_path):
    tiny.save_glb(tiny.room_meshes(), tmp_path / "tiny.glb")
    lines = "".join(f"v {i} {i * i} 0\nf -1 -2 -3\n" for i in range(600_000))  # takes some seconds to read
    (tmp_path / "long.obj").write_text(lines)
    process = start("render", write_job(tmp_path, **(LONG | {"scene": {"file": "long.obj"}})))
    wait_for(has_loaded(process), process)
    time.sleep(0.3)
    assert stop(process, signal.SIGINT) == ["interrupted"]
    assert not (tmp_path / "out").exists()


@pytest.mark.parametrize("number", [signal.SIGINT, signal.SIGTERM])
def test_while_the_ambient_light_is_estimated(number, tmp_path):
    process, log = start_long_render(tmp_path)
    wait_for(has_printed(log, "triangles"), process)
    time.sleep(0.5)
    assert len(stop(process, number, log)) == 1
    left = {file.name for file in (tmp_path / "out").rglob("*") if file.is_file()}
    assert left <= {".guard"} | ({"0-499.lock"} if "compiling" in log.read_text() else set())  # ends at once then


@pytest.mark.parametrize("number", [signal.SIGINT, pytest.param(signal.SIGTERM, marks=pytest.mark.slow)])
def test_while_rendering(number, tmp_path):
    process, log = start_long_render(tmp_path, ambient={"paths": 64})
    out = tmp_path / "out"
    wait_for(lambda: len(list(out.glob("*.l[0-9]*.exr"))) > 20, process)
    lines = stop(process, number, log)
    images = check_files(out, "exr")
    message = f"{images} of 8,000 images were written to {out}; the same command goes on with the rest"
    assert lines[1:] == [message]


def test_while_nothing_but_writing_goes_on(tmp_path):
    """The camera stands still: its one frame is traced at once, then written for 500 eyes."""
    camera = {"keys": tiny.WALK["keys"][:1], "frames": 500, "resolution": [160, 120]}
    process, log = start_long_render(tmp_path, ambient={"paths": 64}, camera=camera, output={"format": "png"})
    wait_for(lambda: len(list((tmp_path / "out").glob("*.l[0-9]*.png"))) > 20, process)
    stop(process, signal.SIGINT, log)
    assert check_files(tmp_path / "out", "png") < 8000


def test_a_stopped_render_can_be_rendered_to_its_end(tmp_path):
    camera = tiny.WALK | {"resolution": [80, 60], "frames": 30}
    changes = {"ambient": {"paths": 64}, "light": {"frames": 4}, "samples": {"hits": 4}}
    process, log = start_long_render(tmp_path, camera=camera, **changes)
    out = tmp_path / "out"
    wait_for(lambda: len(list(out.glob("*.l[0-9]*.exr"))) > 2, process)
    stop(process, signal.SIGINT, log)
    complete("render", "-q", tmp_path / "job.toml")
    assert len(list(out.glob("*.l[0-9]*.exr"))) == 30 * 4
    assert tomllib.loads((out / "manifest.toml").read_text())["summary"]["finished"] is True


def test_while_checking(tmp_path):
    process = start("check", write_job(tmp_path, **LONG))
    wait_for(has_loaded(process), process)
    time.sleep(0.5)
    stop(process, signal.SIGTERM)
    assert not (tmp_path / "out").exists()


def test_before_the_command_line_is_loaded(monkeypatch):
    """Ctrl-C ends the process without Python's help then, and without the traceback of an import."""
    seen = []
    fake = ModuleType("framearray_cli.cli.main")
    fake.main = lambda: seen.append(signal.getsignal(signal.SIGINT))
    monkeypatch.setitem(sys.modules, "framearray_cli.cli.main", fake)
    monkeypatch.setattr(os, "_exit", lambda code: seen.append(code))  # how the process ends when all is done
    importlib.import_module("framearray_cli.__main__").main()
    assert seen == [signal.SIG_DFL, 0]


@pytest.mark.slow
def test_while_kernels_compile(tmp_path, monkeypatch):
    """A thread that compiles cannot be stopped; it is not waited for."""
    monkeypatch.setenv("NUMBA_CACHE_DIR", str(tmp_path / "cache"))
    process, log = start_long_render(tmp_path, ambient={"paths": 64})
    wait_for(has_printed(log, "ambient light"), process)
    time.sleep(1.0)  # now the frame's threads compile
    assert "compiling" in log.read_text()
    assert stop(process, signal.SIGINT, log) == ["interrupted"]


@pytest.mark.parametrize("module", ["llvmlite.binding.executionengine", "importlib._bootstrap"])
def test_an_exception_is_not_raised_where_it_would_be_forgotten(module):
    """A callback from C, for instance, prints an exception and goes on; the program raises it a moment later."""
    inside: list[object] = []
    exec("def f(stop): stop(); inside.append(stop)", space := {"__name__": module, "inside": inside})

    def arrive() -> None:
        interrupts.stop(signal.SIGTERM, sys._getframe())

    space["f"](arrive)
    assert inside == [arrive]
    with pytest.raises(interrupts.Stopped):
        time.sleep(5)
    signal.setitimer(signal.ITIMER_REAL, 0)


def test_a_signal_while_a_job_is_written_down_is_no_error_of_the_library():
    """pydantic wraps every exception of a function that it calls."""

    class Table(BaseModel):
        n: int = 1

        @field_serializer("n")
        def _write(self, n: int) -> int:
            interrupts.stop(signal.SIGTERM, sys._getframe())
            return n

    try:
        assert Table().model_dump() == {"n": 1}
        with pytest.raises(interrupts.Stopped):
            time.sleep(5)
    finally:
        signal.setitimer(signal.ITIMER_REAL, 0)


def test_a_lock_is_never_left_locked():
    """A signal while a lock is taken or released: threads that wait for it later would end a pool only after 2 s."""
    for k in range(20):
        lock, number = threading.Condition(threading.Lock()), signal.SIGTERM
        previous = signal.signal(number, interrupts.stop)
        timer = threading.Timer(0.001 + 0.0002 * k, os.kill, [os.getpid(), number])
        try:
            with pytest.raises(interrupts.Stopped):
                timer.start()  # which the signal may meet, too
                while True:
                    with lock:
                        pass
        finally:
            signal.setitimer(signal.ITIMER_REAL, 0)
            timer.join()
            signal.signal(number, previous)
        assert lock.acquire(blocking=False), f"in run {k}"


def test_an_exception_lost_in_a_destructor_is_raised_again(monkeypatch):
    monkeypatch.setattr(sys, "unraisablehook", sys.unraisablehook)
    interrupts.watch_for_lost()
    started = time.monotonic()

    class Dies:
        def __del__(self) -> None:
            interrupts.stop(signal.SIGTERM, sys._getframe())

    with pytest.raises(interrupts.Stopped):
        Dies()
        time.sleep(5)
    assert time.monotonic() - started < 1
    signal.setitimer(signal.ITIMER_REAL, 0)


def test_a_lock_that_a_signal_broke_counts_as_the_signal(monkeypatch, capsys):
    """This happened once in some hundred runs, when a signal came while a thread pool took in work."""

    def broken(*_: object, **__: object) -> None:
        try:
            raise interrupts.Stopped(signal.SIGTERM)
        finally:
            raise RuntimeError("cannot release un-acquired lock")

    monkeypatch.setattr(cli, "app", broken)
    with pytest.raises(SystemExit) as end:
        cli.main([])
    assert end.value.code == 128 + signal.SIGTERM
    assert capsys.readouterr().err == "terminated\n"


def writer_of(pipe: Path, process: subprocess.Popen[str]) -> int:
    """Return the writing end of a pipe, once the process has opened the reading end."""
    ends: list[int] = []

    def opened() -> bool:
        try:
            ends.append(os.open(pipe, os.O_WRONLY | os.O_NONBLOCK))
        except OSError:
            return False
        return True

    wait_for(opened, process)
    return ends[0]


def wait_for_sleep(process: subprocess.Popen[str]) -> None:
    """Wait until a process sleeps in a system call.

    A signal that comes between two system calls, after Python has opened a pipe and before it reads, interrupts
    neither; Python would notice it only when the read returns.
    """
    states = list[str]()

    def sleeps() -> bool:
        states.append(psutil.Process(process.pid).status())
        return len(states) >= ASLEEP and set(states[-ASLEEP:]) == {psutil.STATUS_SLEEPING}

    wait_for(sleeps, process)


@pytest.mark.parametrize("number", [signal.SIGINT, signal.SIGTERM])
def test_a_job_that_never_comes_is_waited_for_until_a_signal(number, tmp_path):
    pipe = tmp_path / "job.toml"
    os.mkfifo(pipe)
    process = start("check", pipe)
    end = writer_of(pipe, process)
    wait_for_sleep(process)
    stop(process, number)
    os.close(end)


def test_a_job_may_come_through_a_pipe(tmp_path):
    pipe, text = tmp_path / "pipe.toml", write_job(tmp_path, camera={"fov": 500.0}).read_bytes()
    os.mkfifo(pipe)
    process = start("check", pipe)
    end = writer_of(pipe, process)
    os.set_blocking(end, True)
    os.write(end, text)
    os.close(end)
    result = finish(process)
    assert result.code == 2
    assert result.err.startswith(f"{pipe}: camera.fov: expected a number from 0.001 to 179.9, got 500.0\n")


HOURS = LONG | {"ambient": {"paths": 64}}  # of frames
SHORT = HOURS | {"camera": tiny.WALK | {"resolution": [60, 45]}}


def images(out: Path) -> int:
    return len(list(out.glob("*.l[0-9]*.exr")))


@pytest.fixture
def terminal() -> Iterator[tuple[int, int]]:
    """Open a terminal: the screen, and the program's end."""
    screen, program = os.openpty()
    yield screen, program
    for end in (screen, program):
        with suppress(OSError):
            os.close(end)


def test_a_terminal_that_is_closed(terminal, tmp_path):
    """The render ends as after Ctrl-C, although its message cannot be written."""
    screen, program = terminal
    job = write_job(tmp_path, **HOURS)

    def own() -> None:
        os.setsid()
        import fcntl
        import termios

        fcntl.ioctl(program, termios.TIOCSCTTY, 0)

    process = start("render", job, stdin=program, stdout=program, stderr=program, preexec_fn=own)
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
    job = write_job(tmp_path, **(HOURS | {"camera": tiny.WALK | {"resolution": [80, 60], "frames": 30}}))
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
